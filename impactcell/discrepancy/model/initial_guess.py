"""Where the nominal fit starts: stiffness and damping by regression, friction by the slide's curvature."""

import math
from collections.abc import Sequence

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.measured_drive import friction_of_slip
from impactcell.discrepancy.data.shots import FORCE, POSITION, PreparedShot
from impactcell.discrepancy.model.fit import Fit, fit, initial_shot_parameters
from impactcell.discrepancy.model.problem import Problem
from impactcell.errors import DiscrepancyError
from impactcell.physics import Plant
from impactcell.records import Samples

TAP_RATIOS = (1.15, 1.5)
DRIVEN_RATIOS = (1.05, 1.3)
FALLBACK_STIFFNESSES = (5e4, 2e5, 6e5, 2e6, 8e6)


def fit_nominal(problem: Problem, plant: Plant | None = None) -> Fit:
    """Fit the nominal plant from starts taken off the data, or from a plant that is given with its effects.

    Raises
    ------
    DiscrepancyError
        No start leads to a fit.
    """
    shots = problem.shots
    mu = _friction_of_slide(shots.items, shots.gravity_m_s2)
    starts: list[Samples] = []
    if shots.excitation is Excitation.FREE_SLIDE:
        starts.append(np.array([math.log(mu)]))
    elif shots.excitation is Excitation.DRIVEN:
        mu, ratio = friction_of_slip(shots.items, shots.gravity_m_s2)
        starts += [np.array([math.log(mu), math.log(initial)]) for initial in (ratio, *DRIVEN_RATIOS)]
    else:
        contact = _contact_regression(shots.items)
        pairs = [contact] if contact is not None else [(k, 0.7e-3 * k) for k in FALLBACK_STIFFNESSES]
        starts += [
            np.array([math.log(k), b / 100.0, math.log(mu), math.log(ratio)])
            for k, b in pairs
            for ratio in TAP_RATIOS
        ]
    effects: tuple[str, ...] = ()
    if plant is not None:
        effects = tuple(plant.effects)
        starts = [
            _coordinates_of(problem, plant),
            *(
                np.concatenate([initial, _coordinates_of(problem, plant)[len(initial) :]])
                for initial in starts
            ),
        ]
    best: Fit | None = None
    failures: list[str] = []
    for start in starts:
        try:
            fitted = fit(problem, effects, start, initial_shot_parameters(problem, effects, start))
        except DiscrepancyError as error:
            failures.append(str(error))
            continue
        if best is None or fitted.misfit(shots).sum() < best.misfit(shots).sum():
            best = fitted
    if best is None:
        raise DiscrepancyError(f"the nominal model cannot be fitted: {failures[0]}")
    return best


def _coordinates_of(problem: Problem, plant: Plant) -> Samples:
    """Coordinates of a plant."""
    theta = []
    for coordinate in problem.coordinates(tuple(plant.effects)):
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


def _friction_of_slide(items: tuple[PreparedShot, ...], gravity: float) -> float:
    """Coefficient from the curvature of the slide after the fastest moment."""
    coefficients = []
    for shot in items:
        time, position = shot.times[POSITION], shot.values[POSITION] * shot.direction
        if len(time) < 12:
            continue
        step = max(len(time) // 80, 1)
        t, x = time[::step], position[::step]
        speed = np.gradient(x, t)
        first = int(np.argmax(speed))
        slow = np.flatnonzero(speed[first:] < 0.25 * speed[first])
        last = first + int(slow[0]) if len(slow) else len(t) - 1
        inside = (time >= t[first] + 0.2 * (t[last] - t[first])) & (time <= t[last])
        if inside.sum() < 5:
            continue
        bend = np.polyfit(time[inside] - t[first], position[inside], 2)[0]
        if bend < 0.0:
            coefficients.append(-2.0 * bend / gravity)
    return float(np.clip(np.median(coefficients), 0.005, 2.0)) if coefficients else 0.15


def _contact_regression(items: tuple[PreparedShot, ...]) -> tuple[float, float] | None:
    """Stiffness and damping by regressing force on indentation and its rate up to the peak."""
    estimates = []
    for shot in items:
        time, force = shot.times[FORCE], shot.values[FORCE]
        if len(time) < 12 or len(shot.times[POSITION]) < 12:
            continue
        peak = int(np.argmax(force))
        if peak < 6:
            continue
        t = time[:peak]
        x = np.interp(t, shot.times[POSITION], shot.values[POSITION]) * shot.direction
        width = max(len(t) // 15, 1)
        smooth = np.convolve(np.pad(x, width, mode="edge"), np.ones(2 * width + 1) / (2 * width + 1), "valid")
        rate = shot.velocity_m_s - np.gradient(smooth, t)
        columns = np.column_stack([shot.velocity_m_s * t - x, rate])
        solution = np.linalg.lstsq(columns, force[:peak], rcond=None)[0]
        if solution[0] > 0.0:
            estimates.append((float(solution[0]), max(float(solution[1]), 0.0)))
    if not estimates:
        return None
    k, b = np.median(np.array(estimates), axis=0)
    return float(k), float(b)
