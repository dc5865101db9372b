"""Mass and velocity of lines without a unit of theirs are told and never dropped in silence."""

from pathlib import Path

import numpy as np
import pytest

from impactcell.errors import MeasurementError
from impactcell.measurements import Imported, guess, make_campaign, read_tables
from impactcell.measurements.given import read_given
from impactcell.web.texts.import_faults import page_fault
from impactcell.web.texts.import_notes import page_note
from tests.unit.measurements.records import sampled, taps

SETTINGS = [(18.9, 2000), (25.2, 4000)]


def imported(directory: Path, lines: str, *constants: str, columns: bool = False) -> Imported:
    """Import two taps below lines with these forms of mass and velocity."""
    files = []
    for number, (mass, velocity) in enumerate(SETTINGS, 1):
        time, force, position = sampled(taps((velocity,), (mass,))[0], np.random.default_rng(number))
        further = f",{mass}" if columns else ""
        rows = [
            f"{t:.5f},{f:.4f},{1e3 * x:.6f}{further}" for t, f, x in zip(time, force, position, strict=True)
        ]
        head = "Time [s],Force [N],Position [mm]" + (",Mass [kg]" if columns else "")
        stated = lines.format(mass=mass, weight=round(9.81 * mass, 2), velocity=velocity)
        files.append(directory / f"r{number}.csv")
        files[-1].write_text("\n".join([stated, "", head, *rows]), encoding="utf-8")
    tables = [table for file in files for table in read_tables(file)]
    return make_campaign(tables, guess(tables, read_given({"constants": ["stroke=1.5mm", *constants]})))


@pytest.mark.parametrize(
    ("line", "told", "german"),
    [
        (
            "mass: {mass}",
            "the line 'mass' says 18.9 without a unit",
            "„mass“ sagt 18,9 ohne Einheit und zählt",
        ),
        (
            "Weight: {weight} N",
            "'Weight' says 185.41 N, which is no mass,",
            "„Weight“ sagt 185,41 N, keine passende",
        ),
        (
            "Teilemasse = {mass} Stein",
            "'Teilemasse' says 18.9 Stein, which is no mass,",
            "keine passende Einheit",
        ),
    ],
)
def test_a_mass_that_is_not_read_is_told(tmp_path: Path, line: str, told: str, german: str) -> None:
    notes = imported(tmp_path, line + "\nvelocity: {velocity} mm/min").notes
    (note,) = (note for note in notes if "is not used" in note)
    assert told in note
    assert "is not used, in 2 files, the first r1.csv; give --set mass=18.9kg" in note
    language, said = page_note(note, "de")
    assert language == "de"
    assert german in said
    (stated,) = (note for note in notes if note.startswith("no mass is stated"))
    assert stated.startswith("no mass is stated in its unit: it is fitted")
    assert page_note(stated, "de")[1].startswith("keine Masse mit ihrer Einheit angegeben")
    for number in ("mass=18.9kg", "mass=20kg"):
        assert not any(
            "is not used" in note
            for note in imported(tmp_path, line + "\nvelocity: {velocity} mm/min", number).notes
        )


def test_a_velocity_that_is_not_read_is_refused_for_that(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError) as refused:
        imported(tmp_path, "mass: {mass} kg\nvelocity: {velocity}")
    assert str(refused.value) == (
        f"{tmp_path / 'r1.csv'}: the line 'velocity' says 2000 without a unit and is not used; write it as "
        "'velocity: 3000 mm/min', or give it for all shots with --set 'velocity=3000 mm/min' (and 1 more "
        "like this)"
    )
    assert page_fault(str(refused.value), "de")[0] == "de"
    with pytest.raises(MeasurementError, match="'velocity' says 2000 kg, which is no velocity, and is not"):
        imported(tmp_path, "mass: {mass} kg\nvelocity: {velocity} kg")


@pytest.mark.parametrize("columns", [False, True])
def test_what_was_given_for_all_shots_and_files_say_otherwise_is_told(tmp_path: Path, columns: bool) -> None:
    lines = "velocity: {velocity} mm/min" if columns else "mass: {mass} kg\nvelocity: {velocity} mm/min"
    found = imported(tmp_path, lines, "mass=20kg", columns=columns)
    assert {shot.mass_kg for shot in found.campaign.shots} == {20.0}
    (note,) = (note for note in found.notes if "goes before" in note)
    assert note == "mass 20 kg, as given, goes before what the files say: 18.9 to 25.2 kg"
    assert page_note(note, "de") == (
        "de",
        "angegeben, und es gilt: Masse 20 kg; in den Dateien steht 18,9 bis 25,2 kg",
    )


def test_numbers_without_a_unit_that_differ_are_no_one_value_for_all(tmp_path: Path) -> None:
    lines = "mass: {mass} kg\nvelocity: {velocity}"
    (note,) = (n for n in imported(tmp_path, lines, "velocity=3000 mm/min").notes if "goes before" in n)
    assert note == (
        "velocity 3000 mm/min, as given, goes before what the files say without a unit: 2000 to 4000"
    )
    assert page_note(note, "de")[1].endswith(
        "es gilt: Geschwindigkeit 3000 mm/min; in den Dateien steht ohne Einheit 2000 bis 4000"
    )


def test_what_was_given_and_files_say_alike_is_not_told(tmp_path: Path) -> None:
    lines = "mass: 20.00 kg\nvelocity: {velocity} mm/min\nweight of the crate: 3"
    assert not [
        n for n in imported(tmp_path, lines, "mass=20kg").notes if "goes before" in n or "not used" in n
    ]
