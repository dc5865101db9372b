"""Batches that are named late, at times, or by another setting: wear goes on, and a batch has its offset."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from impactcell.serialization import pack, unpack
from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import (
    BatchKnowledge,
    FrictionObservation,
    TrackerSettings,
    TrackerState,
    TrackingResult,
    initial_state,
)

KNOWN = TrackerSettings(wear_limit=0.25)
UNKNOWN = replace(KNOWN, batch=BatchKnowledge.UNKNOWN)
STD, STEP, SLOPE = 0.002, 0.03, 1e-4


def level(cycle: int) -> float:
    """Friction at the first batch."""
    return 0.2 + SLOPE * cycle


def friction(cycle: int, at: float, seed: int = 5) -> float:
    """Of a batch that is `STEP` above the first one, from a cycle on."""
    noise = STD * float(np.random.default_rng([seed, cycle]).standard_normal())
    return level(cycle) + (STEP if cycle >= at else 0.0) + noise


def run(
    observations: list[FrictionObservation], settings_of: Callable[[int], TrackerSettings] = lambda _: KNOWN
) -> list[TrackingResult]:
    state, results = initial_state(), []
    for observation in observations:
        results.append(wear_batch.update(settings_of(observation.cycle), state, observation))
        state = unpack(TrackerState, pack(results[-1].state))
    return results


def assert_wear_goes_on(results: list[TrackingResult], since: int, offset: float = STEP) -> None:
    """From a cycle on; results are of the cycles from 1 on."""
    for cycle, result in enumerate(results[since - 1 :], since):
        wear, batch = result.wear, result.batch
        assert abs(wear.level - level(cycle)) < 4.0 * wear.level_std, cycle
        assert wear.level_std < 0.6 * STD, cycle
        assert abs(batch.offset - offset) < 4.0 * math.hypot(batch.offset_std, STD), cycle
        assert wear.probability_above_limit < 0.01, cycle


@pytest.mark.slow
@pytest.mark.parametrize("expected", [True, False], ids=["announced", "unannounced"])
@pytest.mark.parametrize("named_at", [60, 260])
def test_the_first_batch_that_is_named_has_its_offset_and_wear_goes_on(named_at, expected):
    """It became the reference: level 0.230 -> 0.262 for a limit of 0.25, and a false WearLimit."""
    readings = [
        FrictionObservation(
            n,
            friction(n, named_at),
            STD,
            batch_id="B" if n >= named_at else None,
            expected_change=expected and n == named_at,
        )
        for n in range(1, 321)
    ]
    results = run(readings)
    assert not any(result.shift for result in results)
    assert results[-1].state.filter.batches == (None, "B")
    assert_wear_goes_on(results, named_at)
    assert results[-1].batch.offset == pytest.approx(STEP, abs=4.0 * results[-1].batch.offset_std)


def test_a_first_name_without_a_change_finds_an_offset_of_nothing():
    readings = [
        FrictionObservation(n, friction(n, math.inf), STD, batch_id="A" if n >= 90 else None)
        for n in range(1, 281)
    ]
    results = run(readings)
    assert_wear_goes_on(results, 90, offset=0.0)
    assert not any(result.shift for result in results)


def test_one_or_two_cycles_before_the_first_name_are_no_reference():
    readings = [
        FrictionObservation(n, friction(n, 3), STD, batch_id="A" if n >= 3 else None) for n in range(1, 101)
    ]
    last = run(readings)[-1]
    assert last.state.filter.batches == ("A",)
    assert last.wear.level == pytest.approx(level(100) + STEP, abs=4.0 * last.wear.level_std)


@pytest.mark.slow
@pytest.mark.parametrize("changed_at", [50, 200])
@pytest.mark.parametrize("how", ["found", "announced"])
def test_a_name_that_comes_back_after_a_change_in_between_has_the_offset(changed_at, how):
    gone, back = changed_at - 20, changed_at + 60
    readings = [
        FrictionObservation(
            n,
            friction(n, changed_at),
            STD,
            batch_id=None if gone <= n < back else "A",
            expected_change=how == "announced" and n == changed_at,
        )
        for n in range(1, back + 120)
    ]
    results = run(readings)
    found = [n for n, result in enumerate(results, 1) if result.shift]
    assert all(changed_at <= n < changed_at + 8 for n in found)
    assert len(found) == (how == "found")
    assert_wear_goes_on(results, back)
    assert results[-1].state.filter.batches == (None, "A")


def test_a_name_that_comes_back_without_a_change_is_still_the_reference():
    readings = [
        FrictionObservation(n, friction(n, math.inf), STD, batch_id=None if 100 <= n < 140 else "A")
        for n in range(1, 260)
    ]
    last = run(readings)[-1]
    assert (last.state.filter.batches, last.batch.offset) == (("A",), 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("known_from", [110, 260])
@pytest.mark.parametrize("named", ["one name", "another name"])
def test_a_reload_that_believes_ids_from_now_on_keeps_what_was_found_without_them(known_from, named):
    """The present batch became the reference, with all that was found before."""
    changed_at = known_from - 50
    readings = [
        FrictionObservation(
            n, friction(n, changed_at), STD, batch_id="B" if named == "another name" and n >= 80 else "A"
        )
        for n in range(1, known_from + 120)
    ]
    results = run(readings, lambda n: KNOWN if n >= known_from else UNKNOWN)
    assert [changed_at <= n < known_from for n, result in enumerate(results, 1) if result.shift] == [True]
    assert_wear_goes_on(results, known_from)


def test_a_reload_that_believes_ids_from_now_on_has_the_first_batch_as_reference():
    readings = [FrictionObservation(n, friction(n, math.inf), STD, batch_id="A") for n in range(1, 160)]
    results = run(readings, lambda n: KNOWN if n >= 100 else UNKNOWN)
    assert results[-1].state.filter.batches == ("A",)
    assert_wear_goes_on(results, 100, offset=0.0)


@pytest.mark.slow
def test_ids_that_are_not_believed_for_a_while_leave_no_filter_behind():
    """After known, unknown and known again the level was that of before, 0.03 too low, and sure of it."""
    readings = [FrictionObservation(n, friction(n, math.inf), STD, batch_id="A") for n in range(1, 460)]
    results = run(readings, lambda n: UNKNOWN if 150 <= n < 400 else KNOWN)
    assert results[300].state.filter is None
    assert_wear_goes_on(results, 100, offset=0.0)


@pytest.mark.parametrize(
    "order", [[1, 2, 3, 4, 6, 5, 7, 8, 9], [1, 2, 3, 5, 4, 6, 7, 8]], ids=["after five", "after four"]
)
def test_a_name_that_comes_with_a_late_cycle_only_begins_nothing(order):
    """Each cycle after the next replay of the first ones was an IndexError."""
    late = min(n for n, after in itertools.pairwise(order) if after < n) - 1
    readings = [
        FrictionObservation(n, friction(n, math.inf), STD, batch_id="B" if n == late else None)
        for n in [*order, *range(order[-1] + 1, 80)]
    ]
    results = run(readings)
    assert all(result.used for result in results)
    last = results[-1]
    assert last.state.filter is None
    assert last.wear.level == pytest.approx(level(79), abs=4.0 * last.wear.level_std)


def test_a_filter_that_an_earlier_version_began_with_a_late_cycle_stays_as_it_is():
    readings = [FrictionObservation(n, friction(n, math.inf), STD) for n in range(1, 80)]
    state = initial_state()
    for reading in readings[:10]:
        state = wear_batch.update(KNOWN, state, reading).state
    begun = wear_batch.update(KNOWN, initial_state(), replace(readings[9], batch_id="B")).state.filter
    state = replace(state, filter=begun)
    for reading in readings[10:]:
        result = wear_batch.update(KNOWN, state, reading)
        state = result.state
        assert result.used


@pytest.mark.slow
@pytest.mark.parametrize("step", [10, 20])
@pytest.mark.parametrize("first", [1, 2])
def test_a_first_batch_of_one_or_two_cycles_gives_away_nothing_of_the_step(first, step):
    """Level and offset were off by up to 3.2 of their standard deviations, all to the same side."""
    beyond = []
    for seed in range(12):
        noise = STD * np.random.default_rng([17, seed]).standard_normal(61)
        readings = [
            FrictionObservation(
                n,
                0.2 + noise[n] + (step * STD if n > first else 0.0),
                STD,
                batch_id="B" if n > first else "A",
            )
            for n in range(1, 61)
        ]
        results = run(readings)
        wear, batch = results[-1].wear, results[-1].batch
        off = (wear.level - 0.2) / wear.level_std, (batch.offset - step * STD) / batch.offset_std
        beyond.append((*off, wear.level_std))
        assert any(result.shift for result in results)
    level, offset, level_std = np.transpose(beyond)
    for off in (level, offset):
        assert abs(np.mean(off)) < 3.0 / math.sqrt(len(off))
        assert np.abs(off).max() < 3.5
    assert level_std == pytest.approx(STD, rel=0.5)
