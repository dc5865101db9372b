"""The place of a cycle in time, whatever order cycles come in."""

import math
from dataclasses import replace

import pytest

from impactcell.tracking.wear_batch.input_validation import CycleClock, update_clock, validate_estimate

LIMIT = 64


def come(cycles):
    """Places of cycles that come in this order, a second apart."""
    clock, places = CycleClock(), []
    for cycle in cycles:
        clock, where = update_clock(clock, cycle, 10**18 + cycle * 10**9, LIMIT)
        places.append(where)
    return clock, places


def test_missing_late_and_repeated_cycles():
    clock, places = come([10, 11, 14, 12, 14, 12, 15])
    assert [(p.passed, p.lag, p.repeated) for p in places] == [
        (0, 0, False),
        (1, 0, False),
        (3, 0, False),
        (0, 2, False),
        (0, 0, True),
        (0, 0, True),
        (1, 0, False),
    ]
    assert clock.period_s == 1.0


def test_numbers_that_restart_go_on_one_cycle_later():
    clock, places = come([500, 501, 3, 4, 501])
    assert [(p.index, p.passed) for p in places] == [(500, 0), (501, 1), (502, 1), (503, 1), (1000, 497)]
    assert places[2].note == "cycle numbers restarted at 3; the clock went back by 498 s"
    assert clock.number(clock.last) == 501


def test_the_last_cycle_that_was_used_is_known_to_have_come_however_many_were_of_no_use_since():
    clock, _ = come([100])
    for cycle in range(101, 200):
        clock = replace(update_clock(clock, cycle, 0, LIMIT)[0], last=100)
    _, where = update_clock(clock, 100, 10**18 + 10**12, LIMIT)
    assert where.repeated


def test_a_module_that_restarts_counts_anew_from_its_first_cycle_on():
    """Sixty cycles after a restart, told by the session alone: none came twice, none came late."""
    clock, timings = CycleClock(), []
    for session, cycle in [*((7, c) for c in range(1, 60)), *((8, c) for c in range(1, 60))]:
        clock, timing = update_clock(clock, cycle, 0, LIMIT, session)
        timings.append(timing)
    assert not any(timing.repeated or timing.lag for timing in timings)
    assert [timing.index for timing in timings] == list(range(1, 119))
    assert timings[59].note == "cycle numbers restarted at 1"
    assert clock.number(clock.last) == 59
    # the same cycle of the same session is one that came twice
    assert update_clock(clock, 59, 0, LIMIT, 8)[1].repeated


def test_a_cycle_keeps_the_number_that_the_module_gave_it_however_often_that_starts():
    clock, given = CycleClock(), {}
    for session in range(1, 12):
        for cycle in range(1 if session % 2 else 0, 5 + session):
            clock, timing = update_clock(clock, cycle, 0, LIMIT, session)
            given[timing.index] = cycle
    assert {index: clock.number(index) for index in given} == given


def test_what_is_not_known_any_more_of_a_cycle_s_number_is_0():
    """A number below 0 cannot be sent: no value of its message was, and nobody could read its node."""
    clock = CycleClock()
    for session in range(1, 40):
        for cycle in range(1, 4):
            clock, _ = update_clock(clock, cycle, 0, LIMIT, session)
    assert (clock.number(1), clock.number(clock.last)) == (0, 3)
    assert len(clock.earlier) < 39
    # a state of an earlier version knows of its last numbering only
    assert replace(clock, earlier=()).number(clock.base - 30) == 0


def test_a_module_that_counts_on_after_its_start_has_one_numbering():
    clock = CycleClock()
    for cycle in range(1, 40):
        clock, _ = update_clock(clock, cycle, 0, LIMIT, 1 + cycle // 10)
    assert (clock.base, clock.earlier) == (0, ())


def test_a_session_that_was_not_known_before_is_no_restart():
    clock, _ = come([10, 11])
    clock, timing = update_clock(clock, 11, 0, LIMIT, 5)
    assert timing.repeated
    clock, timing = update_clock(clock, 14, 0, LIMIT, 5)
    assert (timing.index, timing.passed, clock.session) == (14, 3, 5)
    # nor is one that says nothing
    clock, timing = update_clock(clock, 15, 0, LIMIT)
    assert (timing.passed, clock.session) == (1, 5)


def test_a_cycle_without_a_time_leaves_the_period_as_it_was():
    second, begin, clock = 10**9, 10**18, CycleClock()
    for cycle, time_ns in ((1, begin), (2, begin + second), (3, 0), (4, begin + 3 * second)):
        clock, timing = update_clock(clock, cycle, time_ns, LIMIT)
        assert timing.note == ""
    # the two cycles since the last that had a time took what two usual ones take
    assert clock.period_s < 2.0
    clock, timing = update_clock(CycleClock(), 1, 0, LIMIT)
    clock, timing = update_clock(clock, 2, begin, LIMIT)
    assert timing.note == ""
    assert math.isnan(clock.period_s)
    clock, _ = update_clock(clock, 3, begin + second, LIMIT)
    assert clock.period_s == 1.0


@pytest.mark.parametrize(
    ("std", "said"), [(0.0, "zero"), (-0.002, "-0.002"), (1e-12, "1e-12"), (11.0, "11"), (math.inf, "inf")]
)
def test_a_standard_deviation_that_is_not_used_is_told(std, said):
    note = f"the standard deviation of mu_s is {said}, the usual one is used"
    assert validate_estimate(0.2, std) == (note, False)


@pytest.mark.parametrize("std", [math.nan, 1e-9, 0.002, 10.0])
def test_one_that_can_be_one_or_is_not_there_needs_no_note(std):
    assert validate_estimate(0.2, std) == ("", False)


def test_one_cycle_late_is_not_one_cycles_late():
    assert come([10, 12, 11])[1][-1].note == "cycle 11 came 1 cycle late"


def come_with_doubt(cycles, session=0):
    """Places of cycles that come in this order, where more than 100 ahead is in doubt."""
    clock, places = CycleClock(), []
    for cycle in cycles:
        clock, where = update_clock(clock, cycle, 0, LIMIT, session, farthest=100.0)
        places.append(where)
    return clock, places


@pytest.mark.parametrize("session", [0, 7])
def test_a_number_that_is_too_far_ahead_moves_nothing_unless_the_next_goes_on_from_it(session):
    clock, places = come_with_doubt([10, 11, 10_012, 13, 14], session)
    assert [p.doubted for p in places] == [False, False, True, False, False]
    assert [(p.index, p.passed) for p in places if not p.doubted] == [(10, 0), (11, 1), (13, 2), (14, 1)]
    assert [p.note for p in places if p.note] == ["cycle number 10012 after 11 is in doubt, not used"]
    assert (clock.base, clock.earlier, clock.last) == (0, (), 14)


@pytest.mark.parametrize("following", [10_013, 10_014, 10_011])
def test_a_number_from_which_the_next_goes_on_is_believed_and_the_cycles_between_have_passed(following):
    clock, places = come_with_doubt([10, 11, 10_012, following, 10_020])
    assert [(p.index, p.passed) for p in places[3:]] == [
        (following, following - 11),
        (10_020, 10_020 - following),
    ]
    assert [p.doubted for p in places] == [False, False, True, False, False]
    assert (clock.base, clock.number(clock.last)) == (0, 10_020)


def test_a_number_in_doubt_may_come_twice_and_late_cycles_come_late_still():
    _, places = come_with_doubt([10, 11, 10_012, 10_012, 10_013])
    assert [p.repeated for p in places] == [False, False, False, True, False]
    assert (places[-1].index, places[-1].doubted) == (10_013, False)
    _, places = come_with_doubt([10, 12, 10_013, 11, 14])
    assert [(p.index, p.passed, p.lag) for p in places[3:]] == [(11, 0, 1), (14, 2, 0)]


def test_a_module_that_starts_anew_after_a_number_in_doubt_has_restarted():
    _, places = come_with_doubt([500, 501, 10_502, 1, 2])
    assert [p.index for p in places if not p.doubted] == [500, 501, 502, 503]
    assert places[3].note == "cycle numbers restarted at 1"


def test_two_wrong_numbers_one_after_the_other_are_in_doubt_each():
    _, places = come_with_doubt([10, 11, 10_012, 500_000, 14, 15])
    assert [p.doubted for p in places] == [False, False, True, True, False, False]
    assert [(p.index, p.passed) for p in places[4:]] == [(14, 3), (15, 1)]


def test_cycles_of_which_few_are_measured_are_followed_from_the_third_on():
    clock, places = CycleClock(), []
    for cycle in range(1000, 9000, 1000):
        clock, where = update_clock(clock, cycle, 0, LIMIT, farthest=max(LIMIT, clock.last - 1000))
        places.append(where)
    assert [p.doubted for p in places] == [False, True] + 6 * [False]
    assert [p.passed for p in places[2:]] == [2000, *[1000] * 5]


def test_a_gap_of_no_more_than_is_in_doubt_is_one_at_once():
    assert [p.passed for p in come_with_doubt([10, 110, 111])[1]] == [0, 100, 1]


def test_a_number_after_many_cycles_of_no_use_is_not_in_doubt():
    clock, _ = come([100])
    for cycle in range(101, 300):
        clock = replace(update_clock(clock, cycle, 0, LIMIT, farthest=100.0)[0], last=100)
    _, timing = update_clock(clock, 300, 0, LIMIT, farthest=100.0)
    assert (timing.passed, timing.doubted) == (200, False)
