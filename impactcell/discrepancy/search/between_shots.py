"""Effects that act between shots, established although no model of the traces reaches the floor.

What remains in the traces says nothing of them: they show in the friction factors, one a shot, and shots are
independent. One is taken if it explains more of the variance of the factors than one without part in it would
by chance.
"""

from scipy.stats import f as fisher

from impactcell.discrepancy.model import Fit
from impactcell.discrepancy.search import candidate_scores
from impactcell.discrepancy.search.acceptance import SelectionResult
from impactcell.discrepancy.search.candidate_fits import FitTask, run_tasks
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.evidence import ALPHA, ModelEvidence
from impactcell.discrepancy.search.indistinguishability import CandidateFit, compare_fits
from impactcell.discrepancy.search.policy import POLICY
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY


def accept_between_shots(context: SearchContext, evidence: ModelEvidence) -> SelectionResult | None:
    """Accept the effect between shots that narrows the friction factors most, if that is not by chance."""
    nominal = evidence.fit
    fits = sorted(_fits(context, evidence), key=lambda fitted: fitted.spread)
    if not fits:
        return None
    best = fits[0]
    effect = best.effects[-1]
    number = sum(LIBRARY[name].kind is Kind.BETWEEN_SHOTS for name in context.library)
    parameters = len(best.coordinates) - len(nominal.coordinates)
    chance = chance_of_narrowing(nominal.spread, best.spread, context.problem.count, parameters)
    p_value = min(number * chance, 1.0)
    if p_value > POLICY.between_shots_error or best.spread > POLICY.max_spread_ratio * nominal.spread:
        return None
    shots = context.problem.count
    limit = float(fisher.ppf(POLICY.rival_probability, shots, shots))
    tied = tuple(rival.effects[-1] for rival in fits[1:] if rival.spread**2 <= limit * best.spread**2)
    alternatives = compare_fits(
        [CandidateFit(fitted, fitted.log_likelihood(context.problem.shots)) for fitted in fits]
    )
    final = context.test_model(best)
    return SelectionResult(
        evidence, final, best, (effect,), {effect: tied}, {effect: p_value}, alternatives, remains=True
    )


def _fits(context: SearchContext, evidence: ModelEvidence) -> list[Fit]:
    """Fit every effect between shots that the friction factors speak for."""
    scan = evidence.candidate_scan
    tasks = []
    for effect in scan.gains():
        if LIBRARY[effect].kind is not Kind.BETWEEN_SHOTS or scan.p_value_of(effect) > ALPHA:
            continue
        starts = candidate_scores.starting_points(
            scan.candidates, scan.scores, effect, POLICY.starts_per_effect
        )
        if starts:
            model = context.problem.with_effects((*scan.fit.effects, effect))
            tasks.append(FitTask(model, tuple(starts), scan.fit, POLICY.refine_steps))
    return run_tasks(context, tasks)


def chance_of_narrowing(before: float, after: float, shots: int, parameters: int) -> float:
    """Probability that an effect without part in them narrows the factors so, by the F test over shots.

    Parameters
    ----------
    before, after : float
        Standard deviation of the factors about their law without and with the effect.
    shots : int
    parameters : int
        Of the effect.
    """
    freedom = max(shots - parameters - 1, 1)
    explained = max((before / after) ** 2 - 1.0, 0.0)
    return float(fisher.sf(explained * freedom / parameters, parameters, freedom))
