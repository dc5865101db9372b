"""A series that is tracked by itself has the alarms that a running cell would raise, each once."""

import numpy as np

from impactcell.cell.series_replay import replay
from impactcell.tracking.wear_batch import FrictionObservation, TrackerSettings

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
