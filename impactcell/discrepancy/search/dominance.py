"""Effects that stand out from what remains: established although no model reaches the floor.

A real machine never comes to the noise of its sensors. An effect stands out if it takes most of the gap, and
more of it than one that has no part in it would by chance, what is left being counted by its independent
pieces. Whoever leaves no more than as many pieces scatter is tied with it.
"""

from collections.abc import Sequence

from impactcell.discrepancy.model import Fit
from impactcell.discrepancy.search.acceptance import SelectionResult
from impactcell.discrepancy.search.candidate_fits import fit_all_samples, is_at_bound, without_each_effect
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.convergence import converge
from impactcell.discrepancy.search.evidence import ModelEvidence
from impactcell.discrepancy.search.indistinguishability import (
    CandidateFit,
    compare_fits,
    rank_out_of_shot,
)
from impactcell.discrepancy.search.model_error import (
    ModelError,
    estimate_model_error,
    largest_rival_excess,
    share_p_value,
)
from impactcell.discrepancy.search.policy import POLICY


def accept_dominant(
    context: SearchContext,
    evidence: tuple[ModelEvidence, ModelEvidence],
    singles: Sequence[CandidateFit],
    screened: Sequence[Fit],
    pairs: Sequence[CandidateFit],
    stuck: Sequence[Fit],
) -> SelectionResult | None:
    """Accept the single effect that stands out; a second name would mostly be a patch on what remains.

    Parameters
    ----------
    evidence : tuple of ModelEvidence
        Against the nominal model and against the best single effect.
    screened : sequence of Fit
        One effect more on few samples, fitted to their end or not.
    stuck : sequence of Fit
        Trials that came to rest short of their optimum.
    """
    nominal, final = evidence
    before = estimate_model_error(context.problem, nominal.fit)
    candidates = [*singles, *_inside_best_pair(context, nominal.fit, pairs)]
    left = {id(single): estimate_model_error(context.problem, single.fit) for single in candidates}
    candidates.sort(key=lambda single: left[id(single)].excess)
    inside = [
        single
        for single in candidates
        if not is_at_bound(context.problem.shots, single.fit, nominal.fit.effects)
    ]
    if not inside:
        return None
    best = inside[0].fit
    smallest, least = left[id(inside[0])], left[id(candidates[0])]
    p_value = _p_value(context, before.excess, smallest, nominal.fit, best)
    is_beaten = smallest.excess - least.excess > POLICY.max_bound_lead * before.excess
    rivals = [trial for trial in stuck if len(trial.effects) == len(best.effects)]
    if p_value > POLICY.dominance_error or is_beaten or _is_blocked(context, smallest, rivals):
        return None
    effect = best.effects[-1]
    tied = _tied(context, best, smallest, [*(single.fit for single in inside[1:]), *screened])
    if final.fit.effects != best.effects:
        final = context.test_model(best)
    alternatives = compare_fits([*pairs, *singles])
    return SelectionResult(
        nominal, final, best, (effect,), {effect: tied}, {effect: p_value}, alternatives, remains=True
    )


def _is_blocked(context: SearchContext, left: ModelError, stuck: Sequence[Fit]) -> bool:
    """Whether a trial leaves less although it has not come to its optimum: nobody knows then who is best."""
    return any(estimate_model_error(context.problem, trial).excess < left.excess for trial in stuck)


def _inside_best_pair(
    context: SearchContext, nominal: Fit, pairs: Sequence[CandidateFit]
) -> list[CandidateFit]:
    """Fit each effect of the likeliest pair alone: beside what remains none of them need have come first."""
    if not pairs:
        return []
    reduced = fit_all_samples(context, without_each_effect(nominal, pairs[0].fit))
    converged, _ = converge(context, reduced, [nominal])
    return rank_out_of_shot(context.problem, converged)


def _p_value(context: SearchContext, before: float, left: ModelError, fewer: Fit, more: Fit) -> float:
    """Over all effects that might have been named; 1 where it does not take most of the gap."""
    if before - left.excess < POLICY.min_share_explained * before:
        return 1.0
    parameters = len(more.coordinates) - len(fewer.coordinates)
    return min(len(context.library) * share_p_value(before, left, parameters), 1.0)


def _tied(context: SearchContext, best: Fit, left: ModelError, rivals: Sequence[Fit]) -> tuple[str, ...]:
    """Rivals that leave no more than the best one, but for the scatter of what is left."""
    limit = largest_rival_excess(left, POLICY.rival_probability)
    full, coarse = context.problem, context.coarse
    scale = full.shots.values.size / coarse.shots.values.size
    tied: dict[str, None] = {}
    for rival in rivals:
        problem, factor = (full, 1.0) if rival.residual.size == full.shots.values.size else (coarse, scale)
        excess = factor * estimate_model_error(problem, rival).excess
        if rival.effects != best.effects and excess <= limit:
            tied[rival.effects[-1]] = None
    return tuple(tied)
