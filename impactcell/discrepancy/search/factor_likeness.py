"""Effects of the traces that do to the friction factors what one between shots does.

A tilt of the surface pulls with the part's weight, as friction does: where the model lacks it, every shot's
own factor makes up for it, higher uphill and lower downhill, and nothing of it is left in the traces. Beside
a model error no fit of the traces is any help then. So each effect is added as strongly as the factors ask,
nothing else moving but the shots' own numbers.
"""

from dataclasses import replace

import numpy as np

from impactcell.discrepancy.model import (
    Fit,
    Problem,
    effect_coordinates,
    normal_equations,
    refit_shot_parameters,
)
from impactcell.discrepancy.search.candidate_scores import effect_direction, start_coordinates, visited_range
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.effect_grid import GridPoint, effect_grid
from impactcell.discrepancy.search.model_error import ModelError, estimate_model_error, largest_rival_excess
from impactcell.discrepancy.search.policy import POLICY
from impactcell.errors import DiscrepancyError
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY
from impactcell.records import Samples


def fits_to_factors(context: SearchContext, nominal: Fit, best: Fit) -> list[Fit]:
    """Fit effects of one number within shots to the friction factors, where the traces have no say in it.

    Parameters
    ----------
    nominal : Fit
        Model without any of them.
    best : Fit
        Model with the effect between shots: a rival leaves as much in the traces, but for their scatter.
    """
    problem = context.problem
    left = estimate_model_error(problem, best)
    visited = visited_range(problem, nominal)
    fits = []
    for effect in context.library:
        if LIBRARY[effect].kind is Kind.BETWEEN_SHOTS or effect in nominal.effects:
            continue
        grid = effect_grid(effect, problem.batches, visited)
        fitted = _fit_to_factors(problem, nominal, effect, grid[0]) if len(grid) == 1 else None
        if fitted is not None and _are_alike(left, estimate_model_error(problem, fitted)):
            fits.append(fitted)
    return fits


def _are_alike(one: ModelError, other: ModelError) -> bool:
    """Whether what two models leave in the traces does not tell them from each other."""
    limits = [largest_rival_excess(error, POLICY.rival_probability) for error in (one, other)]
    return other.excess <= limits[0] and one.excess <= limits[1]


def _fit_to_factors(problem: Problem, nominal: Fit, effect: str, point: GridPoint) -> Fit | None:
    """Add an effect as strongly as the factors follow its pattern; None where they have no part in it."""
    change = effect_direction(problem, nominal, effect, point)
    if change is None or not point.scaled:
        return None
    pattern = _response(problem, nominal, change)
    centred = pattern - pattern.mean()
    length = float(centred @ centred)
    if not length > 0.0:
        return None
    amplitude = float(centred @ nominal.shot_parameters.log_factor) / length
    model = replace(
        nominal,
        effects=(*nominal.effects, effect),
        coordinates=(*nominal.coordinates, *effect_coordinates(effect, problem.batches)),
        theta=np.concatenate([nominal.theta, start_coordinates(point, amplitude)]),
    )
    try:
        fitted = refit_shot_parameters(problem, model)
    except DiscrepancyError:
        return None
    return replace(fitted, spread=float(fitted.shot_parameters.log_factor.std()))


def _response(problem: Problem, nominal: Fit, change: Samples) -> Samples:
    """How far each shot's friction factor goes to follow a change of the prediction, shape (n,)."""
    model, state = problem.with_effects(nominal.effects), nominal.state
    equations = normal_equations(model, change[None], model.shot_jacobian(state), state)[2]
    steps: Samples = np.einsum("iqr,ir->iq", equations.inverse, equations.cross[:, :, 0])
    return steps[:, 0]
