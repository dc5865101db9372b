"""One large step of the Dormand-Prince method of order 8(5,3) and its interpolant of order 7.

Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., section II.10. The coefficients
are those that scipy ships with its integrator of the same name; the step, the interpolant and what is done
with them are our own, compiled.
"""

import math
from typing import Final

import numpy as np
from scipy.integrate import DOP853

from impactcell.numerics.jit import FloatPointer, compiled, inlined
from impactcell.physics import memory_layout as at
from impactcell.physics.forces import derivative
from impactcell.physics.memory_layout import SmoothPhase, StepBuffers

STAGES: Final = 12  # of the step; the next one is the first of the step after it
EXTENDED: Final = 16  # stages, with those that only the interpolant needs
INTERPOLANT: Final = 8  # coefficients of the interpolant for each component of the state

A = np.zeros((EXTENDED, EXTENDED))
"""Runge-Kutta matrix of Dormand and Prince's tableau, the weights of the step as its row STAGES."""
A[:STAGES, :STAGES] = DOP853.A
A[STAGES, :STAGES] = DOP853.B
A[STAGES + 1 :] = DOP853.A_EXTRA
C = np.concatenate([DOP853.C, [1.0], DOP853.C_EXTRA])
"""Nodes of the tableau, in fractions of the step."""
LATER = np.array([next((j for j in range(1, s) if A[s, j] != 0.0), max(s, 1)) for s in range(EXTENDED)])
"""First stage after the first one that a stage is made of: those between have no weight in it."""
LATER_WEIGHED: Final = 5
"""First stage after the first one that has a weight in the step, its errors and its interpolant."""
D = np.ascontiguousarray(DOP853.D)
"""Weights of the stages in the last four coefficients of the interpolant."""
E3 = np.ascontiguousarray(DOP853.E3)
"""Weights of the stages in the error estimate of order 3."""
E5 = np.ascontiguousarray(DOP853.E5)
"""Weights of the stages in the error estimate of order 5."""

RELATIVE = 1e-10
"""Error allowed in a step, of the state: what keeps a trace within 1e-9 of the exact one."""
ABSOLUTE = np.array([1e-13, 1e-11, 1e-13, 1e-11, 1e-11, 1e-11, 1e-11, 1e-11])
"""The same near zero: m, m/s, m, and m/s of the effects' own states; far below what any encoder tells."""


@compiled
def evaluate_stages(first: int, last: int, t: float, h: float, phase: SmoothPhase, step: StepBuffers) -> None:
    """Evaluate stages `first` to `last` - 1 of the step h; the last one's state stays in `trial_state`."""
    state, trial, K = step.state, step.trial_state, step.stages
    for s in range(first, last):
        # The three components that every plant has are summed side by side, which is faster.
        advance, speed, travel = 0.0, 0.0, 0.0
        if s > 0:
            advance, speed, travel = (
                A[s, 0] * K[at.ADVANCE],
                A[s, 0] * K[at.PART_SPEED],
                A[s, 0] * K[at.TRAVEL],
            )
        for j in range(LATER[s], s):
            weight = A[s, j]
            advance += weight * K[j * at.STATE_WIDTH + at.ADVANCE]
            speed += weight * K[j * at.STATE_WIDTH + at.PART_SPEED]
            travel += weight * K[j * at.STATE_WIDTH + at.TRAVEL]
        trial[at.ADVANCE] = state[at.ADVANCE] + h * advance
        trial[at.PART_SPEED] = state[at.PART_SPEED] + h * speed
        trial[at.TRAVEL] = state[at.TRAVEL] + h * travel
        for i in range(at.FIRST_EXTRA_STATE, phase.contact_mode[at.STATE_COUNT]):
            total = A[s, 0] * K[i] if s > 0 else 0.0
            for j in range(LATER[s], s):
                total += A[s, j] * K[j * at.STATE_WIDTH + i]
            trial[i] = state[i] + h * total
        derivative(t + C[s] * h, trial, phase, K, s * at.STATE_WIDTH)


@compiled
def step_error(n: int, h: float, step: StepBuffers) -> float:
    """Estimated error of the step in units of the tolerance (Hairer's combination of orders 5 and 3)."""
    fifth = 0.0
    third = 0.0
    for i in range(n):
        scale = ABSOLUTE[i] + RELATIVE * max(abs(step.state[i]), abs(step.next_state[i]))
        e5 = E5[0] * step.stages[i]
        e3 = E3[0] * step.stages[i]
        for j in range(LATER_WEIGHED, STAGES + 1):
            e5 += E5[j] * step.stages[j * at.STATE_WIDTH + i]
            e3 += E3[j] * step.stages[j * at.STATE_WIDTH + i]
        fifth += (e5 / scale) ** 2
        third += (e3 / scale) ** 2
    if fifth == 0.0:
        return 0.0
    return abs(h) * fifth / math.sqrt((fifth + 0.01 * third) * n)


@compiled
def build_interpolant(t: float, h: float, phase: SmoothPhase, step: StepBuffers) -> None:
    """Coefficients of the interpolant over the step, shape (INTERPOLANT, STATE_WIDTH), from all 16 stages."""
    first_extra = STAGES + 1
    evaluate_stages(first_extra, first_extra + EXTENDED - STAGES - 1, t, h, phase, step)
    K, out = step.stages, step.interpolant
    for i in range(phase.contact_mode[at.STATE_COUNT]):
        delta = step.next_state[i] - step.state[i]
        out[i] = step.state[i]
        out[at.STATE_WIDTH + i] = delta
        out[2 * at.STATE_WIDTH + i] = h * K[i] - delta
        out[3 * at.STATE_WIDTH + i] = 2.0 * delta - h * (K[STAGES * at.STATE_WIDTH + i] + K[i])
        for j in range(4):
            total = D[j, 0] * K[i]
            for s in range(LATER_WEIGHED, EXTENDED):
                total += D[j, s] * K[s * at.STATE_WIDTH + i]
            out[(4 + j) * at.STATE_WIDTH + i] = h * total


@inlined
def interpolate(theta: float, interpolant: FloatPointer, i: int) -> float:
    """Component i of the state at the fraction `theta` of the step."""
    rest = 1.0 - theta
    value = interpolant[7 * at.STATE_WIDTH + i] * theta
    value = (value + interpolant[6 * at.STATE_WIDTH + i]) * rest
    value = (value + interpolant[5 * at.STATE_WIDTH + i]) * theta
    value = (value + interpolant[4 * at.STATE_WIDTH + i]) * rest
    value = (value + interpolant[3 * at.STATE_WIDTH + i]) * theta
    value = (value + interpolant[2 * at.STATE_WIDTH + i]) * rest
    value = (value + interpolant[at.STATE_WIDTH + i]) * theta
    return value + interpolant[i]


@inlined
def interpolate_state(theta: float, n: int, step: StepBuffers) -> None:
    """Write the state at the fraction `theta` of the step into `trial_state`."""
    for i in range(n):
        step.trial_state[i] = interpolate(theta, step.interpolant, i)
