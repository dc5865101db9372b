"""Which shots would tell tied effects apart, how many of them, and with what power."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.shots import PreparedShot, concatenate_shots
from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.errors import PhysicsError
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY

POWER = 0.9
SIGNIFICANCE = 0.025
MAX_SHOTS = 400
FASTER, SLOWER, HEAVIER = 1.3, 0.7, 1.5
DWELLS_S = (1.0, 1000.0)


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
    for setting, shot in _settings_within_reach(problem):
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


def _settings_within_reach(problem: Problem) -> list[tuple[str, PreparedShot]]:
    """List settings within reach: what was done, and one step beyond it."""
    items = problem.shots.items
    typical = sorted(items, key=lambda shot: (shot.velocity_m_s, shot.place))[len(items) // 2]
    if problem.shots.excitation is not Excitation.TAP:
        return []
    velocities = sorted({shot.velocity_m_s for shot in items})
    masses = sorted({shot.mass_kg for shot in items if math.isfinite(shot.mass_kg)}) or [1.0]
    settings = []
    for velocity in (velocities[0] * SLOWER, velocities[0], velocities[-1], velocities[-1] * FASTER):
        for mass in (masses[0], masses[-1], masses[-1] * HEAVIER):
            for direction in (1, -1):
                words = f"{velocity * 60000.0:.0f} mm/min, {mass:.3g} kg, direction {direction:+d}"
                shot = replace(typical, velocity_m_s=velocity, mass_kg=mass, direction=direction, group=-1)
                settings.append((words, shot))
                if math.isfinite(typical.dwell_s):
                    settings += [
                        (f"{words}, after {dwell:g} s at rest", replace(shot, dwell_s=dwell))
                        for dwell in DWELLS_S
                    ]
    last = max(shot.batch for shot in items)
    if last:
        settings += [
            (f"batch {batch + 1} again, after the others", replace(typical, batch=batch, place=typical.shots))
            for batch in range(last + 1)
        ]
    return settings


def _separation(problem: Problem, best: Fit, rival_fit: Fit, shot: PreparedShot) -> float:
    """Squared distance of the two models' predictions for one shot, its own factor free, in noise units.

    Friction factors that differ between the models count by their spread from shot to shot.
    """
    noise = problem.shots.noise_std
    shot_set = concatenate_shots(
        problem.shots.excitation, problem.shots.gravity_m_s2, problem.shots.stroke_m, (shot,), noise
    )
    single = Problem(shot_set, problem.forward.batches)
    try:
        shot_parameters = single.initial_shot_parameters()
        a = single.residual(best.effects, best.theta, shot_parameters)
        b = single.residual(rival_fit.effects, rival_fit.theta, shot_parameters)
        slope = single.shot_jacobian(best.effects, best.theta, shot_parameters, a)[0]
    except (PhysicsError, ValueError):
        return 0.0
    difference = a - b
    if not (np.isfinite(difference).all() and np.isfinite(slope).all()):
        return 0.0
    along = float(slope @ slope)
    shift = float(difference @ slope) / along if along > 0.0 else 0.0
    remainder = difference - shift * slope
    return float(remainder @ remainder) / 4.0 + (shift / max(best.spread, 1e-6)) ** 2
