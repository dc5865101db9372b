"""Where smooth phases end, and what comes after.

Each kind of event has a margin: positive within the phase, crossing zero at its end. A crossing is looked
for on the interpolant and then located with full steps, so that it is as exact as the integration itself.
"""

import numpy as np

from impactcell.numerics.jit import FloatPointer, IntPointer, compiled, invoke
from impactcell.physics import memory_layout as at
from impactcell.physics.forces import (
    actuator_speed,
    body_force,
    breakaway_force,
    compression,
    contact_force,
)
from impactcell.physics.runge_kutta import evaluate

# A margin that stays within rounding of zero, as in a steady push, is not a crossing.
TOLERANCE = np.array([1e-14, 1e-12, 1e-16, 1e-13, 1e-12, 1e-16, 0.0])
CHECKS = 5


@compiled
def applies(event: int, mode: IntPointer, memo: FloatPointer, program: IntPointer) -> bool:
    """Whether the present phase can end in this kind of event."""
    zone = mode[at.ZONE]
    slip = mode[at.SLIP]
    if event == at.STOP:
        return slip == 1 or slip == -1  # compiled
    if event == at.BREAKAWAY:
        return slip == 0 or slip == at.ELASTIC
    if event == at.GAP:
        return zone != at.ABSENT
    if event == at.RATE:
        return zone == at.TOUCHING
    if event == at.CLIP:
        return zone == at.TOUCHING and program[at.CONTACT + 1] > program[at.CONTACT]
    if event == at.WITHIN_REACH:
        return memo[at.ADHESION_REACH] > 0.0 and (zone == at.NEAR or zone == at.FAR)
    return mode[at.RUNNING] == 1


@compiled
def margin(
    event: int,
    t: float,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
) -> float:
    """Distance from the end of the phase by this kind of event, positive before it."""
    if event == at.STOP:
        return mode[at.SLIP] * z[at.SPEED_OF_PART]
    if event == at.GAP:
        return z[at.TRAVEL] - z[at.U] if mode[at.ZONE] == at.TOUCHING else z[at.U] - z[at.TRAVEL]
    if event == at.WITHIN_REACH:
        beyond = z[at.U] - z[at.TRAVEL] - memo[at.ADHESION_REACH]
        return beyond if mode[at.ZONE] == at.FAR else -beyond
    if event == at.STROKE_END:
        return row[at.STROKE] - z[at.TRAVEL]
    speed = actuator_speed(t, z, mode, row, program)
    if event == at.RATE:
        rate = speed - z[at.SPEED_OF_PART]
        return rate if mode[at.DAMPER] == 1 else -rate
    if event == at.CLIP:
        force = compression(z, speed, mode, row, program)
        return -force if mode[at.CLIPPED] == 1 else force
    if mode[at.SLIP] == at.ELASTIC:
        held = memo[at.STICK_STIFFNESS] * (z[at.U] - memo[at.ANCHOR])
    else:
        held = contact_force(z, speed, mode, row, program) + body_force(t, z, memo, row, program)
    return breakaway_force(z[at.U], row, program) - abs(held)


@compiled
def state_at(theta: float, n: int, dense: FloatPointer, z: FloatPointer) -> None:
    """Write the state at the fraction `theta` of the step into z."""
    for i in range(n):
        z[i] = evaluate(theta, dense, i)


@compiled
def crossing(
    event: int,
    low: float,
    high: float,
    t: float,
    h: float,
    dense: FloatPointer,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
) -> float:
    """Fraction of the step, in (low, high], at which the margin of `event` crosses zero.

    False position in the Illinois form on the interpolant; `z` is scratch.
    """
    state_at(high, mode[at.STATES], dense, z)
    g_high = margin(event, t + high * h, z, mode, memo, row, program)
    state_at(low, mode[at.STATES], dense, z)
    g_low = margin(event, t + low * h, z, mode, memo, row, program)
    if g_low <= 0.0:
        # The margin started at zero and never became positive: the phase ends where it began.
        if low > 0.0:
            return low
        for _ in range(60):
            middle = 0.5 * high
            state_at(middle, mode[at.STATES], dense, z)
            g_low = margin(event, t + middle * h, z, mode, memo, row, program)
            if g_low > 0.0:
                low = middle
                break
            high = middle
            g_high = g_low
        if g_low <= 0.0:
            return 0.0
    for _ in range(60):
        middle = (low * g_high - high * g_low) / (g_high - g_low)
        if not (low < middle < high) or high - low < 1e-15:
            break
        state_at(middle, mode[at.STATES], dense, z)
        g = margin(event, t + middle * h, z, mode, memo, row, program)
        if g < 0.0:
            if abs(g - g_high) < 0.3 * abs(g_high):
                g_low *= 0.5
            high, g_high = middle, g
        elif g > 0.0:
            if abs(g - g_low) < 0.3 * abs(g_low):
                g_high *= 0.5
            low, g_low = middle, g
        else:
            return middle
    return high


@compiled
def first_event(
    t: float,
    h: float,
    dense: FloatPointer,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    found: FloatPointer,
) -> bool:
    """Find the first event within the step; `found` gets its kind and its fraction of the step."""
    high = 1.0
    hit = False
    # The second pass looks more closely at the first interval in which anything crossed.
    low = 0.0
    for _ in range(2):
        width = (high - low) / CHECKS
        begin = low
        hit = False
        for i in range(CHECKS):
            theta = begin + width * (i + 1)
            state_at(theta, mode[at.STATES], dense, z)
            for event in range(at.EVENTS):
                if not applies(event, mode, memo, program):
                    continue
                if margin(event, t + theta * h, z, mode, memo, row, program) < -TOLERANCE[event]:
                    hit = True
            if hit:
                high = theta
                low = theta - width
                break
        if not hit:
            return False
    found[0] = -1.0
    found[1] = 2.0
    for event in range(at.EVENTS):
        if applies(event, mode, memo, program):
            state_at(high, mode[at.STATES], dense, z)
            if margin(event, t + high * h, z, mode, memo, row, program) < -TOLERANCE[event]:
                theta = crossing(event, low, high, t, h, dense, z, mode, memo, row, program)
                if theta < found[1]:
                    found[0] = event
                    found[1] = theta
    return True


@compiled
def hold_or_slip(
    t: float, z: FloatPointer, mode: IntPointer, memo: FloatPointer, row: FloatPointer, program: IntPointer
) -> bool:
    """Let a part at rest slip if what pulls at it exceeds what stick can hold; True if it does."""
    speed = actuator_speed(t, z, mode, row, program)
    pull = contact_force(z, speed, mode, row, program) + body_force(t, z, memo, row, program)
    limit = breakaway_force(z[at.U], row, program)
    if abs(pull) > limit:
        mode[at.SLIP] = 1 if pull > 0.0 else -1
        return True
    return False


@compiled
def next_kink(t: float, row: FloatPointer, program: IntPointer) -> float:
    """Next time after t at which a law of the actuator's run-up changes its formula [s]."""
    kink = np.inf
    for i in range(program[at.UNTIL], program[at.UNTIL + 1], 2):
        when = invoke(program[i], 0.0, 0.0, 0.0, 0.0, row, program[i + 1])
        if t < when < kink:
            kink = when
    return kink
