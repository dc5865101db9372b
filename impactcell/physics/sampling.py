"""Numbers and figures gathered from one accepted step."""

import math

import numpy as np

from impactcell.numerics.jit import FloatPointer, IntPointer, compiled
from impactcell.physics import memory_layout as at
from impactcell.physics.events import state_at
from impactcell.physics.forces import actuator_speed, contact_force, reading
from impactcell.physics.runge_kutta import evaluate

# Chebyshev-Lobatto points of the unit step and the monomial coefficients of the polynomial through them
POWERS = 10
NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(POWERS) / (POWERS - 1))
MONOMIALS = np.linalg.inv(np.vander(NODES, increasing=True))


@compiled
def force_at(
    theta: float,
    t: float,
    h: float,
    dense: FloatPointer,
    z: FloatPointer,
    mode: IntPointer,
    row: FloatPointer,
    program: IntPointer,
) -> float:
    """Contact force at the fraction `theta` of the step [N]; `z` is scratch."""
    if mode[at.ZONE] < at.NEAR:
        return 0.0
    state_at(theta, mode[at.STATES], dense, z)
    return contact_force(z, actuator_speed(t + theta * h, z, mode, row, program), mode, row, program)


@compiled
def exponential_moments(theta: float, ratio: float, out: FloatPointer) -> None:
    """Response of a first-order lag, at rest before, to the powers of time since the step's start.

    out[j] = integral from 0 to theta of s^j exp(-(theta - s)/ratio)/ratio ds, by the recursion
    I_j = theta^j - j ratio I_(j-1), scaled by theta^j and run in the direction in which it is stable.
    """
    n = POWERS
    if theta <= 0.0:
        for j in range(n):
            out[j] = 0.0
        return
    relative = ratio / theta
    if relative <= 1.0:
        value = -math.expm1(-1.0 / relative)
        out[0] = value
        for j in range(1, n):
            value = 1.0 - j * relative * value
            out[j] = value
    else:
        value = 0.0
        for j in range(n + 14, 0, -1):
            value = (1.0 - value) / (j * relative)
            if j - 1 < n:
                out[j - 1] = value
    power = 1.0
    for j in range(n):
        out[j] *= power
        power *= theta


@compiled
def lagged(theta: float, before: float, ratio: float, powers: FloatPointer, moments: FloatPointer) -> float:
    """Lagged force at the fraction `theta` of a step over which the force is the polynomial `powers`."""
    exponential_moments(theta, ratio, moments)
    value = before * math.exp(-theta / ratio)
    for j in range(POWERS):
        value += powers[j] * moments[j]
    return value


@compiled
def force_polynomial(
    t: float,
    h: float,
    dense: FloatPointer,
    z: FloatPointer,
    mode: IntPointer,
    row: FloatPointer,
    program: IntPointer,
    powers: FloatPointer,
) -> None:
    """Monomial coefficients of the contact force over the step, in the fraction of the step."""
    n = POWERS
    for j in range(n):
        powers[j] = 0.0
    if mode[at.ZONE] < at.NEAR:
        return
    for i in range(n):
        force = force_at(NODES[i], t, h, dense, z, mode, row, program)
        for j in range(n):
            powers[j] += MONOMIALS[j, i] * force


@compiled
def sensed(
    theta: float,
    t: float,
    h: float,
    dense: FloatPointer,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    before: float,
    powers: FloatPointer,
    moments: FloatPointer,
) -> float:
    """Contact force after the sensor's lag, before its other laws [N]."""
    if memo[at.LAG_S] > 0.0:
        return lagged(theta, before, memo[at.LAG_S] / h, powers, moments)
    return force_at(theta, t, h, dense, z, mode, row, program)


@compiled
def find_peak(
    t: float,
    h: float,
    dense: FloatPointer,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    before: float,
    powers: FloatPointer,
    moments: FloatPointer,
    figures: FloatPointer,
) -> None:
    """Raise the peak force to the largest within this step."""
    if mode[at.ZONE] == at.ABSENT or (mode[at.ZONE] != at.TOUCHING and memo[at.LAG_S] == 0.0):
        return
    best = -np.inf
    best_at = 0.0
    for i in range(9):
        theta = 0.125 * i
        force = sensed(theta, t, h, dense, z, mode, memo, row, program, before, powers, moments)
        if force > best:
            best = force
            best_at = theta
    low = max(best_at - 0.125, 0.0)
    high = min(best_at + 0.125, 1.0)
    if best < figures[at.PEAK_FORCE] - 0.1 * abs(figures[at.PEAK_FORCE]):
        return
    if best_at == 0.0 or best_at == 1.0:  # compiled
        inside = abs(best_at - 1e-6)
        if sensed(inside, t, h, dense, z, mode, memo, row, program, before, powers, moments) < best:
            high = low
    # Golden section; near a maximum an error of 1e-6 in time is one of 1e-12 in force.
    golden = 0.3819660112501051
    a = low + golden * (high - low)
    b = high - golden * (high - low)
    fa = sensed(a, t, h, dense, z, mode, memo, row, program, before, powers, moments)
    fb = sensed(b, t, h, dense, z, mode, memo, row, program, before, powers, moments)
    for _ in range(24 if high > low else 0):
        if fa > fb:
            high, b, fb = b, a, fa
            a = low + golden * (high - low)
            fa = sensed(a, t, h, dense, z, mode, memo, row, program, before, powers, moments)
        else:
            low, a, fa = a, b, fb
            b = high - golden * (high - low)
            fb = sensed(b, t, h, dense, z, mode, memo, row, program, before, powers, moments)
    if fa > best:
        best, best_at = fa, a
    if fb > best:
        best, best_at = fb, b
    if best > figures[at.PEAK_FORCE]:
        figures[at.PEAK_FORCE] = best
        figures[at.PEAK_TIME] = t + best_at * h


@compiled
def take_samples(
    t: float,
    h: float,
    dense: FloatPointer,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    before: float,
    powers: FloatPointer,
    moments: FloatPointer,
    cursor: IntPointer,
    times: FloatPointer,
    out: FloatPointer,
) -> None:
    """Fill every channel's samples that fall into [t, t + h)."""
    end = t + h
    sign = row[at.DIRECTION]
    delay = memo[at.DELAY_S]
    i = cursor[at.FORCE]
    while i < cursor[at.CHANNELS + at.FORCE] and times[i] - delay < end:
        theta = (times[i] - delay - t) / h
        force = sensed(theta, t, h, dense, z, mode, memo, row, program, before, powers, moments)
        out[i] = reading(force, row, program)
        i += 1
    cursor[at.FORCE] = i
    i = cursor[at.POSITION]
    while i < cursor[at.CHANNELS + at.POSITION] and times[i] < end:
        out[i] = sign * evaluate((times[i] - t) / h, dense, at.U)
        i += 1
    cursor[at.POSITION] = i
    i = cursor[at.ACTUATOR]
    while i < cursor[at.CHANNELS + at.ACTUATOR] and times[i] < end:
        out[i] = sign * evaluate((times[i] - t) / h, dense, at.TRAVEL)
        i += 1
    cursor[at.ACTUATOR] = i
    i = cursor[at.PART_VELOCITY]
    while i < cursor[at.CHANNELS + at.PART_VELOCITY] and times[i] < end:
        out[i] = sign * evaluate((times[i] - t) / h, dense, at.SPEED_OF_PART)
        i += 1
    cursor[at.PART_VELOCITY] = i


@compiled
def record(
    t: float,
    h: float,
    dense: FloatPointer,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    powers: FloatPointer,
    moments: FloatPointer,
    cursor: IntPointer,
    times: FloatPointer,
    out: FloatPointer,
    figures: FloatPointer,
) -> None:
    """Take the peak force and the samples of an accepted step, and carry the sensor's lag over it."""
    before = memo[at.LAGGED_FORCE]
    if memo[at.LAG_S] > 0.0:
        force_polynomial(t, h, dense, z, mode, row, program, powers)
    find_peak(t, h, dense, z, mode, memo, row, program, before, powers, moments, figures)
    take_samples(t, h, dense, z, mode, memo, row, program, before, powers, moments, cursor, times, out)
    if memo[at.LAG_S] > 0.0:
        memo[at.LAGGED_FORCE] = lagged(1.0, before, memo[at.LAG_S] / h, powers, moments)
