"""Which shots would tell tied effects apart, how many of them, and with what power."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from impactcell.discrepancy.data import PreparedShot, concatenate_shots
from impactcell.discrepancy.model import Fit, Problem
from impactcell.errors import PhysicsError
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY

POWER = 0.9
"""Probability with which the shots proposed tell two effects apart."""
SIGNIFICANCE = 0.025
"""One-sided error of the test that they are proposed for."""
MAX_SHOTS = 400
"""More shots than that are no proposal."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """A setting and how many shots of it tell two effects apart.

    Attributes
    ----------
    effects : tuple of str
        The two that would be told apart.
    setting : str
        What to do, in words.
    shots : int
        0 where it is not a matter of shots but of a measurement of its own.
    power : float
    """

    effects: tuple[str, str]
    setting: str
    shots: int
    power: float


def propose_experiments(
    problem: Problem, best: Fit, rivals: Sequence[tuple[str, str, Fit]]
) -> tuple[Proposal, ...]:
    """For each tie the cheapest setting that breaks it.

    Parameters
    ----------
    problem : Problem
    best : Fit
    rivals : sequence of (effect, rival effect, fit of the rival's model)
    """
    experiments = []
    for effect, rival, fit in rivals:
        experiments.append(_cheapest_experiment(problem, best, fit, effect, rival))
    return tuple(experiments)


def _cheapest_experiment(problem: Problem, best: Fit, rival_fit: Fit, effect: str, rival: str) -> Proposal:
    feasible: list[tuple[int, str, float]] = []
    for setting, shot in problem.shots.excitation.settings_within_reach(problem.shots.items):
        separation = _separation(problem, best, rival_fit, shot)
        if separation <= 0.0:
            continue
        needed = (norm.ppf(1.0 - SIGNIFICANCE) + norm.ppf(POWER)) ** 2 / separation
        count = max(math.ceil(needed), 2)
        if count <= MAX_SHOTS:
            power = float(norm.cdf(math.sqrt(count * separation) - norm.ppf(1.0 - SIGNIFICANCE)))
            feasible.append((count, setting, power))
    if not feasible:
        return Proposal((effect, rival), _separate_measurement(effect, rival), 0, 1.0)
    count, setting, power = min(feasible, key=lambda one: one[0])
    return Proposal((effect, rival), setting, count, power)


def _separate_measurement(effect: str, rival: str) -> str:
    """Say what breaks an exact confound: a measurement outside of the shots."""
    kinds = {LIBRARY[effect].kind, LIBRARY[rival].kind}
    names = {effect, rival}
    if "mass_error" in names:
        return "weigh the part: no shot can tell its mass from the scale of the force sensor"
    if Kind.SENSOR in kinds:
        return "load the force sensor with a known weight: no shot tells its error from the plant's own"
    if Kind.BETWEEN_SHOTS in kinds:
        return "repeat the campaign in another order of batches, directions and dwells"
    if Kind.ACTUATOR in kinds:
        return "record the actuator's position"
    return "no setting within reach tells them apart: measure one of them by itself"


def _separation(problem: Problem, best: Fit, rival_fit: Fit, shot: PreparedShot) -> float:
    """Squared distance of the two models' predictions for one shot, its own factor free, in noise units.

    Friction factors that differ between the models count by their spread from shot to shot.
    """
    noise = problem.shots.noise_std
    shot_set = concatenate_shots(
        problem.shots.excitation, problem.shots.gravity_m_s2, problem.shots.stroke_m, (shot,), noise
    )
    single = Problem(shot_set, problem.batches, best.effects)
    try:
        state = single.evaluate(best.theta, single.initial_guess(), best.spread)
        rival = single.with_effects(rival_fit.effects)
        difference = state.residual - rival.residual(rival_fit.theta, state.shot_parameters)
        slope = single.shot_jacobian(state)[0]
    except (PhysicsError, ValueError):
        return 0.0
    if not (np.isfinite(difference).all() and np.isfinite(slope).all()):
        return 0.0
    along = float(slope @ slope)
    shift = float(difference @ slope) / along if along > 0.0 else 0.0
    remainder = difference - shift * slope
    return float(remainder @ remainder) / 4.0 + (shift / max(best.spread, 1e-6)) ** 2
