"""One cycle of a cell, from what was measured to what is shown. Pure: the same inputs give the same bits.

::

    capture ── estimate ── track ── signature ── gap ── alarms ──► snapshot
                             ▲ state                        state ▼

`step` takes a cycle; `apply_rule_result` what happens beside the cycles (link, journal); `apply_event` what
people do to a condition; `start_batch` and `reset_wear_level` what they do to the tracker. Each gives a new
`CellState`, which `impactcell.serialization` writes and reads back bit for bit.
"""

import math
from dataclasses import dataclass, field, replace

from impactcell import alarms
from impactcell.alarms import (
    AlarmEvent,
    AlarmSetState,
    AlarmSettings,
    CycleInputs,
    RuleResult,
    Transition,
)
from impactcell.cell.model_change import REPLACED, model_digest
from impactcell.cell.preprocessing import (
    BatchNaming,
    CaptureDefaults,
    OperatorBatch,
    assign_batch,
    degrade_quality,
    fill_defaults,
    update_period,
)
from impactcell.features import Fault, extract
from impactcell.physics import free_motion
from impactcell.prediction import Model, estimate_from_features
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
from impactcell.tracking.signature.tracker import (
    CycleConditions,
    SignatureSettings,
    SignatureState,
)
from impactcell.tracking.wear_batch import FrictionObservation, TrackerSettings, TrackerState, TrackingResult


@dataclass(frozen=True, slots=True)
class CellDesign:
    """How one cell is computed; comes from its YAML and model file and does not change between cycles.

    Attributes
    ----------
    defaults : CaptureDefaults
        What holds where the module says nothing.
    false_alarm_cycles : float
        Designed mean number of cycles between two false alarms of one rule.
    """

    name: str
    model: Model
    tracker: TrackerSettings
    signature: SignatureSettings
    alarms: AlarmSettings
    defaults: CaptureDefaults = field(default_factory=CaptureDefaults)
    false_alarm_cycles: float = 100_000.0


@dataclass(frozen=True, slots=True, eq=False)
class CellState:
    """All that a cell keeps between cycles.

    Attributes
    ----------
    cycle, time_ns : int
        Of the last one.
    period_s : float
        Mean time between cycles, 0 before it is known.
    grid : tuple
        Length and points of the signature's grid.
    model_digest : str
        Of the model that the state was learned with; empty where that is not known.
    model_changed : bool
        Another model holds from the next cycle on.
    """

    tracker: TrackerState
    signature: SignatureState
    gap: gap_cusum.GapState
    alarms: AlarmSetState
    cycle: int = 0
    time_ns: int = 0
    period_s: float = 0.0
    batch: BatchNaming = field(default_factory=BatchNaming)
    grid: tuple[float, int] = (0.0, 0)
    model_digest: str = ""
    model_changed: bool = False


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


def initial_state(design: CellDesign) -> CellState:
    """State of a cell that has seen nothing."""
    return CellState(
        TrackerState(),
        signature.initial_state(design.signature),
        gap_cusum.GapState(),
        alarms.initial_state(design.alarms),
        grid=_grid(design),
        model_digest=model_digest(design.model),
    )


def migrate_state(design: CellDesign, state: CellState) -> CellState:
    """Make a state fit the design: what is learned on another grid or by another model is learned anew.

    Another model moves the estimates, as another batch would, and what residuals are usual: the next cycle is
    an expected change, and says nothing of the material. Wear learned by a provisional model is learned anew,
    and so is wear where one comes into service: its friction, and how that scatters, are another's.
    """
    if state.grid != _grid(design):
        state = replace(state, signature=signature.initial_state(design.signature), grid=_grid(design))
    digest = model_digest(design.model)
    if state.model_digest == digest:
        return state
    has_changed, model = bool(state.model_digest), design.model
    if has_changed and (model.is_provisional or model.provenance.get(REPLACED) == state.model_digest):
        state = replace(state, tracker=TrackerState(clock=state.tracker.clock))
    gap = gap_cusum.GapState() if has_changed else state.gap
    return replace(state, gap=gap, model_digest=digest, model_changed=state.model_changed or has_changed)


def _grid(design: CellDesign) -> tuple[float, int]:
    return design.signature.length_m, design.signature.points


def step(
    design: CellDesign,
    state: CellState,
    capture: Capture,
    positioning: PositioningState,
    announcement: BatchAnnouncement | None = None,
    faults: tuple[str, ...] = (),
) -> StepResult:
    """Take one cycle through the whole pipeline; `faults` is what the fieldbus found wrong with it."""
    capture = fill_defaults(design.defaults, capture)
    features = extract(capture)
    named = assign_batch(_of_session(state, capture), capture, announcement)
    is_expected = named.expected or state.model_changed
    friction = degrade_quality(estimate_from_features(features, design.model), faults)
    period_s = update_period(state.period_s, (state.cycle, state.time_ns), capture)
    tracked = wear_batch.update(
        design.tracker,
        state.tracker,
        FrictionObservation.of(capture, friction, named.batch_id, expected=is_expected),
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
    tracker, usual = wear_batch.reset_wear_level(state.tracker), signature.restart(state.signature)
    alarm_state = alarms.end_surface(state.alarms, state.cycle, time_ns)
    return replace(state, tracker=tracker, signature=usual, alarms=alarm_state)


def _of_session(state: CellState, capture: Capture) -> BatchNaming:
    """Give what has been said of the batch, without what was announced before the module started anew."""
    before = state.tracker.clock.session
    has_started = before != capture.session and 0 not in (before, capture.session)
    return replace(state.batch, last_announcement=0) if has_started else state.batch


def _gap_quality(friction: FrictionEstimate, gapped: gap_cusum.GapResult) -> Quality:
    if math.isnan(friction.gap):
        return Quality.BAD
    return Quality.UNCERTAIN if gapped.exceeds is None else Quality.GOOD


def _notes(friction: FrictionEstimate, tracked: TrackingResult) -> tuple[str, ...]:
    reason = friction.mu_s.reason if friction.mu_s.quality is not Quality.GOOD else ""
    return tuple(dict.fromkeys(note for note in (reason, *tracked.notes) if note))
