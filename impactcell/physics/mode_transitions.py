"""From one smooth phase to the next: how a tap begins, and what an event changes."""

import math

import numpy as np

from impactcell.numerics.jit import FloatPointer, IntPointer, compiled, invoke
from impactcell.physics import memory_layout as at
from impactcell.physics.events import hold_or_slip, next_kink
from impactcell.physics.forces import actuator_speed, body_force, contact_force, reading

# Stick this stiff gives way by less than a nanometre, and would ring too fast to follow.
RIGID_N_PER_M = 1e12


@compiled
def first_law(kind: int, missing: float, row: FloatPointer, program: IntPointer) -> float:
    """Value of the only law of a kind that is a plain number, `missing` where there is none."""
    if program[kind + 1] == program[kind]:
        return missing
    i = program[kind]
    return invoke(program[i], 0.0, 0.0, 0.0, 0.0, row, program[i + 1])


@compiled
def clear(states: int, mode: IntPointer, figures: FloatPointer) -> None:
    """Forget the tap before."""
    for i in range(at.MODES):
        mode[i] = 0
    mode[at.STATES] = states
    for i in range(at.FIGURES):
        figures[i] = np.nan
    figures[at.PEAK_FORCE] = -np.inf
    figures[at.EVENT_COUNT] = 0.0
    figures[at.STATUS] = at.STILL_MOVING


@compiled
def prepare(t: float, memo: FloatPointer, row: FloatPointer, program: IntPointer) -> None:
    """Read the laws that are plain numbers, once for the whole tap."""
    stick = first_law(at.STICK, np.inf, row, program)
    memo[at.STICK_STIFFNESS] = stick if stick < RIGID_N_PER_M else 0.0
    memo[at.ADHESION_REACH] = first_law(at.REACH, 0.0, row, program)
    memo[at.LAG_S] = first_law(at.LAG, 0.0, row, program)
    memo[at.DELAY_S] = first_law(at.DELAY, 0.0, row, program)
    memo[at.NEXT_KINK_S] = next_kink(t, row, program)
    memo[at.RESTING_FROM_S] = np.inf
    memo[at.NATURAL_STEP_S] = 0.2 * math.sqrt(row[at.MASS] / row[at.STIFFNESS])


@compiled
def begin(
    t: float, z: FloatPointer, mode: IntPointer, memo: FloatPointer, row: FloatPointer, program: IntPointer
) -> None:
    """Set up the first phase: first contact at t = 0, or a part that already slides."""
    if math.isnan(row[at.INITIAL_SPEED]):
        mode[at.ZONE] = at.TOUCHING
        mode[at.DAMPER] = 1
        mode[at.RUNNING] = 1
    else:
        mode[at.ZONE] = at.ABSENT
        z[at.SPEED_OF_PART] = row[at.INITIAL_SPEED]
        if z[at.SPEED_OF_PART] != 0.0:
            mode[at.SLIP] = 1 if z[at.SPEED_OF_PART] > 0.0 else -1
    if mode[at.SLIP] == 0:
        if memo[at.STICK_STIFFNESS] > 0.0:
            mode[at.SLIP] = at.ELASTIC
        else:
            hold_or_slip(t, z, mode, memo, row, program)


@compiled
def unread(shown: float, row: FloatPointer, program: IntPointer) -> float:
    """Find the force at which the sensor shows `shown` [N]; where it is saturated, `shown` itself."""
    force = shown
    for _ in range(20):
        miss = reading(force, row, program) - shown
        delta = 1e-3 * (1.0 + abs(force))
        slope = (reading(force + delta, row, program) - reading(force - delta, row, program)) / (2.0 * delta)
        if abs(slope) < 1e-3 or abs(miss) < 1e-13 * (1.0 + abs(shown)):
            break
        force -= miss / slope
    return force


@compiled
def enter_interval(
    i: int,
    drive: FloatPointer,
    drives: int,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
) -> None:
    """Take up the driving force between its measured samples i and i + 1.

    The force is the measured one with the sensor's laws undone: it came out of them.
    """
    mode[at.INTERVAL] = i
    first = unread(drive[drives + i], row, program)
    second = unread(drive[drives + i + 1], row, program)
    slope = (second - first) / (drive[i + 1] - drive[i])
    memo[at.DRIVE_TIME] = drive[i] - memo[at.DELAY_S]
    memo[at.DRIVE] = first + memo[at.LAG_S] * slope
    memo[at.DRIVE_SLOPE] = slope


@compiled
def enter_first_interval(
    t: float,
    drive: FloatPointer,
    drives: int,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
) -> None:
    """Take up the driving force where it acts at time t, its delay undone."""
    first = 0
    while first + 2 < drives and drive[first + 1] - memo[at.DELAY_S] <= t:
        first += 1
    enter_interval(first, drive, drives, mode, memo, row, program)


@compiled
def note(
    kind: int, t: float, figures: FloatPointer, cursor: IntPointer, kinds: IntPointer, times: FloatPointer
) -> None:
    """Record an event."""
    i = int(figures[at.EVENT_COUNT])
    if i < cursor[at.ROOM]:
        kinds[i] = kind
        times[i] = t
    figures[at.EVENT_COUNT] = i + 1


@compiled
def note_breakaway(
    t: float, figures: FloatPointer, cursor: IntPointer, kinds: IntPointer, times: FloatPointer
) -> None:
    """Record that the part moves; its first time is kept among the figures."""
    if math.isnan(figures[at.BREAKAWAY_TIME]):
        figures[at.BREAKAWAY_TIME] = t
    note(at.WAS_BREAKAWAY, t, figures, cursor, kinds, times)


@compiled
def touch(t: float, z: FloatPointer, mode: IntPointer, row: FloatPointer, program: IntPointer) -> None:
    """Decide anew whether the contact is being compressed, after a jump of either speed."""
    if mode[at.ZONE] == at.TOUCHING:
        mode[at.DAMPER] = 1 if actuator_speed(t, z, mode, row, program) > z[at.SPEED_OF_PART] else 0


@compiled
def pass_event(
    event: int,
    t: float,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    figures: FloatPointer,
    cursor: IntPointer,
    kinds: IntPointer,
    times: FloatPointer,
) -> None:
    """Change from the phase that ends in `event` to the next one."""
    if event == at.STOP:
        z[at.SPEED_OF_PART] = 0.0
        memo[at.ANCHOR] = z[at.U]
        mode[at.SLIP] = at.ELASTIC if memo[at.STICK_STIFFNESS] > 0.0 else 0
        figures[at.STOP_TIME] = t
        note(at.WAS_STOP, t, figures, cursor, kinds, times)
    elif event == at.BREAKAWAY:
        if mode[at.SLIP] == at.ELASTIC:
            mode[at.SLIP] = 1 if z[at.U] > memo[at.ANCHOR] else -1
        else:
            speed = actuator_speed(t, z, mode, row, program)
            pull = contact_force(z, speed, mode, row, program)
            pull += body_force(t, z, memo, row, program)
            mode[at.SLIP] = 1 if pull > 0.0 else -1
        note_breakaway(t, figures, cursor, kinds, times)
    elif event == at.GAP:
        z[at.U] = z[at.TRAVEL]
        if mode[at.ZONE] == at.TOUCHING:
            mode[at.ZONE] = at.NEAR if memo[at.ADHESION_REACH] > 0.0 else at.FAR
            mode[at.CLIPPED] = 0
            figures[at.SEPARATION_TIME] = t
            figures[at.DISTANCE] = z[at.U]
            note(at.WAS_SEPARATION, t, figures, cursor, kinds, times)
            if row[at.HALTS_AT_SEPARATION] != 0.0 and mode[at.RUNNING] == 1:
                mode[at.RUNNING] = 0
                figures[at.HALT_TIME] = t
                note(at.WAS_HALT, t, figures, cursor, kinds, times)
        else:
            mode[at.ZONE] = at.TOUCHING
            touch(t, z, mode, row, program)
            note(at.WAS_CONTACT, t, figures, cursor, kinds, times)
    elif event == at.RATE:
        mode[at.DAMPER] = 1 - mode[at.DAMPER]
    elif event == at.CLIP:
        mode[at.CLIPPED] = 1 - mode[at.CLIPPED]
    elif event == at.WITHIN_REACH:
        mode[at.ZONE] = at.FAR if mode[at.ZONE] == at.NEAR else at.NEAR
    elif event == at.STROKE_END:
        z[at.TRAVEL] = row[at.STROKE]
        mode[at.RUNNING] = 0
        figures[at.HALT_TIME] = t
        note(at.WAS_HALT, t, figures, cursor, kinds, times)
        touch(t, z, mode, row, program)
    if mode[at.SLIP] == 0 and hold_or_slip(t, z, mode, memo, row, program):
        note_breakaway(t, figures, cursor, kinds, times)
