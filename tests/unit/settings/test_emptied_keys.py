"""A key with nothing after it says nothing: it is told, whatever key it is; a written null is a value."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml
from pydantic import BaseModel

from impactcell.errors import SettingsError
from impactcell.process import yaml_loader
from impactcell.process.yaml_schema import read
from impactcell.settings.model_file import ModelFile
from impactcell.settings.sections import CellSettings
from tests.integration.processes import CONFIG

PROTOTYPE = CONFIG / "cells" / "prototype.yaml"


def keys(section: type[BaseModel], above: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], bool]]:
    """Every key of a section and of those in it, and whether it may be left out."""
    for name, field in section.model_fields.items():
        yield (*above, name), not field.is_required()
        for kind in (field.annotation, *get_args(field.annotation)):
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                yield from keys(kind, (*above, name))


def emptied(path: tuple[str, ...]) -> str:
    """Write the prototype's cell file with nothing after one of its keys."""
    content = yaml_loader.load(PROTOTYPE)[0]
    assert isinstance(content, dict)
    content["module"]["register_map"] = str(CONFIG / "maps" / "fpga-v1.yaml")
    content["model"] = str(CONFIG / "models" / "prototype.yaml")
    section: dict[str, Any] = content
    for name in path[:-1]:
        section = section.setdefault(name, {})
    section[path[-1]] = "NOTHING"
    return yaml.safe_dump(content).replace(" NOTHING", "")


@pytest.mark.parametrize(("path", "optional"), [*keys(CellSettings)], ids=str)
def test_every_key_of_a_cell_file(tmp_path: Path, path: tuple[str, ...], optional: bool) -> None:
    file = tmp_path / "cell.yaml"
    file.write_text(emptied(path))
    with pytest.raises(SettingsError) as refused:
        read(file, CellSettings)
    way_out = "give a value, or leave the key out" if optional else "give a value"
    told = [line for line in str(refused.value).splitlines() if f": {'.'.join(path)}: " in line]
    (line,) = told
    place, text = line.split(": ", 1)
    number = int(place.split(":")[1])
    assert file.read_text().splitlines()[number - 1].strip() == f"{path[-1]}:"
    assert text == f"{'.'.join(path)}: nothing is written after it; {way_out}"


@pytest.mark.parametrize("null", ["null", "~"])
def test_a_null_that_is_written_is_one(tmp_path: Path, null: str) -> None:
    file = tmp_path / "cell.yaml"
    file.write_text(emptied(("part", "mass_kg")).replace("mass_kg:", f"mass_kg: {null}") + f"web: {null}\n")
    settings, _ = read(file, CellSettings)
    assert (settings.part.mass_kg, settings.web) == (None, None)


def test_an_unknown_key_is_told_as_unknown_alone(tmp_path: Path) -> None:
    file = tmp_path / "cell.yaml"
    file.write_text(emptied(("part", "mas_kg", "in_it")))
    with pytest.raises(SettingsError) as refused:
        read(file, CellSettings)
    place = f"{file}:{line_of(file, 'mas_kg')}:3"
    assert str(refused.value) == f"{place}: unknown key 'part.mas_kg'; did you mean 'mass_kg'?"


def test_a_key_that_takes_the_place_of_an_emptied_one_that_is_merged(tmp_path: Path) -> None:
    file = tmp_path / "cell.yaml"
    text = emptied(("part", "mass_kg")).replace("part:", "part:\n  <<: {mass_kg: }")
    file.write_text(text.replace("\n  mass_kg:\n", "\n  mass_kg: 2.0\n"))
    assert read(file, CellSettings)[0].part.mass_kg == 2.0


def test_a_model_file_too(tmp_path: Path) -> None:
    file = tmp_path / "model.yaml"
    content = yaml_loader.load(CONFIG / "models" / "prototype.yaml")[0]
    assert isinstance(content, dict)
    file.write_text(yaml.safe_dump({**content, "stroke_m": "NOTHING"}).replace(" NOTHING", ""))
    with pytest.raises(SettingsError, match="stroke_m: nothing is written after it; give a value, or leave"):
        read(file, ModelFile)


def line_of(file: Path, key: str) -> int:
    """Number of the line that has a key."""
    return next(n for n, line in enumerate(file.read_text().splitlines(), 1) if line.strip() == f"{key}:")
