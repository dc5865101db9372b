"""One large step of the Dormand-Prince method of order 8(5,3) and its interpolant of order 7.

Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., section II.10. The coefficients
are those that scipy ships with its integrator of the same name; the step, the interpolant and what is done
with them are our own, compiled.
"""

import math

import numpy as np
from scipy.integrate import DOP853

from impactcell.numerics.jit import FloatPointer, IntPointer, compiled
from impactcell.physics import memory_layout as at
from impactcell.physics.forces import derivative

STAGES = 12
EXTENDED = 16
INTERPOLANT = 7

_A = np.zeros((EXTENDED, EXTENDED))
_A[:STAGES, :STAGES] = DOP853.A
_A[STAGES, :STAGES] = DOP853.B
_A[STAGES + 1 :] = DOP853.A_EXTRA
_C = np.concatenate([DOP853.C, [1.0], DOP853.C_EXTRA])
_D = np.ascontiguousarray(DOP853.D)
_E3 = np.ascontiguousarray(DOP853.E3)
_E5 = np.ascontiguousarray(DOP853.E5)

RELATIVE = 1e-10
ABSOLUTE = np.array([1e-13, 1e-11, 1e-13, 1e-11, 1e-11, 1e-11, 1e-11, 1e-11])


@compiled
def stages(
    first: int,
    last: int,
    t: float,
    h: float,
    z: FloatPointer,
    mode: IntPointer,
    memo: FloatPointer,
    row: FloatPointer,
    program: IntPointer,
    K: FloatPointer,
    scratch: FloatPointer,
) -> None:
    """Evaluate stages `first` to `last` - 1 of the step h from (t, z) into the rows of K."""
    n = mode[at.STATES]
    for s in range(first, last):
        for i in range(n):
            total = 0.0
            for j in range(s):
                total += _A[s, j] * K[j * at.WIDTH + i]
            scratch[i] = z[i] + h * total
        derivative(t + _C[s] * h, scratch, mode, memo, row, program, K, s * at.WIDTH)


@compiled
def error(n: int, h: float, z: FloatPointer, new: FloatPointer, K: FloatPointer) -> float:
    """Estimated error of the step in units of the tolerance (Hairer's combination of orders 5 and 3)."""
    fifth = 0.0
    third = 0.0
    for i in range(n):
        scale = ABSOLUTE[i] + RELATIVE * max(abs(z[i]), abs(new[i]))
        e5 = 0.0
        e3 = 0.0
        for j in range(STAGES + 1):
            e5 += _E5[j] * K[j * at.WIDTH + i]
            e3 += _E3[j] * K[j * at.WIDTH + i]
        fifth += (e5 / scale) ** 2
        third += (e3 / scale) ** 2
    if fifth == 0.0:
        return 0.0
    return abs(h) * fifth / math.sqrt((fifth + 0.01 * third) * n)


@compiled
def interpolant(
    n: int, h: float, z: FloatPointer, new: FloatPointer, K: FloatPointer, dense: FloatPointer
) -> None:
    """Coefficients of the interpolant over the step, shape (8, WIDTH), from all 16 stages."""
    for i in range(n):
        delta = new[i] - z[i]
        dense[i] = z[i]
        dense[at.WIDTH + i] = delta
        dense[2 * at.WIDTH + i] = h * K[i] - delta
        dense[3 * at.WIDTH + i] = 2.0 * delta - h * (K[STAGES * at.WIDTH + i] + K[i])
        for j in range(4):
            total = 0.0
            for s in range(EXTENDED):
                total += _D[j, s] * K[s * at.WIDTH + i]
            dense[(4 + j) * at.WIDTH + i] = h * total


@compiled
def evaluate(theta: float, dense: FloatPointer, i: int) -> float:
    """Component i of the state at the fraction `theta` of the step."""
    rest = 1.0 - theta
    value = dense[7 * at.WIDTH + i] * theta
    value = (value + dense[6 * at.WIDTH + i]) * rest
    value = (value + dense[5 * at.WIDTH + i]) * theta
    value = (value + dense[4 * at.WIDTH + i]) * rest
    value = (value + dense[3 * at.WIDTH + i]) * theta
    value = (value + dense[2 * at.WIDTH + i]) * rest
    value = (value + dense[at.WIDTH + i]) * theta
    return value + dense[i]
