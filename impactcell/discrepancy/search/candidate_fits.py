"""Fits that a search tries: several starts of every promising effect, a race, and the finalists.

A few Gauss-Newton steps on few samples tell who cannot win; the likeliest run to the end, on all samples.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.prepared_campaign import PreparedCampaign
from impactcell.discrepancy.model.fit import Fit, fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.search import candidate_scores
from impactcell.discrepancy.search.evidence import ALPHA, CandidateScan, ModelEvidence, test_model
from impactcell.discrepancy.search.indistinguishability import (
    CandidateFit,
    are_indistinguishable,
    rank_out_of_shot,
    sort_by_likelihood,
    total_log_likelihood,
)
from impactcell.errors import DiscrepancyError
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY
from impactcell.records import Samples

MAX_SCREENED = 10
REFINE_STEPS = 25
START_STEPS = 2
SCREEN_STEPS = 5
MAX_REFINED = 5
FINAL_STEPS = 40
MIN_FINALISTS = 2
MAX_FINALISTS = 6
STARTS_PER_EFFECT = 2
MIN_SCREENED_GAIN = 15.0
MAX_RMS_AT_FLOOR = 1.1
MIN_GAIN = 30.0
"""Log-likelihood that a second effect has to add; an effect that is worth less has no visible gap."""
MAX_SPREAD_RATIO = 0.85
"""Or by which factor it has to lower the spread of the friction factors, if it acts between shots."""
BOUND_SHARE = 0.01
"""Share of the (logarithmic) range of a shape that counts as its end."""

Mapper = Callable[[Callable[[Any], Any], Iterable[Any]], list[Any]]


def _fit_from_starts(task: tuple[Problem, tuple[str, ...], list[Samples], Fit, int]) -> Fit | None:
    """Fit a set of effects from several starts of its last effect, and keep the best.

    None if the plant has no answer at any start.
    """
    problem, effects, starts, base, steps = task
    first = min(steps, START_STEPS) if len(starts) > 1 else steps
    tried = [
        _fit_or_none(problem, effects, np.concatenate([base.theta, start]), base, first) for start in starts
    ]
    best = next(iter(sort_by_likelihood(problem, [fitted for fitted in tried if fitted is not None])), None)
    if best is None or first == steps:
        return best
    return _fit_or_none(problem, effects, best.theta, best, steps - first) or best


def _fit_or_none(
    problem: Problem, effects: tuple[str, ...], theta: Samples, base: Fit, steps: int
) -> Fit | None:
    try:
        return fit(problem, effects, theta, base.shot_parameters, spread=base.spread, most_steps=steps)
    except DiscrepancyError:
        return None


def is_at_bound(model: Fit) -> bool:
    """Whether the shape of an effect was fitted to the end of its range.

    It is then used for something that it is not: a patch wider than any slide is a gradient of friction.
    """
    return any(
        coordinate.effect
        and coordinate.form == "log"
        and min(float(theta) - coordinate.lower, coordinate.upper - float(theta))
        < BOUND_SHARE * (coordinate.upper - coordinate.lower)
        for coordinate, theta in zip(model.coordinates, model.theta, strict=True)
    )


def prefer_interior(problem: Problem, ranking: list[CandidateFit]) -> list[CandidateFit]:
    """Put what is tied with the likeliest, and fitted inside its range, before a likeliest that is not."""
    if not ranking or not is_at_bound(ranking[0].fit):
        return ranking
    inside = [
        candidate
        for candidate in ranking[1:]
        if not is_at_bound(candidate.fit) and are_indistinguishable(problem, ranking[0], candidate)
    ]
    return [*inside, *(candidate for candidate in ranking if candidate not in inside)]


@dataclass(frozen=True, slots=True, eq=False)
class SearchContext:
    """What a search works on: all samples, fewer of them, and what may be named.

    `floor_is_certain` says that the noise is stated, so that what is left above it is a gap.
    """

    problem: Problem
    coarse: Problem
    prepared: PreparedCampaign
    library: tuple[str, ...]
    seed: int
    mapper: Mapper
    floor_is_certain: bool

    def test_model(self, model: Fit) -> ModelEvidence:
        """All evidence against a model."""
        key = (self.seed, len(model.effects))
        return test_model(self.problem, self.coarse, model, self.prepared, self.library, key)

    def is_sufficient(self, evidence: ModelEvidence) -> bool:
        """Whether nothing significant is left, and nothing large either where the noise is stated."""
        return evidence.p_value > ALPHA and self.reaches_floor(evidence.fit)

    def is_closed(self, evidence: ModelEvidence) -> bool:
        """Whether what is left beside an effect is not significant, or too little to be worth a name."""
        return self.is_sufficient(evidence) or (
            self.reaches_floor(evidence.fit) and not self.has_promising(evidence)
        )

    def has_promising(self, evidence: ModelEvidence) -> bool:
        """Whether some candidate or some cell of the map promises enough to be worth a name."""
        gains = evidence.candidate_scan.gains()
        promised = [gain for effect, gain in gains.items() if LIBRARY[effect].kind is not Kind.BETWEEN_SHOTS]
        between = [gain for effect, gain in gains.items() if LIBRARY[effect].kind is Kind.BETWEEN_SHOTS]
        chart, gain = evidence.map, evidence.map_scores.gain
        promised += gain[chart.channel >= 0].tolist()
        between += gain[chart.channel < 0].tolist()
        share = max(between, default=0.0) / self.problem.count
        return max(promised, default=0.0) > 2.0 * MIN_GAIN or share > 1.0 - MAX_SPREAD_RATIO**2

    def gains_enough(self, fewer: Fit, more: Fit) -> bool:
        """Whether one more effect explains enough to be worth a name, significant or not."""
        gain = total_log_likelihood(self.problem, more) - total_log_likelihood(self.problem, fewer)
        return gain > MIN_GAIN or more.spread < MAX_SPREAD_RATIO * fewer.spread

    def reaches_floor(self, model: Fit) -> bool:
        """Whether a model comes near the noise, where that is stated."""
        misfit_per_sample = model.misfit(self.problem.shots) / self.problem.sizes
        # A driven block in which stick ends at the wrong moment is far off whatever the model.
        driven = self.problem.shots.excitation is Excitation.DRIVEN
        misfit = float(
            np.median(misfit_per_sample)
            if driven
            else np.average(misfit_per_sample, weights=self.problem.sizes)
        )
        return not (self.floor_is_certain and misfit > MAX_RMS_AT_FLOOR**2)

    def refit_on_all_samples(self, fits: Sequence[Fit]) -> list[CandidateFit]:
        """Refit on all samples, the likeliest out of shot first."""
        tasks = [(self.problem, model.effects, [np.empty(0)], model, FINAL_STEPS) for model in fits]
        return rank_out_of_shot(
            self.problem, [fitted for fitted in self.mapper(_fit_from_starts, tasks) if fitted is not None]
        )


def screen(context: SearchContext, scanned: CandidateScan, max_effects: int) -> list[Fit]:
    """Fit the most promising candidates beside what the model has already by a few steps."""
    tasks = []
    gains = scanned.gains()
    for effect in sorted(gains, key=lambda effect_name: -gains[effect_name])[:max_effects]:
        if gains[effect] < MIN_SCREENED_GAIN and scanned.p_value_of(effect) > ALPHA:
            continue
        starts = candidate_scores.starting_points(
            scanned.candidates, scanned.scores, effect, STARTS_PER_EFFECT
        )
        if starts:
            tasks.append((context.coarse, (*scanned.fit.effects, effect), starts, scanned.fit, SCREEN_STEPS))
    return sort_by_likelihood(
        context.coarse, [fitted for fitted in context.mapper(_fit_from_starts, tasks) if fitted is not None]
    )


def refine(context: SearchContext, raced: list[Fit]) -> list[Fit]:
    """Run the likeliest of a race to the end."""
    none = [np.empty(0)]
    tasks = [(context.coarse, model.effects, none, model, REFINE_STEPS) for model in raced[:MAX_REFINED]]
    finished = [fitted for fitted in context.mapper(_fit_from_starts, tasks) if fitted is not None]
    return sort_by_likelihood(context.coarse, [*finished, *raced[MAX_REFINED:]])


def finalists(context: SearchContext, rough: list[Fit]) -> list[Fit]:
    """Keep the likeliest, and those that fewer samples do not tell from it."""
    in_sample = [
        CandidateFit(candidate, candidate.log_likelihood(context.coarse.shots))
        for candidate in rough[:MAX_FINALISTS]
    ]
    return [
        candidate.fit
        for place, candidate in enumerate(in_sample)
        if place < MIN_FINALISTS or are_indistinguishable(context.coarse, in_sample[0], candidate)
    ]


def without_each_effect(nominal: Fit, model: Fit) -> list[Fit]:
    """Start fits of a model without each of its new effects in turn, from where it stands.

    What a second effect seems to add may be no more than a way round the place where the fit of the first
    had come to rest.
    """
    reduced = []
    for left_out in model.effects[len(nominal.effects) :]:
        kept = tuple(effect for effect in model.effects if effect != left_out)
        kept_columns = np.array([coordinate.effect != left_out for coordinate in model.coordinates])
        reduced.append(replace(model, effects=kept, theta=model.theta[kept_columns]))
    return reduced
