"""Units in capitals, days, kilograms of force, and units that nobody knows."""

from pathlib import Path

import numpy as np
import pytest

from impactcell.measurements import Given, guess, read_tables
from impactcell.measurements.columns.mapping import Mapping
from impactcell.measurements.notation.units import parse_unit
from impactcell.web.texts.import_faults import page_fault

ROWS = "\n".join(f"{n};{n % 7};{0.5 * n}" for n in range(40))


def guessed(directory: Path, header: str, **units: str) -> Mapping:
    path = directory / "a.csv"
    path.write_text(f"{header}\n{ROWS}", encoding="utf-8")
    return guess(read_tables(path), Given(units=units))


def test_units_in_capitals_are_those_that_alone_they_can_be(tmp_path: Path) -> None:
    mapping = guessed(tmp_path, "TIME [S];FORCE [KN];POSITION [MM]")
    assert not mapping.faults
    factors = [item.unit.factor for item in mapping.assignments if item.unit is not None]
    np.testing.assert_allclose(factors, [1.0, 1e3, 1e-3])
    (fault,) = guessed(tmp_path, "TIME [MS];FORCE [KN];POSITION [MM]").faults
    assert fault.startswith("column 'TIME' (time) is in 'MS', no unit that is known; ")


@pytest.mark.parametrize(
    ("unit", "si"), [("MM/MIN", None), ("KG", 1.0), ("mS", None), ("Mm", None), ("d", 86400.0)]
)
def test_what_may_be_another_unit_is_not_taken_for_it(unit: str, si: float | None) -> None:
    known = parse_unit(unit)
    assert (None if known is None else known.factor) == (
        si if unit != "MM/MIN" else pytest.approx(1e-3 / 60.0)
    )


def test_days_of_a_spreadsheet_are_a_time_and_d_is_a_name(tmp_path: Path) -> None:
    """A spreadsheet counts days: 86 400 s each."""
    mapping = guessed(tmp_path, "Time;Force [N];Position [mm]", Time="d")
    assert not mapping.faults
    (time, *_) = mapping.assignments
    assert time.unit is not None
    assert time.unit.factor == 24 * 60 * 60
    assert [item.column for item in guessed(tmp_path, "t;F;d").assignments] == ["t", "F", "d"]


def test_a_unit_that_is_not_known_is_named(tmp_path: Path) -> None:
    mapping = guessed(tmp_path, "Time [s];Force [Stein];Position [mm]")
    (fault,) = mapping.faults
    assert fault == (
        "column 'Force' (force) is in 'Stein', no unit that is known; say --unit 'Force=N', or which it is"
    )
    assert page_fault(fault, "de") == (
        "de",
        "Spalte „Force“ (Kraft) ist in „Stein“, keiner bekannten Einheit; unten im Formular angeben, etwa N",
    )


@pytest.mark.parametrize(("unit", "of_weight"), [("kg", "kgf"), ("lb", "lbf"), ("lbs", "lbf")])
def test_a_force_in_kilograms_is_one_of_their_weight(tmp_path: Path, unit: str, of_weight: str) -> None:
    mapping = guessed(tmp_path, f"Time [s];Force [{unit}];Position [mm]")
    (fault,) = [one for one in mapping.faults if "Force" in one]
    assert f"say --unit 'Force={of_weight}' where its weight is meant" in fault
    assert page_fault(fault, "de")[0] == "de"
    assert not guessed(tmp_path, f"Time [s];Force [{unit}];Position [mm]", Force=of_weight).faults
