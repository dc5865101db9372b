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
    SLIDE,
)
from impactcell.positioning.mixture_components import (
    merge_components,
    split_components,
    within_most_components,
)
from impactcell.positioning.model_hypotheses import (
    join,
    parts_of,
    reweighted,
    swing_stds,
    with_evidence_of_a_tap,
)
from impactcell.positioning.planner_posterior import (
    BATCH_STD,
    FRICTION,
    PARAMETERS,
    PlannerPosterior,
)
from impactcell.positioning.prediction_watch import POSITION_NOISE_M
from impactcell.positioning.scatter_hypotheses import mean_variances, update_weights
from impactcell.positioning.tap_model import Response, TapModel
from impactcell.records import Samples

DEGREES = 8.0  # of freedom of the likelihood
# Random walk a tap, in units of the parameters: wear of friction, a slow change of the contact, and static
# friction that ages with the time at rest, by some per cent a decade: what is learned of it does not last.
WALK = np.concatenate([[1.5e-3, 3e-4, 6e-4, 4e-3, 0.02], np.zeros(FEATURES)])
NEGLIGIBLE = 1e-4  # weight of a component that is dropped
STILL = 2.0  # standard deviations of the sensor, within which a part has not moved
ITERATIONS = 4  # of the linearisation; the last change is below a twentieth of a standard deviation
CROOKED = 0.1  # of the first regression's remainder that stays, whatever the later ones leave over
IMPOSSIBLE = 6.0
"""Standard deviations by which a Gaussian has to be off to be no explanation of a part that lies still."""
SURPRISING = 3.0
"""Standard deviations by which a tap has to be off to be one that was not foretold."""
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
    posterior: PlannerPosterior,
    response: Response | TapModel,
    moved_m: float,
    noise_m: float = POSITION_NOISE_M,
) -> PlannerPosterior:
    """Posterior after a tap displaced the part by `moved_m`, `response` being the model of that tap.

    Parameters
    ----------
    noise_m : float
        Standard deviation with which a displacement is measured.
    """
    model = response if isinstance(response, TapModel) else TapModel(response)
    updates = [
        update_hypothesis(part, model._replace(swing_m=std * model.swing_m), moved_m, noise_m)
        for part, std in zip(parts_of(posterior), swing_stds(posterior), strict=True)
    ]
    parts = [part for part, _ in updates]
    log_evidence = np.array([evidence for _, evidence in updates])
    probabilities = posterior.probabilities
    if np.isfinite(log_evidence).any():
        probabilities = reweighted(probabilities, log_evidence)
    surprise = float(probabilities @ np.array([part.surprise for part in parts]))
    learned = join(parts, probabilities, posterior)
    slides_easier = learned.mean[FRICTION] < posterior.mean[FRICTION]
    if is_still(moved_m, noise_m) and abs(surprise) > SURPRISING and slides_easier:
        parts = [unexplained(part, surprise) for part in parts_of(posterior)]
        learned = join(parts, posterior.probabilities, posterior)
    learned = replace(learned, taps=posterior.taps + 1, surprise=surprise)
    return with_evidence_of_a_tap(learned, posterior)


def update_hypothesis(
    before: PlannerPosterior, model: TapModel, moved_m: float, noise_m: float
) -> tuple[PlannerPosterior, float]:
    """Posterior under one hypothesis after a tap, and the logarithm of its density at `moved_m`."""
    posterior = within_most_components(split_components(before))
    scatter = mean_variances(posterior.scatter_weights[0])
    steps = [
        update_component(mean, cov + np.diag(WALK**2), scatter, model, moved_m, noise_m)
        for mean, cov in zip(posterior.means, posterior.covs, strict=True)
    ]
    with np.errstate(divide="ignore"):
        logarithm = np.log(posterior.weights) + [step.likelihood for step in steps]
    if not np.isfinite(logarithm).any():
        return posterior, -math.inf
    weights = np.exp(logarithm - logarithm.max())
    weights /= weights.sum()
    possible = np.isfinite(logarithm)
    surprises = np.array([step.surprise for step in steps])
    if is_still(moved_m, noise_m) and (np.abs(surprises) > IMPOSSIBLE).all():
        return unexplained(before, float(posterior.weights @ surprises)), -math.inf
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
    surprise = float(weights @ surprises[keep])
    learned = replace(
        posterior,
        weights=weights,
        means=np.array([step.mean for step in kept]),
        covs=np.array([step.cov for step in kept]),
        scatter_weights=scatter_weights[None],
        surprise=surprise,
        hypotheses=np.zeros(len(kept)),
    )
    return merge_components(with_step_held_possible(learned, before.surprise)), density


def is_still(moved_m: float, noise_m: float) -> bool:
    """Whether a part has not moved, as far as its displacement is measured."""
    return abs(moved_m) < STILL * noise_m


def unexplained(before: PlannerPosterior, surprise: float) -> PlannerPosterior:
    """Posterior under one hypothesis after a part lay still, though all that it holds possible moves it.

    Which of that is least wrong says nothing: often it is a part that slides more easily, whose way is the
    least certain.
    """
    return with_step_held_possible(replace(before, surprise=surprise), before.surprise)


def with_step_held_possible(posterior: PlannerPosterior, surprise_before: float) -> PlannerPosterior:
    """Posterior that holds a change of friction possible that nobody announced: two in a row on one side."""
    if not (abs(posterior.surprise) > SURPRISING and surprise_before * posterior.surprise > 6.0):
        return posterior
    covs = posterior.covs.copy()
    covs[:, FRICTION, FRICTION] += BATCH_STD**2
    return replace(posterior, covs=covs)


def update_component(
    mean: Samples, cov: Samples, scatter: Samples, model: TapModel, moved_m: float, noise_m: float
) -> Step:
    """One Gaussian after one displacement; `scatter` has the expected squares of the three of it.

    What is regressed are the parameters, the tap's friction factor and psi · w; the slope over phi · w, which
    acts on the logarithm, is known.
    """
    size = mean.size
    regressed = np.zeros((PARAMETERS + 2, size + 1))
    regressed[np.arange(PARAMETERS), np.arange(PARAMETERS)] = 1.0
    regressed[FRICTION, PARAMETERS:size] = -model.easing
    regressed[PARAMETERS, size] = 1.0
    regressed[PARAMETERS + 1, PARAMETERS:size] = model.indenting
    before = np.append(mean, 0.0)
    prior = np.zeros((size + 1, size + 1))
    prior[:size, :size] = cov
    prior[size, size] = scatter[0]
    floor = np.diag(LEAST_STD**2)
    unmodelled = noise_m**2 + (HALTING_STD * model.halting_m) ** 2 + model.swing_m**2
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
        pushed = (1.0 - model.features[SLIDE]) * min(model.indentation_m, by_itself)
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
        max(rest, noise_m**2),
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
