"""Names of what acts between shots, held against each further column of `shots.csv`.

A temperature that rises from shot to shot makes friction look as if it drifted, and hardness that goes with
the batch as if batches differed. So a straight line in each column takes the place of such an effect: one
that leaves the friction factors clearly narrower takes its name away, one that leaves them about as narrow is
tied with it. Where what the line leaves goes with the effect all the same, both have a part in it.
"""

from collections.abc import Container, Iterator
from dataclasses import replace

import numpy as np

from impactcell.discrepancy.data import decimate
from impactcell.discrepancy.laws.covariates import visited
from impactcell.discrepancy.laws.free_term import FreeTerm, free_forms_of
from impactcell.discrepancy.laws.scored_model import score_fit, score_term
from impactcell.discrepancy.laws.standing import SAMPLES
from impactcell.discrepancy.laws.term_start import fit_free_term
from impactcell.discrepancy.model import Fit, Problem, fit, refit_shot_parameters
from impactcell.discrepancy.search import (
    POLICY,
    ModelEvidence,
    Outdone,
    SearchContext,
    SelectionResult,
    chance_by_exchange,
    exchange_rng,
    factor_patterns,
    fit_all_samples,
    fitted_with,
    refine,
    reject,
    widest_rival,
    without_each_effect,
)
from impactcell.errors import DiscrepancyError
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY
from impactcell.records import Samples

STRAIGHT = 1e6
"""Weight of the roughness, over what the data know of the coefficients, at which a spline is a straight line:
at 1 it has five numbers, and bends with the scatter of some thirty shots."""
SAME = 1e-9
"""Share of a pattern that others leave up to which it is one of them but for rounding."""


def hold_against_columns(context: SearchContext, selection: SelectionResult) -> SelectionResult:
    """Let straight lines in further columns compete with each accepted effect that acts between shots."""
    if selection.accepted is None or not context.problem.shots.items[0].columns:
        return selection
    fewer = replace(context, coarse=Problem(decimate(context.coarse.shots, SAMPLES), context.problem.batches))
    for effect in selection.added:
        if LIBRARY[effect].kind is not Kind.BETWEEN_SHOTS:
            continue
        tied = []
        for column, is_ahead in _rival_columns(fewer, selection, effect):
            if is_ahead:
                return hold_against_columns(context, _without(context, selection, effect, column))
            tied.append(column)
        both = dict.fromkeys((*selection.ties.get(effect, ()), *tied))
        selection = replace(selection, ties={**selection.ties, effect: tuple(both)})
    return selection


def _rival_columns(
    context: SearchContext, selection: SelectionResult, effect: str
) -> Iterator[tuple[str, bool]]:
    """Free forms of columns that leave the factors as narrow as an effect does, and whether clearly so.

    A column is ahead, too, where what the effect leaves goes with it: where either has its part of what they
    do not share, and the other has none (Davidson and MacKinnon 1981, by exchange of the shots).

    Parameters
    ----------
    context : SearchContext
        With a few samples of each shot.
    """
    accepted = [] if selection.accepted is None else refine(context, [selection.accepted])
    if not accepted:
        return
    (named,) = accepted
    patterns = factor_patterns(context.coarse, selection.nominal, effect)
    if not len(patterns):
        return
    shots, error = context.problem.count, POLICY.between_shots_error
    spread = score_fit(context.coarse, named, effect).variance_of_factors ** 0.5
    starts = [one for one in without_each_effect(selection.nominal.fit, named) if effect not in one.effects]
    for base in refine(context, starts):
        for line in _lines(context, base, frozenset(LIBRARY[effect].columns)):
            column, rng = line.visited.values[None], exchange_rng(context)
            factors = line.fit.shot_parameters.log_factor
            if chance_by_exchange(factors, _apart(patterns, column), rng) <= error:
                continue
            left = score_term(line, "", 1.0).variance_of_factors ** 0.5
            chance = chance_by_exchange(named.shot_parameters.log_factor, _apart(column, patterns), rng)
            is_ahead = chance <= error or widest_rival(left, shots) < spread
            if is_ahead or left <= widest_rival(spread, shots):
                yield line.form.effect.identifier, is_ahead


def beside_column(context: SearchContext, nominal: ModelEvidence, model: Fit) -> tuple[Problem, Fit] | None:
    """Fit a model with a straight line in the column that its friction factors follow most.

    Parameters
    ----------
    nominal : ModelEvidence
        Against the model without effects: the points of their grids.

    Returns
    -------
    tuple of Problem and Fit, or None
        None where factors follow no column, or no effect of the model acts between shots.
    """
    names = [name for name in nominal.candidate_scan.candidates.names if name in model.effects]
    names = [name for name in names if LIBRARY[name].kind is Kind.BETWEEN_SHOTS]
    patterns = np.array([row for name in names for row in factor_patterns(context.coarse, nominal, name)])
    if not len(patterns):
        return None
    own = [column for name in names for column in LIBRARY[name].columns]
    rough = refit_shot_parameters(context.coarse.with_effects(model.effects), model)
    factors, followed = rough.shot_parameters.log_factor, dict[float, FreeTerm]()
    for line in _lines(context, rough, own):
        column = _apart(line.visited.values[None], patterns)
        followed.setdefault(chance_by_exchange(factors, column, exchange_rng(context)), line)
    if min(followed, default=1.0) > POLICY.between_shots_error:
        return None
    term = followed[min(followed)]
    try:
        start = term.fit
        return term.problem, fit(term.problem, start.theta, start.shot_parameters, spread=start.spread)
    except DiscrepancyError:
        return None


def _apart(patterns: Samples, others: Samples) -> Samples:
    """Regress others out of patterns of the shots, shape (Q, n); nought where they are the same."""
    X = np.column_stack([np.ones(patterns.shape[1]), *others])
    apart = patterns - (X @ np.linalg.lstsq(X, patterns.T)[0]).T
    own = np.linalg.norm(apart, axis=1) > SAME * np.linalg.norm(patterns, axis=1)
    return np.where(own[:, None], apart, 0.0)


def _lines(context: SearchContext, base: Fit, own: Container[str]) -> Iterator[FreeTerm]:
    """Fit a straight line in each column beside a model, not in an effect's own or in one of few values."""
    problem = context.coarse.with_effects(base.effects)
    for form in free_forms_of(problem):
        is_rival = form.is_between_shots and form.covariate not in own
        span = visited(problem, base, form) if is_rival else None
        if span is None:
            continue
        try:
            extended, fitted = fit_free_term(problem, base, form, span, STRAIGHT)
        except DiscrepancyError:
            continue
        yield FreeTerm(form, span, extended, fitted, STRAIGHT, np.empty(0))


def _without(context: SearchContext, selection: SelectionResult, effect: str, column: str) -> SelectionResult:
    """Take its name away from an effect; those beside it stay, with what it explained left."""
    outdone = Outdone(effect, column, same_place=False)
    added = tuple(name for name in selection.added if name != effect)
    if not added or selection.accepted is None:
        return replace(reject(selection.nominal, selection.final, selection.alternatives), outdone=outdone)
    known = fitted_with(selection, added)
    starts = without_each_effect(selection.nominal.fit, selection.accepted)
    fits = (
        [known] if known else fit_all_samples(context, [one for one in starts if effect not in one.effects])
    )
    if not fits:
        return replace(reject(selection.nominal, selection.final, selection.alternatives), outdone=outdone)
    return replace(
        selection,
        final=context.test_model(fits[0]),
        accepted=fits[0],
        added=added,
        ties={name: selection.ties.get(name, ()) for name in added},
        p_values={name: selection.p_values[name] for name in added},
        remains=True,
        outdone=outdone,
    )
