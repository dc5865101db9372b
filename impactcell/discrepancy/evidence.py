"""All that is known against a fitted model: the map, the candidates' scores, and whether they suffice."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy import locate, name
from impactcell.discrepancy.campaign import Material
from impactcell.discrepancy.fit import Fit, Problem
from impactcell.discrepancy.resample import Tests, test
from impactcell.discrepancy.tangent import Scores, Tangent, linearise, scores
from impactcell.records import Samples

ALPHA = 0.01
"""Family-wise error of one step: map and candidates each get half of it."""

OVERWHELMING = 150.0
"""A first-order gain, over what shots scatter, beyond which a few shots alone convict a model.

Mirroring whole shots can never make fewer than about eight shots significant, but a force channel that
saturates may do so in three.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Evidence against one fit.

    Attributes
    ----------
    fit : Fit
    map, candidates : Directions, Candidates
    map_tests, candidate_tests : Tests
    map_scores, candidate_scores : Scores
    p_value : float
        That the model lacks nothing, over map and candidates together.
    gain : float
        Largest first-order drop of the squared misfit by any single direction.
    """

    fit: Fit
    tangent: Tangent
    map: locate.Directions
    map_scores: Scores
    map_tests: Tests
    candidates: name.Candidates
    candidate_scores: Scores
    candidate_tests: Tests
    p_value: float
    gain: float

    def gains(self) -> dict[str, float]:
        """Largest first-order gain of each candidate."""
        made = {}
        for number, effect in enumerate(self.candidates.names):
            best = name.best_probes(self.candidates, self.candidate_scores, number, 1)
            made[effect] = best[0][0] if best else 0.0
        return made

    def p_of(self, effect: str) -> float:
        """Adjusted p-value of a candidate; 1 where it could not be tested."""
        if effect not in self.candidates.names:
            return 1.0
        return float(self.candidate_tests.adjusted[self.candidates.names.index(effect)])


def examine(
    problem: Problem, fit: Fit, material: Material, library: Sequence[str], seed: tuple[int, ...]
) -> Evidence:
    """Test a fitted model against the map and against every candidate."""
    tangent = linearise(problem, fit)
    chart = locate.directions(problem, fit, tangent, material)
    chart_scores = scores(tangent, chart.products)
    chart_tests = test(tangent, chart_scores, chart.cell, (*seed, 1))
    found = name.candidates(problem, fit, tangent, library)
    found_scores = scores(tangent, found.products)
    found_tests = test(tangent, found_scores, found.group, (*seed, 2), found.side)
    smallest = min(float(chart_tests.adjusted.min(initial=1.0)), float(found_tests.adjusted.min(initial=1.0)))
    p_value = min(2.0 * smallest, 1.0)
    if _overwhelming(chart_scores) > OVERWHELMING:
        p_value = min(p_value, 1e-4)
    gain = max(float(chart_scores.gain.max(initial=0.0)), float(found_scores.gain.max(initial=0.0)))
    return Evidence(
        fit, tangent, chart, chart_scores, chart_tests, found, found_scores, found_tests, p_value, gain
    )


def _overwhelming(made: Scores) -> float:
    """Largest gain over the dispersion that most directions show."""
    seen = made.information > 0.0
    if not seen.any():
        return 0.0
    dispersion: Samples = (made.each**2).sum(0)[seen] / made.information[seen]
    return float(made.gain.max() / max(float(np.median(dispersion)), 1.0))
