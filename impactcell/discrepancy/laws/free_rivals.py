"""Named effects held against free forms: what stands where neither a name nor two suffice.

What a model of a real machine leaves is a smooth function of something: position, speed, indentation, time or
force. So effects are fitted beside a free-form term in the place that suits them, and the term is fitted
alone. A name stands if it says what no term says alone; where a term does without it the answer is a law's.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data import decimate
from impactcell.discrepancy.laws.covariates import visited
from impactcell.discrepancy.laws.finding import effective_numbers
from impactcell.discrepancy.laws.free_term import (
    FIRST_TRY,
    FreeTerm,
    candidate_terms,
    fit_free_term,
)
from impactcell.discrepancy.model import Fit, Problem, refit_shot_parameters
from impactcell.discrepancy.search import (
    CandidateFit,
    CandidateScan,
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
from impactcell.errors import DiscrepancyError
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY
from impactcell.physics.free_form import FreeForm
from impactcell.physics.remainder_forms import REMAINDER_FORMS
from impactcell.records import Samples

SAMPLES = 100
"""Samples of a channel and shot that the competition reads: gains are in the thousands [1]."""
SCREENED_EFFECTS, FIRST_EFFECTS = 6, 3
"""Effects that are tried alone, and those of them, the likeliest, beside which places are looked for [1]."""
PLACES_EACH = 2
"""Places that are tried for each of them [1]."""
MOST_PLACES = 3
"""Places that are tried in all [1]."""
EFFECTS_PER_PLACE = 4
"""Effects that are fitted beside a term, of those that promise most beside it [1]."""
MIN_GAIN = 30.0
"""Log-likelihood that a name must add to the best term alone [1], as a second effect must to the first."""
TIED_DEVIATIONS, LARGEST_TIE = 2.2, 150.0
"""Standard deviations over shots up to which two models are not told apart [1], and the largest difference
of log-likelihoods that is a tie, over the mean squared residual [1]; as among named effects."""
MAX_P_VALUE = 0.05
"""Over the library, that a term alone lacks nothing [1]: held-out shots are asked as well."""
MIN_SHARE_OF_FREE = 0.9
"""Share of the squared gap that a term alone closes which a name has to close [1]: one wave or patch has been
seen to close 0.83 of what a smooth curve of no name makes."""
MOST_LEFT = 1.1
"""RMS residual [noise floors] up to which a model with a term leaves nothing that speaks against it."""


@dataclass(frozen=True, slots=True, eq=False)
class ScoredModel:
    """A model with a free-form term, with a named effect beside it or alone.

    Attributes
    ----------
    effect : str
        Named effect; empty for the term alone.
    place : str
    fit : Fit
    each : ndarray, shape (n,)
        Log-likelihood of every shot, less its part of half the logarithm of the samples for each number
        (Schwarz 1978), those of the spline counted by what its roughness leaves of them.
    p_value : float
        That the term alone lacks nothing, by the test of this effect beside it, over the library.
    """

    effect: str
    place: str
    fit: Fit
    each: Samples
    p_value: float

    @property
    def score(self) -> float:
        """Over all shots."""
        return float(self.each.sum())

    @property
    def mean_square(self) -> float:
        """Mean squared residual [squared noise floors]."""
        return float(np.mean(self.fit.residual**2))

    def is_told_from(self, other: "ScoredModel") -> bool:
        """Whether the shots tell another model, which is worse, from this one."""
        difference = self.each - other.each
        gap = float(difference.sum())
        scatter = float(difference.std()) * math.sqrt(len(difference))
        return gap > MIN_GAIN and (
            gap > TIED_DEVIATIONS * scatter or gap > LARGEST_TIE * max(self.mean_square, 1.0)
        )


def hold_against_free_forms(context: SearchContext, selection: SelectionResult) -> SelectionResult:
    """Let free forms compete with what a search that found nothing sufficient has named, or has not.

    Where a model of an effect and a term reaches the noise, that effect is named if no term alone does as
    well, with every effect tied that does as well beside a term of its own. Otherwise what the search has
    found to stand out stands if it closes nearly as much as the best term alone.
    """
    if not _asks(context, selection):
        return selection
    nominal = selection.nominal.fit
    problem = context.problem
    fewer = replace(context, coarse=Problem(decimate(problem.shots, SAMPLES), problem.batches))
    alone, beside = _models(fewer, refit_shot_parameters(fewer.coarse, nominal))
    beside = [model for model in beside if not is_at_bound(model.fit)]
    if not alone:
        return selection
    free = max(alone, key=lambda model: model.score)
    best = max(beside, key=lambda model: model.score, default=free)
    is_named = best.is_told_from(free) and best.p_value <= MAX_P_VALUE
    if is_named and best.mean_square <= MOST_LEFT**2:
        return _accept(context, selection, best, _tied(best, beside))
    if selection.accepted is not None and not _is_about_as_good(fewer.coarse, selection, free):
        return reject(selection.nominal, selection.final, selection.alternatives)
    return selection


def _is_about_as_good(problem: Problem, selection: SelectionResult, free: ScoredModel) -> bool:
    """Whether what stands out closes nearly as much of the gap as a term alone, which has more numbers."""
    if selection.accepted is None:
        return False
    before, after = (
        float(np.mean(refit_shot_parameters(problem, model).residual ** 2))
        for model in (selection.nominal.fit, selection.accepted)
    )
    return before - after >= MIN_SHARE_OF_FREE * (before - free.mean_square)


def _asks(context: SearchContext, selection: SelectionResult) -> bool:
    """Whether something is left in the traces of taps that a term may explain."""
    between = any(LIBRARY[effect].kind is Kind.BETWEEN_SHOTS for effect in selection.added)
    is_open = selection.accepted is None or selection.remains
    return context.problem.shots.excitation.has_contact and is_open and not between


def _models(context: SearchContext, rough: Fit) -> tuple[list[ScoredModel], list[ScoredModel]]:
    """Fit terms alone, and effects beside each of them."""
    alone: list[ScoredModel] = []
    beside: list[ScoredModel] = []
    for form in _places(context, rough):
        term = _term(context, rough, form)
        if term is None:
            continue
        there = replace(context, coarse=term.problem)
        scan = scan_candidates(term.problem, term.fit, context.library, (context.seed, 2))
        alone.append(_scored(term, "", 1.0))
        fits = refine(there, screen(there, scan, EFFECTS_PER_PLACE))
        beside += [_beside(term, fitted, scan) for fitted in fits]
    return alone, beside


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


def _term(context: SearchContext, base: Fit, form: FreeForm) -> FreeTerm | None:
    span = visited(context.coarse, base, form)
    if span is None:
        return None
    try:
        problem, fitted = fit_free_term(context.coarse, base, form, span, FIRST_TRY)
    except DiscrepancyError:
        return None
    return FreeTerm(form, span, problem, fitted, FIRST_TRY, np.empty(0))


def _beside(term: FreeTerm, fitted: Fit, scan: CandidateScan) -> ScoredModel:
    effect = fitted.effects[-1]
    model = replace(term, problem=term.problem.with_effects(fitted.effects), fit=fitted)
    return _scored(model, effect, scan.p_value_of(effect))


def _scored(term: FreeTerm, effect: str, p_value: float) -> ScoredModel:
    fitted = term.fit
    numbers = len(fitted.coordinates) - len(term.columns) + effective_numbers(term)
    cost = 0.5 * math.log(fitted.residual.size) * numbers
    each = fitted.log_likelihood(term.problem.shots) - cost / term.problem.count
    return ScoredModel(effect, term.form.place, fitted, each, p_value)


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
    kept = np.array([coordinate.effect != _identifier(model) for coordinate in model.fit.coordinates])
    start = replace(
        model.fit,
        effects=effects,
        coordinates=tuple(c for c, stays in zip(model.fit.coordinates, kept, strict=True) if stays),
        theta=model.fit.theta[kept],
    )
    (fitted,) = fit_all_samples(context, [start])
    return fitted


def _identifier(model: ScoredModel) -> str:
    return REMAINDER_FORMS[model.place].effect.identifier
