"""One cycle of a cell, from what was measured to what is shown. Pure: the same inputs give the same bits.

::

    capture ── estimate ── track ── signature ── gap ── alarms ──► snapshot
                             ▲ state                        state ▼

`step` takes a cycle; `apply_rule_result` what happens beside the cycles (link, journal); `apply_event` what
people do to a condition; `start_batch` and `reset_wear_level` what they do to the tracker. Each gives a new
`CellState`, which `impactcell.serialization` writes and reads back bit for bit.
"""

import math
from dataclasses import dataclass, replace

from impactcell import alarms
from impactcell.alarms import (
    AlarmEvent,
    CycleInputs,
    RuleResult,
    Transition,
)
from impactcell.cell.preprocessing import (
    BatchNaming,
    OperatorBatch,
    assign_batch,
    degrade_quality,
    fill_defaults,
    update_period,
)
from impactcell.cell.state import CellDesign, CellState
from impactcell.features import Fault, extract
from impactcell.physics import free_motion
from impactcell.prediction import estimate_from_features
from impactcell.records import (
    Alarm,
    BatchAnnouncement,
    Capture,
    FrictionEstimate,
    PositioningState,
    Quality,
    Snapshot,
)
from impactcell.tracking import wear_batch
from impactcell.tracking.model_gap import gap_cusum
from impactcell.tracking.signature import tracker as signature
from impactcell.tracking.signature.tracker import CycleConditions
from impactcell.tracking.wear_batch import FrictionObservation, TrackingResult


@dataclass(frozen=True, slots=True, eq=False)
class StepResult:
    """Outcome of one cycle.

    Attributes
    ----------
    changed : tuple of Alarm
        Alarms that moved with it, as they are now.
    notes : tuple of str
        What was wrong with the cycle, and what was done about it.
    """

    state: CellState
    snapshot: Snapshot
    changed: tuple[Alarm, ...]
    notes: tuple[str, ...]


def step(
    design: CellDesign,
    state: CellState,
    capture: Capture,
    positioning: PositioningState,
    announcement: BatchAnnouncement | None = None,
    faults: tuple[str, ...] = (),
    *,
    restarted: bool = False,
) -> StepResult:
    """Take one cycle through the whole pipeline.

    Parameters
    ----------
    faults : tuple of str
        What the fieldbus found wrong with it.
    restarted : bool
        Whether the fieldbus found that the module was started anew since the one before.
    """
    capture = fill_defaults(design.defaults, capture)
    features = extract(capture)
    named = assign_batch(_of_life(state, capture, restarted=restarted), capture, announcement)
    is_expected = named.expected or state.model_changed
    friction = degrade_quality(estimate_from_features(features, design.model), faults)
    period_s = update_period(state.period_s, (state.cycle, state.time_ns), capture)
    tracked = wear_batch.update(
        design.tracker,
        state.tracker,
        FrictionObservation.of(capture, friction, named.batch_id, expected=is_expected, restarted=restarted),
    )
    conditions = CycleConditions(
        batch_id=tracked.batch.batch_id,
        restart=tracked.shift is not None or is_expected or tracked.expected,
        acceleration=free_motion.model_acceleration(design.model.plant, capture),
        gravity_m_s2=design.model.plant.gravity_m_s2,
        period_s=period_s,
    )
    signed = signature.update(design.signature, state.signature, features, conditions)
    gapped = gap_cusum.update(state.gap, friction.gap, capture.cycle, design.false_alarm_cycles, period_s)
    inputs = CycleInputs(
        cycle=capture.cycle,
        wear=tracked.wear,
        batch=tracked.batch,
        friction=friction,
        signature=signed.signature,
        shift=tracked.shift,
        innovation=tracked.innovation,
        deviation=signed.deviation,
        judged=signed.judged,
        pushed_m=math.nan if isinstance(features.slide, Fault) else features.slide.pushed_m,
        gap=gapped.evidence,
        gap_exceeds=gapped.exceeds,
        predictions=positioning.predictions,
        probability_at_horizon=tracked.probability_at_horizon,
        horizon=tracked.horizon,
        false_alarm_cycles=design.false_alarm_cycles,
        period_s=period_s or math.nan,
    )
    alarm_state, transitions = alarms.update(
        design.alarms,
        state.alarms,
        alarms.evaluate(design.alarms, state.alarms, inputs),
        capture.cycle,
        capture.time_ns,
        announced=tracked.expected,
    )
    after = replace(
        state,
        batch=named.naming,
        tracker=tracked.state,
        signature=signed.state,
        gap=gapped.state,
        alarms=alarm_state,
        cycle=capture.cycle,
        time_ns=capture.time_ns,
        period_s=period_s,
        model_changed=False,
    )
    snapshot = Snapshot(
        cycle=capture.cycle,
        time_ns=capture.time_ns,
        velocity_m_s=capture.velocity_m_s,
        mass_kg=capture.mass_kg,
        friction=friction,
        wear=tracked.wear,
        batch=tracked.batch,
        signature=signed.signature,
        positioning=positioning,
        alarms=alarm_state.alarms,
        model_name=design.model.name,
        gap=friction.gap,
        gap_quality=_gap_quality(friction, gapped),
    )
    return StepResult(after, snapshot, tuple(t.alarm for t in transitions), _notes(friction, tracked))


def apply_rule_result(
    design: CellDesign, state: CellState, result: RuleResult, time_ns: int
) -> tuple[CellState, tuple[Alarm, ...]]:
    """Take what a rule beside the cycles says, as of the link or the journal; the alarms that moved."""
    found, done = alarms.apply_rule_result(design.alarms, state.alarms, result, state.cycle, time_ns)
    return replace(state, alarms=found), (done.alarm,) if done.notifications else ()


def expire_shelving(state: CellState, time_ns: int) -> tuple[CellState, tuple[Alarm, ...]]:
    """End every shelving whose time is over, also while no cycles come."""
    alarm_state, transitions = alarms.expire_shelving(state.alarms, state.cycle, time_ns)
    return replace(state, alarms=alarm_state), tuple(transition.alarm for transition in transitions)


def apply_event(state: CellState, name: str, event: AlarmEvent) -> tuple[CellState, Transition]:
    """Apply a person's action on a condition; a refused one leaves the state as it was."""
    alarm_state, transition = alarms.apply_event(state.alarms, name, replace(event, cycle=state.cycle))
    return replace(state, alarms=alarm_state), transition


def start_batch(state: CellState, batch_id: str, *, expected: bool) -> CellState:
    """Name the batch from the next cycle on; an expected change raises no alarm and re-baselines."""
    named = OperatorBatch(batch_id, state.batch.by_module, expected)
    return replace(state, batch=replace(state.batch, by_operator=named))


def reset_wear_level(state: CellState, time_ns: int) -> CellState:
    """Learn wear level and usual friction along the slide anew, after worn parts were replaced.

    Alarms of wear end at `time_ns`. How cycles vary about what is usual is kept.
    """
    return replace(
        state,
        tracker=wear_batch.reset_wear_level(state.tracker),
        signature=signature.restart(state.signature),
        alarms=alarms.end_surface(state.alarms, state.cycle, time_ns),
    )


def _of_life(state: CellState, capture: Capture, *, restarted: bool) -> BatchNaming:
    """Give what has been said of the batch, without what was announced before the module started anew."""
    before = state.tracker.clock.session
    has_started = restarted or (before != capture.session and 0 not in (before, capture.session))
    return replace(state.batch, last_announcement=0) if has_started else state.batch


def _gap_quality(friction: FrictionEstimate, gapped: gap_cusum.GapResult) -> Quality:
    if math.isnan(friction.gap):
        return Quality.BAD
    return Quality.UNCERTAIN if gapped.exceeds is None else Quality.GOOD


def _notes(friction: FrictionEstimate, tracked: TrackingResult) -> tuple[str, ...]:
    reason = friction.mu_s.reason if friction.mu_s.quality is not Quality.GOOD else ""
    return tuple(dict.fromkeys(note for note in (reason, *tracked.notes) if note))
