"""What the planner believes of a cell: friction, contact and scatter, with their uncertainty.

Parameters are Gaussian in logarithms, where a plant that is 10 % off is 0.1 off::

    theta = (ln mu_k, ln k, ln b, ln(mu_s / mu_k), k_v)

and with them the weights of what the model lacks (`impactcell.positioning.displacement_discrepancy`). How
much taps scatter is learned beside (`impactcell.positioning.scatter_hypotheses`). The displacement folds over
as friction varies by more than some 10 %, so that one observation may have two explanations: friction that
is not known better than that is a sum of narrower Gaussians, weighted by how well each foretold what
happened (`impactcell.positioning.posterior_update`).
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from impactcell.positioning.displacement_discrepancy import LEARNED_STD as LEARNED_WEIGHTS_STD
from impactcell.positioning.displacement_discrepancy import PRIOR_STD as PRIOR_WEIGHTS_STD
from impactcell.positioning.displacement_discrepancy import largest_weight, log_bayes_factor
from impactcell.positioning.prediction_watch import ALARM, PredictionWatch, place_bets
from impactcell.positioning.scatter_hypotheses import mean_variances, prior_weights
from impactcell.records import Evidence, Samples, TapPredictions

FRICTION, STIFFNESS, DAMPING, RATIO, VISCOUS = range(5)
"""Where each parameter lies in theta."""
PARAMETERS = 5
"""Of theta; the weights of the discrepancy follow."""
LEARNED_STD = np.concatenate([[0.015, 0.03, 0.05, 0.02, 3.0], LEARNED_WEIGHTS_STD])
"""Left after a handful of taps."""
GAP_EVIDENCE = math.log(1e4)
"""ln of the Bayes factor from which on the model is said to lack something: 1 in 10 000 cells is false."""
DOUBT_SHARE = 0.5
"""Of the prior's standard deviation that the weights have on top, once predictions have been off."""
SHARPENED = 6.0
"""Power of the scatter's probabilities that a handful of taps leaves: what is likely becomes likelier."""
BATCH_STD = 0.08  # of friction, after a batch step whose size the tracker has not measured yet
LEVEL_STD = 0.007  # the tracker's level is believed no better than this: successive levels are correlated


@dataclass(frozen=True, slots=True, eq=False)
class PlannerPosterior:
    """Sum of Gaussians over the parameters and the discrepancy, and a grid over the scatter.

    Attributes
    ----------
    weights : ndarray, shape (c,)
        Probability of each component.
    means : ndarray, shape (c, n)
        n = 5 parameters and the weights of the discrepancy.
    covs : ndarray, shape (c, n, n)
    scatter_weights : ndarray, shape (g,)
        Probability of each combination of `impactcell.positioning.scatter_hypotheses`.
    taps : int
        Displacements learned from.
    surprise : float
        Last normalised innovation, with its sign.
    watch : PredictionWatch
        Whether predictions have been calibrated.
    """

    weights: Samples
    means: Samples
    covs: Samples
    scatter_weights: Samples = field(default_factory=prior_weights)
    taps: int = 0
    surprise: float = 0.0
    watch: PredictionWatch = field(default_factory=PredictionWatch)

    @property
    def scatter(self) -> float:
        """Predictive standard deviation of a tap's friction factor."""
        return math.sqrt(float(mean_variances(self.scatter_weights)[0]))

    @property
    def mean(self) -> Samples:
        """Mean of parameters and weights, shape (n,)."""
        mean: Samples = self.weights @ self.means
        return mean

    @property
    def cov(self) -> Samples:
        """Their covariance, shape (n, n)."""
        apart = self.means - self.mean
        cov: Samples = np.einsum("c,cij->ij", self.weights, self.covs) + (apart.T * self.weights) @ apart
        return cov

    @property
    def mu_k(self) -> float:
        """Kinetic coefficient, median."""
        return math.exp(float(self.mean[FRICTION]))


def tap_predictions(posterior: PlannerPosterior) -> TapPredictions:
    """Say what the taps so far tell of the model: whether it lacks something, and on what that depends."""
    mean, cov = posterior.mean[PARAMETERS:], posterior.cov[PARAMETERS:, PARAMETERS:]
    gap = log_bayes_factor(mean, cov)
    if gap >= GAP_EVIDENCE or not posterior.watch.alarming:
        depends_on, size, std = largest_weight(mean, cov)
        evidence = Evidence(statistic=gap, threshold=GAP_EVIDENCE, size=size, size_std=std)
        return TapPredictions(posterior.taps, gap >= GAP_EVIDENCE, depends_on, evidence)
    off = math.log(posterior.watch.evidence)
    size = posterior.watch.score * posterior.scatter
    evidence = Evidence(statistic=off, threshold=math.log(ALARM), size=size, size_std=posterior.scatter)
    return TapPredictions(posterior.taps, lacking=True, depends_on="", evidence=evidence)


def with_single_gaussian(posterior: PlannerPosterior, mean: Samples, cov: Samples) -> PlannerPosterior:
    """Posterior with one Gaussian over the parameters in place of what it had."""
    return replace(posterior, weights=np.ones(1), means=mean[None], covs=cov[None])


def prior(
    stiffness: float, damping: float, mu_s: float, mu_k: float, viscous: float, friction_std: float = 0.35
) -> PlannerPosterior:
    """Posterior before the first tap: contact within some 10 %, friction within a factor of 1.4.

    Parameters
    ----------
    stiffness, damping, mu_s, mu_k, viscous : float
        Nominal values, SI.
    friction_std : float
        Of ln mu_k.
    """
    mean = np.array(
        [
            math.log(mu_k),
            math.log(stiffness),
            math.log(max(damping, 1e-3 * math.sqrt(stiffness))),
            math.log(max(mu_s / mu_k, 1.0)),
            viscous,
        ]
    )
    std = np.array([friction_std, 0.12, 0.13, 0.03, 0.5 + 0.15 * viscous])
    mean = np.concatenate([mean, np.zeros(PRIOR_WEIGHTS_STD.size)])
    std = np.concatenate([std, PRIOR_WEIGHTS_STD])
    return PlannerPosterior(np.ones(1), mean[None], np.diag(std**2)[None])


def anticipate_learning(posterior: PlannerPosterior) -> PlannerPosterior:
    """Posterior as the next taps will leave it, for what is to be expected of the taps after them.

    One strike tells friction about as well as the scatter allows, and a few tell the contact; to plan as
    if nothing were learned any more would forbid the first tap of a new cell.
    """
    mean, cov = posterior.mean, posterior.cov
    factor = np.minimum(1.0, LEARNED_STD / np.sqrt(np.diag(cov)))
    scatter = posterior.scatter_weights**SHARPENED
    anticipated = with_single_gaussian(posterior, mean, cov * np.outer(factor, factor))
    return replace(anticipated, scatter_weights=scatter / scatter.sum())


def with_score(posterior: PlannerPosterior, score: float) -> PlannerPosterior:
    """Posterior after one more score of its predictions; where they turn out to be off, taps become cautious.

    A planner in doubt knows less of discrepancy and scatter than it thought: the covariance of the weights
    grows, and the probabilities of the scatter move halfway back to where they began.
    """
    watched = place_bets(posterior.watch, score)
    if posterior.watch.doubted or not watched.doubted:
        return replace(posterior, watch=watched)
    covs = posterior.covs.copy()
    weights = np.arange(PARAMETERS, covs.shape[1])
    covs[:, weights, weights] += (DOUBT_SHARE * PRIOR_WEIGHTS_STD) ** 2
    scatter = np.sqrt(posterior.scatter_weights * prior_weights())
    return replace(posterior, covs=covs, scatter_weights=scatter / scatter.sum(), watch=watched)


def condition_on_friction(
    posterior: PlannerPosterior, mu_k: float, std: float, *, batch_changed: bool
) -> PlannerPosterior:
    """Posterior after the tracker reported its level of the kinetic coefficient.

    The tracker's level is itself an average over the cycles this posterior has learned from, so the two are
    not fused as if they were independent: the better informed replaces the other (Jeffrey's rule), and
    the tracker prevails where they contradict each other. After a batch change friction starts afresh,
    and what had been learned together with it keeps only its own uncertainty.
    """
    mean, cov = posterior.mean, posterior.cov
    level, own = math.log(mu_k), float(cov[FRICTION, FRICTION])
    variance = (std / mu_k) ** 2 + LEVEL_STD**2
    difference = level - float(mean[FRICTION])
    contradicts = difference**2 > 9.0 * (own + variance)
    if batch_changed or contradicts:
        variance += BATCH_STD**2 if batch_changed else 0.09 * difference**2
        mean[FRICTION] = level
        cov[FRICTION, :] = cov[:, FRICTION] = 0.0
        cov[FRICTION, FRICTION] = variance
        return replace(with_single_gaussian(posterior, mean, cov), surprise=0.0)
    if variance >= own:
        return posterior
    regression = cov[:, FRICTION] / own
    mean = mean + regression * difference
    cov = cov - np.outer(regression, regression) * (own - variance)
    return with_single_gaussian(posterior, mean, cov)
