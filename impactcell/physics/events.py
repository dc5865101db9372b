"""Where smooth phases end.

Each kind of event has a margin: positive within the phase, crossing zero at its end. A crossing is looked
for on the interpolant and then located with full steps, so that it is as exact as the integration itself.
"""

import numpy as np

from impactcell.numerics.jit import FloatPointer, compiled
from impactcell.physics import memory_layout as at
from impactcell.physics.forces import (
    actuator_speed,
    body_force,
    breakaway_force,
    compression,
    contact_force,
    evaluate_law,
)
from impactcell.physics.memory_layout import SmoothPhase, StepBuffers
from impactcell.physics.runge_kutta import interpolate_state

TOLERANCE = np.array([1e-14, 1e-12, 1e-16, 1e-13, 1e-12, 1e-16, 0.0])
"""Margin of each event that is rounding and no crossing, as in a steady push; m/s, N, m, m/s, N, m, m."""
BISECTIONS = 60
"""At most; that many halve any interval to nothing."""
CHECKS = 5
"""Places of a step at which margins are looked at, and again in the first part with a crossing."""


@compiled
def can_end_phase(event: int, phase: SmoothPhase) -> bool:
    """Whether the present phase can end in this kind of event."""
    zone = phase.contact_mode[at.ZONE]
    slip = phase.contact_mode[at.SLIP]
    if event == at.STOP:
        return slip == 1 or slip == -1  # compiled
    if event == at.BREAKAWAY:
        return slip == 0 or slip == at.ELASTIC
    if event == at.GAP:
        return zone != at.ABSENT
    if event == at.RATE:
        return zone == at.TOUCHING
    if event == at.CLIP:
        return zone == at.TOUCHING and phase.laws[at.CONTACT + 1] > phase.laws[at.CONTACT]
    if event == at.WITHIN_REACH:
        return phase.cache[at.ADHESION_REACH] > 0.0 and (zone == at.NEAR or zone == at.FAR)
    return phase.contact_mode[at.RUNNING] == 1


@compiled
def event_margin(
    event: int,
    t: float,
    state: FloatPointer,
    phase: SmoothPhase,
) -> float:
    """Distance from the end of the phase by this kind of event, positive before it."""
    if event == at.STOP:
        return phase.contact_mode[at.SLIP] * state[at.PART_SPEED]
    if event == at.GAP:
        touching = phase.contact_mode[at.ZONE] == at.TOUCHING
        return state[at.TRAVEL] - state[at.ADVANCE] if touching else state[at.ADVANCE] - state[at.TRAVEL]
    if event == at.WITHIN_REACH:
        beyond = state[at.ADVANCE] - state[at.TRAVEL] - phase.cache[at.ADHESION_REACH]
        return beyond if phase.contact_mode[at.ZONE] == at.FAR else -beyond
    if event == at.STROKE_END:
        return phase.parameters[at.STROKE] - state[at.TRAVEL]
    speed = actuator_speed(t, state, phase)
    if event == at.RATE:
        rate = speed - state[at.PART_SPEED]
        return rate if phase.contact_mode[at.DAMPER] == 1 else -rate
    if event == at.CLIP:
        force = compression(state, speed, phase)
        return -force if phase.contact_mode[at.CLIPPED] == 1 else force
    if phase.contact_mode[at.SLIP] == at.ELASTIC:
        held = phase.cache[at.STICK_STIFFNESS] * (state[at.ADVANCE] - phase.cache[at.ANCHOR])
    else:
        held = contact_force(state, speed, phase) + body_force(t, state, phase)
    return breakaway_force(state[at.ADVANCE], phase) - abs(held)


@compiled
def margin_within(
    event: int, theta: float, t: float, h: float, phase: SmoothPhase, step: StepBuffers
) -> float:
    """Margin at the fraction `theta` of the step from t, on the interpolant."""
    interpolate_state(theta, phase.contact_mode[at.STATE_COUNT], step)
    return event_margin(event, t + theta * h, step.trial_state, phase)


@compiled
def crossing(
    event: int, low: float, high: float, t: float, h: float, phase: SmoothPhase, step: StepBuffers
) -> float:
    """Fraction of the step, in (low, high], at which the margin of `event` crosses zero.

    False position in the Illinois form on the interpolant.
    """
    g_high = margin_within(event, high, t, h, phase, step)
    g_low = margin_within(event, low, t, h, phase, step)
    if g_low <= 0.0:
        # The margin started at zero and never became positive: the phase ends where it began.
        if low > 0.0:
            return low
        for _ in range(BISECTIONS):
            middle = 0.5 * high
            g_low = margin_within(event, middle, t, h, phase, step)
            if g_low > 0.0:
                low = middle
                break
            high = middle
            g_high = g_low
        if g_low <= 0.0:
            return 0.0
    for _ in range(BISECTIONS):
        middle = (low * g_high - high * g_low) / (g_high - g_low)
        if not (low < middle < high) or high - low < 1e-15:
            break
        g = margin_within(event, middle, t, h, phase, step)
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
def first_event(t: float, h: float, phase: SmoothPhase, step: StepBuffers) -> tuple[int, float]:
    """Find the first event within the step and the fraction of the step at which it happens; -1 if none."""
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
            interpolate_state(theta, phase.contact_mode[at.STATE_COUNT], step)
            for event in range(at.EVENT_TYPES):
                if not can_end_phase(event, phase):
                    continue
                if event_margin(event, t + theta * h, step.trial_state, phase) < -TOLERANCE[event]:
                    hit = True
            if hit:
                high = theta
                low = theta - width
                break
        if not hit:
            return -1, 1.0
    first = -1
    fraction = 2.0
    for event in range(at.EVENT_TYPES):
        if can_end_phase(event, phase) and margin_within(event, high, t, h, phase, step) < -TOLERANCE[event]:
            theta = crossing(event, low, high, t, h, phase, step)
            if theta < fraction:
                first = event
                fraction = theta
    return first, fraction


@compiled
def hold_or_slip(t: float, state: FloatPointer, phase: SmoothPhase) -> bool:
    """Let a part at rest slip if what pulls at it exceeds what stick can hold; True if it does."""
    speed = actuator_speed(t, state, phase)
    pull = contact_force(state, speed, phase) + body_force(t, state, phase)
    limit = breakaway_force(state[at.ADVANCE], phase)
    if abs(pull) > limit:
        phase.contact_mode[at.SLIP] = 1 if pull > 0.0 else -1
        return True
    return False


@compiled
def next_kink(t: float, phase: SmoothPhase) -> float:
    """Next time after t at which a law of the actuator's run-up changes its formula [s]."""
    kink = np.inf
    for i in range(phase.laws[at.UNTIL], phase.laws[at.UNTIL + 1], 2):
        when = evaluate_law(i, 0.0, 0.0, 0.0, 0.0, phase)
        if t < when < kink:
            kink = when
    return kink
