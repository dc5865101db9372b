"""Whether a name that leaves something stands against free forms in every place there is.

An effect that stands out takes most of a gap, but so may another law's best likeness in the library: a patch
of friction is drawn to a pull that ends somewhere. So each place at which the equations of motion allow a
force, a friction, a motion or a reading of no form gets a free form, fitted alone, and either channel a
filter. A name falls to a form elsewhere that explains as much. In its own place a form that explains more is
to be expected beside other errors, as it takes a part of them; where it leaves nothing the place is right,
and the law is not. So it is where the form keeps ahead when name and form each have a second form beside them
that may take the other errors. What acts between shots falls to a form that leaves the friction factors as
narrow, and in no order that they would go with it.

A name that only shows beside a form falls to a second form beside that one likewise, and where it only rounds
off what the form leaves.
"""

from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data import FORCE
from impactcell.discrepancy.laws.covariates import visited
from impactcell.discrepancy.laws.free_term import FIRST_TRY, FreeTerm, candidate_terms
from impactcell.discrepancy.laws.scored_model import ScoredModel, score_fit, score_term
from impactcell.discrepancy.laws.term_start import MOST_STEPS, fit_free_term
from impactcell.discrepancy.model import Fit, Problem, fit
from impactcell.discrepancy.search import (
    POLICY,
    ModelEvidence,
    Outdone,
    SearchContext,
    SelectionResult,
    chance_of_order,
    refine,
)
from impactcell.errors import DiscrepancyError
from impactcell.physics import Kind
from impactcell.physics.effect import Effect, LawKind
from impactcell.physics.effects import find_effect
from impactcell.physics.free_form import FreeForm
from impactcell.physics.remainder_forms import FILTERS, REMAINDER_FORMS

MIN_SHARE_OF_FREE = 0.9
"""Share of the squared gap that a term alone closes which a name has to close [1]: one wave or patch has been
seen to close 0.83 of what a smooth curve of no name makes."""
MIN_SHARE_BESIDE = 0.05
"""Share of the squared gap above the noise that a name has to close beside a term [1]: what only rounds off
what a term leaves has been seen to close 0.034 at most, an effect that was there 0.12 at least."""
SAMPLES = 100
"""Samples of a channel and shot that the competition reads: gains are in the thousands [1]."""
SECOND_FORMS = 3
"""Free forms that are fitted beside a name or a form, of those that promise most there [1]. Own choice."""
STATES = tuple(10.0**power for power in range(-6, 3))
"""Values of what a law reads, from micrometres to hundreds of newtons, over which it is asked whether
it does [SI]."""
FILTER_STARTS = ((0.0, 1.0), (1.0, 0.0), (-1.0, 0.0))
"""Delay and time constant at which fits of a filter start, in units of their typical sizes [1]."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeForms:
    """Free forms fitted alone, one a place.

    Attributes
    ----------
    rough : Fit
        Nominal model on the same samples.
    alone : tuple of ScoredModel
        The likeliest first.
    terms : dict of str to FreeTerm
        Splines by their place.
    """

    rough: Fit
    alone: tuple[ScoredModel, ...]
    terms: dict[str, FreeTerm]


def fit_free_forms(context: SearchContext, rough: Fit) -> FreeForms:
    """Fit a free form at every place, each alone; places that the shots do not go through are left out."""
    fitted = [fit_term(context, rough, form) for form in REMAINDER_FORMS.values()]
    terms = {term.form.place: term for term in fitted if term is not None}
    alone = [score_term(term, "", 1.0) for term in terms.values()]
    for identifier in FILTERS:
        filtered = _fit_filter(context, rough, identifier)
        if filtered is not None:
            alone.append(score_fit(context.coarse, filtered, "", identifier))
    return FreeForms(rough, tuple(sorted(alone, key=lambda model: -model.score)), terms)


def fit_term(context: SearchContext, base: Fit, form: FreeForm) -> FreeTerm | None:
    """Fit a term beside a model; None where shots hardly go through its covariate, or it has no answer."""
    span = visited(context.coarse, base, form)
    if span is None:
        return None
    try:
        problem, fitted = fit_free_term(context.coarse, base, form, span, FIRST_TRY)
    except DiscrepancyError:
        return None
    return FreeTerm(form, span, problem, fitted, FIRST_TRY, np.empty(0))


def _fit_filter(context: SearchContext, rough: Fit, identifier: str) -> Fit | None:
    """Fit a filter of a channel from several starts, and keep the likeliest; None without a force channel."""
    if not (context.coarse.shots.channel == FORCE).any():
        return None
    problem = context.coarse.with_effects((*rough.effects, identifier))
    fits = []
    for start in FILTER_STARTS:
        theta = np.concatenate([rough.theta, start])
        try:
            fits.append(
                fit(problem, theta, rough.shot_parameters, spread=rough.spread, most_steps=MOST_STEPS)
            )
        except DiscrepancyError:
            continue
    return max(fits, key=lambda one: float(one.log_likelihood(problem.shots).sum()), default=None)


def outdone_by(context: SearchContext, selection: SelectionResult, forms: FreeForms) -> Outdone | None:
    """Which free form takes the name away from the effect that was accepted; None where it stands.

    What acts between shots is compared by the friction factors, in which it shows; all others by the traces.
    """
    if selection.accepted is None:
        return None
    effect = selection.accepted.effects[-1]
    refitted = refine(context, [selection.accepted])
    if not refitted:
        return Outdone(effect, "", same_place=False)
    named = score_fit(context.coarse, refitted[0], effect)
    if find_effect(effect).kind is Kind.BETWEEN_SHOTS:
        rivals = (
            form
            for form in forms.alone
            if form.variance_of_factors <= named.variance_of_factors
            and not _is_followed(context, selection.nominal, effect, form)
        )
        rival = next(rivals, None)
    else:
        rival = _outdoing(context, named, forms) or _another_law(context, named, forms)
    return None if rival is None else Outdone(effect, rival.place, is_in_its_place(effect, rival.place))


def _outdoing(context: SearchContext, named: ScoredModel, forms: FreeForms) -> ScoredModel | None:
    """Find the free form that outdoes a name.

    One that closes little more than the name has to keep ahead when either has a second form beside it, the
    name one in another place than its own: that may take what is no part of the law.
    """
    rivals = [form for form in forms.alone if outdoes(form, named, forms.rough)]
    contested = [form for form in rivals if _is_contested(form, named, forms.rough)]
    if not rivals or len(contested) < len(rivals):
        return next((form for form in rivals if form not in contested), None)
    seconds = _with_seconds(context, named, forms)
    elsewhere = [one for one in seconds if not is_in_its_place(named.effect, one.place)]
    best = max((named, *elsewhere), key=lambda one: one.score)
    for form in contested:
        rival = max((form, *_with_seconds(context, form, forms)), key=lambda one: one.score)
        is_its_own = is_in_its_place(named.effect, form.place)
        if rival.is_told_from(best) if is_its_own else rival.score >= best.score:
            return form
    return None


def _is_contested(form: ScoredModel, named: ScoredModel, rough: Fit) -> bool:
    """Whether it is open if a spline outdoes a name: not where it closes much more, or all from elsewhere.

    Where both close all, it is.
    """
    is_near = form.place in REMAINDER_FORMS and closes_enough(form, named, rough)
    is_open = is_in_its_place(named.effect, form.place) or named.leaves_nothing or not form.leaves_nothing
    return is_near and is_open


def _with_seconds(context: SearchContext, model: ScoredModel, forms: FreeForms) -> list[ScoredModel]:
    """Fit free forms beside a name or a form, those that promise most there."""
    if not model.effect:
        return seconds_beside_form(context, model, forms)
    return with_second(context, context.coarse.with_effects(model.fit.effects), model.fit, model.effect)


def seconds_beside_form(context: SearchContext, form: ScoredModel, forms: FreeForms) -> list[ScoredModel]:
    """Fit free forms beside a form, those that promise most there."""
    term = forms.terms[form.place]
    return with_second(context, term.problem, term.fit, "")


def stands_beside(context: SearchContext, named: ScoredModel, forms: FreeForms) -> bool:
    """Whether an effect beside a term closes its part, and no second form elsewhere is as likely."""
    alone = next(form for form in forms.alone if form.place == named.place)
    gap = float(np.mean(forms.rough.residual**2)) - 1.0
    if alone.mean_square - named.mean_square < MIN_SHARE_BESIDE * gap:
        return False
    seconds = _with_seconds(context, alone, forms)
    return not any(
        form.score >= named.score for form in seconds if not is_in_its_place(named.effect, form.place)
    )


def _another_law(context: SearchContext, named: ScoredModel, forms: FreeForms) -> ScoredModel | None:
    """Find the form in an effect's place that keeps ahead of it when either has a second form beside it."""
    ahead = (
        form
        for form in forms.alone
        if form.place in forms.terms
        and is_in_its_place(named.effect, form.place)
        and form.is_told_from(named)
    )
    form = next(ahead, None)
    if form is None:
        return None
    best, rival = (
        max(_with_seconds(context, model, forms), key=lambda one: one.score, default=model)
        for model in (named, form)
    )
    return form if rival.is_told_from(best) else None


def with_second(context: SearchContext, problem: Problem, base: Fit, effect: str) -> list[ScoredModel]:
    """Fit free forms beside a model, each by itself, of those that promise most there."""
    there = replace(context, coarse=problem)
    forms = [form for form in REMAINDER_FORMS.values() if form.effect.identifier not in base.effects]
    fitted = [fit_term(there, base, form) for form in candidate_terms(problem, base, forms)[:SECOND_FORMS]]
    return [score_term(term, effect, 1.0) for term in fitted if term is not None]


def _is_followed(context: SearchContext, nominal: ModelEvidence, effect: str, form: ScoredModel) -> bool:
    """Whether the friction factors that a free form leaves go with an effect between shots all the same."""
    chance = chance_of_order(context, nominal, effect, form.fit.shot_parameters.log_factor)
    return chance is not None and chance <= POLICY.between_shots_error


def outdoes(form: ScoredModel, named: ScoredModel, rough: Fit) -> bool:
    """Whether a free form takes a name away from an effect that leaves something.

    Parameters
    ----------
    form, named : ScoredModel
        Free form alone, and named effect alone.
    rough : Fit
        Model with neither, on the same samples.
    """
    if not closes_enough(form, named, rough):
        return True
    if is_in_its_place(named.effect, form.place):
        return not named.leaves_nothing and form.leaves_nothing and form.is_told_from(named)
    return form.is_told_from(named) if named.leaves_nothing else form.score >= named.score


def closes_enough(form: ScoredModel, named: ScoredModel, rough: Fit) -> bool:
    """Whether a name closes most of the squared gap that a free form closes."""
    before = float(np.mean(rough.residual**2))
    return before - named.mean_square >= MIN_SHARE_OF_FREE * (before - form.mean_square)


def is_in_its_place(effect: str, place: str) -> bool:
    """Whether a free form may be the law of an effect: it enters where that does, and reads all it reads."""
    named = find_effect(effect)
    if place in FILTERS:
        return bool(set(named.laws) & set(FILTERS[place].laws))
    form = REMAINDER_FORMS[place]
    shared = set(named.laws) & set(form.effect.laws)
    return any(state_read(named, kind) <= form.state for kind in shared)


def state_read(effect: Effect, kind: LawKind) -> frozenset[str]:
    """Which of the first two numbers of a law, its state, it reads: `a`, `b`, both or neither.

    The other two are numbers of the shot or of the plant. It reads what changes its value, with its
    parameters at their typical sizes and its columns in the middle of their ranges.
    """
    law, typical = effect.laws[kind], [parameter.typical for parameter in effect.parameters]
    typical += [0.5 * (low + high) for low, high in effect.columns.values()]
    varied = {
        "a": [{law(state, other, 1.0, 1.0, typical) for state in STATES} for other in STATES],
        "b": [{law(other, state, 1.0, 1.0, typical) for state in STATES} for other in STATES],
    }
    return frozenset(name for name, values in varied.items() if any(len(items) > 1 for items in values))
