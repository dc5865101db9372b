"""A friction series replayed through the tracker of wear and batch, and through its alarm rules."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from impactcell import alarms
from impactcell.alarms import AlarmSetState, AlarmSettings, CycleInputs, Notification
from impactcell.alarms.rules import batch_shift, wear_limit
from impactcell.cell import series_runs
from impactcell.errors import SeriesError
from impactcell.records import BatchState, Evidence, Samples, WearState
from impactcell.records.uncertainty import TOLD_STDS
from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import (
    FrictionObservation,
    TrackerSettings,
    TrackingResult,
    initial_state,
)

LARGEST_CYCLE = 2**53
"""Beyond it doubles are no longer every whole number."""
MOST_FALLS = 0.25
"""Share of cycles with a lower number than the one before, above which a series is not in order: late cycles
and counters that begin anew are few."""
FEWEST_FALLS = 3
"""Falls below which it says nothing of order."""


@dataclass(frozen=True, slots=True)
class RaisedAlarm:
    """One activation of an alarm.

    Attributes
    ----------
    alarm : str
        Name of its condition.
    cycle : int
        At which it was raised.
    evidence : Evidence
        What was compared with what, when the change began and how large it is; of a batch shift, as the
        cycles after it came to see it.
    cleared_cycle : int or None
        At which its condition was over; None while it stands. A batch shift is an event, and has none.
    may_be_renewed : bool
        It stands, and is of a level above the limit, while friction with the present batch is below it: a
        surface that was renewed without anybody saying so looks like that.
    """

    alarm: str
    cycle: int
    evidence: Evidence
    cleared_cycle: int | None = None
    may_be_renewed: bool = False

    @property
    def withdrawn(self) -> bool:
        """Whether a batch shift, as the cycles after it came to see it, may as well be none (95 %)."""
        evidence = self.evidence
        return self.alarm == batch_shift.NAME and abs(evidence.size) <= TOLD_STDS * evidence.size_std


@dataclass(frozen=True, slots=True, eq=False)
class TrackedSeries:
    """A friction series after its last cycle, and its course.

    Attributes
    ----------
    wear : WearState
        Level, rate per cycle and cycles left, after the last cycle.
    batch : BatchState
        Offset of the present batch and the last shift found, after the last cycle.
    friction, friction_std : float
        mu_s of the present batch, level and offset together, after the last cycle, and its standard
        deviation.
    alarms : tuple of RaisedAlarm
        In the order in which they were raised.
    cycle, level, level_std, batch_offset : ndarray, shape (cycles,)
        What was known after each cycle: mu_s at the reference batch, its standard deviation, and the offset
        of the batch from it.
    cycles_to_limit : ndarray, shape (cycles, 3)
        What was known after each cycle of the cycles left, and both ends of their 95 % interval.
    used : int
        Cycles that went into the state.
    notes : tuple of (int, str)
        Cycle, and what was wrong with it.
    """

    wear: WearState
    batch: BatchState
    friction: float
    friction_std: float
    alarms: tuple[RaisedAlarm, ...]
    cycle: Samples
    level: Samples
    level_std: Samples
    batch_offset: Samples
    cycles_to_limit: Samples
    used: int
    notes: tuple[tuple[int, str], ...]


def replay(settings: TrackerSettings, observations: Sequence[FrictionObservation]) -> TrackedSeries:
    """Track a series and its alarms.

    Raises
    ------
    SeriesError
        The series has no cycles, or they are not in the order in which they were measured; cycles come again,
        some with the same value and some with another, or one by one with other values or batches.
    """
    cycles = [observation.cycle for observation in observations]
    falls = sum(after < before for before, after in pairwise(cycles))
    if falls >= FEWEST_FALLS and falls > MOST_FALLS * len(cycles):
        raise SeriesError(
            f"{falls} of {len(cycles)} cycles have a lower number than the one before; sort them by cycle"
        )
    rules = AlarmSettings()
    state, alarm_set = initial_state(), alarms.initial_state(rules)
    raised: list[RaisedAlarm] = []
    course: list[tuple[float, ...]] = []
    notes: list[tuple[int, str]] = []
    result: TrackingResult | None = None
    used, open_shift = 0, -1
    wrong = series_runs.misnumbered(observations, settings.reorder_limit)
    numbered = [observation for place, observation in enumerate(observations) if place not in wrong]
    in_runs = iter(series_runs.told_apart(numbered, settings.reorder_limit))
    for place, given in enumerate(observations):
        if place in wrong:
            notes.append((given.cycle, wrong[place]))
            course.append((given.cycle, *course[-1][1:]))
            continue
        observation = replace(next(in_runs), number_is_sure=place < len(observations) - 1)
        result = wear_batch.update(settings, state, observation)
        state = result.state
        used += result.used
        notes.extend((observation.cycle, note) for note in result.notes)
        wear = result.wear
        left = wear.cycles_to_limit, wear.cycles_to_limit_low, wear.cycles_to_limit_high
        course.append((observation.cycle, wear.level, wear.level_std, result.batch.offset, *left))
        inputs = CycleInputs(
            observation.cycle,
            result.wear,
            result.batch,
            shift=result.shift,
            probability_at_horizon=result.probability_at_horizon,
            horizon=result.horizon,
        )
        rule_results = alarms.evaluate(rules, alarm_set, inputs)
        alarm_set, transitions = alarms.update(
            rules,
            alarm_set,
            rule_results,
            observation.cycle,
            observation.time_ns,
            announced=result.expected,
        )
        if transitions:
            raised = [_cleared(alarm, alarm_set, observation.cycle) for alarm in raised]
        raised.extend(
            RaisedAlarm(event.alarm.name, observation.cycle, event.alarm.evidence)
            for event in transitions
            if Notification.ANNUNCIATE in event.notifications and event.alarm.name != batch_shift.NAME
        )
        if result.shift is not None:
            # a second shift while the first still stands is news too
            open_shift = len(raised)
            raised.append(RaisedAlarm(batch_shift.NAME, observation.cycle, result.shift))
        elif open_shift >= 0:
            raised[open_shift] = _refined(raised[open_shift], result.batch)
    if result is None:
        raise SeriesError("the series has no cycles")
    if wear_limit.may_be_renewed(result.wear, result.batch):
        raised = [_perhaps_renewed(alarm) for alarm in raised]
    cycle, level, level_std, batch_offset, *cycles_to_limit = np.array(course).T
    friction, friction_std = wear_batch.present_friction(settings, state, observations[-1])
    return TrackedSeries(
        wear=result.wear,
        batch=result.batch,
        friction=friction,
        friction_std=friction_std,
        alarms=tuple(raised),
        cycle=cycle,
        level=level,
        level_std=level_std,
        batch_offset=batch_offset,
        cycles_to_limit=np.column_stack(cycles_to_limit),
        used=used,
        notes=tuple(notes),
    )


def whole_number_fault(cycle: float) -> str:
    """Say why a number is none of a cycle; empty where it is one."""
    if not (cycle >= 0.0 and cycle == math.floor(cycle) < math.inf):
        return "is not a whole number from 0 on"
    if cycle > LARGEST_CYCLE:
        return f"is larger than {LARGEST_CYCLE}, up to which cycles are counted"
    return ""


def _cleared(raised: RaisedAlarm, alarm_set: AlarmSetState, cycle: int) -> RaisedAlarm:
    """Keep the cycle at which what stood is found to be over."""
    is_over = raised.alarm != batch_shift.NAME and not alarm_set.alarm(raised.alarm).active
    return replace(raised, cleared_cycle=cycle) if is_over and raised.cleared_cycle is None else raised


def _perhaps_renewed(raised: RaisedAlarm) -> RaisedAlarm:
    """Keep of a level that stands above the limit that friction is below it."""
    stands = raised.alarm == wear_limit.NAME and raised.cleared_cycle is None
    return replace(raised, may_be_renewed=stands)


def _refined(raised: RaisedAlarm, batch: BatchState) -> RaisedAlarm:
    """Let what is now estimated of the shift replace what was estimated when it was found."""
    if not math.isfinite(batch.last_shift):
        return raised
    evidence = replace(
        raised.evidence,
        change_cycle=batch.last_shift_cycle,
        size=batch.last_shift,
        size_std=batch.last_shift_std,
    )
    return replace(raised, evidence=evidence)
