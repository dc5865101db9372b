"""A file named as what it is not is a fault of the line that names it: it is well as it is."""

from pathlib import Path

import pytest

from impactcell.errors import SettingsError
from impactcell.settings import read_cell, read_register_map
from tests.unit.settings.test_impossible_paths import CONFIG, cell_file

NEWER = "it was written for a newer version of impactcell: run that"
BASE = "format: 1\ncoordinate: rotation\nexcitation: driven\n"
CAMPAIGN = "format: 1\nexcitation: tap\nsensors: {force: {rate_hz: 1000}}\n"
A_CELL = "format: 1\ncell: press-2\nmodel: x.yaml\n"
MODEL, MAP = CONFIG / "models" / "prototype.yaml", CONFIG / "maps" / "fpga-v1.yaml"


@pytest.mark.parametrize(("key", "place", "kind"), [
    ("model", "5:8", "a model"), ("module.register_map", "4:24", "a register map"),
])  # fmt: skip
@pytest.mark.parametrize(
    ("text", "told"),
    [
        (BASE, "{file} is a base model, not {kind}"),
        (CAMPAIGN, "{file} is the head of a campaign, not {kind}"),
        (A_CELL, "{file} is a cell file, not {kind}"),
        ("of the other", "{file} is {other}, not {kind}"),
        ("of a newer version", f"{{file}} is of format 9; {NEWER}"),
    ],
)
def test_it_is_told_where_it_is_named(
    tmp_path: Path, key: str, place: str, kind: str, text: str, told: str
) -> None:
    """It was told to take every key out of a register map, and to write those of a model into it."""
    own, other = (MODEL, MAP) if key == "model" else (MAP, MODEL)
    text = text.replace("of the other", other.read_text(encoding="utf-8"))
    if text == "of a newer version":
        text = own.read_text(encoding="utf-8").replace("\nformat: 1\n", "\nformat: 9\nnews: 3\n")
    file = tmp_path / "named.yaml"
    file.write_text(text, encoding="utf-8")
    cell = cell_file(tmp_path, key, file.name)
    with pytest.raises(SettingsError) as fault:
        read_cell(cell)
    other_kind = "a register map" if key == "model" else "a model"
    said = told.format(file=file, kind=kind, other=other_kind)
    assert str(fault.value) == f"{cell}:{place}: {key}: {said}"


def test_a_cell_file_of_a_newer_version_names_the_way_out(tmp_path: Path) -> None:
    cell = cell_file(tmp_path, "model", str(MODEL))
    cell.write_text(cell.read_text(encoding="utf-8").replace("format: 1", "format: 2"), encoding="utf-8")
    with pytest.raises(SettingsError, match=f"^{cell}:1:9: format: should be 1, not 2; {NEWER}$"):
        read_cell(cell)


def test_a_register_map_of_a_newer_version_is_told_alike_without_a_cell(tmp_path: Path) -> None:
    """It was told what is unknown and missing in it, and that its format must be 1."""
    file = tmp_path / "map.yaml"
    text = MAP.read_text(encoding="utf-8").replace("\nformat: 1\n", "\nformat: 9\nnews: 3\n")
    file.write_text(text, encoding="utf-8")
    line = text.splitlines().index("format: 9") + 1
    with pytest.raises(SettingsError) as alone:
        read_register_map(file)
    assert str(alone.value) == f"{file}:{line}:1: is of format 9; {NEWER}"
    with pytest.raises(SettingsError) as within:
        read_cell(cell_file(tmp_path, "module.register_map", file.name))
    assert str(within.value).endswith(f"module.register_map: {file} is of format 9; {NEWER}")
