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
from functools import cached_property

import numpy as np

from impactcell.positioning.displacement_discrepancy import FEATURES, friction_features
from impactcell.positioning.displacement_discrepancy import LEARNED_STD as LEARNED_WEIGHTS_STD
from impactcell.positioning.prediction_watch import PredictionWatch
from impactcell.positioning.scatter_hypotheses import TailScores, mean_variances, prior_weights, tail_scores
from impactcell.records import Samples

FRICTION, STIFFNESS, DAMPING, RATIO, VISCOUS = range(5)
"""Where each parameter lies in theta."""
PARAMETERS = 5
"""Of theta; the weights of the discrepancy follow."""
LEARNED_STD = np.concatenate([[0.015, 0.03, 0.1, 0.02, 3.0], LEARNED_WEIGHTS_STD])
"""Left after a handful of taps; of the damping little is learned, slow pushes say nothing of it."""
SHARPENED = 6.0
"""Power of the scatter's probabilities that a handful of taps leaves: what is likely becomes likelier."""
BATCH_STD = 0.08  # of friction, after a batch step whose size the tracker has not measured yet
LEVEL_STD = 0.007  # the tracker's level is believed no better than this: successive levels are correlated


@dataclass(frozen=True, eq=False)
class PlannerPosterior:
    """Sums of Gaussians over the parameters and the discrepancy, and grids over the scatter.

    Each of h hypotheses has its own; `impactcell.positioning.model_hypotheses` has what they are. What a plan
    asks for several times is worked out once.

    Attributes
    ----------
    weights : ndarray, shape (c,)
        Probability of each component.
    means : ndarray, shape (c, n)
        n = 5 parameters and the weights of the discrepancy.
    covs : ndarray, shape (c, n, n)
    scatter_weights : ndarray, shape (h, g)
        Probability of each combination of `impactcell.positioning.scatter_hypotheses`.
    taps : int
        Displacements learned from.
    surprise : float
        Last normalised innovation, with its sign.
    watch : PredictionWatch
        Whether predictions have been calibrated.
    hypotheses : ndarray, shape (c,)
        Number of the hypothesis to which each component belongs.
    uncounted_evidence : float
        Part of the ln of the Bayes factor against the model that is not told: what a single tap said beyond
        what one may, what an extended model has taken in; negative for what a doubt would have taken back.
    """

    weights: Samples
    means: Samples
    covs: Samples
    scatter_weights: Samples = field(default_factory=lambda: prior_weights()[None])
    taps: int = 0
    surprise: float = 0.0
    watch: PredictionWatch = field(default_factory=PredictionWatch)
    hypotheses: Samples = field(default_factory=lambda: np.zeros(1))
    uncounted_evidence: float = 0.0

    @property
    def probabilities(self) -> Samples:
        """Of the hypotheses, shape (h,)."""
        return self._probabilities.copy()

    @property
    def mixed_scatter(self) -> Samples:
        """Probability of each combination of scatter over all hypotheses, shape (g,)."""
        mixed: Samples = self._probabilities @ self.scatter_weights
        return mixed

    @cached_property
    def scatter(self) -> float:
        """Predictive standard deviation of a tap's friction factor."""
        return math.sqrt(float(mean_variances(self.mixed_scatter)[0]))

    @cached_property
    def scatter_scores(self) -> TailScores:
        """How far each of the scatters reaches over all hypotheses."""
        return tail_scores(self.mixed_scatter)

    @property
    def mean(self) -> Samples:
        """Mean of parameters and weights, shape (n,)."""
        return self._moments[0].copy()

    @property
    def cov(self) -> Samples:
        """Their covariance, shape (n, n)."""
        return self._moments[1].copy()

    @property
    def mu_k(self) -> float:
        """Kinetic coefficient, median."""
        return math.exp(float(self.mean[FRICTION]))

    @cached_property
    def _probabilities(self) -> Samples:
        numbers = np.arange(len(self.scatter_weights))[:, None]
        probabilities: Samples = (self.hypotheses == numbers) @ self.weights
        return probabilities

    @cached_property
    def _moments(self) -> tuple[Samples, Samples]:
        mean: Samples = self.weights @ self.means
        apart = self.means - mean
        cov: Samples = np.einsum("c,cij->ij", self.weights, self.covs) + (apart.T * self.weights) @ apart
        return mean, cov


def with_single_gaussian(posterior: PlannerPosterior, mean: Samples, cov: Samples) -> PlannerPosterior:
    """Posterior with one Gaussian over the parameters, and one hypothesis, in place of what it had."""
    return replace(
        posterior,
        weights=np.ones(1),
        means=mean[None],
        covs=cov[None],
        scatter_weights=posterior.mixed_scatter[None],
        hypotheses=np.zeros(1),
    )


def mean_at(posterior: PlannerPosterior, part: Samples, place: Samples) -> Samples:
    """Mean with the friction that there is where the part lies, in place of that at 0.

    `part` and `place` as in `impactcell.positioning.displacement_quantiles.Scenarios`.
    """
    mean = posterior.mean
    mean[FRICTION] -= friction_features(part, place) @ mean[PARAMETERS:]
    return mean


def cov_at(posterior: PlannerPosterior, part: Samples, place: Samples) -> Samples:
    """Covariance with that friction."""
    xi = friction_features(part, place)
    cov = posterior.cov
    cov[FRICTION] -= xi @ cov[PARAMETERS:]
    cov[:, FRICTION] -= cov[:, PARAMETERS:] @ xi
    return cov


def prior_of_plant(
    stiffness: float, damping: float, mu_s: float, mu_k: float, viscous: float, friction_std: float = 0.35
) -> PlannerPosterior:
    """Posterior before the first tap, nothing missing: contact within 10 %, friction within a factor of 1.4.

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
    mean, std = np.append(mean, np.zeros(FEATURES)), np.append(std, np.zeros(FEATURES))
    return PlannerPosterior(np.ones(1), mean[None], np.diag(std**2)[None])


def anticipate_learning(posterior: PlannerPosterior) -> PlannerPosterior:
    """Posterior as the next taps will leave it, for what is to be expected of the taps after them.

    One strike tells friction about as well as the scatter allows, and a few tell the contact; to plan as
    if nothing were learned any more would forbid the first tap of a new cell.
    """
    mean, cov = posterior.mean, posterior.cov
    factor = np.minimum(1.0, LEARNED_STD / np.sqrt(np.maximum(np.diag(cov), 1e-300)))
    anticipated = with_single_gaussian(posterior, mean, cov * np.outer(factor, factor))
    scatter = anticipated.scatter_weights**SHARPENED
    return replace(anticipated, scatter_weights=scatter / scatter.sum())
