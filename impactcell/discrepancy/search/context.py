"""What all stages of a search share: the shots, what may be named, and the tests that a model has to pass."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from impactcell.discrepancy.data import PreparedCampaign
from impactcell.discrepancy.model import Fit, Problem
from impactcell.discrepancy.search.evidence import ALPHA, ModelEvidence, test_model
from impactcell.discrepancy.search.indistinguishability import total_log_likelihood
from impactcell.discrepancy.search.policy import POLICY
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY

Mapper = Callable[[Callable[[Any], Any], Iterable[Any]], list[Any]]
"""`map` that may work in parallel."""


@dataclass(frozen=True, slots=True, eq=False)
class SearchContext:
    """What a search works on.

    Attributes
    ----------
    problem, coarse : Problem
        The nominal model on all samples of the training shots, and on fewer.
    prepared : PreparedCampaign
        Of it the search reads the covariates.
    library : tuple of str
        Effects that may be named.
    seed : int
        Of the random numbers of all tests.
    mapper : callable
        Applies a function to many candidates, in parallel where it can.
    floor_is_certain : bool
        What is above the floor is a gap: the noise is stated, or sampled fast enough to be seen.
    known : tuple of Fit
        Fits of an earlier search, in which records were taken as they tell, fitted on to these shots: where
        a shot has more of its own, the nominal model may lie too far from them to come there.
    """

    problem: Problem
    coarse: Problem
    prepared: PreparedCampaign
    library: tuple[str, ...]
    seed: int
    mapper: Mapper
    floor_is_certain: bool
    known: tuple[Fit, ...] = ()

    def test_model(self, model: Fit) -> ModelEvidence:
        """All evidence against a model."""
        key = (self.seed, len(model.effects))
        return test_model((self.problem, self.coarse), model, self.prepared, self.library, key)

    def is_sufficient(self, evidence: ModelEvidence) -> bool:
        """Whether nothing significant is left, and nothing large either where the noise is stated."""
        return evidence.p_value > ALPHA and self.reaches_floor(evidence.fit)

    def is_closed(self, evidence: ModelEvidence) -> bool:
        """Whether what is left beside an effect is not significant, or too little to be worth a name."""
        if self.is_sufficient(evidence):
            return True
        return self.reaches_floor(evidence.fit) and not self.has_promising_candidate(evidence)

    def has_promising_candidate(self, evidence: ModelEvidence) -> bool:
        """Whether some candidate or some cell of the residual map promises enough to be worth a name.

        Gains are first-order falls of the squared misfit, twice those of the log-likelihood; of the friction
        factors, a number of shots times the share of their variance that is explained.
        """
        gains = evidence.candidate_scan.gains()
        map_gains, on_traces = evidence.map_scores.gain, evidence.map.channel >= 0
        trace_gains, factor_gains = map_gains[on_traces].tolist(), map_gains[~on_traces].tolist()
        for effect, gain in gains.items():
            (factor_gains if LIBRARY[effect].kind is Kind.BETWEEN_SHOTS else trace_gains).append(gain)
        explained_share = max(factor_gains, default=0.0) / self.problem.count
        return bool(
            max(trace_gains, default=0.0) > 2.0 * POLICY.min_gain
            or explained_share > 1.0 - POLICY.max_spread_ratio**2
        )

    def gains_enough(self, fewer: Fit, more: Fit) -> bool:
        """Whether one more effect explains enough to be worth a name, significant or not."""
        gain = total_log_likelihood(self.problem, more) - total_log_likelihood(self.problem, fewer)
        return gain > POLICY.min_gain or more.spread < POLICY.max_spread_ratio * fewer.spread

    def reaches_floor(self, model: Fit) -> bool:
        """Whether a model comes near the noise, where that is certain."""
        return not (self.floor_is_certain and self.gap(model) > POLICY.max_rms_at_floor)

    def gap(self, model: Fit) -> float:
        """Gap that a model leaves in the traces [noise floors]."""
        shots, sizes = self.problem.shots, self.problem.sizes
        return math.sqrt(shots.excitation.misfit_level(model.misfit(shots) / sizes, sizes))
