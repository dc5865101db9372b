"""Waves that a smooth force of position and velocity is made of.

sin(i pi (x + L) / (2 L)) sin(j pi (u + L) / (2 L)) / L, x of position and u of velocity over half their
ranges, L = `BOX` (Solin and Särkkä 2020, doi:10.1007/s11222-019-09886-w, eq. 32).
"""

import math

import numpy as np

from impactcell.discrepancy.machine.terms.base_model import Reach
from impactcell.records import Samples

WAVES = 8
"""Waves along position, and as many along velocity [1]."""
BOX = 1.5
"""Half width of what they are waves in, over half the range that was gone through [1]."""


def waves_at(position: Samples, velocity: Samples, reach: Reach) -> Samples:
    """Waves at positions and velocities, shape (WAVES², n), those along the velocity in a row."""
    low, high = reach.position
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), np.finfo(float).tiny)
    along = _waves((position - middle) / half)
    over = _waves(velocity / max(reach.speed, np.finfo(float).tiny))
    waves: Samples = (along[:, None] * over[None]).reshape(WAVES**2, *np.shape(position))
    return waves


def _waves(values: Samples) -> Samples:
    """Waves in the box, shape (WAVES, n)."""
    number = np.arange(1, WAVES + 1).reshape(-1, *([1] * np.ndim(values)))
    waves: Samples = np.sin(number * np.pi * (values + BOX) / (2.0 * BOX)) / math.sqrt(BOX)
    return waves


def spectrum(length: float) -> Samples:
    """Variances of the waves of a force of one correlation length, in the order of its columns.

    2 pi l² exp(-l² |w|² / 2), w the angular frequencies of a wave (ibid., eq. 3), l over half the range.
    """
    frequency = np.arange(1, WAVES + 1) * np.pi / (2.0 * BOX)
    square = np.add.outer(frequency**2, frequency**2).ravel()
    variances: Samples = 2.0 * np.pi * length**2 * np.exp(-0.5 * length**2 * square)
    return variances
