"""A law that nobody had listed, from what remains to what is proposed, proved on shots that were held out."""

import math
from dataclasses import replace

import numpy as np

from impactcell.discrepancy.laws.condense import rank_forms
from impactcell.discrepancy.laws.covariates import FEWEST_VALUES, poor_columns
from impactcell.discrepancy.laws.fitted_function import (
    drawn_function,
    effective_numbers,
    gives_energy,
    slices_of,
)
from impactcell.discrepancy.laws.free_term import (
    SMOOTHNESS,
    FreeTerm,
    fit_free_terms,
    free_forms_of,
    pair_forms_of,
)
from impactcell.discrepancy.laws.law_finding import LawFinding
from impactcell.discrepancy.laws.refit import FittedLaw, refit_forms, tied_with
from impactcell.discrepancy.laws.tangent import tangent
from impactcell.discrepancy.model import (
    Fit,
    Problem,
    fit,
    refit_shot_parameters,
)
from impactcell.discrepancy.search import GapChange, GapMeasure, Outdone, Part
from impactcell.errors import DiscrepancyError
from impactcell.physics.free_column_forms import printed

STRAIGHT = frozenset({"1", "u", "1 + u"})
"""Forms without a bend: what a spline at its smoothest bound is."""
TIED_PLACES = 2.2
"""Standard deviations over shots within which two places predict alike, as for named effects."""
MOST_LEFT = 1.2
"""Gap of the held-out traces, in noise floors, up to which a term is the law that was missing."""
MOST_SHARE_LEFT = 0.5
"""Share of the squared gap above the noise that it may leave [1]: beside a gap of 1.05 anything comes below
`MOST_LEFT`."""
MOST_STEPS = 9
"""Gauss-Newton steps with all samples, from where few came to rest."""
SETTLING_STEPS = 40
"""And with few, of a spline that is proposed itself: most rest long before."""


def find_law(
    training: tuple[Problem, Problem, Fit],
    measure: GapMeasure,
    held_base: Fit,
    seed: int,
    outdone: Outdone | None = None,
) -> LawFinding | None:
    """Look for the law that a model lacks; None where no covariate was gone through far enough to say.

    Parameters
    ----------
    training : tuple of Problem, Problem and Fit
        Shots with all samples and with fewer, and the model that leaves something.
    measure : GapMeasure
        Of the shots that were never used.
    held_base : Fit
        The same model with their own factors.
    seed : int
        Of the inner split, by which smoothness and place are chosen, and of the resampling of the proof.
    outdone : Outdone, optional
        A name that fell: where a column of `shots.csv` has taken it, that is the place.
    """
    problem, coarse, base = training
    rough = base if coarse is problem else refit_shot_parameters(coarse, base)
    forms = [form for form in free_forms_of(coarse) if form.is_between_shots]
    known = [form for form in forms if outdone and form.effect.identifier == outdone.form]
    single = _best_finding(training, rough, measure, held_base, fit_free_terms(coarse, rough, seed, known))
    if single is None or not single.refused or single.change.after.trace <= MOST_LEFT:
        return single
    # No function of one covariate is enough: what it leaves may depend on a second one.
    terms = fit_free_terms(coarse, rough, seed, pair_forms_of(coarse))
    pair = _best_finding(training, rough, measure, held_base, terms)
    if pair is None:
        return replace(
            single, refused=_none_of_two(single, "no second one was gone through far enough", coarse)
        )
    refused = pair.refused
    if not refused and not measure.change(single.held_out, pair.held_out, (Part.TRACES,)).is_real():
        refused = "on held-out shots it says no more than the best function of one by more than chance"
    return replace(single, refused=_none_of_two(single, refused, coarse)) if refused else pair


def _none_of_two(single: LawFinding, reason: str, problem: Problem) -> str:
    """Say why nothing is proposed where functions of one covariate and of two were tried."""
    poor = [printed(name) for name in poor_columns(problem)]
    untried = (
        f"; the {'column' if len(poor) == 1 else 'columns'} {' and '.join(poor)} had fewer than "
        f"{FEWEST_VALUES} different values, too little variety for a function"
        if poor
        else ""
    )
    return f"{single.refused}; of two covariates: {reason}{untried}"


def _best_finding(
    training: tuple[Problem, Problem, Fit],
    rough: Fit,
    measure: GapMeasure,
    held_base: Fit,
    terms: list[FreeTerm],
) -> LawFinding | None:
    """Condense the first term, and prove what comes of it; None where there are no terms."""
    if not terms:
        return None
    problem, best = training[0], terms[0]
    laws = refit_forms(rough, best, rank_forms(tangent(best)))
    if best.smoothness == SMOOTHNESS[-1]:
        laws = _straight_first(laws)
    law = laws[0] if laws and not _spline_is_better(best, laws[0]) else None
    best = settled(best) if law is None else best
    source = best if law is None else law
    model, fitted = _with_all_samples(problem, source.problem, source.fit)
    held = refit_shot_parameters(measure.problem.constrained(fitted.effects, model.constraints), fitted)
    change = measure.change(held_base, held, (_part(best),))
    return LawFinding(
        best,
        drawn_function(best),
        slices_of(best),
        law,
        () if law is None else _equivalents(laws),
        tuple(term.form.effect.identifier for term in terms[1:] if _predict_alike(best, term)),
        change,
        model,
        fitted,
        held,
        _refusal(
            best, law, change, MOST_LEFT if _part(best) is Part.TRACES else measure.expected(held)[1].factor
        ),
    )


def settled(term: FreeTerm) -> FreeTerm:
    """Run the fit of a term on until it rests: a few steps only had to tell places and weights apart."""
    model = term.fit
    try:
        fitted = fit(
            term.problem, model.theta, model.shot_parameters, spread=model.spread, most_steps=SETTLING_STEPS
        )
    except DiscrepancyError:
        return term
    return replace(term, fit=fitted)


def _straight_first(laws: list[FittedLaw]) -> list[FittedLaw]:
    """Put a straight form first where it is tied with the best: then the data tell nothing of a bend."""
    for law in laws:
        if law.law.functional_form in STRAIGHT and tied_with(laws[0], law):
            return [law, *(item for item in laws if item is not law)]
    return laws


def _part(term: FreeTerm) -> Part:
    """In what a term shows: what acts between shots in their friction factors only."""
    return Part.FACTORS if term.form.is_between_shots else Part.TRACES


def _with_all_samples(problem: Problem, coarse: Problem, fitted: Fit) -> tuple[Problem, Fit]:
    """Fit the same model to all samples."""
    model = problem.constrained(coarse.effects, coarse.constraints)
    if coarse.shots is problem.shots:
        return model, fitted
    start = refit_shot_parameters(model, fitted)
    try:
        again = fit(
            model, start.theta, start.shot_parameters, spread=max(fitted.spread, 1e-6), most_steps=MOST_STEPS
        )
    except DiscrepancyError:
        return model, start
    return model, again


def _spline_is_better(term: FreeTerm, law: FittedLaw) -> bool:
    """Whether the spline says more than the best form, its own numbers paid for."""
    spline = term.fit.log_likelihood(term.problem.shots)
    numbers = effective_numbers(term)
    cost = 0.5 * math.log(term.fit.residual.size)
    better = float(spline.sum()) - cost * numbers - law.score
    scatter = float(np.std(spline - law.per_shot)) * math.sqrt(len(spline))
    return better > max(cost, TIED_PLACES * scatter)


def _equivalents(laws: list[FittedLaw]) -> tuple[FittedLaw, ...]:
    """Forms that are tied with the first; one that merely contains it says nothing else."""
    best = laws[0]
    parts = set(best.law.functional_form.split(" + "))
    return tuple(
        law
        for law in laws[1:]
        if tied_with(best, law) and not parts < set(law.law.functional_form.split(" + "))
    )


def _predict_alike(best: FreeTerm, other: FreeTerm) -> bool:
    """Whether two places predict shots that they were not fitted to equally well."""
    difference = np.log(other.check_per_shot / best.check_per_shot)
    scatter = float(np.std(difference)) / math.sqrt(max(len(difference), 1))
    return float(np.mean(difference)) < TIED_PLACES * scatter


def _refusal(term: FreeTerm, law: FittedLaw | None, change: GapChange, most_left: float) -> str:
    """Why nothing is proposed, if so; `most_left` is the gap that it may leave."""
    if not change.is_real():
        return "on held-out shots the gap does not fall by more than chance"
    left, before = (gap.of(change.parts) for gap in (change.after, change.before))
    if left > most_left or left**2 - 1.0 > MOST_SHARE_LEFT * (before**2 - 1.0):
        return (
            f"the best term, {term.form.effect.equation}, leaves {left:.3g} of {before:.3g} noise "
            f"floors: what is missing is no function of {_named(term)}{'' if term.form.second else ' alone'}"
        )
    if gives_energy(term, law):
        return (
            f"the term would give energy: {term.form.effect.equation} becomes negative in the range that was "
            "gone through, so that something else is missing"
        )
    if term.smoothness == SMOOTHNESS[-1] and law is None:
        return (
            "the smoothest spline predicts best, so that the data tell nothing of how the term bends; "
            f"shots over a wider range of {_named(term)} would"
        )
    return ""


def _named(term: FreeTerm) -> str:
    """Say in words what a term is of."""
    return " and ".join(printed(name).replace("_", " ") for name in term.form.covariates)
