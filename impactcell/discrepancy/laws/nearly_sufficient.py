"""Names that suffice but for a little, held against free forms in other places.

A patch of friction takes most of what a magnet's pull does, and what it leaves, two to eight hundredths of
the noise, shows in no effect of the library. A curve over position alone explains more. So may one that takes
other errors of the record where the name is right: the name stands where it adds to such a form, or is the
likelier when either has a second form beside it.
"""

from dataclasses import replace

import numpy as np

from impactcell.discrepancy.laws.scored_model import ScoredModel, score_fit, score_term
from impactcell.discrepancy.laws.standing import (
    FreeForms,
    fit_term,
    is_in_its_place,
    seconds_beside_form,
    with_second,
)
from impactcell.discrepancy.search import Outdone, SearchContext, SelectionResult, refine
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY
from impactcell.physics.remainder_forms import REMAINDER_FORMS

MOST_UNASKED = 1.015
"""RMS residual of the traces [noise floors] up to which what suffices is not asked: right names have been
seen to leave 1.009 at most where nothing else was wrong, another law's best likeness 1.006 (a weak law, which
is thus still named) to 1.084. Own choice."""
SAMPLES_OF_LITTLE = 400
"""Samples of a channel and shot that the competition reads, as little is left to tell by [1]. Own choice."""


def leaves_a_little(selection: SelectionResult) -> bool:
    """Whether what suffices leaves more in the traces than right names do; not what acts between shots."""
    if selection.accepted is None or selection.remains:
        return False
    if acts_between_shots(selection):
        return False
    return float(np.mean(selection.accepted.residual**2)) > MOST_UNASKED**2


def acts_between_shots(selection: SelectionResult) -> bool:
    """Whether any effect that a search has added acts between shots."""
    return any(LIBRARY[effect].kind is Kind.BETWEEN_SHOTS for effect in selection.added)


def outdone_elsewhere(context: SearchContext, selection: SelectionResult, forms: FreeForms) -> Outdone | None:
    """Which free form in another place takes away names that suffice but for a little; None if they stand.

    Several go by the first of them, which takes most.
    """
    refitted = [] if selection.accepted is None else refine(context, [selection.accepted])
    if not refitted:
        return None
    effect = selection.added[0]
    named = score_fit(context.coarse, refitted[0], effect)
    beside = replace(context, coarse=context.coarse.with_effects(named.fit.effects))
    ahead = [
        form
        for form in forms.alone
        if form.place in forms.terms
        and not is_in_its_place(effect, form.place)
        and form.is_told_from(named)
        and not _adds_to(beside, named, form)
    ]
    if not ahead:
        return None
    seconds = with_second(context, beside.coarse, named.fit, effect)
    elsewhere = [one for one in seconds if not is_in_its_place(effect, one.place)]
    best = max(one.score for one in (named, *elsewhere))
    for form in ahead:
        if max(one.score for one in (form, *seconds_beside_form(context, form, forms))) >= best:
            return Outdone(effect, form.place, same_place=False)
    return None


def _adds_to(beside: SearchContext, named: ScoredModel, form: ScoredModel) -> bool:
    """Whether the names say something beside a form that it does not say alone.

    Parameters
    ----------
    beside : SearchContext
        With the names in the model.
    """
    term = fit_term(beside, named.fit, REMAINDER_FORMS[form.place])
    return term is not None and score_term(term, named.effect, 1.0).is_told_from(form)
