"""Friction along the stroke, learned from signatures: the signature as a control variable.

A part that leaves its actuator with kinetic energy E slides until friction has taken it. With friction
mu_k rho(x), x the distance slid since loss of contact, and the mean of rho over the stroke 1,

    E = mu_k m g s = mu_k m g ∫_0^D rho dx,

so that what slides s at the mean coefficient slides D. rho is learned at each point of the signature's grid
as a Gaussian about 1, so that noise is not taken for structure.
"""

from dataclasses import dataclass

import numpy as np

from impactcell.errors import PositioningError
from impactcell.records import Samples

PRIOR_STD = 0.05  # of rho about 1
ROUGHNESS_STD = 0.01  # from one signature to the next, beside their noise
MEMORY = 30.0  # signatures after which the old ones fade


@dataclass(frozen=True, slots=True, eq=False)
class StrokeFriction:
    """Relative friction on a grid of distances slid since loss of contact.

    Attributes
    ----------
    position_m : ndarray, shape (g,)
    ratio : ndarray, shape (g,)
        rho, as measured.
    information : ndarray, shape (g,)
        Inverse variance of `ratio`.
    """

    position_m: Samples
    ratio: Samples
    information: Samples

    def warp(self) -> Samples:
        """Step, then what is slid instead of 0, 1, 2, ... steps at the mean; m, shape (1 + n,)."""
        trust = self.information / (self.information + PRIOR_STD**-2)
        rho = 1.0 + (self.ratio - 1.0) * trust
        grid = np.concatenate([[0.0], self.position_m]) if self.position_m[0] > 0.0 else self.position_m
        rho = np.concatenate([rho[:1], rho]) if self.position_m[0] > 0.0 else rho
        at_mean = np.concatenate([[0.0], np.cumsum(0.5 * (rho[1:] + rho[:-1]) * np.diff(grid))])
        steps = np.linspace(0.0, at_mean[-1], 2 * grid.size)
        return np.concatenate([steps[1:2], np.interp(steps, at_mean, grid)])


def update_stroke_friction(
    known: StrokeFriction | None, position_m: Samples, friction: Samples, friction_std: Samples
) -> StrokeFriction | None:
    """Profile after one more signature; the old one where the new one says nothing.

    Parameters
    ----------
    position_m : ndarray, shape (g,)
        Increasing, from 0 on, m.
    friction, friction_std : ndarray, shape (g,)
        Kinetic coefficient and its standard deviation; nan where the part did not get that far.

    Raises
    ------
    PositioningError
        For arrays of unequal length or a grid that does not increase.
    """
    if not position_m.shape == friction.shape == friction_std.shape or position_m.ndim != 1:
        raise PositioningError("signature: position, friction and its deviation differ in length")
    if position_m.size < 2 or not (np.diff(position_m) > 0.0).all() or position_m[0] < 0.0:
        raise PositioningError("signature: positions must increase from 0 on")
    seen = np.isfinite(friction) & np.isfinite(friction_std) & (friction > 0.0) & (friction_std > 0.0)
    if np.count_nonzero(seen) < 3:
        return known
    if known is None or not np.array_equal(known.position_m, position_m):
        known = StrokeFriction(position_m, np.ones(position_m.size), np.zeros(position_m.size))
    mean = float(np.average(friction[seen] / known.ratio[seen], weights=friction_std[seen] ** -2.0))
    fresh = np.where(seen, friction / mean, 1.0)
    weight = np.where(seen, 1.0 / ((friction_std / mean) ** 2 + ROUGHNESS_STD**2), 0.0)
    old = known.information * np.where(seen, 1.0 - 1.0 / MEMORY, 1.0)
    information = old + weight
    ratio = np.where(
        information > 0.0, (old * known.ratio + weight * fresh) / np.maximum(information, 1e-300), 1.0
    )
    return StrokeFriction(position_m, ratio, information)
