"""Nodes of a standard normal variable, at which what a tap may do is followed, with their probabilities."""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

Z = np.array([-4.2, -3.3, -2.6, -1.9, -1.2, -0.6, 0.0, 0.6, 1.2, 1.9, 2.6, 3.3, 4.2])
"""Nodes along the line, in standard deviations: beyond the last lies one case in 40 000."""
COARSE_Z = np.array([-3.8, -2.8, -1.8, -0.85, 0.0, 0.85, 1.8, 2.8, 3.8])
"""The same for tables of many taps."""


class Quadrature(NamedTuple):
    """Nodes of a standard normal variable, shape (q,), and the probability between neighbours, (q - 1,)."""

    z: Samples
    probability: Samples


@compiled
def normal_tail(z: float) -> float:
    """P(Z > z) of a standard normal Z."""
    half: float = 0.5 * math.erfc(0.7071067811865476 * z)
    return half


def quadrature(z: Samples) -> Quadrature:
    """Nodes with the probability between neighbours; the tails go to the outermost intervals."""
    below = np.array([1.0 - normal_tail(float(v)) for v in z])
    below[0], below[-1] = 0.0, 1.0
    return Quadrature(z, np.diff(below))


@cache
def coarse_nodes() -> Quadrature:
    """Nodes at which the taps of a table are evaluated."""
    return quadrature(COARSE_Z)


@cache
def fine_nodes() -> Quadrature:
    """Nodes at which taps that are refined are evaluated."""
    return quadrature(Z)
