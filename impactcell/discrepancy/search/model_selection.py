"""Which effects join the model: a declared list of stages, each of which may end the search.

Forward with every candidate refitted, one at a time or two, then backward. A set of effects is accepted when
nothing significant is left against the model that has it. Of all sets of the smallest size the likeliest is
taken; sets that are not significantly less likely, shot by shot, are tied with it. When no set suffices
nothing is added: forward selection on an effect outside the library would add wrong names until it gives up.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

from impactcell.discrepancy.model import Fit
from impactcell.discrepancy.search.acceptance import (
    SelectionResult,
    accept_pair,
    accept_plausible,
    accept_single,
    reject,
)
from impactcell.discrepancy.search.between_shots import accept_between_shots
from impactcell.discrepancy.search.candidate_fits import (
    finalists,
    fit_alike,
    fit_all_samples,
    is_at_bound,
    prefer_interior,
    refine,
    screen,
    without_each_effect,
)
from impactcell.discrepancy.search.confirmation import NestedModels
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.convergence import converge
from impactcell.discrepancy.search.dominance import accept_dominant
from impactcell.discrepancy.search.evidence import CandidateScan, ModelEvidence, scan_candidates
from impactcell.discrepancy.search.indistinguishability import (
    CandidateFit,
    compare_fits,
    rank_out_of_shot,
    sort_by_likelihood,
    total_log_likelihood,
)
from impactcell.discrepancy.search.policy import POLICY


@dataclass(frozen=True, slots=True, eq=False)
class SearchState:
    """What the stages so far have found; each stage reads it and returns the next.

    Attributes
    ----------
    evidence : ModelEvidence
        Against the nominal model.
    screened : list of Fit
        One effect more, on few samples, the likeliest first.
    singles, pairs : list of CandidateFit
        One and two effects more, on all samples, the likeliest out of shot first.
    single_evidence : ModelEvidence
        Against the best single effect.
    scans : list of CandidateScan
        Second effects beside several first ones.
    unconverged : list of Fit
        Trials that came to rest short of their optimum: they neither win nor lose.
    result : SelectionResult or None
        Ends the search.
    """

    evidence: ModelEvidence
    screened: list[Fit] = field(default_factory=list)
    singles: list[CandidateFit] = field(default_factory=list)
    single_evidence: ModelEvidence | None = None
    scans: list[CandidateScan] = field(default_factory=list)
    pairs: list[CandidateFit] = field(default_factory=list)
    unconverged: list[Fit] = field(default_factory=list)
    result: SelectionResult | None = None

    @property
    def latest(self) -> ModelEvidence:
        """Evidence against the best single effect, or against the nominal model before there is one."""
        return self.single_evidence or self.evidence


def select_model(context: SearchContext, nominal: Fit) -> SelectionResult:
    """Look for the smallest set of effects that leaves nothing significant."""
    state = SearchState(context.test_model(nominal))
    for stage in STAGES:
        state = stage(context, state)
        if state.result is not None:
            result = state.result if state.result.accepted is not None else _dominant_or_none(context, state)
            return replace(result, unconverged=tuple(model.effects for model in state.unconverged))
    raise AssertionError("the last stage ends every search")


def _dominant_or_none(context: SearchContext, state: SearchState) -> SelectionResult:
    """Accept what stands out between shots or in the traces where nothing suffices, else nothing.

    Shots are independent; what is left in the traces is not. So the friction factors are asked first, and
    give a name only where no fit of the traces explains them better.
    """
    if state.result is None:
        raise AssertionError("only a search that has ended")
    trials = [*(single.fit for single in state.singles), *state.screened, *state.unconverged]
    with_one_more = [trial for trial in trials if len(trial.effects) == len(state.evidence.fit.effects) + 1]
    between = accept_between_shots(context, state.evidence, with_one_more)
    if between is not None:
        return between
    dominant = accept_dominant(
        context,
        (state.evidence, state.latest),
        state.singles,
        state.screened,
        state.pairs,
        state.unconverged,
    )
    return dominant or state.result


def only_test(context: SearchContext, nominal: Fit) -> SelectionResult:
    """Test the nominal model and look no further, where there are too few shots to name anything."""
    evidence = context.test_model(nominal)
    accepted = nominal if context.is_sufficient(evidence) else None
    return SelectionResult(evidence, evidence, accepted, (), {}, {})


def nested_models(context: SearchContext, selection: SelectionResult) -> NestedModels:
    """Models with the effects that were added, and with some of them."""
    nominal, best = selection.nominal.fit, selection.accepted
    if best is None or not selection.added:
        return NestedModels(nominal)
    steps, last = [(selection.added[-1], best)], selection.added[-1]
    if len(selection.added) == 1:
        return NestedModels(nominal, steps)
    reduced = fit_all_samples(context, without_each_effect(nominal, best))
    singles = {single.effects[-1]: single for single in reduced}
    first = selection.added[0]
    if first in singles:
        steps.insert(0, (first, singles[first]))
    return NestedModels(nominal, steps, {last: singles[last]} if singles.keys() >= {first, last} else {})


def test_nominal(context: SearchContext, state: SearchState) -> SearchState:
    """Accept the nominal model where nothing is left."""
    if not context.is_sufficient(state.evidence):
        return state
    nominal = state.evidence.fit
    return replace(state, result=SelectionResult(state.evidence, state.evidence, nominal, (), {}, {}))


def fit_single_effects(context: SearchContext, state: SearchState) -> SearchState:
    """Fit one effect more: screened and refined on few samples, finalists on all."""
    screened = refine(context, screen(context, state.evidence.candidate_scan, POLICY.max_screened))
    if not screened:
        return replace(state, result=reject(state.evidence, state.evidence, ()))
    fitted = fit_all_samples(context, finalists(context, screened))
    converged, others = converge(context, fitted, [state.evidence.fit])
    state = replace(state, screened=screened, unconverged=others)
    if not converged:
        return replace(state, result=reject(state.evidence, state.evidence, ()))
    singles = prefer_interior(context.problem, rank_out_of_shot(context.problem, converged))
    alike = fit_alike(context, state.evidence.candidate_scan, singles[0].fit, converged)
    if alike:
        more, _ = converge(context, alike, [state.evidence.fit])
        singles = prefer_interior(context.problem, rank_out_of_shot(context.problem, [*converged, *more]))
    return replace(state, singles=singles, single_evidence=context.test_model(singles[0].fit))


def accept_single_effect(context: SearchContext, state: SearchState) -> SearchState:
    """Accept the best single effect where nothing is left beside it, or nothing worth a name."""
    if not context.is_closed(state.latest):
        return state
    result = accept_single(context.problem, state.evidence, state.latest, state.singles)
    return replace(state, result=result)


def accept_plausible_effect(context: SearchContext, state: SearchState) -> SearchState:
    """Accept the effect that explains most of a gap where the floor is only a lower bound."""
    result = accept_plausible(context, state.evidence, state.latest, state.singles, state.screened)
    return replace(state, result=result)


def fit_pairs(context: SearchContext, state: SearchState) -> SearchState:
    """Fit two effects more; the likeliest first effects on all samples need not have been so on few."""
    best = state.singles[0].fit
    others = [model for model in state.screened if model.effects != best.effects]
    scan = partial(scan_candidates, context.coarse, library=context.library, seed=(context.seed, 1))
    scans = [state.latest.candidate_scan, *context.mapper(scan, others[: POLICY.max_first_effects - 1])]
    likeliest: dict[frozenset[str], Fit] = {}
    for candidate_scan in scans:
        for fitted in screen(context, candidate_scan, POLICY.max_second_effects):
            key = frozenset(fitted.effects)
            if key not in likeliest or total_log_likelihood(context.coarse, fitted) > total_log_likelihood(
                context.coarse, likeliest[key]
            ):
                likeliest[key] = fitted
    refined = refine(context, sort_by_likelihood(context.coarse, likeliest.values()))
    if not refined:
        return replace(state, result=reject(state.evidence, state.latest, compare_fits(state.singles)))
    inner = [state.evidence.fit, *(single.fit for single in state.singles)]
    on_all_samples = fit_all_samples(context, finalists(context, refined))
    converged, stuck = converge(context, on_all_samples, inner)
    state = replace(state, unconverged=[*state.unconverged, *stuck])
    pairs = prefer_interior(context.problem, rank_out_of_shot(context.problem, converged))
    if not pairs or not context.reaches_floor(pairs[0].fit):
        alternatives = compare_fits([*pairs, *state.singles])
        rejected = reject(state.evidence, state.latest, alternatives)
        return replace(state, scans=scans, pairs=pairs, result=rejected)
    return replace(state, scans=scans, pairs=pairs)


def drop_either_effect(context: SearchContext, state: SearchState) -> SearchState:
    """Fit single effects again from where the best pair stands; accept one that suffices from there."""
    reduced = without_each_effect(state.evidence.fit, state.pairs[0].fit)
    converged, _ = converge(context, fit_all_samples(context, reduced), [state.evidence.fit])
    again = rank_out_of_shot(context.problem, converged)
    if not again or total_log_likelihood(context.problem, again[0].fit) <= (
        total_log_likelihood(context.problem, state.singles[0].fit) + POLICY.min_refit_gain
    ):
        return state
    refitted = {candidate.fit.effects for candidate in again}
    singles = [*again, *(single for single in state.singles if single.fit.effects not in refitted)]
    singles.sort(key=lambda candidate: -float(candidate.each.sum()))
    better = replace(state, singles=singles, single_evidence=context.test_model(singles[0].fit))
    return accept_single_effect(context, better)


def prefer_single_effect(context: SearchContext, state: SearchState) -> SearchState:
    """Accept the best single effect where a second one adds too little to be worth a name."""
    single, pair = state.singles[0].fit, state.pairs[0].fit
    if context.gains_enough(single, pair) or not context.reaches_floor(single):
        return state
    result = accept_single(context.problem, state.evidence, state.latest, state.singles)
    return replace(state, result=result)


def accept_pair_of_effects(context: SearchContext, state: SearchState) -> SearchState:
    """Accept the best pair where nothing is left beside it, else nothing."""
    best = state.pairs[0].fit
    alternatives = compare_fits([*state.pairs, *state.singles])
    evidence = context.test_model(best)
    if not context.is_sufficient(evidence) or is_at_bound(best):
        return replace(state, result=reject(state.evidence, evidence, alternatives))
    order = [model.effects[-1] for model in state.screened]
    scans = (state.evidence.candidate_scan, *state.scans)
    result = accept_pair(context.problem, (state.evidence, evidence), state.pairs, order, scans, alternatives)
    return replace(state, result=result)


Stage = Callable[[SearchContext, SearchState], SearchState]
"""A step of the search: its name, and what is known after it from what was known before."""

STAGES: tuple[Stage, ...] = (
    test_nominal,
    fit_single_effects,
    accept_single_effect,
    accept_plausible_effect,
    fit_pairs,
    drop_either_effect,
    prefer_single_effect,
    accept_pair_of_effects,
)
"""The search, in order."""
