"""Files of one import of which one lacks what the others hold: refused with the way out, or told."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from impactcell.errors import MeasurementError
from impactcell.measurements import Imported, guess, make_campaign, read_tables
from impactcell.measurements.given import read_given
from impactcell.web.texts.import_faults import page_fault
from impactcell.web.texts.import_notes import page_note
from tests.unit.measurements.records import sampled, taps

TAP = taps(velocities=(3500,), masses=(18.9,))[0]
ALL = {"mass [kg]": "18.9", "velocity [mm/min]": "3500", "actuator [mm]": "", "direction": "1"}


def write(directory: Path, name: str, held: dict[str, str], beside: str = "") -> Path:
    """One shot with columns of one value; that of the actuator goes with the time."""
    time, force, position = sampled(TAP, np.random.default_rng(len(name)))
    path = directory / f"{name}.csv"
    rows = [";".join(["time [s]", "force [N]", "position [mm]", *held])]
    for t, f, x in zip(time, force, position, strict=True):
        values = [
            value or f"{3500 / 60 * t:.6f}" if "actuator" in key else value for key, value in held.items()
        ]
        rows.append(";".join([f"{t:.5f}", f"{f:.4f}", f"{1e3 * x:.6f}", *values]))
    path.write_text(beside + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def imported(files: Sequence[Path], **said: list[str]) -> Imported:
    tables = [table for file in files for table in read_tables(file)]
    return make_campaign(tables, guess(tables, read_given({"constants": ["stroke=1.5mm"], **said})))


def without(column: str) -> dict[str, str]:
    return {name: value for name, value in ALL.items() if name != column}


@pytest.mark.parametrize(
    ("column", "way_out"),
    [
        ("mass [kg]", "give it for all with --set mass=18.9kg, or leave it out of all"),
        ("velocity [mm/min]", "give it for all with --set 'velocity=3000 mm/min', or leave it out of all"),
        ("direction", "give it for all with --set direction=1, or leave it out of all"),
        ("actuator [mm]", "import the files one by one, or leave it out of all"),
    ],
)
@pytest.mark.parametrize("lacking_first", [True, False])
def test_a_file_without_what_the_others_have_is_refused(
    tmp_path: Path, column: str, way_out: str, *, lacking_first: bool
) -> None:
    """A mass was left empty, a velocity taken from the actuator, a direction from the position."""
    name = column.partition(" ")[0]
    files = [write(tmp_path, "a", ALL), write(tmp_path, "b", ALL), write(tmp_path, "c", without(column))]
    with pytest.raises(MeasurementError) as refused:
        imported(files[::-1] if lacking_first else files)
    fault = str(refused.value)
    assert fault.startswith(f"{files[2]}: has no {name}, which {tmp_path}")
    assert f"as column '{name}'; call it so here too, {way_out} with --column 'ignored={name}'" in fault
    for language in ("en", "de"):
        assert page_fault(fault, language)[0] == language
        assert "--" not in page_fault(fault, language)[1]


def test_the_ways_out_lead_out(tmp_path: Path) -> None:
    files = [write(tmp_path, "a", ALL), write(tmp_path, "b", without("mass [kg]"))]
    masses = [
        [shot.mass_kg for shot in imported(files, **said).campaign.shots]
        for said in ({"constants": ["stroke=1.5mm", "mass=20kg"]}, {"columns": ["ignored=mass"]})
    ]
    assert masses[0] == [20.0, 20.0]
    assert np.isnan(masses[1]).all()


def test_a_mass_beside_the_columns_of_one_file_is_missed_in_another(tmp_path: Path) -> None:
    held = without("mass [kg]")
    files = [write(tmp_path, "a", held, "Masse: 18.9 kg\n"), write(tmp_path, "b", held)]
    with pytest.raises(MeasurementError) as refused:
        imported(files)
    assert str(refused.value) == (
        f"{files[1]}: has no mass, which {files[0]} says beside its columns; say it here too, or give it for "
        "all with --set mass=18.9kg"
    )
    assert page_fault(str(refused.value), "de")[1].endswith("unten im Formular für alle Stöße")
    files[1] = write(tmp_path, "b", ALL)
    assert [shot.mass_kg for shot in imported(files).campaign.shots] == [18.9, 18.9]


def test_what_is_left_empty_is_told(tmp_path: Path) -> None:
    files = [
        write(tmp_path, "a", ALL | {"humidity [%]": "40", "batch": "A"}),
        write(tmp_path, "b", ALL | {"mass [kg]": ""}),
    ]
    notes = imported(files).notes
    mass = (
        "no mass is stated in 1 of 2 records, the first b.csv: it is left empty there; give --set mass=18.9kg"
    )
    told = {
        "column 'humidity' is in 1 of 2 files only: left empty for the others, the first b.csv": (
            "Spalte „humidity“ steht nur in 1 von 2 Dateien: in den anderen leer, zuerst in b.csv"
        ),
        "column 'batch' is in 1 of 2 files only: left empty for the others, the first b.csv": (
            "Spalte „batch“ steht nur in 1 von 2 Dateien: in den anderen leer, zuerst in b.csv"
        ),
        mass: ("in 1 von 2 Aufzeichnungen ist keine Masse angegeben, zuerst in b.csv: dort bleibt sie leer"),
    }
    assert set(told) <= set(notes)
    assert [page_note(note, "de") for note in told] == [("de", german) for german in told.values()]


def test_files_that_hold_the_same_say_nothing_of_it(tmp_path: Path) -> None:
    files = [write(tmp_path, name, ALL | {"humidity [%]": "40"}) for name in ("a", "bb")]
    assert not [note for note in imported(files).notes if "left empty" in note]


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("other", ["temp", "temp [furlong]"])
def test_a_covariate_without_a_unit_beside_one_with_a_unit_is_refused(
    tmp_path: Path, order: int, other: str
) -> None:
    """It had that of the first file: 295 (kelvins) became 568.15 K."""
    files = [write(tmp_path, "a", ALL | {"temp [°C]": "21.5"}), write(tmp_path, "b", ALL | {other: "295"})]
    with pytest.raises(MeasurementError) as refused:
        imported(files[::order])
    assert str(refused.value) == (
        f"{files[1]}: column 'temp' has no unit that is known, and in {files[0]} it is in °C; say the unit "
        "of all with --unit 'temp=°C', or leave the column out with --column 'ignored=temp'"
    )
    assert page_fault(str(refused.value), "de")[1].endswith("unten im Formular eine Einheit für alle angeben")
    (first, second) = imported(files, units=["temp=°C"]).campaign.shots
    assert (first.covariates["temp_k"], second.covariates["temp_k"]) == pytest.approx((294.65, 568.15))


def test_a_covariate_of_no_unit_needs_none(tmp_path: Path) -> None:
    files = [write(tmp_path, "a", ALL | {"grade [-]": "2"}), write(tmp_path, "b", ALL | {"grade": "3"})]
    assert [shot.covariates["grade"] for shot in imported(files).campaign.shots] == [2.0, 3.0]
