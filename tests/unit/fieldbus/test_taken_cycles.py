"""What is remembered of cycles that were taken: bounded, the oldest forgotten first."""

from impactcell.fieldbus.cycles.cycle_numbers import CycleNumbers
from impactcell.fieldbus.cycles.taken_cycles import TakenCycles
from impactcell.records import CycleId

REMEMBERED = 16
"""Sessions before the last one, as `TakenCycles` promises."""


def test_a_session_of_before_is_behind_until_sixteen_others_have_come() -> None:
    taken = TakenCycles(None, 0, 8, CycleNumbers(None))
    for session in range(1, REMEMBERED + 3):
        taken.add(CycleId(session, 1), b"header", 1_000_000_000 * session)
    behind = [session for session in range(1, REMEMBERED + 3) if taken.is_behind(CycleId(session, 1))]
    assert behind == list(range(2, REMEMBERED + 3))  # the last one's own cycle is behind it too
    assert not taken.is_behind(CycleId(REMEMBERED + 2, 2))


def test_a_session_that_comes_again_is_the_last_one() -> None:
    taken = TakenCycles(CycleId(1, 40), 0, 8, CycleNumbers(None))
    taken.add(CycleId(2, 1), b"header", 0)
    assert taken.is_behind(CycleId(1, 41))
    taken.add(CycleId(1, 41), b"header", 0)
    assert not taken.is_behind(CycleId(1, 42))
    assert taken.is_behind(CycleId(2, 2))
