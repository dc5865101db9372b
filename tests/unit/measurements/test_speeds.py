"""Records of which the speed was measured and not the position."""

import numpy as np
import pytest

from impactcell.campaign import Coordinate, Excitation
from impactcell.errors import MeasurementError
from impactcell.measurements import Given, guess, make_campaign
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.table import MeasuredColumn, Table

TIME_S = np.arange(2000) * 1e-3
TURN_S = 2.0 * np.pi * 3.0
"""Angular frequency of what is recorded [rad/s]."""
FORCE = np.cos(TURN_S * TIME_S)
DRIVEN = Given(excitation=Excitation.DRIVEN, columns={ColumnMeaning.POSITION: "v"})


def table(speed: np.ndarray, unit: str, force_unit: str = "N") -> Table:
    columns = {"time": ("s", TIME_S), "v": (unit, speed), "F": (force_unit, FORCE)}
    return Table("a.csv", tuple(MeasuredColumn(name, of, values) for name, (of, values) in columns.items()))


def summed_up(recorded: Table, given: Given = DRIVEN) -> tuple[np.ndarray, Coordinate, tuple[str, ...]]:
    imported = make_campaign([recorded], guess([recorded], given))
    (shot,) = imported.campaign.shots
    assert shot.position is not None
    return shot.position.values, imported.campaign.coordinate, imported.notes


def test_a_speed_that_is_given_as_the_position_is_summed_up() -> None:
    position, coordinate, notes = summed_up(table(0.4 * np.cos(TURN_S * TIME_S), "m/s"))
    # of the trapezoidal rule h²/12 times the change of the derivative at most
    assert position == pytest.approx(0.4 / TURN_S * np.sin(TURN_S * TIME_S), abs=1e-6 * 0.4 * TURN_S / 6.0)
    assert coordinate is Coordinate.TRANSLATION
    imported = make_campaign([recorded := table(FORCE, "m/s")], guess([recorded], DRIVEN))
    assert imported.campaign.sensors["position"].summed_up
    assert imported.campaign.shots[0].position is not None
    assert imported.campaign.shots[0].position.summed_up
    assert "position summed up from the speed 'v', from 0 at the first sample of each record" in "\n".join(
        notes
    )


def test_samples_that_are_missing_are_bridged() -> None:
    speed = 0.4 * np.cos(TURN_S * TIME_S)
    speed[500:520] = np.nan
    position, _, _ = summed_up(table(speed, "m/s"))
    assert len(position) == len(TIME_S) - 20
    true = 0.4 / TURN_S * np.sin(TURN_S * TIME_S[np.isfinite(speed)])
    assert position == pytest.approx(true, abs=0.021**3 / 12.0 * 0.4 * TURN_S**2 + 2e-6)


def test_turns_a_minute_are_of_a_rotation_and_a_sign_turns_them() -> None:
    given = Given(
        excitation=Excitation.DRIVEN,
        columns={ColumnMeaning.POSITION: "v"},
        signs={ColumnMeaning.POSITION: -1},
    )
    position, coordinate, _ = summed_up(table(np.full(len(TIME_S), 60.0), "rpm", "N m"), given)
    assert coordinate is Coordinate.ROTATION
    assert position == pytest.approx(-2.0 * np.pi * TIME_S)


def test_a_speed_is_not_taken_for_the_position_unless_it_is_given() -> None:
    recorded = table(0.4 * np.cos(TURN_S * TIME_S), "m/s")
    with pytest.raises(MeasurementError, match=r"--column 'position=v' sums it up"):
        make_campaign([recorded], guess([recorded], Given(excitation=Excitation.DRIVEN)))
    called = Table(
        "a.csv",
        tuple(
            MeasuredColumn("position" if one.name == "v" else one.name, one.unit, one.values)
            for one in recorded.columns
        ),
    )
    (fault,) = [one for one in guess([called]).faults if "is called as the position, but is in m/s" in one]
    assert "say --column 'position=position' to have the speed summed up" in fault


def test_of_a_tap_the_position_has_to_be_measured() -> None:
    recorded = table(0.4 * np.cos(TURN_S * TIME_S), "m/s")
    given = Given(
        excitation=Excitation.TAP,
        columns={ColumnMeaning.POSITION: "v"},
        constants={"mass": 2.0, "velocity": 0.05},
    )
    with pytest.raises(MeasurementError, match="'v' is a speed, whose noise adds up in a position"):
        make_campaign([recorded], guess([recorded], given))
