"""All that is known against a fitted model: the map, the candidates' scores, and whether they suffice."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data import (
    CoarseRaster,
    IndexArray,
    PreparedCampaign,
    beside_rasters,
    coarse_rasters,
)
from impactcell.discrepancy.model import Fit, Problem, Scores, linearise, scores
from impactcell.discrepancy.search import candidate_scores, residual_map
from impactcell.discrepancy.search.wild_bootstrap import BootstrapTests, wild_bootstrap
from impactcell.records import Samples

ALPHA = 0.01
"""Family-wise error of one step: map and candidates each get half of it."""

OVERWHELMING_GAIN = 150.0
"""A first-order gain, over what shots scatter, beyond which a few shots alone convict a model.

Mirroring whole shots can never make fewer than about eight shots significant, but a force channel that
saturates may do so in three.
"""


@dataclass(frozen=True, slots=True, eq=False)
class CandidateScan:
    """Scores of all candidates against one fit."""

    fit: Fit
    candidates: candidate_scores.CandidateDirections
    scores: Scores
    tests: BootstrapTests

    def gains(self) -> dict[str, float]:
        """Largest first-order gain of each candidate."""
        gains = {}
        for number, effect in enumerate(self.candidates.names):
            best = candidate_scores.best_points(self.candidates, self.scores, number, 1)
            gains[effect] = best[0][0] if best else 0.0
        return gains

    def seen(self) -> tuple[str, ...]:
        """Name the candidates of which these shots tell anything that the model could not take up."""
        found = set(self.candidates.group[self.scores.information > 0.0].tolist())
        return tuple(effect for number, effect in enumerate(self.candidates.names) if number in found)

    def p_value_of(self, effect: str) -> float:
        """Return the adjusted p-value of a candidate; 1 where it could not be tested."""
        if effect not in self.candidates.names:
            return 1.0
        return float(self.tests.p_adjusted[self.candidates.names.index(effect)])


@dataclass(frozen=True, slots=True, eq=False)
class ModelEvidence:
    """Evidence against one fit.

    Attributes
    ----------
    fit : Fit
    map, map_scores, map_tests
        Residuals of every phase against every covariate.
    candidate_scan : CandidateScan
        Candidates.
    p_value : float
        That the model lacks nothing, over map and candidates together.
    """

    fit: Fit
    map: residual_map.MapDirections
    map_scores: Scores
    map_tests: BootstrapTests
    candidate_scan: CandidateScan
    p_value: float


def evaluate_on(problem: Problem, fit: Fit) -> Fit:
    """Return the same model with the residuals of another selection of the same shots' samples."""
    model = problem.with_effects(fit.effects)
    return replace(fit, residual=model.residual(fit.theta, fit.shot_parameters))


def scan_candidates(
    coarse: Problem,
    fit: Fit,
    library: Sequence[str],
    seed: tuple[int, ...],
    rasters: Sequence[CoarseRaster | None] = (),
) -> CandidateScan:
    """Score every candidate against a fitted model, beside what rounding to `rasters` makes of it."""
    coarse_fit = _beside_rasters(coarse, evaluate_on(coarse, fit), rasters)
    linearisation = linearise(coarse, coarse_fit)
    directions = candidate_scores.candidate_directions(coarse, coarse_fit, linearisation, library)
    gains = scores(linearisation, directions.products)
    return CandidateScan(
        fit,
        directions,
        gains,
        wild_bootstrap(
            linearisation,
            gains,
            directions.group,
            (*seed, 2),
            directions.sign,
            gains.information if any(rasters) else None,
        ),
    )


def test_model(
    problems: tuple[Problem, Problem],
    fit: Fit,
    prepared: PreparedCampaign,
    library: Sequence[str],
    seed: tuple[int, ...],
) -> ModelEvidence:
    """Test a fitted model against the map, and against every candidate on fewer samples.

    Parameters
    ----------
    problems : tuple of Problem
        The shots with all samples, and with fewer of them.
    """
    problem, coarse = problems
    rasters = coarse_rasters(problem.shots.items)
    linearisation = linearise(problem, _beside_rasters(problem, fit, rasters))
    chart = residual_map.map_directions(problem, fit, linearisation, prepared)
    chart_scores = scores(linearisation, chart.products)
    chart_tests = wild_bootstrap(
        linearisation,
        chart_scores,
        chart.cell,
        (*seed, 1),
        least=_noise_of_rounding(chart.channel, chart_scores.information, rasters),
    )
    scanned = scan_candidates(coarse, fit, library, seed, rasters)
    smallest = min(
        float(chart_tests.p_adjusted.min(initial=1.0)), float(scanned.tests.p_adjusted.min(initial=1.0))
    )
    p_value = min(2.0 * smallest, 1.0)
    if _relative_gain(chart_scores) > OVERWHELMING_GAIN:
        p_value = min(p_value, 1e-4)
    return ModelEvidence(fit, chart, chart_scores, chart_tests, scanned, p_value)


def _beside_rasters(problem: Problem, fit: Fit, rasters: Sequence[CoarseRaster | None]) -> Fit:
    """Return the same model with the residuals that it leaves beside what rounding makes."""
    return replace(fit, residual=beside_rasters(problem.shots, fit.residual, rasters))


def _noise_of_rounding(
    channel: IndexArray, information: Samples, rasters: Sequence[CoarseRaster | None]
) -> Samples:
    """Variance that a score has by the noise floor, where samples are rounded, and else 0.

    Samples that all shots have rounded alike scatter by nothing, and any trifle would be significant.
    """
    is_rounded = np.array([*(raster is not None for raster in rasters), False])
    return np.where(is_rounded[channel], information, 0.0)


def _relative_gain(map_scores: Scores) -> float:
    """Largest gain over the dispersion that most directions show."""
    seen = map_scores.information > 0.0
    if not seen.any():
        return 0.0
    dispersion = (map_scores.each**2).sum(0)[seen] / map_scores.information[seen]
    return float(map_scores.gain.max() / max(float(np.median(dispersion)), 1.0))
