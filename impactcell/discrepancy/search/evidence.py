"""All that is known against a fitted model: the map, the candidates' scores, and whether they suffice."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data.prepared_campaign import Material
from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.linearisation import Scores, linearise, scores
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.search import candidate_scores, residual_map
from impactcell.discrepancy.search.wild_bootstrap import Tests, resampled

ALPHA = 0.01
"""Family-wise error of one step: map and candidates each get half of it."""

OVERWHELMING = 150.0
"""A first-order gain, over what shots scatter, beyond which a few shots alone convict a model.

Mirroring whole shots can never make fewer than about eight shots significant, but a force channel that
saturates may do so in three.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """Scores of all candidates against one fit."""

    fit: Fit
    candidates: candidate_scores.Candidates
    scores: Scores
    tests: Tests

    def gains(self) -> dict[str, float]:
        """Largest first-order gain of each candidate."""
        made = {}
        for number, effect in enumerate(self.candidates.names):
            best = candidate_scores.best_probes(self.candidates, self.scores, number, 1)
            made[effect] = best[0][0] if best else 0.0
        return made

    def p_of(self, effect: str) -> float:
        """Return the adjusted p-value of a candidate; 1 where it could not be tested."""
        if effect not in self.candidates.names:
            return 1.0
        return float(self.tests.adjusted[self.candidates.names.index(effect)])


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Evidence against one fit.

    Attributes
    ----------
    fit : Fit
    map, map_scores, map_tests
        Residuals of every phase against every covariate.
    scan : Scan
        Candidates.
    p_value : float
        That the model lacks nothing, over map and candidates together.
    """

    fit: Fit
    map: residual_map.Directions
    map_scores: Scores
    map_tests: Tests
    scan: Scan
    p_value: float


def at_problem(problem: Problem, fit: Fit) -> Fit:
    """Return the same model with the residuals of another selection of the same shots' samples."""
    return replace(fit, residual=problem.residual(fit.effects, fit.at, fit.local))


def scan(coarse: Problem, fit: Fit, library: Sequence[str], seed: tuple[int, ...]) -> Scan:
    """Score every candidate against a fitted model."""
    here = at_problem(coarse, fit)
    tangent = linearise(coarse, here)
    found = candidate_scores.candidates(coarse, here, tangent, library)
    made = scores(tangent, found.products)
    return Scan(fit, found, made, resampled(tangent, made, found.group, (*seed, 2), found.side))


def examine(
    problem: Problem,
    coarse: Problem,
    fit: Fit,
    material: Material,
    library: Sequence[str],
    seed: tuple[int, ...],
) -> Evidence:
    """Test a fitted model against the map, and against every candidate on fewer samples."""
    tangent = linearise(problem, fit)
    chart = residual_map.directions(problem, fit, tangent, material)
    chart_scores = scores(tangent, chart.products)
    chart_tests = resampled(tangent, chart_scores, chart.cell, (*seed, 1))
    scanned = scan(coarse, fit, library, seed)
    smallest = min(
        float(chart_tests.adjusted.min(initial=1.0)), float(scanned.tests.adjusted.min(initial=1.0))
    )
    p_value = min(2.0 * smallest, 1.0)
    if _overwhelming(chart_scores) > OVERWHELMING:
        p_value = min(p_value, 1e-4)
    return Evidence(fit, chart, chart_scores, chart_tests, scanned, p_value)


def _overwhelming(made: Scores) -> float:
    """Largest gain over the dispersion that most directions show."""
    seen = made.information > 0.0
    if not seen.any():
        return 0.0
    dispersion = (made.each**2).sum(0)[seen] / made.information[seen]
    return float(made.gain.max() / max(float(np.median(dispersion)), 1.0))
