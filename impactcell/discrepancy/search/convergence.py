"""Which trials have converged: one that has not can neither win nor lose, and ties with nothing.

A trial has come to rest short of its optimum if a Gauss-Newton step still promises much, or if a model inside
it is likelier: what it could be is not known then.
"""

from collections.abc import Sequence

import numpy as np

from impactcell.discrepancy.model import Coordinate, Fit, Problem, effect_coordinates, promised_fall
from impactcell.discrepancy.search.candidate_fits import FitTask, run_tasks
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.indistinguishability import total_log_likelihood
from impactcell.discrepancy.search.policy import POLICY


def is_converged(problem: Problem, model: Fit, inner: Sequence[Fit] = ()) -> bool:
    """Whether a fit is at its optimum.

    Parameters
    ----------
    inner : sequence of Fit
        Models with fewer effects, fitted to the same shots.
    """
    if _is_beaten(problem, model, inner):
        return False
    size, misfit = problem.shots.values.size, float(model.misfit(problem.shots).sum())
    limit = max(POLICY.max_promise * max(misfit / size, 1.0), POLICY.max_promised_share * (misfit - size))
    return promised_fall(problem, model) <= limit


def _is_beaten(problem: Problem, model: Fit, inner: Sequence[Fit]) -> bool:
    """Whether some model inside this one is likelier: the larger one can do all that it does."""
    best = max((total_log_likelihood(problem, one) for one in _inside(model, inner)), default=-np.inf)
    return total_log_likelihood(problem, model) < best - POLICY.max_nesting_loss


def _inside(model: Fit, inner: Sequence[Fit]) -> list[Fit]:
    return [one for one in inner if set(one.effects) < set(model.effects)]


def converge(
    context: SearchContext, fits: Sequence[Fit], inner: Sequence[Fit]
) -> tuple[list[Fit], list[Fit]]:
    """Fit those that have not converged once more, from the likeliest model inside them.

    Returns
    -------
    converged, others : list of Fit
    """
    problem = context.problem
    converged = [model for model in fits if is_converged(problem, model, inner)]
    stuck = [model for model in fits if not any(model is other for other in converged)]
    again = run_tasks(context, [_restart(problem, model, inner) for model in stuck])
    converged += [model for model in again if is_converged(problem, model, inner)]
    reached = {frozenset(model.effects) for model in converged}
    return converged, [model for model in stuck if frozenset(model.effects) not in reached]


def _restart(problem: Problem, model: Fit, inner: Sequence[Fit]) -> FitTask:
    """Fit a model from the likeliest one inside it, with nothing of what that lacks, or from where it is."""
    if not _is_beaten(problem, model, inner):
        return FitTask(problem.with_effects(model.effects), (np.empty(0),), model, POLICY.final_steps)
    base = max(_inside(model, inner), key=lambda one: total_log_likelihood(problem, one))
    lacking = tuple(effect for effect in model.effects if effect not in base.effects)
    coordinates = [one for effect in lacking for one in effect_coordinates(effect, problem.batches)]
    start = np.array([_null(coordinate) for coordinate in coordinates])
    return FitTask(problem.with_effects((*base.effects, *lacking)), (start,), base, POLICY.final_steps)


def _null(coordinate: Coordinate) -> float:
    """Coordinate at which an effect has no strength."""
    return coordinate.lower if coordinate.form == "reciprocal" else coordinate.initial
