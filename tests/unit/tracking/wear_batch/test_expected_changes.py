"""A change that somebody said comes is expected until a cycle shows it, however many are of no use."""

import math
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

KNOWN = TrackerSettings(identical_limit=2)
UNKNOWN = replace(KNOWN, batch=BatchKnowledge.UNKNOWN)
STD, STEP, AT = 0.002, 0.015, 120
WAYS = {
    "unknown": (UNKNOWN, None, None),
    "known, another name": (KNOWN, "A", "B"),
    "known, the same name": (KNOWN, "A", "A"),
}
"""Settings, and the names of the batch before and after the change."""


def readings(before: str | None, after: str | None) -> list[FrictionObservation]:
    """One each cycle; a change is expected at `AT`."""
    noise = STD * np.random.default_rng(3).standard_normal(200)
    return [
        FrictionObservation(
            n,
            0.2 + float(noise[n]) + (STEP if n >= AT else 0.0),
            STD,
            batch_id=after if n >= AT else before,
            expected_change=n == AT,
            session=7,
        )
        for n in range(1, 200)
    ]


def run(settings: TrackerSettings, cycles: list[FrictionObservation]) -> list[TrackingResult]:
    """Follow the cycles, with a restart after each of those about the change."""
    state, results = initial_state(), []
    for observation in cycles:
        results.append(wear_batch.update(settings, state, observation))
        state = results[-1].state
        if abs(observation.cycle - AT) < 5:
            state = unpack(TrackerState, pack(state))
    return results


def unusable(kind: str, cycles: list[FrictionObservation]) -> list[FrictionObservation]:
    """Let what comes at `AT`, with which the change is expected, be of no use."""
    place = AT - 1
    before, first = cycles[place - 1], cycles[place]
    others = {
        "unreadable": replace(first, mu_s=math.nan, mu_s_std=math.nan),
        "no friction": replace(first, mu_s=40.0),
        "identical": replace(first, mu_s=before.mu_s),
        "repeated": replace(first, cycle=before.cycle),
    }
    return [*cycles[:place], others[kind], *cycles[place + 1 :]]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", ["unreadable", "no friction", "identical", "repeated", "two unreadable"])
def test_a_change_whose_first_cycle_is_of_no_use_is_expected_with_the_next(way, kind):
    """It was forgotten, and the next good cycle was a change that nobody had said: a false BatchShift."""
    settings, before, after = WAYS[way]
    cycles = readings(before, after)
    shown_at = AT + 1
    if kind == "two unreadable":
        kind, shown_at = "unreadable", AT + 2
        cycles[AT] = replace(cycles[AT], mu_s=math.nan)
    results = run(settings, unusable(kind, cycles))
    assert not any(result.shift for result in results)
    assert [n for n, result in enumerate(results, 1) if result.expected] == [shown_at]
    last = results[-1]
    assert last.wear.level == pytest.approx(0.2, abs=4.0 * last.wear.level_std)
    assert last.batch.offset == pytest.approx(STEP, abs=4.0 * last.batch.offset_std)
    assert not last.state.expects_change


@pytest.mark.parametrize("way", WAYS)
def test_a_change_that_is_said_with_a_late_cycle_is_expected_with_the_next_in_order(way):
    settings, before, after = WAYS[way]
    cycles = readings(before, after)
    place = AT - 1
    late = replace(cycles[place - 2], expected_change=True)
    cycles[place] = replace(cycles[place], expected_change=False)
    results = run(settings, [*cycles[: place - 2], *cycles[place - 1 : place], late, *cycles[place:]])
    assert not any(result.shift for result in results)
    assert [result.expected for result in results].index(True) == place
    assert sum(result.expected for result in results) == 1


def test_a_change_before_the_first_cycle_of_use_is_over_with_it():
    cycles = readings(None, None)[AT - 1 :]
    cycles[0] = replace(cycles[0], mu_s=math.nan)
    results = run(UNKNOWN, cycles)
    assert results[0].state.expects_change
    assert not any(result.expected for result in results)
    assert not results[1].state.expects_change
