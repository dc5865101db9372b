"""Where the nominal fit starts: stiffness and damping by regression, friction by the slide's curvature."""

import math
from collections.abc import Sequence

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.measured_drive import friction
from impactcell.discrepancy.data.shots import FORCE, POSITION, Shot
from impactcell.discrepancy.model.fit import Fit, begin, fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.errors import DiscrepancyError
from impactcell.physics import Plant
from impactcell.records import Samples

RATIOS = (1.15, 1.5)
DRIVEN_RATIOS = (1.05, 1.3)
STIFFNESSES = (5e4, 2e5, 6e5, 2e6, 8e6)


def fit_nominal(problem: Problem, plant: Plant | None = None) -> Fit:
    """Fit the nominal plant from starts taken off the data, or from a plant that is given with its effects.

    Raises
    ------
    DiscrepancyError
        No start leads to a fit.
    """
    shots = problem.shots
    mu = _friction(shots.items, shots.gravity_m_s2)
    starts: list[Samples] = []
    if shots.excitation is Excitation.FREE_SLIDE:
        starts.append(np.array([math.log(mu)]))
    elif shots.excitation is Excitation.DRIVEN:
        mu, ratio = friction(shots.items, shots.gravity_m_s2)
        starts += [np.array([math.log(mu), math.log(one)]) for one in (ratio, *DRIVEN_RATIOS)]
    else:
        found = _contact(shots.items)
        pairs = [found] if found is not None else [(k, 0.7e-3 * k) for k in STIFFNESSES]
        starts += [
            np.array([math.log(k), b / 100.0, math.log(mu), math.log(ratio)])
            for k, b in pairs
            for ratio in RATIOS
        ]
    effects: tuple[str, ...] = ()
    if plant is not None:
        effects = tuple(plant.effects)
        starts = [
            _given(problem, plant),
            *(np.concatenate([one, _given(problem, plant)[len(one) :]]) for one in starts),
        ]
    best: Fit | None = None
    failures: list[str] = []
    for start in starts:
        try:
            made = fit(problem, effects, start, begin(problem, effects, start))
        except DiscrepancyError as error:
            failures.append(str(error))
            continue
        if best is None or made.misfit(shots).sum() < best.misfit(shots).sum():
            best = made
    if best is None:
        raise DiscrepancyError(f"the nominal model cannot be fitted: {failures[0]}")
    return best


def _given(problem: Problem, plant: Plant) -> Samples:
    """Coordinates of a plant."""
    made = []
    for one in problem.coordinates(tuple(plant.effects)):
        if one.effect:
            value = plant.effects[one.effect].get(one.parameter, math.nan)
            if isinstance(value, Sequence):
                value = value[one.batch - 1] if one.batch - 1 < len(value) else math.nan
            made.append(one.start if math.isnan(value) else one.coordinate(value))
        elif one.parameter == "ratio":
            made.append(one.coordinate(max(plant.mu_s / plant.mu_k, 1.0)))
        else:
            made.append(one.coordinate(getattr(plant, one.parameter)))
    return np.array(made)


def _friction(items: tuple[Shot, ...], gravity: float) -> float:
    """Coefficient from the curvature of the slide after the fastest moment."""
    found = []
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
            found.append(-2.0 * bend / gravity)
    return float(np.clip(np.median(found), 0.005, 2.0)) if found else 0.15


def _contact(items: tuple[Shot, ...]) -> tuple[float, float] | None:
    """Stiffness and damping by regressing force on indentation and its rate up to the peak."""
    found = []
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
            found.append((float(solution[0]), max(float(solution[1]), 0.0)))
    if not found:
        return None
    k, b = np.median(np.array(found), axis=0)
    return float(k), float(b)
