"""Samples and outputs gathered from one accepted step."""

import math
from typing import Final

import numpy as np

from impactcell.numerics.jit import FloatPointer, advance, compiled
from impactcell.physics import memory_layout as at
from impactcell.physics.forces import actuator_speed, contact_force, sensor_reading
from impactcell.physics.memory_layout import SmoothPhase, StepBuffers, TapRecord
from impactcell.physics.runge_kutta import STAGES, interpolate, interpolate_state

POWERS: Final = at.LAG_MOMENTS - at.FORCE_POWERS
"""Coefficients of the polynomial that stands for the contact force, or the position, over a step."""
NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(POWERS) / (POWERS - 1))
"""Chebyshev-Lobatto points of the unit step, through which that polynomial goes."""
MONOMIALS = np.linalg.inv(np.vander(NODES, increasing=True))
"""Its monomial coefficients for a unit value at each node."""
STARTED_EARLIER: Final = 14
"""Powers above the last at which the downward recursion starts, by which its error has died away."""
GOLDEN = 0.3819660112501051  # (3 - sqrt 5) / 2, of a golden-section search
NARROWINGS = 24  # of that search: an error of 1e-6 in time, near a maximum, is one of 1e-12 in force
PROBES: Final = 8  # equal parts of a step at whose ends the force is looked at


@compiled
def force_at(theta: float, t: float, h: float, phase: SmoothPhase, step: StepBuffers) -> float:
    """Contact force at the fraction `theta` of the step [N]."""
    if phase.contact_mode[at.ZONE] < at.NEAR:
        return 0.0
    interpolate_state(theta, phase.contact_mode[at.STATE_COUNT], step)
    state = step.trial_state
    return contact_force(state, actuator_speed(t + theta * h, state, phase), phase)


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
        for j in range(n + STARTED_EARLIER, 0, -1):
            value = (1.0 - value) / (j * relative)
            if j - 1 < n:
                out[j - 1] = value
    power = 1.0
    for j in range(n):
        out[j] *= power
        power *= theta


@compiled
def lag_response(theta: float, ratio: float, before: float, powers: int, cache: FloatPointer) -> float:
    """Show at the fraction `theta` of a step what a first-order lag that showed `before` makes of powers."""
    exponential_moments(theta, ratio, advance(cache, at.LAG_MOMENTS))
    value = before * math.exp(-theta / ratio)
    for j in range(POWERS):
        value += cache[powers + j] * cache[at.LAG_MOMENTS + j]
    return value


@compiled
def lagged_force(theta: float, h: float, cache: FloatPointer) -> float:
    """Force after the lag of the sensor at the fraction `theta` of a step h that has been fitted [N]."""
    return lag_response(theta, cache[at.LAG_S] / h, cache[at.LAGGED_FORCE], at.FORCE_POWERS, cache)


@compiled
def lagged_position(theta: float, h: float, cache: FloatPointer, step: StepBuffers) -> float:
    """Position after the lag of its sensor at the fraction `theta` of a step h that has been fitted [m]."""
    origin = step.state[at.ADVANCE]
    before = cache[at.LAGGED_POSITION] - origin
    return origin + lag_response(theta, cache[at.POSITION_LAG_S] / h, before, at.POSITION_POWERS, cache)


@compiled
def fit_force(t: float, h: float, phase: SmoothPhase, step: StepBuffers) -> None:
    """Fit the polynomial that stands for the contact force over the step, in the fraction of the step."""
    powers = advance(phase.cache, at.FORCE_POWERS)
    for j in range(POWERS):
        powers[j] = 0.0
    if phase.contact_mode[at.ZONE] < at.NEAR:
        return
    for i in range(POWERS):
        force = force_at(NODES[i], t, h, phase, step)
        for j in range(POWERS):
            powers[j] += MONOMIALS[j, i] * force


@compiled
def fit_position(phase: SmoothPhase, step: StepBuffers) -> None:
    """Fit the polynomial that is the way of the part over the step, in the fraction of the step."""
    powers = advance(phase.cache, at.POSITION_POWERS)
    for j in range(POWERS):
        powers[j] = 0.0
    for i in range(POWERS):
        way = interpolate(NODES[i], step.interpolant, at.ADVANCE) - step.state[at.ADVANCE]
        for j in range(POWERS):
            powers[j] += MONOMIALS[j, i] * way


@compiled
def sensed_force(theta: float, t: float, h: float, phase: SmoothPhase, step: StepBuffers) -> float:
    """Contact force after the sensor's lag, before its other laws [N]."""
    if phase.cache[at.LAG_S] > 0.0:
        return lagged_force(theta, h, phase.cache)
    return force_at(theta, t, h, phase, step)


@compiled
def update_peak_force(
    t: float, h: float, phase: SmoothPhase, step: StepBuffers, outputs: FloatPointer
) -> None:
    """Raise the peak force to the largest within this step: by golden section about the largest probe."""
    zone = phase.contact_mode[at.ZONE]
    if zone == at.ABSENT or (zone != at.TOUCHING and phase.cache[at.LAG_S] == 0.0):
        return
    best = -np.inf
    best_at = 0.0
    for i in range(PROBES + 1):
        theta = i / PROBES
        force = sensed_force(theta, t, h, phase, step)
        if force > best:
            best = force
            best_at = theta
    low = max(best_at - 1.0 / PROBES, 0.0)
    high = min(best_at + 1.0 / PROBES, 1.0)
    if best < outputs[at.PEAK_FORCE] - 0.1 * abs(outputs[at.PEAK_FORCE]):
        return
    if best_at == 0.0 or best_at == 1.0:  # compiled
        inside = abs(best_at - 1e-6)
        if sensed_force(inside, t, h, phase, step) < best:
            high = low
    a = low + GOLDEN * (high - low)
    b = high - GOLDEN * (high - low)
    force_a = sensed_force(a, t, h, phase, step)
    force_b = sensed_force(b, t, h, phase, step)
    for _ in range(NARROWINGS if high > low else 0):
        if force_a > force_b:
            high, b, force_b = b, a, force_a
            a = low + GOLDEN * (high - low)
            force_a = sensed_force(a, t, h, phase, step)
        else:
            low, a, force_a = a, b, force_b
            b = high - GOLDEN * (high - low)
            force_b = sensed_force(b, t, h, phase, step)
    for force in (force_a, force_b, best):
        if force > outputs[at.PEAK_FORCE]:
            outputs[at.PEAK_FORCE] = force


@compiled
def samples_until(end_s: float, late_s: float, first: int, last: int, times: FloatPointer) -> int:
    """Return the first of the samples `first` to `last` - 1, `late_s` early each, not before `end_s`."""
    i = first
    while i < last and times[i] - late_s < end_s:
        i += 1
    return i


@compiled
def fill_force(t: float, h: float, phase: SmoothPhase, step: StepBuffers, record: TapRecord) -> None:
    """Fill the samples of the force channel that fall into [t, t + h), as the sensor shows them."""
    index, times, samples = record.sample_index, record.sample_times, record.samples
    delay = phase.cache[at.DELAY_S]
    first = index[at.FORCE]
    end = samples_until(t + h, delay, first, index[at.CHANNEL_COUNT + at.FORCE], times)
    if phase.contact_mode[at.ZONE] < at.NEAR and not phase.cache[at.LAG_S] > 0.0:
        nothing = sensor_reading(0.0, phase)
        for i in range(first, end):
            samples[i] = nothing
    else:
        for i in range(first, end):
            force = sensed_force((times[i] - delay - t) / h, t, h, phase, step)
            samples[i] = sensor_reading(force, phase)
    index[at.FORCE] = end


@compiled
def fill_channel(
    channel: int,
    component: int,
    t: float,
    h: float,
    sign: float,
    interpolant: FloatPointer,
    record: TapRecord,
) -> None:
    """Fill the samples of a channel that is a component of the state, along +1, that fall into [t, t + h)."""
    index, times, samples = record.sample_index, record.sample_times, record.samples
    first = index[channel]
    end = samples_until(t + h, 0.0, first, index[at.CHANNEL_COUNT + channel], times)
    for i in range(first, end):  # known before, so that several samples are worked out side by side
        samples[i] = sign * interpolate((times[i] - t) / h, interpolant, component)
    index[channel] = end


@compiled
def fill_lagged_position(
    t: float, h: float, sign: float, phase: SmoothPhase, step: StepBuffers, record: TapRecord
) -> None:
    """Fill the samples of the position channel that fall into [t, t + h) behind its lag, and carry it on."""
    fit_position(phase, step)
    index, times = record.sample_index, record.sample_times
    first = index[at.POSITION]
    end = samples_until(t + h, 0.0, first, index[at.CHANNEL_COUNT + at.POSITION], times)
    for i in range(first, end):
        record.samples[i] = sign * lagged_position((times[i] - t) / h, h, phase.cache, step)
    index[at.POSITION] = end
    phase.cache[at.LAGGED_POSITION] = lagged_position(1.0, h, phase.cache, step)


@compiled
def accept_step(
    t: float, h: float, phase: SmoothPhase, step: StepBuffers, record: TapRecord, goal: int
) -> None:
    """Take samples of a step, and the peak force where outputs are wanted; go on from the step's end.

    The sensors' lags are carried over it.
    """
    sign = phase.parameters[at.DIRECTION]
    if phase.cache[at.LAG_S] > 0.0:
        fit_force(t, h, phase, step)
    if goal == at.TO_REST:
        update_peak_force(t, h, phase, step, record.outputs)
    fill_force(t, h, phase, step, record)
    if phase.cache[at.POSITION_LAG_S] > 0.0:
        fill_lagged_position(t, h, sign, phase, step, record)
    else:
        fill_channel(at.POSITION, at.ADVANCE, t, h, sign, step.interpolant, record)
    fill_channel(at.ACTUATOR, at.TRAVEL, t, h, sign, step.interpolant, record)
    fill_channel(at.PART_VELOCITY, at.PART_SPEED, t, h, sign, step.interpolant, record)
    if phase.cache[at.LAG_S] > 0.0:
        phase.cache[at.LAGGED_FORCE] = lagged_force(1.0, h, phase.cache)
    for i in range(phase.contact_mode[at.STATE_COUNT]):
        step.state[i] = step.next_state[i]
        step.stages[i] = step.stages[STAGES * at.STATE_WIDTH + i]
