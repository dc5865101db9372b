"""Learning from a displacement: an iterated Kalman step for each Gaussian of the posterior.

The displacement is made linear by regression over points drawn from the posterior, and what the regression
leaves over counts as noise, so that a crooked response teaches no more than it can (iterated posterior
linearisation: Garcia-Fernandez et al., IEEE Transactions on Signal Processing 63, 2015). Sum of Gaussians:
Alspach and Sorenson, IEEE Transactions on Automatic Control 17 (1972). The tap's own
friction factor is one more state. The likelihood is Student's t, so that a tap that does not belong is
learned from little.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from impactcell.positioning.displacement_discrepancy import (
    BREAKAWAY,
    BREAKAWAY_SHARE,
    FEATURES,
    HALTING_STD,
    INDENTATION,
)
from impactcell.positioning.model_hypotheses import (
    join,
    parts_of,
    reweighted,
    with_evidence_of_a_tap,
)
from impactcell.positioning.planner_posterior import (
    BATCH_STD,
    FRICTION,
    PARAMETERS,
    STIFFNESS,
    PlannerPosterior,
    with_single_gaussian,
)
from impactcell.positioning.scatter_hypotheses import mean_variances, update_weights
from impactcell.positioning.tap_model import Response, TapModel
from impactcell.records import Samples

DEGREES = 8.0  # of freedom of the likelihood
POSITION_NOISE_M = 0.5e-6  # standard deviation of a displacement by an encoder of 1 um: 1 um / sqrt 12, twice
# Random walk a tap, in units of the parameters: wear of friction, a slow change of the contact, and static
# friction that ages with the time at rest, by some per cent a decade: what is learned of it does not last.
WALK = np.concatenate([[1.5e-3, 3e-4, 6e-4, 4e-3, 0.02], np.zeros(FEATURES)])
NARROW = {FRICTION: 0.05, STIFFNESS: 0.04}  # standard deviations that one Gaussian is trusted with
NEGLIGIBLE = 1e-4  # weight of a component that is dropped
ITERATIONS = 4  # of the linearisation; the last change is below a twentieth of a standard deviation
CROOKED = 0.1  # of the first regression's remainder that stays, whatever the later ones leave over


LEAST_STD = np.concatenate([np.full(PARAMETERS + 1, 1e-8), [1e-4]])
"""Over which the displacement is made linear at least, in what is regressed; less would be numbers' noise."""


class Step(NamedTuple):
    """One Gaussian after one displacement.

    `likelihood` is a logarithm, `surprise` the normalised innovation; `innovation` (m), its `variance` but
    for scatter (m²) and the `reaches` of the scatter (m), shape (3,), are those foretold before it.
    """

    mean: Samples
    cov: Samples
    likelihood: float
    surprise: float
    innovation: float
    variance: float
    reaches: Samples


def update_posterior(
    posterior: PlannerPosterior, response: Response | TapModel, moved_m: float
) -> PlannerPosterior:
    """Posterior after a tap displaced the part by `moved_m`, `response` being the model of that tap."""
    model = response if isinstance(response, TapModel) else TapModel(response)
    updates = [update_hypothesis(part, model, moved_m) for part in parts_of(posterior)]
    parts = [part for part, _ in updates]
    log_evidence = np.array([evidence for _, evidence in updates])
    probabilities = posterior.probabilities
    if np.isfinite(log_evidence).any():
        probabilities = reweighted(probabilities, log_evidence)
    surprise = float(probabilities @ np.array([part.surprise for part in parts]))
    learned = join(parts, probabilities, posterior)
    learned = replace(learned, taps=posterior.taps + 1, surprise=surprise)
    return with_evidence_of_a_tap(learned, posterior)


def update_hypothesis(
    posterior: PlannerPosterior, model: TapModel, moved_m: float
) -> tuple[PlannerPosterior, float]:
    """Posterior under one hypothesis after a tap, and the logarithm of its density at `moved_m`."""
    posterior = split_components(posterior)
    scatter = mean_variances(posterior.scatter_weights[0])
    steps = [
        update_component(mean, cov + np.diag(WALK**2), scatter, model, moved_m)
        for mean, cov in zip(posterior.means, posterior.covs, strict=True)
    ]
    with np.errstate(divide="ignore"):
        logarithm = np.log(posterior.weights) + [step.likelihood for step in steps]
    if not np.isfinite(logarithm).any():
        return posterior, -math.inf
    weights = np.exp(logarithm - logarithm.max())
    weights /= weights.sum()
    possible = np.isfinite(logarithm)
    scatter_weights, density = update_weights(
        posterior.scatter_weights[0],
        posterior.weights[possible],
        np.array([step.innovation for step in steps])[possible],
        np.array([step.variance for step in steps])[possible],
        np.array([step.reaches for step in steps])[possible],
    )
    keep = weights > NEGLIGIBLE
    weights = weights[keep] / weights[keep].sum()
    kept = [step for step, k in zip(steps, keep, strict=True) if k]
    surprise = float(weights @ np.array([step.surprise for step in kept]))
    covs = np.array([step.cov for step in kept])
    if abs(surprise) > 3.0 and posterior.surprise * surprise > 6.0:
        # Two in a row on one side: friction has changed and nobody said so.
        covs[:, FRICTION, FRICTION] += BATCH_STD**2
    learned = replace(
        posterior,
        weights=weights,
        means=np.array([step.mean for step in kept]),
        covs=covs,
        scatter_weights=scatter_weights[None],
        surprise=surprise,
        hypotheses=np.zeros(len(kept)),
    )
    return merge_components(learned), density


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


def update_component(mean: Samples, cov: Samples, scatter: Samples, model: TapModel, moved_m: float) -> Step:
    """One Gaussian after one displacement; `scatter` has the expected squares of the three of it.

    What is regressed are the parameters, the tap's friction factor and psi · w; the slope over phi · w, which
    acts on the logarithm, is known.
    """
    size = mean.size
    regressed = np.zeros((PARAMETERS + 2, size + 1))
    regressed[np.arange(PARAMETERS), np.arange(PARAMETERS)] = 1.0
    regressed[PARAMETERS, size] = 1.0
    regressed[PARAMETERS + 1, PARAMETERS:size] = model.indenting
    before = np.append(mean, 0.0)
    prior = np.zeros((size + 1, size + 1))
    prior[:size, :size] = cov
    prior[size, size] = scatter[0]
    floor = np.diag(LEAST_STD**2)
    unmodelled = POSITION_NOISE_M**2 + (HALTING_STD * model.halting_m) ** 2
    point, after = before.copy(), prior
    weight, surprise, likelihood, crooked = 1.0, 0.0, -math.inf, 0.0
    foretold, rest, reaches = 0.0, 1.0, np.zeros(3)
    slope = np.zeros(size + 1)
    for iteration in range(ITERATIONS):
        root = np.linalg.cholesky(regressed @ after @ regressed.T + floor)
        factor = math.exp(float(model.features @ point[PARAMETERS:size]))
        further = model.indentation_m * float(model.breakaway @ point[PARAMETERS:size])
        values = np.maximum(factor * model.response(regressed @ point + POINTS @ root.T) + further, 0.0)
        if not np.isfinite(values).all():
            return Step(mean, cov, -math.inf, 0.0, 0.0, 1.0, np.zeros(3))
        centre = float(values.mean())
        white = POINTS.T @ (values - centre) / len(POINTS)
        along = np.linalg.solve(root.T, white)
        slope = along @ regressed
        slope[PARAMETERS:size] += centre * model.features + model.indentation_m * model.breakaway
        by_itself, by_contact = abs(centre), abs(along[PARAMETERS + 1])
        pushed = (1.0 - model.features[0]) * min(model.indentation_m, by_itself)
        breaking = BREAKAWAY_SHARE * model.indentation_m * float(model.breakaway[BREAKAWAY])
        by_contact = max(by_contact, pushed, breaking)
        noise = unmodelled + scatter[1] * by_itself**2 + scatter[2] * by_contact**2
        bent = float(((values - centre - POINTS @ white) ** 2).sum()) / (len(POINTS) - PARAMETERS - 3)
        crooked = max(bent, CROOKED * crooked)
        innovation = moved_m - centre - float(slope @ (before - point))
        variance = float(slope @ prior @ slope) + noise + crooked
        if iteration == 0:
            surprise = innovation / math.sqrt(variance)
            weight = min(1.0, (DEGREES + 1.0) / (DEGREES + surprise**2))
            likelihood = -0.5 * math.log(variance)
            likelihood -= 0.5 * (DEGREES + 1.0) * math.log1p(surprise**2 / DEGREES)
            reaches = np.array([slope[size], by_itself, by_contact])
            foretold, rest = innovation, variance - float(scatter @ reaches**2)
        gain = prior @ slope / variance
        new = before + weight * gain * innovation
        settled = bool(np.all(np.abs(new - point) < 0.05 * np.sqrt(np.diag(prior))))
        point = new
        after = prior - weight * np.outer(gain, gain) * variance
        after = 0.5 * (after + after.T)
        if settled and iteration > 0:
            break
    return Step(
        point[:size],
        after[:size, :size],
        likelihood,
        surprise,
        foretold,
        max(rest, POSITION_NOISE_M**2),
        reaches,
    )


def _spread_evenly(count: int, seed: int) -> Samples:
    """Points in seven dimensions, symmetric, with exactly zero mean and unit covariance."""
    half = np.random.default_rng(seed).standard_normal((count // 2, PARAMETERS + 2))
    points = np.vstack([half, -half])
    root = np.linalg.cholesky(points.T @ points / count)
    spread: Samples = np.linalg.solve(root, points.T).T
    return spread


POINTS = _spread_evenly(56, 8)
"""At which the displacement is made linear: eight a dimension; the seed is any that spreads them well."""
