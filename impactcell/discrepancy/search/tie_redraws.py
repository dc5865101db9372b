"""How often further shots tell two models apart by the rule that ties them, both fitted to all of them.

Old shots stay as they are; further ones are drawn of the model that is taken for the true one. Both models
step to old and new shots together, the factors' spread with them, and are judged out of shot, as in the
search.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data import IndexArray, PreparedShot
from impactcell.discrepancy.model import Fit
from impactcell.discrepancy.search.further_shots import NewShots
from impactcell.discrepancy.search.indistinguishability import (
    are_apart,
    are_indistinguishable,
    evaluate_out_of_shot,
    folds_of_groups,
    out_of_shot_loss,
    widest_rival,
)
from impactcell.discrepancy.search.separation import (
    EliminatedShots,
    LinearShots,
    Pair,
    best_step,
    weights_of,
)
from impactcell.discrepancy.search.simulated_shots import (
    DrawnShots,
    Scatter,
    draw_linear_shots,
    refit_with,
    simulate_shots,
)
from impactcell.errors import DiscrepancyError, PhysicsError
from impactcell.records import Samples

SPREAD_ROUNDS = 3
"""Times that steps and the factors' spread, each of which goes with the other, are taken in turn."""
SPREAD_DRAWS = 40
"""Draws by which the spread is found, which is the same for all of them."""
SMALLEST_SPREAD = 2e-4
"""No friction repeats to better than 0.02 %."""


@dataclass(frozen=True, slots=True, eq=False)
class RefittedModel:
    """A model refitted to old and new shots, in every draw.

    Attributes
    ----------
    each : ndarray, shape (R, n)
        Log-likelihood of every shot out of shot, but for what noise makes of all models alike.
    spread : ndarray, shape (R,)
    """

    each: Samples
    spread: Samples


def share_told(
    pair: Pair, new: NewShots, kind: IndexArray, groups: IndexArray, draws: int, rng: np.random.Generator
) -> float:
    """Share of redraws in which the true model of a pair is told from its rival, and not the other way.

    Parameters
    ----------
    kind : ndarray, shape (n,)
        Kind of each new shot that both are fitted to.
    groups : ndarray, shape (n,)
        Their replicate groups.
    """
    true = pair.models[0]
    size = float(pair.problem.sizes.mean())
    dispersion = max(float(true.misfit(pair.problem.shots).mean()) / size, 1.0)
    scatter = Scatter(true.spread, math.sqrt(dispersion), _uncertainty(pair), len(pair.own))
    drawn = draw_linear_shots(new, kind, scatter, draws, rng)
    fold = folds_of_groups(np.concatenate([[shot.group for shot in pair.problem.shots.items], groups]))
    first, second = pair.columns
    preferred = _refitted(pair, 0, new, drawn, (0, first, fold))
    other = _refitted(pair, 1, new, drawn, (first, second, fold))
    difference = preferred.each - other.each
    limit = widest_rival(1.0, difference.shape[-1]) * preferred.spread
    told = other.spread > limit
    if not pair.by_factors:
        told = (told & (difference.sum(-1) > 0.0)) | are_apart(difference, dispersion)
    return float(told.mean())


def is_told(pair: Pair, items: Sequence[PreparedShot], rng: np.random.Generator) -> bool:
    """Whether the true model of a pair is told from its rival with further shots, simulated and fitted to.

    False where the plant has no answer.
    """
    try:
        new = simulate_shots(pair.problem, pair.models[0], items, rng)
        refitted = [refit_with(pair.problem, model, new) for model in pair.models]
    except (PhysicsError, DiscrepancyError, ValueError):
        return False
    (problem, true), (_, rival) = refitted
    is_wider = rival.spread > widest_rival(true.spread, problem.count)
    if pair.by_factors:
        return is_wider
    first, second = (evaluate_out_of_shot(problem, model) for _, model in refitted)
    is_likelier = float(first.each.sum()) > float(second.each.sum())
    return is_likelier and (is_wider or not are_indistinguishable(problem, first, second))


def _uncertainty(pair: Pair) -> Samples:
    """Square root of the covariance of the true model's coordinates, shape (p, r)."""
    weights = weights_of(pair.own, pair.models[0].spread)
    H = pair.old[0].eliminate(weights).H.sum(0)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-300))
    values, vectors = np.linalg.eigh(H * np.outer(scale, scale))
    seen = values > 1e-10 * values.max()
    root: Samples = scale[:, None] * vectors[:, seen] / np.sqrt(values[seen])
    return root


def _refitted(
    pair: Pair, which: int, new: NewShots, drawn: DrawnShots, layout: tuple[int, int, IndexArray]
) -> RefittedModel:
    """Refit one of the models to old and new shots; `layout` is its first column, their number, and folds."""
    first, width, fold = layout
    model, old = pair.models[which], pair.old[which]
    spread, few = model.spread, drawn.first(SPREAD_DRAWS)
    for _ in range(SPREAD_ROUNDS):
        there = _stepped(model, old, new, few, (first, width), pair.own, spread)
        spread = max(float(np.sqrt(np.mean(there.factor**2))), SMALLEST_SPREAD)
    there = _stepped(model, old, new, drawn, (first, width), pair.own, spread)
    each = -0.5 * there.cost - math.log(spread)
    each = each - out_of_shot_loss(there.H, there.u, fold, np.zeros(there.H.shape[-1]))
    return RefittedModel(each, np.sqrt(np.mean(there.factor**2, axis=-1)))


def _stepped(
    model: Fit,
    old: LinearShots,
    new: NewShots,
    drawn: DrawnShots,
    columns: tuple[int, int],
    own: Sequence[str],
    spread: float,
) -> EliminatedShots:
    """All shots about where a model comes in each draw."""
    weights = weights_of(own, spread)
    first, width = columns
    changes = drawn.changes
    if first:  # the rival lacks what lies between the two
        changes = changes.copy()
        changes[..., -1] = 1.0
    seen = new.select(drawn.kind).seen_by(first, width, drawn.along, changes)
    every = old.eliminate(weights).join(seen.eliminate(weights))
    H, u = every.H.sum(0), every.u.sum(-2)
    step = best_step(H, u)
    lower = np.array([coordinate.lower for coordinate in model.coordinates]) - model.theta
    upper = np.array([coordinate.upper for coordinate in model.coordinates]) - model.theta
    mean = step.mean(0)
    held = (mean < lower) | (mean > upper)
    if held.any():
        step = np.broadcast_to(np.clip(mean, lower, upper), step.shape).copy()
        free = ~held
        rest = u[:, free] - step[:, held] @ H[np.ix_(held, free)]
        step[:, free] = best_step(H[np.ix_(free, free)], rest)
    return every.moved(step)
