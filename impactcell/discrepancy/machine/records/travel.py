"""How far and which way a machine goes: through many turns, and one way only.

What turns is the same again after a turn, so that a law of its place repeats with each turn, or within one;
over many turns it repeats by nothing else. Where a rotation goes on one way, a function of the turns that it
has made is one of the time.
"""

import math
from collections.abc import Sequence

import numpy as np

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.records.whole_turns import TURN

ONE_WAY = 0.95
"""Share of a record's path that lies between its ends where it goes one way [1]."""
MANY_TURNS = 3.0
"""Turns from which on a rotation goes through many: a wave of a turn has repeated then. Our choice."""
MOST_IN_A_TURN = 24
"""Waves in a turn that are looked for at most: as many as in a range (`PERIOD_SHARES`)."""
TURN_IN_DEGREES = 360.0
"""A turn of an angle that was taken to be in rad and is in degrees."""
ABOUT_A_TURN = 0.02
"""Share by which a period may differ from 360 for its angle to look like degrees. Our choice."""


def goes_one_way(records: Sequence[UniformRecord]) -> bool:
    """Whether every record goes one way all the time, but for noise."""
    for record in records:
        width = max(len(record.position) // 200, 1)  # between quantised positions noise goes to and fro
        coarse = record.position[::width]
        if abs(coarse[-1] - coarse[0]) < ONE_WAY * float(np.abs(np.diff(coarse)).sum()):
            return False
    return True


def goes_through_many_turns(coordinate: Coordinate, low: float, high: float) -> bool:
    """Whether a range of positions is that of a rotation through many turns."""
    return coordinate is Coordinate.ROTATION and high - low >= MANY_TURNS * TURN


def turns_on(records: Sequence[UniformRecord], coordinate: Coordinate) -> bool:
    """Whether every record turns on one way, through many turns."""
    return goes_one_way(records) and all(
        goes_through_many_turns(coordinate, float(record.position.min()), float(record.position.max()))
        for record in records
    )


def periods_of_a_turn(travel: float) -> tuple[float, ...]:
    """Periods after which what turns is the same again [rad]: a turn and its parts, in ascending order.

    Half a turn more stands at the end, for what comes nearest there comes nearest to none of them; and within
    a `travel` of as many, a turn in degrees.
    """
    parts = [TURN / count for count in range(MOST_IN_A_TURN, 0, -1)]
    degrees = [TURN_IN_DEGREES, 1.5 * TURN_IN_DEGREES] if travel >= 1.5 * TURN_IN_DEGREES else []
    return (*parts, 1.5 * TURN, *degrees)


def is_turn_in_degrees(period: float) -> bool:
    """Whether a period is about that of a turn of an angle in degrees."""
    return abs(period / TURN_IN_DEGREES - 1.0) <= ABOUT_A_TURN


def may_repeat(period: float, coordinate: Coordinate, low: float, high: float) -> bool:
    """Whether a law of position over a range may repeat after a period.

    It has repeated within the range; or it is of a rotation, and repeats with each turn. Over many turns it
    is a turn or a part of one, to half a wave over the range, which nobody tells apart.

    Examples
    --------
    >>> may_repeat(0.3, Coordinate.TRANSLATION, 0.0, 0.2), may_repeat(0.1, Coordinate.TRANSLATION, 0.0, 0.2)
    (False, True)
    >>> may_repeat(6.2832, Coordinate.ROTATION, -1.0, 1.0), may_repeat(70.0, Coordinate.ROTATION, 0.0, 200.0)
    (True, False)
    """
    travel = high - low
    if coordinate is not Coordinate.ROTATION:
        return period <= travel
    if is_turn_in_degrees(period) and period <= travel:
        return True  # which is asked about
    if not goes_through_many_turns(coordinate, low, high):
        return period <= max(travel, (1.0 + ABOUT_A_TURN) * TURN)
    waves = TURN / period
    return round(waves) >= 1 and math.isclose(waves, round(waves), abs_tol=0.5 * TURN / travel)
