"""How many Gaussians a posterior is a sum of: each narrow enough to be trusted, no more than is affordable.

The displacement folds over as friction varies, so that a wide Gaussian is split before it learns. Where that
makes too many of them, each of the lightest joins the nearest of the others, so that mean and spread of the
whole stay (West, Journal of the Royal Statistical Society B 55, 1993).
"""

import math
from dataclasses import replace

import numpy as np

from impactcell.positioning.displacement_discrepancy import INDENTATION
from impactcell.positioning.planner_posterior import (
    FRICTION,
    PARAMETERS,
    STIFFNESS,
    PlannerPosterior,
    with_single_gaussian,
)
from impactcell.records import Samples

NARROW = {FRICTION: 0.05, STIFFNESS: 0.04}  # standard deviations that one Gaussian is trusted with
MOST_COMPONENTS = 1000
"""Of one hypothesis; a new cell has some 200 after its first taps, and one whose friction steps up to 600."""


def narrow_enough(std: Samples) -> dict[int, float]:
    """Return the standard deviations that one Gaussian is trusted with.

    Where the discrepancy leaves the indentation uncertain, a crooked response to stiffness does not matter.
    """
    return {**NARROW, STIFFNESS: max(NARROW[STIFFNESS], float(std[PARAMETERS + INDENTATION]))}


def split_components(posterior: PlannerPosterior) -> PlannerPosterior:
    """Sum of Gaussians, each narrow in friction, then in stiffness, with the posterior's mean and spread.

    Of one hypothesis, as `merge_components`.
    """
    weights, means, covs = [], [], []
    for weight, mean, cov in zip(posterior.weights, posterior.means, posterior.covs, strict=True):
        std = np.sqrt(np.diag(cov))
        widths = narrow_enough(std)
        wide = next((axis for axis, narrow in widths.items() if std[axis] > 1.5 * narrow), None)
        if wide is None:
            weights.append(weight)
            means.append(mean)
            covs.append(cov)
            continue
        ratio = std[wide] / widths[wide]
        nodes = np.linspace(-2.6, 2.6, 2 * math.ceil(1.3 * ratio) + 1)
        shares = np.exp(-0.5 * nodes**2)
        shares /= shares.sum()
        regression = cov[wide] / std[wide]
        left = cov - np.outer(regression, regression) * min(float(shares @ nodes**2), 1.0 - ratio**-2)
        for node, share in zip(nodes, shares, strict=True):
            weights.append(weight * share)
            means.append(mean + regression * node)
            covs.append(left)
    return replace(
        posterior,
        weights=np.array(weights),
        means=np.array(means),
        covs=np.array(covs),
        hypotheses=np.zeros(len(weights)),
    )


def merge_components(posterior: PlannerPosterior) -> PlannerPosterior:
    """One Gaussian, as soon as together they are narrow enough for one to be trusted."""
    if posterior.weights.size == 1:
        return posterior
    std = np.sqrt(np.diag(posterior.cov))
    if any(std[axis] > 1.3 * narrow for axis, narrow in narrow_enough(std).items()):
        return posterior
    return with_single_gaussian(posterior, posterior.mean, posterior.cov)


def within_most_components(posterior: PlannerPosterior) -> PlannerPosterior:
    """Posterior of one hypothesis with no more than `MOST_COMPONENTS`, mean and spread as before."""
    if posterior.weights.size <= MOST_COMPONENTS:
        return posterior
    order = np.argsort(-posterior.weights, kind="stable")
    kept, lightest = order[:MOST_COMPONENTS], order[MOST_COMPONENTS:]
    places = posterior.means[:, list(NARROW)] / np.array(list(NARROW.values()))
    apart = ((places[lightest, None] - places[kept]) ** 2).sum(axis=2)
    joined = np.empty(order.size, dtype=np.intp)
    joined[kept] = np.arange(MOST_COMPONENTS)
    joined[lightest] = apart.argmin(axis=1)
    weights = np.zeros(MOST_COMPONENTS)
    np.add.at(weights, joined, posterior.weights)
    shares = posterior.weights / weights[joined]
    means = np.zeros((MOST_COMPONENTS, posterior.means.shape[1]))
    np.add.at(means, joined, shares[:, None] * posterior.means)
    off = posterior.means - means[joined]
    covs = np.zeros((MOST_COMPONENTS, *posterior.covs.shape[1:]))
    spread = posterior.covs + off[:, :, None] * off[:, None, :]
    np.add.at(covs, joined, shares[:, None, None] * spread)
    return replace(posterior, weights=weights, means=means, covs=covs, hypotheses=np.zeros(MOST_COMPONENTS))
