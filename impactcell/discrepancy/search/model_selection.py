"""Which effects join the model: forward with every candidate refitted, one at a time or two, then backward.

A set of effects is accepted when nothing significant is left against the model that has it. Of all sets of
the smallest size the likeliest is taken; sets that are not significantly less likely, shot by shot, are tied
with it. When no set suffices nothing is added: forward selection on an effect outside the library would add
wrong names until it gives up.
"""

from dataclasses import dataclass, field

from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.search.candidate_fits import (
    MAX_SCREENED,
    SearchContext,
    finalists,
    is_at_bound,
    prefer_interior,
    refine,
    screen,
    without_each_effect,
)
from impactcell.discrepancy.search.evidence import CandidateScan, ModelEvidence, scan_candidates
from impactcell.discrepancy.search.indistinguishability import (
    Alternative,
    CandidateFit,
    are_indistinguishable,
    compare_fits,
    sort_by_likelihood,
    total_log_likelihood,
)

MAX_FIRST_EFFECTS = 4
MAX_SECOND_EFFECTS = 5
MIN_SHARE_EXPLAINED = 0.5
MIN_REFIT_GAIN = 2.0
MAX_RIVAL_SHARE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class SelectionResult:
    """Outcome of the search.

    Attributes
    ----------
    steps : tuple of Evidence
        Against the nominal model, then against each model that was accepted or tried last.
    accepted : Fit or None
        None where nothing suffices.
    added : tuple of str
        Effects in the order they were added.
    ties : dict of str to tuple of str
    p_values : dict of str to float
    alternatives : tuple of Alternative
        Everything that was fitted, the likeliest first.
    """

    nominal: ModelEvidence
    final: ModelEvidence
    accepted: Fit | None
    added: tuple[str, ...]
    ties: dict[str, tuple[str, ...]]
    p_values: dict[str, float]
    alternatives: tuple[Alternative, ...] = field(default=())


def _scan_task(task: tuple[Problem, Fit, tuple[str, ...], tuple[int, ...]]) -> CandidateScan:
    return scan_candidates(*task)


def select_model(context: SearchContext, nominal: Fit) -> SelectionResult:
    """Look for the smallest set of effects that leaves nothing significant."""
    first = context.test_model(nominal)
    if context.is_sufficient(first):
        return SelectionResult(first, first, nominal, (), {}, {})
    rough = refine(context, screen(context, first.candidate_scan, MAX_SCREENED))
    if not rough:
        return SelectionResult(first, first, None, (), {}, {})
    singles = prefer_interior(context.problem, context.refit_on_all_samples(finalists(context, rough)))
    against = context.test_model(singles[0].fit)
    if context.is_closed(against):
        return _accept_single(context.problem, first, against, singles)
    plausible = _accept_plausible(context, first, against, singles[0].fit, rough, compare_fits(singles))
    if plausible is not None:
        return plausible
    # The likeliest on all samples need not have been so on few.
    other_singles = [candidate for candidate in rough if candidate.effects != singles[0].fit.effects]
    tasks = [
        (context.coarse, candidate, context.library, (context.seed, 1))
        for candidate in other_singles[: MAX_FIRST_EFFECTS - 1]
    ]
    sources = [against.candidate_scan, *context.mapper(_scan_task, tasks)]
    rough_pairs = _fit_pairs(context, sources)
    if not rough_pairs:
        return SelectionResult(first, against, None, (), {}, {}, compare_fits(singles))
    pairs = prefer_interior(context.problem, context.refit_on_all_samples(finalists(context, rough_pairs)))
    if not context.reaches_floor(pairs[0].fit):
        return SelectionResult(first, against, None, (), {}, {}, compare_fits([*pairs, *singles]))
    again = context.refit_on_all_samples(without_each_effect(nominal, pairs[0].fit))
    if (
        again
        and total_log_likelihood(context.problem, again[0].fit)
        > total_log_likelihood(context.problem, singles[0].fit) + MIN_REFIT_GAIN
    ):
        effects = {candidate.fit.effects for candidate in again}
        singles = [*again, *(candidate for candidate in singles if candidate.fit.effects not in effects)]
        singles.sort(key=lambda candidate: -float(candidate.each.sum()))
        against = context.test_model(singles[0].fit)
        if context.is_closed(against):
            return _accept_single(context.problem, first, against, singles)
    everything = compare_fits([*pairs, *singles])
    if not context.gains_enough(singles[0].fit, pairs[0].fit) and context.reaches_floor(singles[0].fit):
        return _accept_single(context.problem, first, against, singles)
    last = context.test_model(pairs[0].fit)
    if not context.is_sufficient(last) or is_at_bound(pairs[0].fit):
        return SelectionResult(first, last, None, (), {}, {}, everything)
    return _accept_pair(context.problem, first, last, pairs, rough, sources, everything)


def _fit_pairs(context: SearchContext, sources: list[CandidateScan]) -> list[Fit]:
    """Fit the most promising second effects beside several first ones, the likeliest first."""
    best: dict[frozenset[str], Fit] = {}
    for source in sources:
        for fitted in screen(context, source, MAX_SECOND_EFFECTS):
            key = frozenset(fitted.effects)
            if key not in best or total_log_likelihood(context.coarse, fitted) > total_log_likelihood(
                context.coarse, best[key]
            ):
                best[key] = fitted
    return refine(context, sort_by_likelihood(context.coarse, best.values()))


def _accept_plausible(
    context: SearchContext,
    first: ModelEvidence,
    against: ModelEvidence,
    best: Fit,
    rough: list[Fit],
    everything: tuple[Alternative, ...],
) -> SelectionResult | None:
    """Accept the effect that explains most of a gap, if the floor itself is only a lower bound.

    What is left then may be noise that nobody stated. It also may be what separates the best effect from its
    rivals: whoever is behind by less than that is tied.
    """
    if context.floor_is_certain or is_at_bound(best):
        return None
    size = context.problem.shots.values.size
    before = float(first.fit.misfit(context.problem.shots).sum()) - size
    after = float(best.misfit(context.problem.shots).sum()) - size
    if after > (1.0 - MIN_SHARE_EXPLAINED) * before:
        return None
    scale = context.coarse.shots.values.size / size
    smallest = float(best.misfit(context.problem.shots).sum()) * scale
    effect = best.effects[-1]
    tied = tuple(
        model.effects[-1]
        for model in rough
        if model.effects != best.effects
        and float(model.misfit(context.coarse.shots).sum()) - smallest <= MAX_RIVAL_SHARE * after * scale
    )
    return SelectionResult(
        first,
        against,
        best,
        (effect,),
        {effect: tied},
        {effect: first.candidate_scan.p_value_of(effect)},
        everything,
    )


def _accept_single(
    problem: Problem, first: ModelEvidence, against: ModelEvidence, singles: list[CandidateFit]
) -> SelectionResult:
    best = singles[0].fit
    if is_at_bound(best):
        return SelectionResult(first, against, None, (), {}, {}, compare_fits(singles))
    effect = best.effects[-1]
    tied = tuple(
        other.fit.effects[-1] for other in singles[1:] if are_indistinguishable(problem, singles[0], other)
    )
    return SelectionResult(
        first,
        against,
        best,
        (effect,),
        {effect: tied},
        {effect: first.candidate_scan.p_value_of(effect)},
        compare_fits(singles),
    )


def _accept_pair(
    problem: Problem,
    first: ModelEvidence,
    last: ModelEvidence,
    pairs: list[CandidateFit],
    rough: list[Fit],
    sources: list[CandidateScan],
    everything: tuple[Alternative, ...],
) -> SelectionResult:
    best = pairs[0].fit
    order = {model.effects[-1]: place for place, model in enumerate(rough)}
    new_effects = [effect for effect in best.effects if effect not in first.fit.effects]
    added = tuple(sorted(new_effects, key=lambda effect: order.get(effect, len(order))))
    ties: dict[str, tuple[str, ...]] = dict.fromkeys(added, ())
    for rival in pairs[1:]:
        other = rival.fit.effects
        if len(set(other) & set(added)) == 1 and are_indistinguishable(problem, pairs[0], rival):
            replaced = next(effect for effect in added if effect not in other)
            instead = next(effect for effect in other if effect not in best.effects)
            ties[replaced] = (*ties[replaced], instead)
    p_values = {added[0]: first.candidate_scan.p_value_of(added[0])}
    beside = [source for source in sources if source.fit.effects[-1:] == added[:1]]
    p_values[added[1]] = (
        beside[0].p_value_of(added[1]) if beside else first.candidate_scan.p_value_of(added[1])
    )
    return SelectionResult(first, last, best, added, ties, p_values, everything)
