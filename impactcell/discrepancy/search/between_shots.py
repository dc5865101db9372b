"""Effects that act between shots, established although no model of the traces reaches the floor.

What remains in the traces says nothing of them: they show in the friction factors, one a shot, and shots are
independent. One is taken if it explains more of the variance of the factors than one without part in it would
by chance, by the F test and by shots exchanged at random, and if nothing in the traces explains more of it:
parts that slide apart by direction make friction by position look like friction by direction, and a fit of
the traces narrows the factors then. What the model lacks in the traces, in one direction more than in the
other, say, makes the factors go with it as well: so they must become narrower by more than that explains,
and the size of the effect must be told from nothing.
"""

import math
from collections.abc import Collection, Sequence

import numpy as np
from scipy.stats import f as fisher

from impactcell.discrepancy.model import Fit, Problem, estimate_parameters, linearise
from impactcell.discrepancy.search import candidate_scores
from impactcell.discrepancy.search.acceptance import SelectionResult
from impactcell.discrepancy.search.candidate_fits import FitTask, run_tasks
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.evidence import ALPHA, ModelEvidence
from impactcell.discrepancy.search.factor_likeness import fits_to_factors
from impactcell.discrepancy.search.gap import narrows
from impactcell.discrepancy.search.indistinguishability import CandidateFit, compare_fits, widest_rival
from impactcell.discrepancy.search.model_error import shared_error
from impactcell.discrepancy.search.policy import POLICY
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY
from impactcell.records import Samples

EXCHANGES = 19_999
"""Orders of shots that are drawn [1]: the smallest probability is 5e-5, a twentieth of what is asked."""
EXCHANGE_STREAM = 9
"""Stream of random numbers of these draws [1], apart from those of the split and of other tests."""


def accept_between_shots(
    context: SearchContext, evidence: ModelEvidence, rivals: Sequence[Fit]
) -> SelectionResult | None:
    """Accept the effect between shots that narrows the friction factors most, if that is not by chance.

    Parameters
    ----------
    evidence : ModelEvidence
        Against the nominal model.
    rivals : sequence of Fit
        Models with one effect more that were fitted to the traces, at the end of their range or not,
        converged or not: where one of them leaves the factors narrower, nothing between shots has a name,
        and one that leaves them about as narrow is tied. So is any other that does so, although the traces
        do not speak for it, as they do not for a tilt of the surface.
    """
    nominal = evidence.fit
    known = {rival.effects[-1] for rival in rivals}
    fitted = sorted(_fits(context, evidence, known), key=lambda fitted: fitted.spread)
    fits = [fit for fit in fitted if acts_between_shots(fit)]
    if not fits:
        return None
    best = fits[0]
    effect = best.effects[-1]
    number = sum(LIBRARY[name].kind is Kind.BETWEEN_SHOTS for name in context.library)
    parameters = len(best.coordinates) - len(nominal.coordinates)
    chance = chance_of_narrowing(nominal.spread, best.spread, context.problem.count, parameters)
    in_order = chance_of_order(context, evidence, effect, nominal.shot_parameters.log_factor)
    chance = chance if in_order is None else max(chance, in_order)
    p_value = min(number * chance, 1.0)
    if p_value > POLICY.between_shots_error or not narrows(nominal.spread, best.spread, context.gap(best)):
        return None
    shots = context.problem.count
    # Of an effect that was fitted to the traces, too, the fit to the factors comes into question here.
    to_factors = {fit.effects[-1]: fit for fit in fits_to_factors(context, nominal, best)}
    rivals = [rival for rival in rivals if rival.effects[-1] not in to_factors]
    in_traces, explained = trace_rivals(best.spread, rivals, shots)
    fitted = [*to_factors.values(), *(fit for fit in fitted if fit.effects[-1] not in to_factors)]
    alike = factor_rivals(best, fitted, shots)
    if explained or alike is None:
        return None
    tied = (*alike, *in_traces)
    alternatives = compare_fits(
        [CandidateFit(fit, fit.log_likelihood(context.problem.shots)) for fit in fitted]
    )
    final = context.test_model(best)
    if not has_a_size(context.problem, final):
        return None
    return SelectionResult(
        evidence, final, best, (effect,), {effect: tied}, {effect: p_value}, alternatives, remains=True
    )


def has_a_size(problem: Problem, evidence: ModelEvidence) -> bool:
    """Whether the last effect of a model is told from nothing beside the error that all shots share.

    An error that goes with a covariate makes the friction factors go with it too: the traces show how large
    it is, and so how far an effect between shots is uncertain.
    """
    model = evidence.fit
    effect = model.effects[-1]
    nulls = {parameter.name: parameter.null for parameter in LIBRARY[effect].parameters}
    estimates = estimate_parameters(model, linearise(problem, model), shared_error(evidence))
    sizes = [one for one in estimates if one.effect == effect and not math.isnan(nulls[one.parameter])]
    return not sizes or any(not one.low <= nulls[one.parameter] <= one.high for one in sizes)


def trace_rivals(spread: float, rivals: Sequence[Fit], shots: int) -> tuple[tuple[str, ...], bool]:
    """Effects within shots that leave the factors about as narrow, and whether one leaves them narrower."""
    within = [rival for rival in rivals if not acts_between_shots(rival)]
    limit = widest_rival(spread, shots)
    alike = {rival.effects[-1]: None for rival in within if rival.spread <= limit}
    return tuple(alike), any(rival.spread <= spread for rival in within)


def factor_rivals(best: Fit, fitted: Sequence[Fit], shots: int) -> tuple[str, ...] | None:
    """Effects that leave the factors as narrow as the best between shots; None where one is told from it."""
    if any(widest_rival(fit.spread, shots) < best.spread for fit in fitted):
        return None
    limit = widest_rival(best.spread, shots)
    return tuple(fit.effects[-1] for fit in fitted if fit is not best and fit.spread <= limit)


def acts_between_shots(model: Fit) -> bool:
    """Whether the last effect of a model acts between shots and nowhere else."""
    return LIBRARY[model.effects[-1]].kind is Kind.BETWEEN_SHOTS


def _fits(context: SearchContext, evidence: ModelEvidence, known: Collection[str]) -> list[Fit]:
    """Fit every effect between shots that the factors speak for and, if any, all within them not `known`."""
    scan = evidence.candidate_scan
    between = {name for name in scan.gains() if LIBRARY[name].kind is Kind.BETWEEN_SHOTS}
    spoken_for = [name for name in scan.gains() if name in between and scan.p_value_of(name) <= ALPHA]
    others = [name for name in scan.gains() if name not in between | set(known)]
    tasks = []
    for effect in (*spoken_for, *others) if spoken_for else ():
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


def chance_of_order(
    context: SearchContext, evidence: ModelEvidence, effect: str, log_factor: Samples
) -> float | None:
    """Probability that friction factors follow an effect so well by chance, by shots exchanged at random.

    Parameters
    ----------
    evidence : ModelEvidence
        Against a model without the effect: the points of its grid.
    log_factor : ndarray, shape (n,)
        Of whatever model.

    Returns
    -------
    float or None
        None where the effect acts on static friction alone: the signs of the shots' scores tell that.
    """
    patterns = factor_patterns(context.problem, evidence, effect)
    if not len(patterns):
        return None
    return chance_by_exchange(log_factor, patterns, exchange_rng(context))


def factor_patterns(problem: Problem, evidence: ModelEvidence, effect: str) -> Samples:
    """List what logarithms of friction factors follow under an effect, shape (Q, n), at points of its grid.

    None where it acts on static friction alone.
    """
    candidates = evidence.candidate_scan.candidates
    number = candidates.names.index(effect)
    rows = [
        candidate_scores.between_shot_factors(problem, effect, point)
        for point, group in zip(candidates.points, candidates.group, strict=True)
        if group == number
    ]
    return np.array([row for row in rows if row is not None]).reshape(-1, problem.count)


def exchange_rng(context: SearchContext) -> np.random.Generator:
    """Random numbers of the orders in which shots are drawn."""
    return np.random.default_rng([context.seed, EXCHANGE_STREAM])


def chance_by_exchange(log_factor: Samples, patterns: Samples, rng: np.random.Generator) -> float:
    """Probability that shots in another order are followed as well: a permutation test (Fisher 1935).

    It holds whatever the distribution of the factors, as long as nothing tells their order: with a few shots
    far off the F test finds a drift too easily.

    Parameters
    ----------
    log_factor : ndarray, shape (n,)
        One a shot.
    patterns : ndarray, shape (Q, n)
        What the factors may follow; the best of them counts, in every order anew.
    """
    deviation = log_factor - log_factor.mean()
    centred = patterns - patterns.mean(1, keepdims=True)
    length = np.sqrt(np.einsum("qi,qi->q", centred, centred))
    units = centred[length > 0.0] / length[length > 0.0, None]
    if not len(units):
        return 1.0
    reached = np.max((units @ deviation) ** 2)
    orders = rng.permuted(np.tile(deviation, (EXCHANGES, 1)), axis=1)
    best = np.max((orders @ units.T) ** 2, axis=1)
    return float(1 + np.sum(best >= reached * (1.0 - 1e-12))) / (1 + EXCHANGES)
