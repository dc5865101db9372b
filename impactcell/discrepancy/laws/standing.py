"""Whether a name that leaves something stands against a free form in every place there is.

An effect that stands out takes most of a gap, but so may another law's best likeness in the library: a patch
of friction is drawn to a pull that ends somewhere. So each place at which the equations of motion allow a
force, a friction, a motion or a reading of no form gets a free form, fitted alone, and the force channel a
filter. A name falls to a form elsewhere that explains as much. In its own place a form that explains more is
to be expected beside other errors, as it takes a part of them; where it leaves nothing the place is right,
and the law is not. What acts between shots falls to a form that leaves the friction factors as narrow, and in
no order that they would go with it.
"""

from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data import FORCE
from impactcell.discrepancy.laws.covariates import visited
from impactcell.discrepancy.laws.free_term import FIRST_TRY, MOST_STEPS, FreeTerm, fit_free_term
from impactcell.discrepancy.laws.scored_model import ScoredModel, score_fit, score_term
from impactcell.discrepancy.model import Fit, fit
from impactcell.discrepancy.search import (
    POLICY,
    ModelEvidence,
    SearchContext,
    SelectionResult,
    chance_of_order,
    refine,
)
from impactcell.errors import DiscrepancyError
from impactcell.physics import Kind
from impactcell.physics.effects import find_effect
from impactcell.physics.free_form import FreeForm
from impactcell.physics.remainder_forms import FORCE_FILTER, REMAINDER_FORMS

MIN_SHARE_OF_FREE = 0.9
"""Share of the squared gap that a term alone closes which a name has to close [1]: one wave or patch has been
seen to close 0.83 of what a smooth curve of no name makes."""
FILTER_STARTS = ((0.0, 1.0), (1.0, 0.0), (-1.0, 0.0))
"""Delay and time constant at which fits of the filter start, in units of their typical sizes [1]."""


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
    fitted = [_fit_term(context, rough, form) for form in REMAINDER_FORMS.values()]
    terms = {term.form.place: term for term in fitted if term is not None}
    alone = [score_term(term, "", 1.0) for term in terms.values()]
    filtered = _fit_filter(context, rough)
    if filtered is not None:
        alone.append(score_fit(context.coarse, filtered, "", FORCE_FILTER.identifier))
    return FreeForms(rough, tuple(sorted(alone, key=lambda model: -model.score)), terms)


def _fit_term(context: SearchContext, base: Fit, form: FreeForm) -> FreeTerm | None:
    """Fit a term beside a model; None where shots hardly go through its covariate, or it has no answer."""
    span = visited(context.coarse, base, form)
    if span is None:
        return None
    try:
        problem, fitted = fit_free_term(context.coarse, base, form, span, FIRST_TRY)
    except DiscrepancyError:
        return None
    return FreeTerm(form, span, problem, fitted, FIRST_TRY, np.empty(0))


def _fit_filter(context: SearchContext, rough: Fit) -> Fit | None:
    """Fit the filter of the force channel from several starts, and keep the likeliest; None without one."""
    if not (context.coarse.shots.channel == FORCE).any():
        return None
    problem = context.coarse.with_effects((*rough.effects, FORCE_FILTER.identifier))
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


def stands(context: SearchContext, selection: SelectionResult, forms: FreeForms) -> bool:
    """Whether no free form takes the name away from the effect that was accepted.

    What acts between shots is compared by the friction factors, in which it shows; all others by the traces.
    """
    if selection.accepted is None:
        return False
    refitted = refine(context, [selection.accepted])
    if not refitted:
        return False
    named = score_fit(context.coarse, refitted[0], selection.accepted.effects[-1])
    if find_effect(named.effect).kind is Kind.BETWEEN_SHOTS:
        narrower = [form for form in forms.alone if form.variance_of_factors <= named.variance_of_factors]
        return all(_is_followed(context, selection.nominal, named.effect, form) for form in narrower)
    return not any(outdoes(form, named, forms.rough) for form in forms.alone)


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
    before = float(np.mean(rough.residual**2))
    if before - named.mean_square < MIN_SHARE_OF_FREE * (before - form.mean_square):
        return True
    if named.leaves_nothing:
        return False
    if is_in_its_place(named.effect, form.place):
        return form.leaves_nothing and form.is_told_from(named)
    return form.score >= named.score


def is_in_its_place(effect: str, place: str) -> bool:
    """Whether an effect enters the equations of motion where a free form does."""
    return bool(set(find_effect(effect).laws) & set(find_effect(place).laws))
