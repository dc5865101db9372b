"""What the planner believes of a cell: friction, contact and scatter, with their uncertainty.

Parameters are Gaussian in logarithms, where a plant that is 10 % off is 0.1 off::

    theta = (ln mu_k, ln k, ln b, ln(mu_s / mu_k), k_v),   theta ~ N(mean, cov)

and each tap has a friction factor of its own, 1 + sigma z, z ~ N(0, 1), on mu_s and mu_k alike; sigma²
is inverse-gamma. A displacement is learned from by an iterated extended Kalman step (Bell and Cathey,
IEEE Trans. Automatic Control 38, 1993) in which the tap's own factor is one more state, with the
weight of a Student-t likelihood (Huber-like against a tap that does not belong).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from impactcell.records import Samples

FRICTION, STIFFNESS, DAMPING, RATIO, VISCOUS = range(5)
STUDENT_DEGREES = 8.0
POSITION_NOISE_M = 0.5e-6
MODEL_ERROR = 2e-3  # of a displacement: what the nominal model leaves out
# Random walk a tap, in units of the parameters: wear of friction, a slow change of the contact.
WALK = np.array([1.5e-3, 3e-4, 6e-4, 3e-4, 0.02])
LEARNED_STD = np.array([0.015, 0.03, 0.05, 0.02, 3.0])  # left after a handful of taps
BATCH_STD = 0.08  # of friction, after a batch step whose size the tracker has not measured yet
LEVEL_STD = 0.007  # the tracker's level is believed no better than this: successive levels are correlated

Response = Callable[[Samples], Samples]
"""Displacements (m), shape (n,), for rows of (theta, z sigma), shape (n, 6)."""


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """Gaussian over the parameters and inverse-gamma over the variance of the friction factor.

    Attributes
    ----------
    mean : ndarray, shape (5,)
    cov : ndarray, shape (5, 5)
    shape, rate : float
        Of the inverse-gamma distribution of sigma².
    taps : int
        Displacements learned from.
    surprise : float
        Last normalised innovation, with its sign.
    """

    mean: Samples
    cov: Samples
    shape: float = 12.0
    rate: float = field(default=11.0 * 0.03**2)
    taps: int = 0
    surprise: float = 0.0

    @property
    def scatter(self) -> float:
        """Predictive standard deviation of a tap's friction factor."""
        return math.sqrt(self.rate / (self.shape - 1.0))

    @property
    def mu_k(self) -> float:
        """Kinetic coefficient, median."""
        return math.exp(float(self.mean[FRICTION]))


def prior(
    stiffness: float, damping: float, mu_s: float, mu_k: float, viscous: float, friction_std: float = 0.35
) -> Belief:
    """Belief before the first tap: contact within some 10 %, friction within a factor of 1.4.

    Parameters
    ----------
    stiffness, damping, mu_s, mu_k, viscous : float
        Nominal values, SI.
    friction_std : float
        Of ln mu_k.
    """
    mean = np.array(
        [math.log(mu_k), math.log(stiffness), math.log(damping), math.log(max(mu_s / mu_k, 1.0)), viscous]
    )
    std = np.array([friction_std, 0.12, 0.13, 0.03, 0.5 + 0.15 * viscous])
    return Belief(mean, np.diag(std**2))


def foreseen(belief: Belief) -> Belief:
    """Belief as the next taps will leave it, for what is to be expected of the taps after them.

    One strike tells friction about as well as the scatter allows, and a few tell the contact; to plan as
    if nothing were learned any more would forbid the first tap of a new cell.
    """
    std = np.sqrt(np.diag(belief.cov))
    factor = np.minimum(1.0, LEARNED_STD / std)
    return replace(belief, cov=belief.cov * np.outer(factor, factor))


def learn(belief: Belief, response: Response, moved_m: float) -> Belief:
    """Belief after a tap displaced the part by `moved_m`, `response` being the model of that tap."""
    mean, cov = belief.mean, belief.cov + np.diag(WALK**2)
    sigma = belief.scatter
    prior_mean = np.append(mean, 0.0)
    prior_cov = np.zeros((6, 6))
    prior_cov[:5, :5] = cov
    prior_cov[5, 5] = sigma**2
    point, spread = prior_mean.copy(), np.sqrt(np.diag(prior_cov))
    noise = POSITION_NOISE_M**2 + (MODEL_ERROR * moved_m) ** 2
    weight, gain, slope, variance = 1.0, np.zeros(6), np.zeros(6), 1.0
    for iteration in range(4):
        offsets = np.diag(spread if iteration == 0 else 0.5 * spread)
        rows = np.vstack([point, point + offsets, point - offsets])
        values = response(rows)
        if not np.isfinite(values).all():
            return replace(belief, taps=belief.taps + 1)
        slope = (values[1:7] - values[7:]) / (2.0 * np.diag(offsets))
        innovation = moved_m - values[0] - slope @ (prior_mean - point)
        variance = float(slope @ prior_cov @ slope) + noise
        if iteration == 0:
            normalised = innovation / math.sqrt(variance)
            weight = min(1.0, (STUDENT_DEGREES + 1.0) / (STUDENT_DEGREES + normalised**2))
        gain = prior_cov @ slope / variance
        new = prior_mean + weight * gain * innovation
        if np.all(np.abs(new - point) < 0.02 * spread):
            point = new
            break
        point = new
    posterior = prior_cov - weight * np.outer(gain, gain) * variance
    told = 1.0 - posterior[5, 5] / sigma**2  # how much this tap says of its own friction factor
    surprise = float(normalised)
    cov = 0.5 * (posterior[:5, :5] + posterior[:5, :5].T)
    if abs(surprise) > 3.0 and belief.surprise * surprise > 6.0:
        # Two in a row on one side: friction has changed and nobody said so.
        cov = cov + np.diag([BATCH_STD**2, 0.0, 0.0, 0.0, 0.0])
    return Belief(
        mean=point[:5],
        cov=cov,
        shape=belief.shape + 0.5 * weight * told,
        rate=belief.rate + 0.5 * weight * float(point[5]) ** 2,
        taps=belief.taps + 1,
        surprise=surprise,
    )


def told_friction(belief: Belief, mu_k: float, std: float, *, batch_changed: bool) -> Belief:
    """Belief after the tracker reported its level of the kinetic coefficient.

    The tracker's level is itself an average over the cycles this belief has learned from, so the two are
    not fused as if they were independent: the better informed replaces the other (Jeffrey's rule), and
    the tracker prevails where they contradict each other. After a batch change friction starts afresh,
    and what had been learned together with it keeps only its own uncertainty.
    """
    level, own = math.log(mu_k), float(belief.cov[FRICTION, FRICTION])
    relative = math.hypot(std / mu_k, LEVEL_STD)
    difference = level - float(belief.mean[FRICTION])
    mean, cov = belief.mean.copy(), belief.cov.copy()
    if batch_changed:
        mean[FRICTION] = level
        cov[FRICTION, :] = cov[:, FRICTION] = 0.0
        cov[FRICTION, FRICTION] = relative**2 + BATCH_STD**2
        return replace(belief, mean=mean, cov=cov, surprise=0.0)
    if difference**2 > 9.0 * (own + relative**2):
        relative = math.hypot(relative, 0.3 * abs(difference))
        mean[FRICTION] = level
        cov[FRICTION, :] = cov[:, FRICTION] = 0.0
        cov[FRICTION, FRICTION] = relative**2
        return replace(belief, mean=mean, cov=cov, surprise=0.0)
    if relative**2 >= own:
        return belief
    regression = cov[:, FRICTION] / own
    mean = mean + regression * difference
    cov = cov - np.outer(regression, regression) * (own - relative**2)
    return replace(belief, mean=mean, cov=cov)
