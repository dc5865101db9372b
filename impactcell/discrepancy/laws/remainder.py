"""Parameters of an effect beside what remains: a free form takes the remainder, so that the effect need not.

What a model lacks pulls the parameters of its effects along, in all shots alike, and no scatter between shots
tells of it. So where something remains, the free form that does best beside the model is fitted with it, and
the effects' parameters are those of this fit; what the form leaves in its turn widens their intervals. Where
friction goes with a column of `shots.csv` beside an effect between shots, a line in it is that form.
"""

from collections.abc import Sequence
from dataclasses import replace

from impactcell.discrepancy.data import decimate
from impactcell.discrepancy.laws.column_rivals import beside_column
from impactcell.discrepancy.laws.covariates import visited
from impactcell.discrepancy.laws.free_term import FIRST_TRY
from impactcell.discrepancy.laws.scored_model import MIN_GAIN, score_fit
from impactcell.discrepancy.laws.standing import SAMPLES, with_second
from impactcell.discrepancy.laws.term_start import fit_free_term
from impactcell.discrepancy.model import (
    Fit,
    ParameterEstimate,
    Problem,
    fit,
    refit_shot_parameters,
)
from impactcell.discrepancy.search import (
    ALPHA,
    ModelEvidence,
    SearchContext,
    estimate_beside_error,
)
from impactcell.errors import DiscrepancyError
from impactcell.physics.remainder_forms import REMAINDER_FORMS


def estimate_effects(
    context: SearchContext,
    evidence: ModelEvidence,
    alone: Sequence[ParameterEstimate],
    nominal: ModelEvidence,
) -> tuple[ParameterEstimate, ...]:
    """Parameters of a model's effects with their intervals: beside a free form, if something remains.

    Parameters
    ----------
    evidence : ModelEvidence
        Against the model.
    alone : sequence of ParameterEstimate
        Of the model as it stands.
    nominal : ModelEvidence
        Against the model without them.
    """
    model, has_contact = evidence.fit, context.problem.shots.excitation.has_contact
    own = tuple(one for one in alone if one.effect)
    if not own or not has_contact or evidence.p_value > ALPHA:
        return own
    fitted = beside_column(context, nominal, model) or _beside_form(context, model)
    if fitted is None:
        return own
    beside = estimate_beside_error(*fitted, context.prepared)
    return tuple(one for one in beside if one.effect in model.effects)


def _beside_form(context: SearchContext, model: Fit) -> tuple[Problem, Fit] | None:
    """Fit a model with the free form that does best beside it; None where none is worth it."""
    problem = context.problem.with_effects(model.effects)
    few = replace(context, coarse=Problem(decimate(problem.shots, SAMPLES), problem.batches, model.effects))
    rough = refit_shot_parameters(few.coarse, model)
    forms = with_second(few, few.coarse, rough, "")
    best = max(forms, key=lambda form: form.score, default=None)
    if best is None or best.score <= score_fit(few.coarse, rough, "").score + MIN_GAIN:
        return None
    form, coarse = REMAINDER_FORMS[best.place], context.coarse.with_effects(model.effects)
    base = refit_shot_parameters(coarse, model)
    span = visited(coarse, base, form)
    if span is None:
        return None
    try:
        extended, few_steps = fit_free_term(coarse, base, form, span, FIRST_TRY)
        # A few steps tell which form does best; parameters are those of the optimum.
        return extended, fit(extended, few_steps.theta, few_steps.shot_parameters, spread=few_steps.spread)
    except DiscrepancyError:
        return None
