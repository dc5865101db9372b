"""Which effects join the model: a declared list of stages, each of which may end the search.

Forward with every candidate refitted, one at a time, two or three, then backward. A set of effects is
accepted when nothing significant is left against the model that has it. Of all sets of the smallest size the
likeliest is taken; sets that are not significantly less likely, shot by shot, are tied with it. When no set
suffices nothing is added: forward selection on an effect outside the library would add wrong names until it
gives up.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from impactcell.discrepancy.model import Fit
from impactcell.discrepancy.search.acceptance import (
    SelectionResult,
    accept_plausible,
    accept_set,
    fitted_with,
    reject,
)
from impactcell.discrepancy.search.between_shots import accept_between_shots
from impactcell.discrepancy.search.candidate_fits import (
    fit_alike,
    fit_all_samples,
    is_at_bound,
    without_each_effect,
)
from impactcell.discrepancy.search.confirmation import NestedModels
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.convergence import converge
from impactcell.discrepancy.search.dominance import accept_dominant
from impactcell.discrepancy.search.one_more import (
    SearchState,
    exchange_each,
    fit_one_more,
    merge,
    refit_smaller,
)


def select_model(context: SearchContext, nominal: Fit) -> SelectionResult:
    """Look for the smallest set of effects that leaves nothing significant."""
    state = SearchState({0: context.test_model(nominal)})
    for stage in STAGES:
        state = stage(context, state)
        if state.result is not None:
            result = state.result if state.result.accepted is not None else _dominant_or_none(context, state)
            return replace(result, unconverged=tuple(model.effects for model in state.unconverged))
    raise AssertionError("the last stage ends every search")


def _dominant_or_none(context: SearchContext, state: SearchState) -> SelectionResult:
    """Accept what stands out between shots or in the traces where nothing suffices, else nothing.

    Shots are independent; what is left in the traces is not. So the friction factors are asked first, and
    give a name only where no fit of the traces explains them better, and no single effect brings traces that
    are off to the noise: that one stands out, and the factors are asked beside it.
    """
    if state.result is None:
        raise AssertionError("only a search that has ended")
    screened = state.rough.get(1, [])
    trials = [*state.fits(1), *screened, *state.unconverged]
    with_one_more = [trial for trial in trials if len(trial.effects) == len(state.nominal.effects) + 1]
    if context.reaches_floor(state.nominal) or not any(map(context.reaches_floor, state.fits(1))):
        between = accept_between_shots(context, state.tested[0], with_one_more)
        if between is not None:
            return between
    dominant = accept_dominant(
        context,
        (state.tested[0], state.tested.get(1, state.tested[0])),
        state.sets.get(1, []),
        screened,
        state.sets.get(2, []),
        state.unconverged,
    )
    return dominant or state.result


def only_test(context: SearchContext, nominal: Fit) -> SelectionResult:
    """Test the nominal model and look no further, where there are too few shots to name anything."""
    evidence = context.test_model(nominal)
    accepted = nominal if context.is_sufficient(evidence) else None
    return SelectionResult(evidence, evidence, accepted, (), {}, {})


def nested_models(context: SearchContext, selection: SelectionResult) -> NestedModels:
    """Models with all effects that were added, and with some: as the search has them, else fitted.

    What it has not fitted starts from where a larger one stands.
    """
    nominal = selection.nominal.fit
    if selection.accepted is None or not selection.added:
        return NestedModels({frozenset(): nominal})
    models = {frozenset(selection.added): selection.accepted}
    layer = [selection.accepted]
    for _ in selection.added[1:]:
        starts = {
            _beside(nominal, start): start for model in layer for start in without_each_effect(nominal, model)
        }
        known = [fit for fit in (fitted_with(selection, names) for names in starts) if fit is not None]
        names_known = {_beside(nominal, fit) for fit in known}
        missing = [start for names, start in starts.items() if names not in names_known]
        layer = [*known, *fit_all_samples(context, missing)]
        models |= {_beside(nominal, model): model for model in layer}
    return NestedModels(models | {frozenset(): nominal}, selection.added)


def _beside(nominal: Fit, model: Fit) -> frozenset[str]:
    """Effects that a model has beside the nominal ones."""
    return frozenset(model.effects) - frozenset(nominal.effects)


def test_nominal(context: SearchContext, state: SearchState) -> SearchState:
    """Accept the nominal model where nothing is left."""
    evidence = state.tested[0]
    if not context.is_sufficient(evidence):
        return state
    return replace(state, result=SelectionResult(evidence, evidence, evidence.fit, (), {}, {}))


def fit_sets(size: int, context: SearchContext, state: SearchState) -> SearchState:
    """Fit so many effects more."""
    state = fit_one_more(context, state, size)
    return state if state.sets[size] else _reject(state)


def fit_confounded(context: SearchContext, state: SearchState) -> SearchState:
    """Fit single effects to which the residuals point as much as to the likeliest."""
    converged = state.fits(1)
    alike = fit_alike(context, state.tested[0].candidate_scan, state.best(1), converged)
    more, _ = converge(context, alike, [state.nominal])
    return merge(context, state, 1, more)


def accept_sufficient(size: int, context: SearchContext, state: SearchState) -> SearchState:
    """Accept the best set of a size where nothing is left beside it and each of its effects earns its place.

    Beside a single effect what is left may be significant, as long as it is too little to be worth a name.
    """
    if not context.reaches_floor(state.best(size)):
        return state
    state = _with_test(context, state, size)
    evidence = state.tested[size]
    suffices = context.is_closed(evidence) if size == 1 else context.is_sufficient(evidence)
    if not suffices or not _each_earns(context, state, size):
        return state
    return _accept(context, state, size)


def accept_plausible_effect(context: SearchContext, state: SearchState) -> SearchState:
    """Accept the effect that explains most of a gap where the floor is only a lower bound."""
    result = accept_plausible(context, state.tested[0], state.latest, state.sets[1], state.rough[1])
    return replace(state, result=result)


def refit_singles(context: SearchContext, state: SearchState) -> SearchState:
    """Fit single effects again from where a pair at the floor stands: one of them may suffice from there."""
    return refit_smaller(context, state, 2)[0] if context.reaches_floor(state.best(2)) else state


def prefer_single_effect(context: SearchContext, state: SearchState) -> SearchState:
    """Accept the best single effect where a second one adds too little to be worth a name."""
    single, pair = state.best(1), state.best(2)
    if (
        not context.reaches_floor(pair)
        or context.gains_enough(single, pair)
        or not context.reaches_floor(single)
    ):
        return state
    return _accept(context, _with_test(context, state, 1), 1)


def exchange_effects(size: int, context: SearchContext, state: SearchState) -> SearchState:
    """Look for a better effect in the place of each of the best set, and for those that are tied with it."""
    return exchange_each(context, state, size)


def _reject(state: SearchState) -> SearchState:
    """Accept nothing."""
    return replace(state, result=reject(state.tested[0], state.latest, state.alternatives))


def reject_all(_: SearchContext, state: SearchState) -> SearchState:
    """Accept nothing where no set suffices."""
    return _reject(state)


def reject_without_floor(context: SearchContext, state: SearchState) -> SearchState:
    """Accept nothing where a third effect could not be held to a floor."""
    return state if context.floor_is_certain else _reject(state)


def _with_test(context: SearchContext, state: SearchState, size: int) -> SearchState:
    """Test the best model of a size, if that has not been done."""
    best = state.best(size)
    if size in state.tested and state.tested[size].fit is best:
        return state
    return replace(state, tested=state.tested | {size: context.test_model(best)})


def _each_earns(context: SearchContext, state: SearchState, size: int) -> bool:
    """Whether each effect of the best set adds enough to be worth a name, all others being there."""
    best = state.best(size)
    inside = [fit for fit in state.fits(size - 1) if set(fit.effects) < set(best.effects)]
    return all(context.gains_enough(fewer, best) for fewer in inside)


def _accept(context: SearchContext, state: SearchState, size: int) -> SearchState:
    """Accept the best set of a size."""
    order = [
        model.effects[-1] for model in sorted(state.rough[1], key=partial(is_at_bound, context.coarse.shots))
    ]
    evidence = (state.tested[0], state.tested[size])
    result = accept_set(context.problem, evidence, state.sets[size], order, state.scans, state.alternatives)
    return replace(state, result=result)


Stage = Callable[[SearchContext, SearchState], SearchState]
"""A step of the search: its name, and what is known after it from what was known before."""

STAGES: tuple[Stage, ...] = (
    test_nominal,
    partial(fit_sets, 1),
    fit_confounded,
    partial(accept_sufficient, 1),
    accept_plausible_effect,
    partial(fit_sets, 2),
    refit_singles,
    partial(accept_sufficient, 1),
    prefer_single_effect,
    partial(accept_sufficient, 2),
    reject_without_floor,
    partial(fit_sets, 3),
    partial(exchange_effects, 3),
    partial(accept_sufficient, 2),
    partial(accept_sufficient, 3),
    reject_all,
)
"""The search, in order."""
