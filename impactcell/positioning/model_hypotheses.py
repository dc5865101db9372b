"""How much the planner's model lacks: four hypotheses, averaged, and the evidence that it lacks anything.

Under each, the weights of the discrepancy have another standard deviation beforehand: the model is right
but for some tenths of a per cent; it lacks resistance that grows with speed, for which it has a parameter; it
is off as models usually are; something essential is missing. Each learns parameters, weights and scatter of
its own, and each tap shifts its probability by how well it foretold that tap (Bayesian model averaging:
Hoeting et al., Statistical Science 14, 1999). So scatter and discrepancy are told apart, large discrepancies
are believed within a few taps, and a model that is right costs none.

A model is complete where the first hypothesis holds and the contact is the same at each tap: one that gives
way by some tenths more or less is not the one the model has, and such a scatter would explain away whatever
is missing there. Friction and displacement may scatter. With nothing missing, the Bayes factor of all else
over this has expectation 1 after any number of taps, so that it exceeds 1/alpha at any time with a
probability of at most alpha (Ville, 1939). Of all scatters of the displacement the one counts that speaks
most for the model, so that this holds for each of them and not for their mean.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impactcell.positioning.displacement_discrepancy import (
    FEATURES,
    MASS_KG,
    SPEED_M_S,
    largest_weight,
)
from impactcell.positioning.planner_posterior import (
    BATCH_STD,
    FRICTION,
    LEVEL_STD,
    PARAMETERS,
    VISCOUS,
    PlannerPosterior,
    prior_of_plant,
    with_single_gaussian,
)
from impactcell.positioning.prediction_watch import ALARM, PredictionWatch, place_bets
from impactcell.positioning.scatter_hypotheses import (
    GRID,
    PRIOR_WEIGHTS,
    prior_weights,
    same_contact_by_displacement,
)
from impactcell.records import Evidence, Samples, TapPredictions

WEIGHTS_STD = np.array([0.002, 0.005, 0.025, 0.16])
"""Of the weights beforehand, under each hypothesis: relative to a displacement, or to an indentation."""
VISCOUS_STD = np.array([0.0, 60.0, 4.0, 24.0])
"""Of k_v beforehand on top of what the model says, N s/m: as much as slows a light part by half."""
SWING = np.array([0.0, 0.2, 0.5, 0.5])
"""Standard deviation, in `swing_m`, of what the swing of a pushed part is off by under each hypothesis."""
PROBABILITIES = np.array([0.72, 0.06, 0.15, 0.07])
"""Of the hypotheses before the first tap: most models are right but for friction; a choice."""
COMPLETE = PROBABILITIES[0] * same_contact_by_displacement(PRIOR_WEIGHTS)
"""Probability before the first tap that the model is complete, with each scatter of the displacement."""
RESISTANCE = 1
"""The hypothesis that resistance grows with speed and nothing else is missing."""
GRAVITY_M_S2 = 9.81
"""For what is said of a resistance in per cent of friction."""
LEAST_PROBABILITY = 1e-6
"""Of a hypothesis, however long another was right: what a cell lacks may come later."""
STEP_STD, STEP_PROBABILITY = 0.25, 0.01
"""Of ln(friction) in a step that nobody announced, and how probable one is where a doubt begins."""
MOST_EVIDENCE_OF_A_TAP = math.log(1e3)
"""ln of the factor by which one tap may tell two hypotheses apart: an outlier is no proof."""
GAP_EVIDENCE = math.log(1e4)
"""ln of the Bayes factor from which on the model is said to lack something: 1 in 10 000 cells is false."""


def prior(
    stiffness: float, damping: float, mu_s: float, mu_k: float, viscous: float, friction_std: float = 0.35
) -> PlannerPosterior:
    """Posterior before the first tap, under all hypotheses; arguments as in `prior_of_plant`."""
    plant = prior_of_plant(stiffness, damping, mu_s, mu_k, viscous, friction_std)
    parts = [_lacking(plant, *std) for std in zip(WEIGHTS_STD, VISCOUS_STD, strict=True)]
    return join(parts, PROBABILITIES, plant)


def _lacking(plant: PlannerPosterior, std: float, viscous_std: float) -> PlannerPosterior:
    covs = plant.covs.copy()
    weights = np.arange(PARAMETERS, PARAMETERS + FEATURES)
    covs[:, weights, weights] = std**2
    covs[:, VISCOUS, VISCOUS] += viscous_std**2
    return replace(plant, covs=covs)


def parts_of(posterior: PlannerPosterior) -> list[PlannerPosterior]:
    """Posterior under each hypothesis, as if there were no other."""
    parts = []
    for n, probability in enumerate(posterior.probabilities):
        chosen = posterior.hypotheses == n
        part = replace(
            posterior,
            weights=posterior.weights[chosen] / probability,
            means=posterior.means[chosen],
            covs=posterior.covs[chosen],
            scatter_weights=posterior.scatter_weights[n : n + 1],
            hypotheses=np.zeros(int(chosen.sum())),
        )
        parts.append(part)
    return parts


def join(
    parts: Sequence[PlannerPosterior], probabilities: Samples, posterior: PlannerPosterior
) -> PlannerPosterior:
    """Posterior of all hypotheses; what does not belong to one of them is that of `posterior`."""
    floored = np.maximum(probabilities / probabilities.sum(), LEAST_PROBABILITY)
    floored /= floored.sum()
    return replace(
        posterior,
        weights=np.concatenate([p * part.weights for p, part in zip(floored, parts, strict=True)]),
        means=np.concatenate([part.means for part in parts]),
        covs=np.concatenate([part.covs for part in parts]),
        scatter_weights=np.concatenate([part.scatter_weights for part in parts]),
        hypotheses=np.repeat(np.arange(float(len(parts))), [part.weights.size for part in parts]),
    )


def swing_stds(posterior: PlannerPosterior) -> Samples:
    """Return `SWING` for each of its hypotheses; 0 for a posterior that has one alone."""
    return SWING if posterior.probabilities.size == SWING.size else np.zeros(1)


def swing_std(posterior: PlannerPosterior) -> float:
    """Return the standard deviation of the swing over all hypotheses."""
    return math.sqrt(float(posterior.probabilities @ swing_stds(posterior) ** 2))


def reweighted(probabilities: Samples, log_evidence: Samples) -> Samples:
    """Probabilities of the hypotheses after a tap that they foretold with these log densities."""
    told = np.maximum(log_evidence, log_evidence.max() - MOST_EVIDENCE_OF_A_TAP)
    likely = probabilities * np.exp(told - told.max())
    after: Samples = likely / likely.sum()
    return after


def log_bayes_factor(posterior: PlannerPosterior) -> float:
    """Evidence that something is missing: Bayes factor of all else over a complete model, ln."""
    return _evidence_of_all_taps(posterior) - posterior.uncounted_evidence


def _evidence_of_all_taps(posterior: PlannerPosterior) -> float:
    """Return the logarithm of that factor as probabilities have it, whatever is told of it."""
    probabilities = posterior.probabilities
    if probabilities.size < WEIGHTS_STD.size:
        return 0.0
    complete = probabilities[0] * same_contact_by_displacement(posterior.scatter_weights[0])
    all_else = (1.0 - float(complete.sum())) / (1.0 - float(COMPLETE.sum()))
    return math.log(all_else) - math.log(max(float((complete / COMPLETE).max()), sys.float_info.min))


def with_evidence_of_a_tap(after: PlannerPosterior, before: PlannerPosterior) -> PlannerPosterior:
    """Posterior after a tap, telling of what it said against the model no more than one tap may.

    What it said beyond stays uncounted; later taps that speak for the model take it from there first.
    """
    said = _evidence_of_all_taps(after) - _evidence_of_all_taps(before)
    uncounted = before.uncounted_evidence + max(said - MOST_EVIDENCE_OF_A_TAP, 0.0)
    if said < 0.0 < uncounted:
        uncounted = max(uncounted + said, 0.0)
    return replace(after, uncounted_evidence=uncounted)


def tap_predictions(posterior: PlannerPosterior) -> TapPredictions:
    """Say what the taps so far tell of the model: whether it lacks something, and on what that depends."""
    gap = log_bayes_factor(posterior)
    if gap >= GAP_EVIDENCE or not posterior.watch.alarming:
        probabilities = posterior.probabilities
        likeliest = 1 + int(probabilities[1:].argmax()) if probabilities.size > 1 else 0
        part, weights = parts_of(posterior)[likeliest], slice(PARAMETERS, None)
        depends_on, size, std = largest_weight(part.mean[weights], part.cov[weights, weights])
        if likeliest == RESISTANCE:
            # of the force of friction, at a speed and a mass in the middle
            relative = SPEED_M_S / (part.mu_k * MASS_KG * GRAVITY_M_S2)
            depends_on, size = "velocity", -relative * float(part.mean[VISCOUS])
            std = relative * math.sqrt(float(part.cov[VISCOUS, VISCOUS]))
        scatter = posterior.scatter_weights[0]
        differs = float(probabilities[0]) * (1.0 - float(same_contact_by_displacement(scatter).sum()))
        if differs > probabilities[1:].max(initial=0.0):
            # the contact's, from tap to tap, of the indentation
            depends_on, size = "contact", float(scatter @ GRID[:, 2])
            std = math.sqrt(float(scatter @ (GRID[:, 2] - size) ** 2))
        evidence = Evidence(statistic=gap, threshold=GAP_EVIDENCE, size=size, size_std=std)
        return TapPredictions(posterior.taps, gap >= GAP_EVIDENCE, depends_on, evidence)
    watch, std = posterior.watch, posterior.scatter
    off = math.log(watch.told_evidence)
    evidence = Evidence(
        statistic=off,
        threshold=math.log(ALARM),
        size=watch.mean_score * std,
        size_std=std / math.sqrt(max(watch.off_taps, 1)),
    )
    return TapPredictions(watch.off_taps, lacking=True, depends_on="", evidence=evidence)


def with_model_accepted(posterior: PlannerPosterior) -> PlannerPosterior:
    """Posterior once the model has been extended by what was missing.

    How far taps move a part is what was learned under the likeliest hypothesis; that is now what the model
    says, and the hypotheses are about what may be missing beside it. Taps to come have to show whether it is.
    """
    if posterior.probabilities.size < WEIGHTS_STD.size:
        return replace(posterior, watch=PredictionWatch())
    learned = parts_of(posterior)[int(posterior.probabilities.argmax())]
    weights = np.arange(PARAMETERS, learned.covs.shape[1])
    parts = []
    for std, viscous_std in zip((0.0, *WEIGHTS_STD[1:]), VISCOUS_STD, strict=True):
        covs = learned.covs.copy()
        covs[:, weights, weights] += std**2
        covs[:, VISCOUS, VISCOUS] += viscous_std**2
        parts.append(replace(learned, covs=covs))
    accepted = join(parts, PROBABILITIES, replace(posterior, watch=PredictionWatch()))
    return replace(accepted, uncounted_evidence=_evidence_of_all_taps(accepted))


def with_score(posterior: PlannerPosterior, score: float) -> PlannerPosterior:
    """Posterior after one more score of its predictions; where they turn out to be off, taps become cautious.

    A planner in doubt knows less of discrepancy and scatter than it thought: the probabilities of both move
    halfway back to where they began, and friction may have stepped. Predictions that are off are no evidence
    that the model is right, nor by themselves that it lacks something: what taps have said against it stays
    said, and no more.
    """
    watched = place_bets(posterior.watch, score)
    probabilities = posterior.probabilities
    if posterior.watch.doubted or not watched.doubted:
        return replace(posterior, watch=watched)
    scatter = np.sqrt(posterior.scatter_weights * prior_weights())
    doubting = replace(posterior, scatter_weights=scatter / scatter.sum(axis=1, keepdims=True), watch=watched)
    if probabilities.size < WEIGHTS_STD.size:
        return doubting
    halfway = np.sqrt(probabilities * PROBABILITIES)
    right = min(float(halfway[0] / halfway.sum()), float(probabilities[0]))
    lacking = (1.0 - right) * halfway[1:] / halfway[1:].sum()
    parts = [_with_step_of_friction(part) for part in parts_of(doubting)]
    doubting = join(parts, np.append(right, lacking), doubting)
    said = log_bayes_factor(posterior)
    told = max(said, min(log_bayes_factor(doubting), 0.0))
    return replace(doubting, uncounted_evidence=_evidence_of_all_taps(doubting) - told)


def _with_step_of_friction(part: PlannerPosterior) -> PlannerPosterior:
    """One hypothesis that holds possible that friction has just stepped."""
    stepped = part.covs.copy()
    stepped[:, FRICTION, FRICTION] += STEP_STD**2
    weights = np.outer([1.0 - STEP_PROBABILITY, STEP_PROBABILITY], part.weights).ravel()
    return replace(
        part,
        weights=weights,
        means=np.tile(part.means, (2, 1)),
        covs=np.concatenate([part.covs, stepped]),
        hypotheses=np.zeros(weights.size),
    )


def condition_on_friction(
    posterior: PlannerPosterior, mu_k: float, std: float, *, batch_changed: bool
) -> PlannerPosterior:
    """Posterior after the tracker reported its level of the kinetic coefficient, under each hypothesis.

    The tracker's level is itself an average over the cycles this posterior has learned from, so the two are
    not fused as if they were independent: the better informed replaces the other (Jeffrey's rule), and
    the tracker prevails where they contradict each other. After a batch change friction starts afresh,
    and what had been learned together with it keeps only its own uncertainty.
    """
    before = parts_of(posterior)
    parts = [_conditioned(part, mu_k, std, batch_changed=batch_changed) for part in before]
    if all(part is known for part, known in zip(parts, before, strict=True)):
        return posterior
    told = posterior if all(part.surprise for part in parts) else replace(posterior, surprise=0.0)
    return join(parts, posterior.probabilities, told)


def _conditioned(part: PlannerPosterior, mu_k: float, std: float, *, batch_changed: bool) -> PlannerPosterior:
    mean, cov = part.mean, part.cov
    level, own = math.log(mu_k), float(cov[FRICTION, FRICTION])
    variance = (std / mu_k) ** 2 + LEVEL_STD**2
    difference = level - float(mean[FRICTION])
    contradicts = difference**2 > 9.0 * (own + variance)
    if batch_changed or contradicts:
        variance += BATCH_STD**2 if batch_changed else 0.09 * difference**2
        mean[FRICTION] = level
        cov[FRICTION, :] = cov[:, FRICTION] = 0.0
        cov[FRICTION, FRICTION] = variance
        return replace(with_single_gaussian(part, mean, cov), surprise=0.0)
    if variance >= own:
        return part
    regression = cov[:, FRICTION] / own
    mean = mean + regression * difference
    cov = cov - np.outer(regression, regression) * (own - variance)
    return with_single_gaussian(part, mean, cov)
