"""Columns that would be missed or misread silently: of a second file, of text, of groups out of order."""

import contextlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from impactcell import campaign
from impactcell.cli.app import run_verb
from impactcell.errors import MeasurementError
from impactcell.measurements import Given, guess, read_tables
from tests.unit.measurements.records import sampled, taps

TIME, FORCE, PLACE = (values[::4] for values in sampled(taps((3000,), (18.9,))[0], np.random.default_rng(3)))
HEAD = "Zeit [s];Kraft [N];Weg [mm]"
VELOCITY = ("--set", "velocity=3000 mm/min")


def write(
    path: Path,
    head: str = HEAD,
    *further: Callable[[int], object],
    place: Callable[[int], object] | None = None,
) -> Path:
    """One tap; `place` gives other cells of the position by their row, `further` those of more columns."""
    rows = [
        ";".join(
            (
                f"{t:.6g}",
                f"{f:.6g}",
                str(place(n)) if place else f"{1e3 * x:.7g}",
                *(str(cell(n)) for cell in further),
            )
        )
        for n, (t, f, x) in enumerate(zip(TIME, FORCE, PLACE, strict=True))
    ]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def run(files: Sequence[Path], out: Path, *options: str) -> campaign.Campaign:
    with contextlib.suppress(SystemExit):
        run_verb(["import", *map(str, files), "-o", str(out), *VELOCITY, *options])
    return campaign.read(out)


def refused(files: Sequence[Path], out: Path, *options: str) -> str:
    with pytest.raises(MeasurementError) as caught:
        run(files, out, *options)
    assert not out.exists()
    return str(caught.value)


@pytest.mark.parametrize("unit", ["", " [1/10 mm]"])
def test_a_second_file_has_not_the_unit_of_the_first(unit: str, tmp_path: Path) -> None:
    files = [write(tmp_path / "a.csv"), write(tmp_path / "b.csv", f"Zeit [s];Kraft [N];Weg{unit}")]
    lack = "is in '1/10 mm', no unit that is known" if unit else "has no unit"
    told = f"column 'Weg' (position) {lack}; say --unit 'Weg=m', or which it is"
    assert refused(files[1:], tmp_path / "out") == told
    assert refused(files, tmp_path / "out") == f"{files[1]}: {told}"
    assert refused(files[::-1], tmp_path / "out") == told
    first, second = run(files, tmp_path / "out", "--unit", "Weg=mm").shots
    assert first.position is not None
    assert second.position is not None
    np.testing.assert_array_equal(first.position.values, second.position.values)


def test_a_second_file_needs_no_unit_of_what_has_none(tmp_path: Path) -> None:
    files = [
        write(tmp_path / "a.csv", f"{HEAD};Versuch [1];Ventil", lambda _: 1, lambda _: 3),
        write(tmp_path / "b.csv", f"{HEAD};Versuch;Ventil", lambda _: 2, lambda _: 4),
    ]
    assert [shot.covariates["ventil"] for shot in run(files, tmp_path / "out").shots] == [3, 4]


def test_a_gain_says_the_unit_of_a_second_file_too(tmp_path: Path) -> None:
    files = [
        write(tmp_path / "a.csv", "Zeit [s];Kraft [V];Weg [mm]"),
        write(tmp_path / "b.csv", "Zeit [s];Kraft;Weg [mm]"),
    ]
    assert len(run(files, tmp_path / "out", "--gain", "force=12.5 N/V").shots) == 2


def over(row: int) -> object:
    return "OVER" if row >= 60 else row


@pytest.mark.parametrize("head", [HEAD, "Zeit [s];Kraft [N];Weg", "Zeit [s];Kraft [N];Laser"])
def test_a_channel_of_text_is_refused_with_its_first_cell(head: str, tmp_path: Path) -> None:
    name = head.rsplit(";", maxsplit=1)[-1].partition(" [")[0]
    file = write(tmp_path / "a.csv", head, place=over)
    assert (
        f"{file}:62: column {name!r} holds text, as 'OVER', where the position is needed; correct the cell, "
        f"or leave it empty, or leave the column out with --column 'ignored={name}'"
    ) in refused([file], tmp_path / "out")
    run([file], tmp_path / "out", "--column", f"ignored={name}")


def test_a_channel_of_text_is_refused_beside_one_that_is_less_sure(tmp_path: Path) -> None:
    file = write(tmp_path / "a.csv", "Zeit [s];Kraft [N];Ort [mm];Weg", over)
    assert f"{file}:62: column 'Weg' holds text" in refused([file], tmp_path / "out")


def test_a_channel_of_text_in_a_second_file_is_refused(tmp_path: Path) -> None:
    files = [write(tmp_path / "a.csv"), write(tmp_path / "b.csv", place=over)]
    for order in (files, files[::-1]):
        assert f"{files[1]}:62: column 'Weg' holds text" in refused(order, tmp_path / "out")


@pytest.mark.parametrize("name", ["Weg", "Weg [µm]", "Weg 1"])
def test_a_unit_in_each_cell_is_refused(name: str, tmp_path: Path) -> None:
    file = write(tmp_path / "a.csv", f"Zeit [s];Kraft [N];{name}", place=lambda row: f"{row}.75 µm")
    told = refused([file], tmp_path / "out")
    assert "a.csv:2: column 'Weg" in told
    assert "holds units in its cells, as '0.75 µm', where the position is needed; put the unit behind" in told


def test_numbers_of_json_and_matlab_that_are_none_are_refused(tmp_path: Path) -> None:
    columns = {"time_s": TIME.tolist(), "force_n": [f"{f:.2f}".replace(".", ",") for f in FORCE]}
    file = tmp_path / "a.json"
    file.write_text(json.dumps(columns | {"position_m": PLACE.tolist()}), encoding="utf-8")
    assert f"{file}: row 1: column 'force' holds text, as '" in refused([file], tmp_path / "out")
    file = tmp_path / "a.mat"
    savemat(file, {"time_s": TIME, "force_n": FORCE + 1j, "position_m": PLACE})
    assert f"{file}: row 1: column 'force' holds text, as '(" in refused([file], tmp_path / "out")


def test_text_under_a_name_that_says_nothing_or_names_a_thing_may_be_there(tmp_path: Path) -> None:
    words = {
        "Bemerkung": "Kontakt 3",
        "Teil": "A17",
        "Kraft OK": "ja",
        "Kraftsensor": "U9C 50 N",
        "Datum": "heute",
    }
    file = write(
        tmp_path / "a.csv", ";".join([HEAD, *words]), *(lambda _, word=word: word for word in words.values())
    )
    (shot,) = run([file], tmp_path / "out").shots
    assert shot.position is not None
    assert shot.covariates["teil"] == "A17"
    mapping = guess(
        read_tables(write(tmp_path / "b.csv", "Zeit [s];Kraft [N];Stempel", place=lambda _: "S 2"))
    )
    assert mapping.faults == ()
    head = "# Abtastrate: 2500 Hz\nDatum;Kraft [N];Weg [mm]"
    file = write(tmp_path / "c.csv", head)
    lines = [
        f"01.05.2024;{line.partition(';')[2]}" for line in file.read_text(encoding="utf-8").splitlines()[2:]
    ]
    file.write_text("\n".join([head, *lines]), encoding="utf-8")
    assert guess(read_tables(file)).faults == ()


def test_a_time_of_text_is_told_once(tmp_path: Path) -> None:
    file = write(tmp_path / "a.csv")
    text = file.read_text(encoding="utf-8").replace("Zeit [s]", "Zeit").replace("\n", "\num ")
    file.write_text(text.removesuffix("um "), encoding="utf-8")
    (fault,) = guess(read_tables(file)).faults
    assert (
        f"{file}:2: column 'Zeit' holds text, as 'um 0', where the time is needed; correct the cell, or"
        in fault
    )
    assert fault.endswith(
        "leave the column out with --column 'ignored=Zeit' and give the rate with --set rate=10kHz"
    )
    rate = guess(read_tables(file), Given(constants={"rate_hz": 2500.0}))
    assert len(rate.faults) == 1


def test_a_channel_that_ends_early_is_one_of_numbers(tmp_path: Path) -> None:
    file = write(tmp_path / "a.csv", f"{HEAD};", lambda _: "", place=lambda row: row if row < 20 else "")
    column = read_tables(file)[0].column("Weg")
    assert column is not None
    assert column.text is None
    assert np.isfinite(column.values).sum() == 20


@pytest.mark.parametrize(
    ("head", "lacking"),
    [("Zeit [s];Kraft [N];Weg 1 [mm]", "position"), ("Zeit [s];Last [N];Weg [mm]", "force")],
)
def test_a_file_without_a_channel_of_the_others_is_refused(head: str, lacking: str, tmp_path: Path) -> None:
    files = [write(tmp_path / "a.csv"), write(tmp_path / "b.csv", head)]
    name = {"position": "Weg", "force": "Kraft"}[lacking]
    for order in (files, files[::-1]):
        assert refused(order, tmp_path / "out") == (
            f"{files[1]}: has no {lacking}, which {files[0]} has as column {name!r}; call it so here too, "
            f"import the files one by one, or leave it out of all with --column 'ignored={name}'"
        )


def test_groups_of_hdf5_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for number in (10, 2, 1):
            file.create_group(f"shot{number}").create_dataset("time", data=TIME)
    assert [table.name for table in read_tables(tmp_path / "a.h5")] == ["shot1", "shot2", "shot10"]
