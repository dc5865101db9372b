"""The motion of one tap: smooth phases, each taken in large steps, joined at located events."""

import math
from typing import Final

import numpy as np

from impactcell.numerics.jit import FloatPointer, IntArray, advance, compiled, float_pointer, int_pointer
from impactcell.physics import memory_layout as at
from impactcell.physics.boundary_samples import (
    fill_after_end,
    fill_before_contact,
    fill_unknown,
    finish_outputs,
    is_at_rest,
    last_sample_time,
)
from impactcell.physics.events import event_margin, first_event, margin_within, next_kink
from impactcell.physics.forces import actuator_speed
from impactcell.physics.memory_layout import DrivingForce, SmoothPhase, StepBuffers, TapRecord
from impactcell.physics.mode_transitions import (
    apply_event,
    begin_first_phase,
    cache_constants,
    enter_drive_interval,
    enter_first_drive_interval,
    record_breakaway,
    reset,
    update_damper,
)
from impactcell.physics.runge_kutta import (
    EXTENDED,
    INTERPOLANT,
    STAGES,
    build_interpolant,
    evaluate_stages,
    step_error,
)
from impactcell.physics.sampling import accept_step
from impactcell.records import Samples

MAX_EVENTS = 20_000  # of a tap; one that has more is pushed on without end
EVENTS_PER_DRIVE_SAMPLE = 10  # allowed beyond that under a measured force
MAX_STEPS = 200_000  # of a tap, which needs some hundreds, or 30 000 to slide for ten minutes
STEPS_PER_DRIVE_SAMPLE = 100  # allowed beyond that under a measured force
MAX_STEP_S = 0.02  # beyond which events could be stepped over
SHORTEST_STEP_S = 1e-14  # accepted whatever its error: rounding of the time
SHORTEST_TRIAL_S = 1e-15  # below which laws that give no numbers are given up
SLIVER = 1e-3  # of a step; what would be left of the way to a limit is taken along
MIN_FACTOR, MAX_FACTOR = 0.2, 6.0  # of the length of a step, from one to the next (Hairer)
SAFETY, EXPONENT = 0.9, 0.125  # of that factor, SAFETY error**-EXPONENT: 1/8 for a method of order 8
LOCATING_STEPS = 4  # of Newton's method for an event; it converges in two
NEGLIGIBLE_ERROR = 1e-6  # of a step, below which it may be lengthened by the largest factor
STALLED = 1e-6  # of its commanded velocity, below which an actuator that was not halted stands
SAMPLE_MARGIN_S = 1e-9  # beyond the last sample, so that it lies inside a step

STEP_ROOM: Final = (3 + EXTENDED + INTERPOLANT) * at.STATE_WIDTH  # numbers of `StepBuffers`
WORKSPACE: Final = STEP_ROOM + at.CACHE_COUNT  # numbers of all buffers


@compiled
def try_step(t: float, h: float, fresh: bool, phase: SmoothPhase, step: StepBuffers) -> float:  # noqa: FBT001
    """Take a step and return its error; `fresh`: its first stage is not the last of the step before."""
    evaluate_stages(0 if fresh else 1, STAGES + 1, t, h, phase, step)
    for i in range(phase.contact_mode[at.STATE_COUNT]):
        step.next_state[i] = step.trial_state[i]
    return step_error(phase.contact_mode[at.STATE_COUNT], h, step)


@compiled
def step_to_event(
    event: int, fraction: float, t: float, h: float, phase: SmoothPhase, step: StepBuffers
) -> float:
    """Length of the step that ends exactly at the event; the buffers become that step's.

    Newton's method on full steps: the interpolant only gives the first guess, `fraction` of h, and the slope.
    """
    delta = 1e-3 * fraction
    above = margin_within(event, fraction + delta, t, h, phase, step)
    below = margin_within(event, fraction - delta, t, h, phase, step)
    slope = (above - below) / (2.0 * delta * h)
    length = fraction * h
    for attempt in range(LOCATING_STEPS):
        try_step(t, length, False, phase, step)  # noqa: FBT003
        change = -event_margin(event, t + length, step.next_state, phase) / slope
        last = attempt == LOCATING_STEPS - 1
        if last or not 1e-13 * h < abs(change) < 0.1 * h or length + change <= 0.0:
            break
        length += change
    build_interpolant(t, length, phase, step)
    return length


@compiled
def complete_step(t: float, h: float, phase: SmoothPhase, step: StepBuffers) -> tuple[int, float]:
    """Interpolate an accepted step and end it at its first event; the event, -1 if none, and the length."""
    build_interpolant(t, h, phase, step)
    event, fraction = first_event(t, h, phase, step)
    if event < 0:
        return event, h
    if fraction > 0.0:
        return event, step_to_event(event, fraction, t, h, phase, step)
    return event, 0.0


@compiled
def drive_limit(phase: SmoothPhase, drive: DrivingForce) -> float:
    """Time at which the present interval of the driving force ends [s]; inf without one."""
    if drive.samples < 2:
        return math.inf
    return drive.values[phase.contact_mode[at.DRIVE_INTERVAL] + 1] - phase.cache[at.DELAY_S]


@compiled
def begin_tap(phase: SmoothPhase, step: StepBuffers, record: TapRecord, drive: DrivingForce) -> float:
    """Set up the first phase and fill the samples before it; the time at which it begins [s]."""
    reset(phase, record.outputs)
    t = 0.0 if drive.samples < 2 else drive.values[0]
    cache_constants(t, phase)
    if drive.samples > 1:
        enter_first_drive_interval(t, drive, phase)
    begin_first_phase(t, step.state, phase)
    slip = phase.contact_mode[at.SLIP]
    if (slip == 1 or slip == -1) and step.state[at.PART_SPEED] == 0.0:  # compiled
        record_breakaway(t, record)
    fill_before_contact(t, step.state, phase, record)
    return t


@compiled
def cross_limit(t: float, phase: SmoothPhase, step: StepBuffers, drive: DrivingForce) -> tuple[bool, bool]:
    """Go on beyond a kink or into the next interval of the driving force: if it did, and if that is over."""
    crossed = False
    if t >= phase.cache[at.NEXT_KINK_S]:
        phase.cache[at.NEXT_KINK_S] = next_kink(t, phase)
        update_damper(t, step.state, phase)
        crossed = True
    if t >= drive_limit(phase, drive):
        following = phase.contact_mode[at.DRIVE_INTERVAL] + 1
        if following + 1 >= drive.samples:
            return crossed, True
        enter_drive_interval(following, drive, phase)
        crossed = True
    return crossed, False


@compiled
def end_time(phase: SmoothPhase, record: TapRecord, drive: DrivingForce, horizon: float, goal: int) -> float:
    """Time up to which to integrate [s]."""
    if goal == at.TO_REST:
        return horizon
    last = last_sample_time(phase, record) + SAMPLE_MARGIN_S
    return min(last, horizon) if drive.samples < 2 else last


@compiled
def is_refused(error: float, h: float) -> bool:
    """Whether a step is to be taken again, shorter."""
    return not math.isfinite(error) or (error > 1.0 and h > SHORTEST_STEP_S)


@compiled
def following_length(error: float, h: float) -> float:
    """Length of the step after one of length h and this error: its own repetition where it is refused [s]."""
    if not math.isfinite(error):
        return 0.1 * h
    if error < NEGLIGIBLE_ERROR:
        return h * MAX_FACTOR
    factor: float = min(MAX_FACTOR, SAFETY * error**-EXPONENT)
    return h * (max(MIN_FACTOR, factor) if is_refused(error, h) else factor)


@compiled
def gives_up(steps: int, error: float, h: float, drive: DrivingForce, outputs: FloatPointer) -> bool:
    """Whether a tap has no end or its laws give no numbers; its status says so."""
    if outputs[at.EVENT_COUNT] > MAX_EVENTS + EVENTS_PER_DRIVE_SAMPLE * drive.samples:
        outputs[at.STATUS] = at.TOO_MANY_EVENTS
        return True
    if steps > MAX_STEPS + STEPS_PER_DRIVE_SAMPLE * drive.samples:
        outputs[at.STATUS] = at.TOO_MANY_STEPS
        return True
    if not math.isfinite(error) and h < SHORTEST_TRIAL_S:
        outputs[at.STATUS] = at.NOT_FINITE
        return True
    return False


@compiled
def end_tap(t: float, horizon: float, phase: SmoothPhase, step: StepBuffers, record: TapRecord) -> None:
    """Fill what lies after the last step, and the outputs."""
    outputs, state = record.outputs, step.state
    if t >= horizon and phase.contact_mode[at.SLIP] == 0:
        # Between two slips of a part that is pushed on it is held, too, but not for good.
        stalled = abs(actuator_speed(t, state, phase)) <= STALLED * phase.parameters[at.VELOCITY]
        if phase.contact_mode[at.RUNNING] == 0 or stalled:
            outputs[at.STATUS] = at.AT_REST
    if outputs[at.STATUS] in (at.TOO_MANY_EVENTS, at.TOO_MANY_STEPS):
        fill_unknown(record)
    else:
        fill_after_end(t, state, phase, record)
    finish_outputs(t, state, phase, outputs)


@compiled
def integrate_tap(
    phase: SmoothPhase, step: StepBuffers, record: TapRecord, drive: DrivingForce, horizon: float, goal: int
) -> None:
    """Integrate one tap from its first contact on."""
    t = begin_tap(phase, step, record, drive)
    last = end_time(phase, record, drive, horizon, goal)
    outputs = record.outputs
    h = phase.cache[at.NATURAL_STEP_S]
    fresh, over = True, False
    steps = 0
    while t < last and not over:
        if phase.contact_mode[at.RUNNING] == 0 and drive.samples < 2 and is_at_rest(t, phase, step, record):
            break
        limit = min(last, phase.cache[at.NEXT_KINK_S], drive_limit(phase, drive))
        reaches_limit = limit - (t + h) < SLIVER * h
        length = limit - t if reaches_limit else h
        error = try_step(t, length, fresh, phase, step)
        fresh = False
        steps += 1
        if gives_up(steps, error, length, drive, outputs):
            break
        following = following_length(error, length)
        if is_refused(error, length):
            h = following
            continue
        event, length = complete_step(t, length, phase, step)
        reaches_limit = reaches_limit and event < 0
        if length > 0.0:
            accept_step(t, length, phase, step, record, goal)
        t = limit if reaches_limit else t + length
        if not reaches_limit or following > h:
            h = min(following, MAX_STEP_S)
        if event >= 0:
            apply_event(event, t, phase, step, record)
            fresh = True
        if reaches_limit:
            crossed, over = cross_limit(t, phase, step, drive)
            fresh = fresh or crossed
    outputs[at.STEP_COUNT] = steps
    end_tap(t, horizon, phase, step, record)


@compiled
def integrate_taps(
    taps: tuple[Samples, IntArray, Samples, IntArray],
    asked: tuple[IntArray, Samples, Samples, IntArray, Samples],
    outputs: Samples,
    horizon: float,
    goal: int,
) -> None:
    """Integrate n taps.

    Parameters
    ----------
    taps, asked : tuple
        What `TapArrays` and `SampleArrays` hold; numba takes over plain tuples in a third of the time.
    outputs : ndarray, shape (n, OUTPUT_COUNT)
        What came out.
    horizon : float
        Longest time to integrate [s].
    goal : int
        TO_REST, for the outputs, or TO_LAST_SAMPLE.
    """
    parameters, laws, drives, drive_ends = taps
    sample_index, times, samples, event_kinds, event_times = asked
    workspace = np.empty(WORKSPACE)
    mode = np.empty(at.MODE_COUNT, np.int64)
    work = float_pointer(workspace)
    step = StepBuffers(
        state=work,
        next_state=advance(work, at.STATE_WIDTH),
        trial_state=advance(work, 2 * at.STATE_WIDTH),
        stages=advance(work, 3 * at.STATE_WIDTH),
        interpolant=advance(work, (3 + EXTENDED) * at.STATE_WIDTH),
    )
    for i in range(parameters.shape[0]):
        workspace[:] = 0.0
        phase = SmoothPhase(
            parameters=float_pointer(parameters[i]),
            laws=int_pointer(laws),
            contact_mode=int_pointer(mode),
            cache=advance(work, STEP_ROOM),
        )
        record = TapRecord(
            outputs=float_pointer(outputs[i]),
            sample_index=int_pointer(sample_index[i]),
            sample_times=float_pointer(times),
            samples=float_pointer(samples),
            event_kinds=int_pointer(event_kinds),
            event_times=float_pointer(event_times),
        )
        drive = DrivingForce(float_pointer(drives[drive_ends[i] :]), (drive_ends[i + 1] - drive_ends[i]) // 2)
        integrate_tap(phase, step, record, drive, horizon, goal)
    # A last use keeps the workspace alive while bare pointers into it are in use.
    mode[0] = workspace.shape[0]
