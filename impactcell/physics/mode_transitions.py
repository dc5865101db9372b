"""From one smooth phase to the next: how a tap begins, and what an event changes."""

import math

import numpy as np

from impactcell.numerics.jit import FloatPointer, compiled
from impactcell.physics import memory_layout as at
from impactcell.physics.events import hold_or_slip, next_kink
from impactcell.physics.forces import (
    actuator_speed,
    body_force,
    contact_force,
    evaluate_law,
    sensor_reading,
)
from impactcell.physics.memory_layout import DrivingForce, SmoothPhase, StepBuffers, TapRecord

RIGID_N_PER_M = 1e12
"""Stick this stiff gives way by less than a nanometre, and would ring too fast to follow."""
FIRST_STEP = 0.2
"""First step to try, in units of the contact's sqrt(m/k): short enough to be accepted."""


@compiled
def single_law_value(kind: int, missing: float, phase: SmoothPhase) -> float:
    """Value of the only law of a kind that is a plain number, `missing` where there is none."""
    if phase.laws[kind + 1] == phase.laws[kind]:
        return missing
    return evaluate_law(phase.laws[kind], 0.0, 0.0, 0.0, 0.0, phase)


@compiled
def reset(phase: SmoothPhase, outputs: FloatPointer) -> None:
    """Forget the tap before."""
    states = at.FIRST_EXTRA_STATE + (phase.laws[at.LOSS + 1] - phase.laws[at.LOSS]) // 2
    for i in range(at.MODE_COUNT):
        phase.contact_mode[i] = 0
    phase.contact_mode[at.STATE_COUNT] = states
    for i in range(at.OUTPUT_COUNT):
        outputs[i] = np.nan
    outputs[at.PEAK_FORCE] = -np.inf
    outputs[at.EVENT_COUNT] = 0.0
    outputs[at.STATUS] = at.STILL_MOVING


@compiled
def cache_constants(t: float, phase: SmoothPhase) -> None:
    """Read the laws that are plain numbers, once for the whole tap."""
    stick = single_law_value(at.STICK, np.inf, phase)
    phase.cache[at.STICK_STIFFNESS] = stick if stick < RIGID_N_PER_M else 0.0
    phase.cache[at.ADHESION_REACH] = single_law_value(at.REACH, 0.0, phase)
    phase.cache[at.LAG_S] = single_law_value(at.LAG, 0.0, phase)
    phase.cache[at.POSITION_LAG_S] = single_law_value(at.POSITION_LAG, 0.0, phase)
    phase.cache[at.DELAY_S] = single_law_value(at.DELAY, 0.0, phase)
    phase.cache[at.NEXT_KINK_S] = next_kink(t, phase)
    phase.cache[at.RESTING_FROM_S] = np.inf
    phase.cache[at.NATURAL_STEP_S] = FIRST_STEP * math.sqrt(
        phase.parameters[at.MASS] / phase.parameters[at.STIFFNESS]
    )


@compiled
def begin_first_phase(t: float, state: FloatPointer, phase: SmoothPhase) -> None:
    """Set up the first phase: first contact at t = 0, or a part that already slides."""
    if math.isnan(phase.parameters[at.INITIAL_SPEED]):
        phase.contact_mode[at.ZONE] = at.TOUCHING
        phase.contact_mode[at.DAMPER] = 1
        phase.contact_mode[at.RUNNING] = 1
    else:
        phase.contact_mode[at.ZONE] = at.ABSENT
        state[at.PART_SPEED] = phase.parameters[at.INITIAL_SPEED]
        if state[at.PART_SPEED] != 0.0:
            phase.contact_mode[at.SLIP] = 1 if state[at.PART_SPEED] > 0.0 else -1
    if phase.contact_mode[at.SLIP] == 0:
        if phase.cache[at.STICK_STIFFNESS] > 0.0:
            phase.contact_mode[at.SLIP] = at.ELASTIC
        else:
            hold_or_slip(t, state, phase)


@compiled
def invert_reading(shown: float, phase: SmoothPhase) -> float:
    """Find the force at which the sensor shows `shown` [N]; where it is saturated, `shown` itself."""
    force = shown
    for _ in range(20):
        miss = sensor_reading(force, phase) - shown
        delta = 1e-3 * (1.0 + abs(force))
        slope = (sensor_reading(force + delta, phase) - sensor_reading(force - delta, phase)) / (2.0 * delta)
        if abs(slope) < 1e-3 or abs(miss) < 1e-13 * (1.0 + abs(shown)):
            break
        force -= miss / slope
    return force


@compiled
def enter_drive_interval(
    i: int,
    drive: DrivingForce,
    phase: SmoothPhase,
) -> None:
    """Take up the driving force between its measured samples i and i + 1.

    The force is the measured one with the sensor's laws undone: it came out of them.
    """
    phase.contact_mode[at.DRIVE_INTERVAL] = i
    first = invert_reading(drive.values[drive.samples + i], phase)
    second = invert_reading(drive.values[drive.samples + i + 1], phase)
    slope = (second - first) / (drive.values[i + 1] - drive.values[i])
    phase.cache[at.DRIVE_TIME] = drive.values[i] - phase.cache[at.DELAY_S]
    phase.cache[at.DRIVE] = first + phase.cache[at.LAG_S] * slope
    phase.cache[at.DRIVE_SLOPE] = slope


@compiled
def enter_first_drive_interval(
    t: float,
    drive: DrivingForce,
    phase: SmoothPhase,
) -> None:
    """Take up the driving force where it acts at time t, its delay undone."""
    first = 0
    while first + 2 < drive.samples and drive.values[first + 1] - phase.cache[at.DELAY_S] <= t:
        first += 1
    enter_drive_interval(first, drive, phase)


@compiled
def record_event(kind: int, t: float, record: TapRecord) -> None:
    """Record an event, where there is room for it, and count it."""
    i = int(record.outputs[at.EVENT_COUNT])
    if i < record.sample_index[at.EVENT_ROOM]:
        record.event_kinds[i] = kind
        record.event_times[i] = t
    record.outputs[at.EVENT_COUNT] = i + 1


@compiled
def record_breakaway(t: float, record: TapRecord) -> None:
    """Record that the part moves; its first time is kept among the outputs."""
    if math.isnan(record.outputs[at.BREAKAWAY_TIME]):
        record.outputs[at.BREAKAWAY_TIME] = t
    record_event(at.WAS_BREAKAWAY, t, record)


@compiled
def record_halt(t: float, record: TapRecord) -> None:
    """Record that the actuator has halted."""
    record.outputs[at.HALT_TIME] = t
    record_event(at.WAS_HALT, t, record)


@compiled
def update_damper(t: float, state: FloatPointer, phase: SmoothPhase) -> None:
    """Decide anew whether the contact is being compressed, after a jump of either speed."""
    if phase.contact_mode[at.ZONE] == at.TOUCHING:
        phase.contact_mode[at.DAMPER] = 1 if actuator_speed(t, state, phase) > state[at.PART_SPEED] else 0


@compiled
def begin_slip(t: float, state: FloatPointer, phase: SmoothPhase) -> None:
    """Let a part slip to where it is pulled, once stick no longer holds it."""
    if phase.contact_mode[at.SLIP] == at.ELASTIC:
        phase.contact_mode[at.SLIP] = 1 if state[at.ADVANCE] > phase.cache[at.ANCHOR] else -1
        return
    speed = actuator_speed(t, state, phase)
    pull = contact_force(state, speed, phase)
    pull += body_force(t, state, phase)
    phase.contact_mode[at.SLIP] = 1 if pull > 0.0 else -1


@compiled
def cross_gap(t: float, state: FloatPointer, phase: SmoothPhase, record: TapRecord) -> None:
    """Lose contact or make it."""
    state[at.ADVANCE] = state[at.TRAVEL]
    if phase.contact_mode[at.ZONE] != at.TOUCHING:
        phase.contact_mode[at.ZONE] = at.TOUCHING
        update_damper(t, state, phase)
        record_event(at.WAS_CONTACT, t, record)
        return
    phase.contact_mode[at.ZONE] = at.NEAR if phase.cache[at.ADHESION_REACH] > 0.0 else at.FAR
    phase.contact_mode[at.CLIPPED] = 0
    record.outputs[at.SEPARATION_TIME] = t
    record.outputs[at.DISTANCE] = state[at.ADVANCE]
    record_event(at.WAS_SEPARATION, t, record)
    if phase.parameters[at.HALTS_AT_SEPARATION] != 0.0 and phase.contact_mode[at.RUNNING] == 1:
        phase.contact_mode[at.RUNNING] = 0
        record_halt(t, record)


@compiled
def apply_event(event: int, t: float, phase: SmoothPhase, step: StepBuffers, record: TapRecord) -> None:
    """Change from the phase that ends in `event` to the next one."""
    state, mode = step.state, phase.contact_mode
    if event == at.STOP:
        state[at.PART_SPEED] = 0.0
        phase.cache[at.ANCHOR] = state[at.ADVANCE]
        mode[at.SLIP] = at.ELASTIC if phase.cache[at.STICK_STIFFNESS] > 0.0 else 0
        record.outputs[at.STOP_TIME] = t
        record_event(at.WAS_STOP, t, record)
    elif event == at.BREAKAWAY:
        begin_slip(t, state, phase)
        record_breakaway(t, record)
    elif event == at.GAP:
        cross_gap(t, state, phase, record)
    elif event == at.RATE:
        mode[at.DAMPER] = 1 - mode[at.DAMPER]
    elif event == at.CLIP:
        mode[at.CLIPPED] = 1 - mode[at.CLIPPED]
    elif event == at.WITHIN_REACH:
        mode[at.ZONE] = at.FAR if mode[at.ZONE] == at.NEAR else at.NEAR
    elif event == at.STROKE_END:
        state[at.TRAVEL] = phase.parameters[at.STROKE]
        mode[at.RUNNING] = 0
        record_halt(t, record)
        update_damper(t, state, phase)
    if mode[at.SLIP] == 0 and hold_or_slip(t, state, phase):
        record_breakaway(t, record)
