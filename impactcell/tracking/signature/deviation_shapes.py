"""Shapes that a deviant cycle may have: bumps, ripples, level and tilt."""

from bisect import bisect_left
from dataclasses import dataclass
from functools import lru_cache
from operator import neg

import numpy as np

from impactcell.records import Samples
from impactcell.tracking.signature import friction_profile

BUMP_WIDTHS_M = (0.2e-3, 0.3e-3, 0.45e-3, 0.7e-3)
"""Standard deviations of the bells looked for, m: neighbours are a factor of 1.5 apart. Our choice."""
MIN_WAVE_M = 0.4e-3
"""Shortest wave of the ripples looked for, m. Our choice; on a coarse grid it is four points."""


@dataclass(frozen=True, slots=True, eq=False)
class DeviationShapes:
    """Spline coefficients of the shapes looked for, in the last axis.

    Attributes
    ----------
    bumps : ndarray, shape (4, g, j)
        Of every width at every grid point.
    ripples : ndarray, shape (q, 2, j)
        Cosine and sine of every wave, the longest first.
    plain : ndarray, shape (2, j)
        Level and tilt.
    spacing_m : float
        Of the grid.
    waves_m : tuple of float
    """

    bumps: Samples
    ripples: Samples
    plain: Samples
    spacing_m: float
    waves_m: tuple[float, ...]

    @lru_cache(maxsize=64)  # noqa: B019  # few shapes are ever made, and they are kept anyway
    def among(self, across: int, first: int, coefficients: int) -> Samples:
        """Rows of the shapes with bumps at the first places and without the first waves."""
        parts = self.bumps[:, :across], self.ripples[first:], self.plain
        return np.concatenate([part[..., :coefficients].reshape(-1, coefficients) for part in parts])

    def within(self, reached_m: float, coefficients: int) -> tuple[Samples, int, int]:
        """Shapes that a slide can show: bumps on its way, no wave longer than that.

        Returns
        -------
        rows : ndarray, shape (m, coefficients)
            Bumps of every width in turn at every place, cosine and sine of every wave in turn, level, tilt.
        across : int
            Places of bumps.
        waves : int
        """
        across = min(max(int(reached_m / self.spacing_m), 1) + 1, self.bumps.shape[1])
        first = bisect_left(self.waves_m, -reached_m, key=neg)
        return self.among(across, first, coefficients), across, len(self.waves_m) - first


@lru_cache(maxsize=8)
def deviation_shapes(length_m: float, points: int) -> DeviationShapes:
    """Make the shapes for a grid of `points` from 0 to `length_m`."""
    grid = np.linspace(0.0, length_m, points)
    to_coefficients = friction_profile.shape_coefficients(points)
    spacing = float(grid[1] - grid[0])
    bumps = np.array([[np.exp(-0.5 * ((grid - c) / w) ** 2) for c in grid] for w in BUMP_WIDTHS_M])
    waves = length_m / np.arange(1.0, length_m / max(4.0 * spacing, MIN_WAVE_M) + 0.5, 0.5)
    ripples = np.array([[f(2.0 * np.pi * grid / w) for f in (np.cos, np.sin)] for w in waves])
    plain = np.array([np.ones(points), grid / length_m])
    return DeviationShapes(
        bumps @ to_coefficients,
        ripples @ to_coefficients,
        plain @ to_coefficients,
        spacing,
        tuple(waves.tolist()),
    )
