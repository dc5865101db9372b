"""One cycle of a cell, from what was measured to what is shown. Pure: the same inputs give the same bits.

::

    capture ── estimate ── track ── signature ── gap ── alarms ──► snapshot
                             ▲ state                        state ▼

`step` takes a cycle; `find` takes what happens beside the cycles (link, journal); `act` takes what people
do to a condition; `start_batch` and `reset_wear` what they do to the tracker. Each gives a new `CellState`,
which `impactcell.values` writes and reads back bit for bit.
"""

import math
from dataclasses import dataclass, replace

from impactcell import alarms
from impactcell.alarms import AlarmSettings, AlarmState, Finding, Occurrence, Transition
from impactcell.prediction import Model, estimate
from impactcell.records import (
    Alarm,
    AlarmName,
    Capture,
    Channel,
    Evidence,
    FrictionEstimate,
    PositioningState,
    Quality,
    Snapshot,
)
from impactcell.tracking import (
    Reading,
    Tracked,
    TrackerSettings,
    TrackerState,
    gap,
    reset_wear,
    signature,
    track,
)
from impactcell.tracking.signature import SignatureSettings, SignatureState, SignatureTracked

PERIOD_GAIN = 0.05
"""How fast the mean time between cycles follows."""


@dataclass(frozen=True, slots=True)
class CellDesign:
    """How one cell is computed; comes from its YAML and model file and does not change between cycles.

    Attributes
    ----------
    mass_kg, stroke_m : float or None
        Taken where the module reports none.
    force_noise_std_n, position_noise_std_m : float
        Of the sensors.
    false_alarm_cycles : float
        Designed mean number of cycles between two false alarms of one rule.
    """

    name: str
    model: Model
    tracker: TrackerSettings
    signature: SignatureSettings
    alarms: AlarmSettings
    mass_kg: float | None = None
    stroke_m: float | None = None
    force_noise_std_n: float = 0.4
    position_noise_std_m: float = 1.5e-6
    false_alarm_cycles: float = 100_000.0


@dataclass(frozen=True, slots=True)
class NamedBatch:
    """A batch named by a person: holds until the module names another than it did then."""

    batch_id: str
    module_said: str | None
    expected: bool


@dataclass(frozen=True, slots=True)
class Announcement:
    """A batch change that the PLC announces through the module; `sequence` 0 before the first."""

    sequence: int = 0
    from_cycle: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class CellState:
    """All that a cell keeps between cycles."""

    tracker: TrackerState
    signature: SignatureState
    gap: gap.GapState
    alarms: AlarmState
    cycle: int = 0
    time_ns: int = 0
    period_s: float = 0.0
    named_batch: NamedBatch | None = None
    module_batch: str | None = None
    announcement_seen: int = 0
    grid: tuple[float, int] = (0.0, 0)


@dataclass(frozen=True, slots=True, eq=False)
class Stepped:
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
        gap.GapState(),
        alarms.initial_state(design.alarms),
        grid=_grid(design),
    )


def adapted(design: CellDesign, state: CellState) -> CellState:
    """Make a state fit the design: a signature on another grid is learned anew, all else stays."""
    if state.grid == _grid(design):
        return state
    return replace(state, signature=signature.initial_state(design.signature), grid=_grid(design))


def _grid(design: CellDesign) -> tuple[float, int]:
    return design.signature.length_m, design.signature.points


def step(
    design: CellDesign,
    state: CellState,
    capture: Capture,
    positioning: PositioningState,
    announcement: Announcement | None = None,
    faults: tuple[str, ...] = (),
) -> Stepped:
    """Take one cycle through the whole pipeline; `faults` is what the fieldbus found wrong with it."""
    capture = completed(design, capture)
    state, batch_id, expected = _batch(state, capture, announcement)
    friction = _doubted(estimate(capture, design.model), faults)
    period_s = _period_s(state, capture)
    tracked = track(
        design.tracker,
        state.tracker,
        Reading.of(capture.cycle, capture.time_ns, friction, batch_id, expected=expected),
    )
    signed = _sign(design, state, capture, tracked, period_s)
    gapped = gap.follow(state.gap, friction.gap, capture.cycle, design.false_alarm_cycles, period_s)
    findings = _findings(design, state, capture, tracked, signed, gapped, period_s)
    alarm_state, moved = alarms.after_cycle(
        design.alarms, state.alarms, findings, capture.cycle, capture.time_ns, announced=tracked.expected
    )
    after = replace(
        state,
        tracker=tracked.state,
        signature=signed.state,
        gap=gapped.state,
        alarms=alarm_state,
        cycle=capture.cycle,
        time_ns=capture.time_ns,
        period_s=period_s,
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
    return Stepped(after, snapshot, tuple(t.alarm for t in moved), _notes(friction, tracked))


def completed(design: CellDesign, capture: Capture) -> Capture:
    """Fill in what the module does not report: mass, stroke and the noise of its sensors."""
    mass_kg, stroke_m = capture.mass_kg, capture.stroke_m
    if math.isnan(mass_kg) and design.mass_kg is not None:
        mass_kg = design.mass_kg
    if math.isinf(stroke_m) and design.stroke_m is not None:
        stroke_m = design.stroke_m
    return replace(
        capture,
        mass_kg=mass_kg,
        stroke_m=stroke_m,
        force=_with_noise(capture.force, design.force_noise_std_n),
        position=_with_noise(capture.position, design.position_noise_std_m),
    )


def find(
    design: CellDesign, state: CellState, finding: Finding, time_ns: int
) -> tuple[CellState, tuple[Alarm, ...]]:
    """Take what a rule beside the cycles says, as of the link or the journal; the alarms that moved."""
    found, done = alarms.find(design.alarms, state.alarms, finding, state.cycle, time_ns)
    return replace(state, alarms=found), (done.alarm,) if done.effects else ()


def pass_time(state: CellState, time_ns: int) -> tuple[CellState, tuple[Alarm, ...]]:
    """End every shelving whose time is over, also while no cycles come."""
    passed, moved = alarms.at_time(state.alarms, state.cycle, time_ns)
    return replace(state, alarms=passed), tuple(transition.alarm for transition in moved)


def act(state: CellState, name: AlarmName, occurrence: Occurrence) -> tuple[CellState, Transition]:
    """Apply a person's action on a condition; a refused one leaves the state as it was."""
    acted, done = alarms.act(state.alarms, name, replace(occurrence, cycle=state.cycle))
    return replace(state, alarms=acted), done


def start_batch(state: CellState, batch_id: str, *, expected: bool) -> CellState:
    """Name the batch from the next cycle on; an expected change raises no alarm and re-baselines."""
    return replace(state, named_batch=NamedBatch(batch_id, state.module_batch, expected))


def renew_surface(state: CellState) -> CellState:
    """Learn the wear level anew from the next cycle on, after worn parts were replaced."""
    return replace(state, tracker=reset_wear(state.tracker))


def _sign(
    design: CellDesign, state: CellState, capture: Capture, tracked: Tracked, period_s: float
) -> SignatureTracked:
    """Friction along the stroke, with the viscous part that the model knows taken out."""
    plant = design.model.plant
    viscous = plant.effects.get("viscous_friction", {}).get("viscous_coefficient_n_s_per_m", 0.0)
    slope = viscous / capture.mass_kg if isinstance(viscous, float) and capture.mass_kg > 0.0 else 0.0
    return signature.update(
        design.signature,
        state.signature,
        capture,
        batch_id=tracked.batch.batch_id,
        restart=tracked.shift is not None,
        viscous_per_mass=slope,
        gravity_m_s2=plant.gravity_m_s2,
        period_s=period_s,
    )


def _doubted(friction: FrictionEstimate, faults: tuple[str, ...]) -> FrictionEstimate:
    """Make an estimate from a capture with faults uncertain at best, and say why."""
    if not faults or friction.mu_s.quality is not Quality.GOOD:
        return friction
    reason = "; ".join(faults)
    mu_s = replace(friction.mu_s, quality=Quality.UNCERTAIN, reason=reason)
    mu_k = replace(friction.mu_k, quality=max(friction.mu_k.quality, Quality.UNCERTAIN), reason=reason)
    return replace(friction, mu_s=mu_s, mu_k=mu_k)


def _with_noise(channel: Channel | None, noise_std: float) -> Channel | None:
    return (
        channel if channel is None or channel.noise_std is not None else replace(channel, noise_std=noise_std)
    )


def _batch(
    state: CellState, capture: Capture, announcement: Announcement | None
) -> tuple[CellState, str | None, bool]:
    """Which batch this cycle belongs to, and whether its change was expected."""
    named, batch_id, expected = state.named_batch, capture.batch_id, False
    if named is not None and named.module_said == capture.batch_id:
        batch_id, expected = named.batch_id, named.expected
        named = replace(named, expected=False)
    else:
        named = None
    seen = state.announcement_seen
    if (
        announcement is not None
        and announcement.sequence != seen
        and capture.cycle >= announcement.from_cycle
    ):
        expected, seen = True, announcement.sequence
    after = replace(state, named_batch=named, module_batch=capture.batch_id, announcement_seen=seen)
    return after, batch_id, expected


def _period_s(state: CellState, capture: Capture) -> float:
    """Mean time between cycles, 0 before it is known; pauses of a shift change count little."""
    cycles, elapsed_s = capture.cycle - state.cycle, (capture.time_ns - state.time_ns) * 1e-9
    if not state.time_ns or cycles <= 0 or elapsed_s <= 0.0:
        return state.period_s
    now_s = elapsed_s / cycles
    if not state.period_s:
        return now_s
    return state.period_s + PERIOD_GAIN * (min(now_s, 10.0 * state.period_s) - state.period_s)


def _findings(
    design: CellDesign,
    state: CellState,
    capture: Capture,
    tracked: Tracked,
    signed: SignatureTracked,
    gapped: gap.GapTracked,
    period_s: float,
) -> list[Finding]:
    wear_active = state.alarms.alarm(AlarmName.WEAR_LIMIT).active
    found = [
        alarms.wear_limit(design.alarms, tracked.wear, capture.cycle, active=wear_active),
        alarms.batch_shift(tracked.shift),
        alarms.deviant_cycle(signed.deviation, signed.signature.deviates_at_m, judged=signed.judged),
        Finding(AlarmName.MODEL_GAP, gapped.exceeds, _gap_message(gapped), gapped.evidence),
    ]
    return [replace(one, evidence=_rated(design, one.evidence, period_s)) for one in found]


def _rated(design: CellDesign, evidence: Evidence, period_s: float) -> Evidence:
    """Add how rarely the rule was designed to be wrong, in cycles and in days at the present rate."""
    cycles = design.false_alarm_cycles
    return replace(
        evidence,
        false_alarm_cycles=cycles,
        false_alarm_days=cycles * period_s / 86_400 if period_s else math.nan,
    )


def _gap_message(gapped: gap.GapTracked) -> str:
    evidence = gapped.evidence
    return f"residual {evidence.size:+.2f} above its usual level since cycle {evidence.change_cycle}"


def _gap_quality(friction: FrictionEstimate, gapped: gap.GapTracked) -> Quality:
    if math.isnan(friction.gap):
        return Quality.BAD
    return Quality.UNCERTAIN if gapped.exceeds is None else Quality.GOOD


def _notes(friction: FrictionEstimate, tracked: Tracked) -> tuple[str, ...]:
    reason = friction.mu_s.reason if friction.mu_s.quality is not Quality.GOOD else ""
    return tuple(dict.fromkeys(note for note in (reason, *tracked.notes) if note))
