"""A series that is tracked by itself has the alarms that a running cell would raise, each once."""

import math

import numpy as np
import pytest

from impactcell.cell.series_replay import RaisedAlarm, replay
from impactcell.records import Evidence
from impactcell.tracking.wear_batch import BatchKnowledge, FrictionObservation, TrackerSettings

LIMIT, BEYOND, SHIFT = 0.23, 900, 0.03
"""Limit of friction; cycle at which it is gone through; and by how much another batch is off."""


def observed(friction: np.ndarray) -> list[FrictionObservation]:
    noise = np.random.default_rng(8).normal(0.0, 0.002, friction.size)
    return [
        FrictionObservation(cycle, mu_s, 0.002) for cycle, mu_s in enumerate((friction + noise).tolist(), 1)
    ]


def test_wear_through_its_limit_is_one_alarm_and_is_foretold() -> None:
    wear = 0.2 + (LIMIT - 0.2) / BEYOND * np.arange(1, 1_201)
    tracked = replay(TrackerSettings(wear_limit=LIMIT), observed(wear))
    warning, alarm = tracked.alarms
    assert (warning.alarm, alarm.alarm) == ("WearWarning", "WearLimit")
    assert warning.cycle < alarm.cycle
    assert abs(alarm.cycle - BEYOND) < 60


def test_another_batch_is_one_alarm_and_is_told_better_as_it_goes_on() -> None:
    batch = np.full(400, 0.2)
    batch[200:] -= SHIFT
    tracked = replay(TrackerSettings(wear_limit=LIMIT), observed(batch))
    (alarm,) = tracked.alarms
    assert alarm.alarm == "BatchShift"
    assert alarm.evidence.change_cycle == 201
    assert abs(alarm.evidence.size + SHIFT) < 4.0 * alarm.evidence.size_std < 0.2 * SHIFT


@pytest.mark.parametrize("knowledge", list(BatchKnowledge))
@pytest.mark.parametrize("shift", [SHIFT, 0.0])
def test_present_friction_is_level_and_offset_and_known_better_than_either(
    knowledge: BatchKnowledge, shift: float
) -> None:
    """What the level lacks the offset has: of their sum much more is known than of each."""
    friction = 0.2 + shift * (np.arange(400) >= 200) + 1e-5 * np.arange(400)
    batches = [FrictionObservation(o.cycle, o.mu_s, o.mu_s_std, batch_id="A") for o in observed(friction)]
    batches[200:] = [FrictionObservation(o.cycle, o.mu_s, 0.002, batch_id="B") for o in batches[200:]]
    tracked = replay(TrackerSettings(batch=knowledge), batches)
    assert tracked.friction == pytest.approx(tracked.wear.level + tracked.batch.offset, abs=1e-12)
    assert abs(tracked.friction - friction[-1]) < 3.0 * tracked.friction_std
    assert (
        0.0 < tracked.friction_std < min(0.002, math.hypot(tracked.wear.level_std, tracked.batch.offset_std))
    )


def test_present_friction_is_known_where_nobody_says_of_which_batch_the_last_cycle_is() -> None:
    batches = [FrictionObservation(o.cycle, o.mu_s, 0.002, batch_id="A") for o in observed(np.full(60, 0.2))]
    batches[-1] = FrictionObservation(60, batches[-1].mu_s, 0.002)
    tracked = replay(TrackerSettings(batch=BatchKnowledge.KNOWN), batches)
    assert abs(tracked.friction - 0.2) < 3.0 * tracked.friction_std
    nothing = replay(TrackerSettings(), [FrictionObservation(1, math.nan, 0.002)])
    assert math.isnan(nothing.friction)
    assert math.isnan(nothing.friction_std)


def test_a_shift_that_may_as_well_be_none_by_now_is_withdrawn() -> None:
    """Steps up and down by one standard deviation, in the end seen as friction that goes unsteadily."""
    noise = np.random.default_rng(12003).normal(0.0, 0.002, 800)
    values = 0.2 + 0.002 * (np.arange(800) // 100 % 2) + noise
    tracked = replay(TrackerSettings(), [FrictionObservation(i, v, 0.002) for i, v in enumerate(values, 1)])
    assert [alarm.withdrawn for alarm in tracked.alarms] == [False, False, False, True]
    assert not RaisedAlarm("WearLimit", 9, Evidence(size=0.001, size_std=0.002)).withdrawn
    assert not RaisedAlarm("BatchShift", 9, Evidence()).withdrawn


def test_an_alarm_of_wear_that_is_over_has_the_cycle_at_which_it_was() -> None:
    falling = 0.25 - 1e-4 * np.arange(400)
    (alarm,) = replay(TrackerSettings(wear_limit=LIMIT), observed(falling)).alarms
    assert alarm.alarm == "WearLimit"
    assert alarm.cleared_cycle is not None
    assert abs(alarm.cleared_cycle - 200) < 60
    standing = replay(TrackerSettings(wear_limit=LIMIT), observed(falling[:120])).alarms
    assert [alarm.cleared_cycle for alarm in standing] == [None]
