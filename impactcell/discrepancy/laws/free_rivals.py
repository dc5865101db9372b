"""Named effects held against free forms: what stands where neither a name nor two or three suffice.

What a model of a real machine leaves is a smooth function of something: position, speed, indentation, time or
force. So effects are fitted beside a free-form term in the place that suits them, and the term is fitted
alone. A name stands if it says what no term says alone; where a term does without it the answer is a law's.
A name that leaves something has to stand against the free forms of all places (`standing.py`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impactcell.discrepancy.data import decimate
from impactcell.discrepancy.laws.column_rivals import hold_against_columns
from impactcell.discrepancy.laws.free_term import FreeTerm, candidate_terms
from impactcell.discrepancy.laws.nearly_sufficient import (
    SAMPLES_OF_LITTLE,
    acts_between_shots,
    leaves_a_little,
    outdone_elsewhere,
)
from impactcell.discrepancy.laws.scored_model import ScoredModel, score_term
from impactcell.discrepancy.laws.standing import (
    SAMPLES,
    FreeForms,
    fit_free_forms,
    fit_term,
    outdone_by,
    stands_beside,
)
from impactcell.discrepancy.model import Fit, Problem, refit_shot_parameters
from impactcell.discrepancy.search import (
    CandidateFit,
    CandidateScan,
    Outdone,
    SearchContext,
    SelectionResult,
    compare_fits,
    fit_all_samples,
    is_at_bound,
    refine,
    reject,
    scan_candidates,
    screen,
)
from impactcell.physics.free_form import FreeForm
from impactcell.physics.free_forms import FINER
from impactcell.physics.remainder_forms import REMAINDER_FORMS

SCREENED_EFFECTS, FIRST_EFFECTS = 6, 3
"""Effects that are tried alone, and those of them, the likeliest, beside which places are looked for [1]."""
PLACES_EACH = 2
"""Places that are tried for each of them [1]."""
MOST_PLACES = 3
"""Places that are tried in all [1]."""
EFFECTS_PER_PLACE = 4
"""Effects that are fitted beside a term, of those that promise most beside it [1]."""
MAX_P_VALUE = 0.05
"""Over the library, that a term alone lacks nothing [1]: held-out shots are asked as well."""


def hold_against_free_forms(context: SearchContext, selection: SelectionResult) -> SelectionResult:
    """Let free forms compete with what a search has named, or has not, where something is left.

    Where a model of an effect and a term reaches the noise, that effect is named if no term alone does as
    well, with every effect tied that does as well beside a term of its own. Otherwise what the search has
    found to stand out falls where a free form explains as much, and so does what suffices but for a little,
    where a form in another place than its first name's explains more. What acts between shots is held
    against the columns of `shots.csv` in any case.
    """
    return hold_against_columns(context, _hold_against_places(context, selection))


def _hold_against_places(context: SearchContext, selection: SelectionResult) -> SelectionResult:
    """Let free forms in the traces compete, where something is left there."""
    if not context.problem.shots.excitation.has_contact:
        return selection
    if selection.accepted is None or selection.remains:
        return _hold_what_leaves_something(context, selection)
    if leaves_a_little(selection):
        return _hold_what_leaves_a_little(context, selection)
    return selection


def _hold_what_leaves_something(context: SearchContext, selection: SelectionResult) -> SelectionResult:
    fewer, forms = _forms_of(context, selection, SAMPLES)
    if not forms.alone:
        return selection
    if not acts_between_shots(selection):
        found = _told_beside_terms(fewer, forms)
        if found is not None:
            return _accept(context, selection, *found)
    outdone = outdone_by(fewer, selection, forms)
    return selection if outdone is None else _rejected(selection, outdone)


def _hold_what_leaves_a_little(context: SearchContext, selection: SelectionResult) -> SelectionResult:
    """Let free forms compete with names that suffice; where these fall, others may show beside a term."""
    fewer, forms = _forms_of(context, selection, SAMPLES_OF_LITTLE)
    outdone = outdone_elsewhere(fewer, selection, forms)
    if outdone is None:
        return selection
    found = _told_beside_terms(fewer, forms)
    rejected = _rejected(selection, outdone)
    return rejected if found is None else _accept(context, replace(rejected, outdone=None), *found)


def _forms_of(
    context: SearchContext, selection: SelectionResult, samples: int
) -> tuple[SearchContext, FreeForms]:
    """Fit free forms to so many samples of each channel and shot."""
    problem = context.problem
    fewer = replace(context, coarse=Problem(decimate(problem.shots, samples), problem.batches))
    return fewer, fit_free_forms(fewer, refit_shot_parameters(fewer.coarse, selection.nominal.fit))


def _rejected(selection: SelectionResult, outdone: Outdone) -> SelectionResult:
    return replace(reject(selection.nominal, selection.final, selection.alternatives), outdone=outdone)


def _told_beside_terms(
    context: SearchContext, forms: FreeForms
) -> tuple[ScoredModel, list[ScoredModel]] | None:
    """Effect that a term shows beside it, and those tied with it; None where there is none.

    Where the likeliest leaves something, its term is given more pieces.
    """
    shots, given = context.problem.shots, forms.rough.effects
    beside = [model for model in beside_terms(context, forms) if not is_at_bound(shots, model.fit, given)]
    if not beside:
        return None
    best = max(beside, key=lambda model: model.score)
    if not best.leaves_nothing and best.place in FINER:
        forms, beside = with_more_pieces(context, forms, beside, best.place)
        best = max(beside, key=lambda model: model.score)
    stands = (
        best.leaves_nothing
        and best.is_told_from(forms.alone[0])
        and best.p_value <= MAX_P_VALUE
        and stands_beside(context, best, forms)
    )
    return (best, _tied(best, beside)) if stands else None


def beside_terms(context: SearchContext, forms: FreeForms) -> list[ScoredModel]:
    """Fit effects beside each of the terms that promise most."""
    beside: list[ScoredModel] = []
    for form in _places(context, forms.rough):
        term = forms.terms.get(form.place)
        if term is None:
            continue
        there = replace(context, coarse=term.problem)
        scan = scan_candidates(term.problem, term.fit, context.library, (context.seed, 2))
        fits = refine(there, screen(there, scan, EFFECTS_PER_PLACE))
        beside += [_beside(term, fitted, scan) for fitted in fits]
    return beside


def with_more_pieces(
    context: SearchContext, forms: FreeForms, beside: Sequence[ScoredModel], place: str
) -> tuple[FreeForms, list[ScoredModel]]:
    """Give the term at a place more pieces, alone and beside each effect, where it leaves something."""
    form = FINER[place]
    alone = fit_term(context, forms.rough, form)
    if alone is None:
        return forms, list(beside)
    others = tuple(model for model in forms.alone if model.place != place)
    all_alone = sorted((score_term(alone, "", 1.0), *others), key=lambda model: -model.score)
    models = []
    for model in beside:
        fitted = None if model.place != place else fit_term(context, _without_term(forms.rough, model), form)
        models.append(model if fitted is None else score_term(fitted, model.effect, model.p_value))
    return replace(forms, alone=tuple(all_alone), terms={**forms.terms, place: alone}), models


def _places(context: SearchContext, rough: Fit) -> list[FreeForm]:
    """Places at which a term promises most: beside the effects likeliest alone, then beside nothing."""
    forms = list(REMAINDER_FORMS.values())
    scan = scan_candidates(context.coarse, rough, context.library, (context.seed, 2))
    singles = screen(context, scan, SCREENED_EFFECTS)[:FIRST_EFFECTS]
    order: dict[str, FreeForm] = {}
    for base in [*singles, rough]:
        for form in candidate_terms(context.coarse, base, forms)[:PLACES_EACH]:
            order.setdefault(form.place, form)
    return list(order.values())[:MOST_PLACES]


def _beside(term: FreeTerm, fitted: Fit, scan: CandidateScan) -> ScoredModel:
    effect = fitted.effects[-1]
    model = replace(term, problem=term.problem.with_effects(fitted.effects), fit=fitted)
    return score_term(model, effect, scan.p_value_of(effect))


def _tied(best: ScoredModel, beside: Sequence[ScoredModel]) -> list[ScoredModel]:
    """Other effects that the shots do not tell from the best, each beside the term that suits it."""
    likeliest: dict[str, ScoredModel] = {}
    for model in sorted(beside, key=lambda model: -model.score):
        likeliest.setdefault(model.effect, model)
    others = [model for effect, model in likeliest.items() if effect != best.effect]
    return [model for model in others if not best.is_told_from(model)]


def _accept(
    context: SearchContext, selection: SelectionResult, best: ScoredModel, tied: Sequence[ScoredModel]
) -> SelectionResult:
    """Accept the effect: the model that has it alone, from where it stands beside the term."""
    fits = [_named_alone(context, selection, model) for model in (best, *tied)]
    final = selection.final
    if final.fit.effects != fits[0].effects:
        final = context.test_model(fits[0])
    shots = context.problem.shots
    named = {fitted.effects for fitted in fits}
    others = [alternative.fit for alternative in selection.alternatives if alternative.effects not in named]
    candidates = [CandidateFit(fitted, fitted.log_likelihood(shots)) for fitted in (*fits, *others)]
    return replace(
        selection,
        final=final,
        accepted=fits[0],
        added=(best.effect,),
        ties={best.effect: tuple(model.effect for model in tied)},
        p_values={best.effect: best.p_value},
        alternatives=compare_fits(candidates),
        remains=True,
    )


def _named_alone(context: SearchContext, selection: SelectionResult, model: ScoredModel) -> Fit:
    """Fit nominal plant and effect to all samples, without the term."""
    effects = (*selection.nominal.fit.effects, model.effect)
    for alternative in selection.alternatives:
        if alternative.effects == effects:
            return alternative.fit
    (fitted,) = fit_all_samples(context, [_without_term(selection.nominal.fit, model)])
    return fitted


def _without_term(nominal: Fit, model: ScoredModel) -> Fit:
    """Nominal plant and effect as they stand beside the term."""
    effects = (*nominal.effects, model.effect)
    kept = np.array([coordinate.effect in {"", *effects} for coordinate in model.fit.coordinates])
    coordinates = tuple(c for c, stays in zip(model.fit.coordinates, kept, strict=True) if stays)
    return replace(model.fit, effects=effects, coordinates=coordinates, theta=model.fit.theta[kept])
