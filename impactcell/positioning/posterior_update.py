"""Learning from a displacement: an iterated Kalman step for each Gaussian of the posterior.

The displacement is made linear by regression over points drawn from the posterior, and what the regression
leaves over counts as noise, so that a crooked response teaches no more than it can (iterated posterior
linearisation: Garcia-Fernandez et al., IEEE Transactions on Signal Processing 63, 2015). Sum of Gaussians:
Alspach and Sorenson, IEEE Transactions on Automatic Control 17 (1972). The tap's own
friction factor is one more state. The likelihood is Student's t, so that a tap that does not belong is
learned from little.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from impactcell.positioning.planner_posterior import BATCH_STD, FRICTION, STIFFNESS, PlannerPosterior
from impactcell.records import Samples

DEGREES = 8.0  # of freedom of the likelihood
POSITION_NOISE_M = 0.5e-6  # standard deviation of a displacement by an encoder of 1 um: 1 um / sqrt 12, twice
MODEL_ERROR = 2e-3  # of a displacement: what the nominal model leaves out
# Random walk a tap, in units of the parameters: wear of friction, a slow change of the contact.
WALK = np.array([1.5e-3, 3e-4, 6e-4, 3e-4, 0.02])
NARROW = {FRICTION: 0.05, STIFFNESS: 0.04}  # standard deviations that one Gaussian is trusted with
NEGLIGIBLE = 1e-4  # weight of a component that is dropped
ITERATIONS = 4  # of the linearisation; the last change is below a twentieth of a standard deviation
CLIPPED = 3.5  # standard deviations of a tap's factor, beyond which more does not count as scatter
CROOKED = 0.1  # of the first regression's remainder that stays, whatever the later ones leave over

Response = Callable[[Samples], Samples]
"""Displacements (m), shape (n,), for rows of (theta, z sigma), shape (n, 6)."""


def update_posterior(posterior: PlannerPosterior, response: Response, moved_m: float) -> PlannerPosterior:
    """Posterior after a tap displaced the part by `moved_m`, `response` being the model of that tap."""
    posterior = split_components(posterior)
    steps = [
        update_component(mean, cov + np.diag(WALK**2), posterior.scatter, response, moved_m)
        for mean, cov in zip(posterior.means, posterior.covs, strict=True)
    ]
    with np.errstate(divide="ignore"):
        logarithm = np.log(posterior.weights) + [s[2] for s in steps]
    if not np.isfinite(logarithm).any():
        return replace(posterior, taps=posterior.taps + 1)
    weights = np.exp(logarithm - logarithm.max())
    weights /= weights.sum()
    keep = weights > NEGLIGIBLE
    weights = weights[keep] / weights[keep].sum()
    kept = [s for s, k in zip(steps, keep, strict=True) if k]
    surprise = float(weights @ np.array([s[3] for s in kept]))
    told = float(weights @ np.array([s[4] for s in kept]))
    square = float(weights @ np.array([s[5] for s in kept]))
    covs = np.array([s[1] for s in kept])
    if abs(surprise) > 3.0 and posterior.surprise * surprise > 6.0:
        # Two in a row on one side: friction has changed and nobody said so.
        covs[:, FRICTION, FRICTION] += BATCH_STD**2
    learned = replace(
        posterior,
        weights=weights,
        means=np.array([s[0] for s in kept]),
        covs=covs,
        shape=posterior.shape + 0.5 * told,
        rate=posterior.rate + 0.5 * square,
        taps=posterior.taps + 1,
        surprise=surprise,
    )
    return merge_components(learned)


def split_components(posterior: PlannerPosterior) -> PlannerPosterior:
    """Sum of Gaussians, each narrow in friction, then in stiffness, with the posterior's mean and spread."""
    weights, means, covs = [], [], []
    for weight, mean, cov in zip(posterior.weights, posterior.means, posterior.covs, strict=True):
        std = np.sqrt(np.diag(cov))
        wide = next((axis for axis, narrow in NARROW.items() if std[axis] > 1.5 * narrow), None)
        if wide is None:
            weights.append(weight)
            means.append(mean)
            covs.append(cov)
            continue
        ratio = std[wide] / NARROW[wide]
        nodes = np.linspace(-2.6, 2.6, 2 * math.ceil(1.3 * ratio) + 1)
        shares = np.exp(-0.5 * nodes**2)
        shares /= shares.sum()
        regression = cov[wide] / std[wide]
        left = cov - np.outer(regression, regression) * min(float(shares @ nodes**2), 1.0 - ratio**-2)
        for node, share in zip(nodes, shares, strict=True):
            weights.append(weight * share)
            means.append(mean + regression * node)
            covs.append(left)
    return replace(posterior, weights=np.array(weights), means=np.array(means), covs=np.array(covs))


def merge_components(posterior: PlannerPosterior) -> PlannerPosterior:
    """One Gaussian, as soon as together they are narrow enough for one to be trusted."""
    if posterior.weights.size == 1:
        return posterior
    std = np.sqrt(np.diag(posterior.cov))
    if any(std[axis] > 1.3 * narrow for axis, narrow in NARROW.items()):
        return posterior
    return replace(posterior, weights=np.ones(1), means=posterior.mean[None], covs=posterior.cov[None])


def update_component(
    mean: Samples, cov: Samples, sigma: float, response: Response, moved_m: float
) -> tuple[Samples, Samples, float, float, float, float]:
    """One Gaussian after one displacement.

    Returns
    -------
    mean, cov : ndarray, shapes (5,) and (5, 5)
    likelihood : float
        Its logarithm.
    surprise : float
        Normalised innovation.
    told, square : float
        How much the tap says of its own friction factor, 0 to 1, and the square of that factor's
        deviation.
    """
    before = np.append(mean, 0.0)
    prior = np.zeros((6, 6))
    prior[:5, :5] = cov
    prior[5, 5] = sigma**2
    noise = POSITION_NOISE_M**2 + (MODEL_ERROR * moved_m) ** 2
    point, after = before.copy(), prior
    weight, surprise, likelihood, crooked = 1.0, 0.0, -math.inf, 0.0
    gain, variance, innovation = np.zeros(6), 1.0, 0.0
    for iteration in range(ITERATIONS):
        root = np.linalg.cholesky(after + 1e-12 * np.diag(np.diag(prior)))
        values = response(point + POINTS @ root.T)
        if not np.isfinite(values).all():
            return mean, cov, -math.inf, 0.0, 0.0, 0.0
        centre = float(values.mean())
        white = POINTS.T @ (values - centre) / len(POINTS)
        slope = np.linalg.solve(root.T, white)
        bent = float(((values - centre - POINTS @ white) ** 2).sum()) / (len(POINTS) - 7)
        crooked = max(bent, CROOKED * crooked)
        innovation = moved_m - centre - float(slope @ (before - point))
        variance = float(slope @ prior @ slope) + noise + crooked
        if iteration == 0:
            surprise = innovation / math.sqrt(variance)
            weight = min(1.0, (DEGREES + 1.0) / (DEGREES + surprise**2))
            likelihood = -0.5 * math.log(variance)
            likelihood -= 0.5 * (DEGREES + 1.0) * math.log1p(surprise**2 / DEGREES)
        gain = prior @ slope / variance
        new = before + weight * gain * innovation
        settled = bool(np.all(np.abs(new - point) < 0.05 * np.sqrt(np.diag(prior))))
        point = new
        after = prior - weight * np.outer(gain, gain) * variance
        after = 0.5 * (after + after.T)
        if settled and iteration > 0:
            break
    told = float(gain[5]) ** 2 * variance / sigma**2
    # Of the factor's variance it says factor² / told; an outlier counts as one of 3.5 standard deviations.
    square = min(float(gain[5] * innovation) ** 2, CLIPPED**2 * told * sigma**2)
    return point[:5], after[:5, :5], likelihood, surprise, told, square


def _spread_evenly(count: int, seed: int) -> Samples:
    """Points in six dimensions, symmetric, with exactly zero mean and unit covariance."""
    half = np.random.default_rng(seed).standard_normal((count // 2, 6))
    points = np.vstack([half, -half])
    root = np.linalg.cholesky(points.T @ points / count)
    spread: Samples = np.linalg.solve(root, points.T).T
    return spread


POINTS = _spread_evenly(48, 8)
"""At which the displacement is made linear: eight a dimension; the seed is any that spreads them well."""
