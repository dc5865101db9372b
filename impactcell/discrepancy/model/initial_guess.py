"""Where the nominal fit starts: at values taken off the data, or at a plant that is given."""

import math
from collections.abc import Sequence

import numpy as np

from impactcell.discrepancy.model.least_squares import Fit, fit, fit_from, initial_shot_parameters
from impactcell.discrepancy.model.problem import Problem
from impactcell.errors import DiscrepancyError
from impactcell.physics import Plant
from impactcell.records import Samples


def fit_nominal(problem: Problem, plant: Plant | None = None) -> Fit:
    """Fit the nominal plant from starts taken off the data, or from a plant that is given with its effects.

    Where first contact is open, it is at t = 0 first: from afar a wrong plant would move it to an end.

    Raises
    ------
    DiscrepancyError
        No start leads to a fit.
    """
    if problem.onset_step_s.any():
        return fit_from(problem, fit_nominal(problem.with_exact_contact(), plant))
    shots = problem.shots
    guesses = shots.excitation.plant_guesses(shots.items, shots.gravity_m_s2)
    nominal = problem.with_effects(())
    starts = [
        np.array([coordinate.coordinate(guess[coordinate.parameter]) for coordinate in nominal.coordinates])
        for guess in guesses
    ]
    if plant is not None:
        problem = problem.with_effects(tuple(plant.effects))
        given = _coordinates_of(problem, plant)
        starts = [given, *(np.concatenate([start, given[len(start) :]]) for start in starts)]
    best: Fit | None = None
    failures: list[str] = []
    for start in starts:
        try:
            fitted = fit(problem, start, initial_shot_parameters(problem, start))
        except DiscrepancyError as error:
            failures.append(str(error))
            continue
        if best is None or fitted.misfit(shots).sum() < best.misfit(shots).sum():
            best = fitted
    if best is None:
        raise DiscrepancyError(f"the nominal model cannot be fitted: {failures[0]}")
    return best


def _coordinates_of(problem: Problem, plant: Plant) -> Samples:
    """Coordinates of a plant in the order of the problem's; the initial one where the plant says nothing.

    `ratio` is mu_s / mu_k here, as in `parameters`.
    """
    theta = []
    for coordinate in problem.coordinates:
        if coordinate.effect:
            value = plant.effects[coordinate.effect].get(coordinate.parameter, math.nan)
            if isinstance(value, Sequence):
                value = value[coordinate.batch - 1] if coordinate.batch - 1 < len(value) else math.nan
            theta.append(coordinate.initial if math.isnan(value) else coordinate.coordinate(value))
        elif coordinate.parameter == "ratio":
            theta.append(coordinate.coordinate(max(plant.mu_s / plant.mu_k, 1.0)))
        else:
            theta.append(coordinate.coordinate(getattr(plant, coordinate.parameter)))
    return np.array(theta)
