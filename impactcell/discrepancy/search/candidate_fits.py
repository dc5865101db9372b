"""Fits that a search tries: several starts of every promising effect, screened, refined, and the finalists.

A few Gauss-Newton steps on few samples tell who cannot win; the likeliest run to the end, on all samples.
"""

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data import ShotSet
from impactcell.discrepancy.model import Fit, Problem, fit
from impactcell.discrepancy.search import candidate_scores
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.evidence import ALPHA, CandidateScan
from impactcell.discrepancy.search.indistinguishability import (
    CandidateFit,
    are_indistinguishable,
    sort_by_likelihood,
)
from impactcell.discrepancy.search.policy import POLICY
from impactcell.errors import DiscrepancyError
from impactcell.physics import Kind, ParameterKind
from impactcell.physics.effects import LIBRARY
from impactcell.records import Samples

AS_IT_STANDS = np.empty(0)
"""Start of an effect's coordinates that are in the base already."""


@dataclass(frozen=True, slots=True, eq=False)
class FitTask:
    """A model to be fitted, as it travels to another process.

    Attributes
    ----------
    problem : Problem
        The model on its shots.
    starts : tuple of ndarray
        Coordinates of its last effect, appended to those of `base`.
    base : Fit
        Where all else starts.
    steps : int
    """

    problem: Problem
    starts: tuple[Samples, ...]
    base: Fit
    steps: int

    def run(self) -> Fit | None:
        """Fit from every start and keep the best; None if the plant has no answer at any of them."""
        first = min(self.steps, POLICY.start_steps) if len(self.starts) > 1 else self.steps
        tried = [
            self._fit(np.concatenate([self.base.theta, start]), self.base, first) for start in self.starts
        ]
        ranking = sort_by_likelihood(self.problem, [fitted for fitted in tried if fitted is not None])
        if not ranking or first == self.steps:
            return next(iter(ranking), None)
        return self._fit(ranking[0].theta, ranking[0], self.steps - first) or ranking[0]

    def _fit(self, theta: Samples, base: Fit, steps: int) -> Fit | None:
        try:
            return fit(self.problem, theta, base.shot_parameters, spread=base.spread, most_steps=steps)
        except DiscrepancyError:
            return None


def is_at_bound(shots: ShotSet, model: Fit, given: Container[str] = ()) -> bool:
    """Whether the shape of an effect was fitted to the end of its range, or to where no shot has been.

    It is then used for something that it is not: a patch wider than any slide, or far beyond its end, is a
    gradient of friction, and so is a wave of less than half a period.

    Parameters
    ----------
    given : container of str
        Effects that the nominal plant has: the shape of one runs off as its strength comes to nothing, where
        a better name takes its place.
    """
    low, high = shots.visited_m
    span = high - low
    for coordinate, theta in zip(model.coordinates, model.theta.tolist(), strict=True):
        if not coordinate.effect or coordinate.effect in given or coordinate.definition is None:
            continue
        kind, value = coordinate.definition.kind, coordinate.value(theta)
        is_unseen = {
            ParameterKind.POSITION: not low <= value <= high,
            ParameterKind.WIDTH: value > span,
            ParameterKind.PERIOD: value > 2.0 * span,
        }.get(kind, False)
        nearest = min(theta - coordinate.lower, coordinate.upper - theta)
        is_at_end = coordinate.form == "log" and nearest < POLICY.bound_share * (
            coordinate.upper - coordinate.lower
        )
        if is_at_end or (is_unseen and span > 0.0):
            return True
    return False


def prefer_interior(problem: Problem, nominal: Fit, ranking: list[CandidateFit]) -> list[CandidateFit]:
    """Put what is fitted inside its range before a likeliest that is not, if it is tied with that.

    Or, alone beside the nominal model, if it leaves more by a small part of the gap at most: what a shape at
    its end makes of the rest is no name.
    """
    if not ranking or not is_at_bound(problem.shots, ranking[0].fit, nominal.effects):
        return ranking
    best = ranking[0].fit
    squares = {id(one): float(one.residual @ one.residual) for one in (nominal, *(c.fit for c in ranking))}
    gap = squares[id(nominal)] - squares[id(best)]
    is_single = len(best.effects) == len(nominal.effects) + 1

    def comes_first(candidate: CandidateFit) -> bool:
        lead = squares[id(candidate.fit)] - squares[id(best)]
        return not is_at_bound(problem.shots, candidate.fit, nominal.effects) and (
            are_indistinguishable(problem, ranking[0], candidate)
            or (is_single and lead <= POLICY.max_bound_lead * gap)
        )

    inside = [candidate for candidate in ranking[1:] if comes_first(candidate)]
    return [*inside, *(candidate for candidate in ranking if candidate not in inside)]


def screen(context: SearchContext, scanned: CandidateScan, max_effects: int) -> list[Fit]:
    """Fit the most promising candidates beside what the model has already by a few steps."""
    tasks = []
    gains = scanned.gains()
    for effect in sorted(gains, key=lambda name: -gains[name])[:max_effects]:
        if gains[effect] < POLICY.min_screened_gain and scanned.p_value_of(effect) > ALPHA:
            continue
        starts = candidate_scores.starting_points(
            scanned.candidates, scanned.scores, effect, POLICY.starts_per_effect
        )
        if starts:
            model = context.coarse.with_effects((*scanned.fit.effects, effect))
            tasks.append(FitTask(model, tuple(starts), scanned.fit, POLICY.screen_steps))
    return sort_by_likelihood(context.coarse, run_tasks(context, tasks))


def refine(context: SearchContext, screened: list[Fit]) -> list[Fit]:
    """Run the likeliest of those that were screened to the end."""
    refined = _continue(context, context.coarse, screened[: POLICY.max_refined], POLICY.refine_steps)
    return sort_by_likelihood(context.coarse, [*refined, *screened[POLICY.max_refined :]])


def fit_all_samples(context: SearchContext, fits: Sequence[Fit]) -> list[Fit]:
    """Fit models on from where they stand, to all samples."""
    return _continue(context, context.problem, fits, POLICY.final_steps)


def _continue(context: SearchContext, problem: Problem, fits: Sequence[Fit], steps: int) -> list[Fit]:
    """Fit models further from where they stand."""
    return run_tasks(
        context,
        [FitTask(problem.with_effects(model.effects), (AS_IT_STANDS,), model, steps) for model in fits],
    )


def run_tasks(context: SearchContext, tasks: Sequence[FitTask]) -> list[Fit]:
    """Fit models, in parallel where the mapper is; those that the plant has no answer for are left out."""
    return [fitted for fitted in context.mapper(FitTask.run, tasks) if fitted is not None]


def finalists(context: SearchContext, rough: list[Fit], given: Container[str] = ()) -> list[Fit]:
    """Keep the likeliest, as many inside their range, and those that fewer samples do not tell from it."""
    in_sample = [
        CandidateFit(candidate, candidate.log_likelihood(context.coarse.shots))
        for candidate in rough[: POLICY.max_finalists]
    ]
    inside = [one for one in in_sample if not is_at_bound(context.coarse.shots, one.fit, given)]
    kept = [*in_sample[: POLICY.min_finalists], *inside[: POLICY.min_finalists]]
    return [
        candidate.fit
        for candidate in in_sample
        if candidate in kept or are_indistinguishable(context.coarse, in_sample[0], candidate)
    ]


def fit_alike(context: SearchContext, scanned: CandidateScan, best: Fit, tried: Sequence[Fit]) -> list[Fit]:
    """Fit effects to which the residuals point as much as to the likeliest model's, from where that stands.

    An exact confound points in the same direction; on few samples its fit may come to rest elsewhere, and
    then nobody would hear of it.
    """
    gains = scanned.gains()
    known = {model.effects[-1] for model in tried}
    own = gains.get(best.effects[-1], 0.0)
    (base,) = without_each_effect(scanned.fit, best)
    tasks = []
    for effect in (name for name, gain in gains.items() if abs(gain - own) <= POLICY.alike_share * own):
        if effect not in known:
            model = context.problem.with_effects((*scanned.fit.effects, effect))
            starts = candidate_scores.starting_points(
                scanned.candidates, scanned.scores, effect, POLICY.starts_per_effect
            )
            tasks.append(FitTask(model, tuple(starts), base, POLICY.final_steps))
    return run_tasks(context, [task for task in tasks if task.starts])


def fit_between_shots(context: SearchContext, scanned: CandidateScan) -> list[Fit]:
    """Fit each effect that acts between shots, alone beside what the model has already."""
    tasks = []
    for effect in (name for name in scanned.gains() if LIBRARY[name].kind is Kind.BETWEEN_SHOTS):
        starts = candidate_scores.starting_points(
            scanned.candidates, scanned.scores, effect, POLICY.starts_per_effect
        )
        model = context.problem.with_effects((*scanned.fit.effects, effect))
        tasks.append(FitTask(model, tuple(starts), scanned.fit, POLICY.final_steps))
    return run_tasks(context, [task for task in tasks if task.starts])


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
