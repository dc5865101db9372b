"""Which shots would tell tied effects apart, how many of them, and with what power."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.shots import Shot, lay_out
from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.errors import PhysicsError
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY

POWER = 0.9
ERROR = 0.025
MOST_SHOTS = 400
FASTER, SLOWER, HEAVIER = 1.3, 0.7, 1.5
DWELLS = (1.0, 1000.0)


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


def propose(problem: Problem, best: Fit, rivals: Sequence[tuple[str, str, Fit]]) -> tuple[Proposal, ...]:
    """For each tie the cheapest setting that breaks it.

    Parameters
    ----------
    problem : Problem
    best : Fit
    rivals : sequence of (effect, rival effect, fit of the rival's model)
    """
    made = []
    for effect, rival, fit in rivals:
        made.append(_cheapest(problem, best, fit, effect, rival))
    return tuple(made)


def _cheapest(problem: Problem, best: Fit, other: Fit, effect: str, rival: str) -> Proposal:
    found: list[tuple[int, str, float]] = []
    for setting, shot in _settings(problem):
        separation = _separation(problem, best, other, shot)
        if separation <= 0.0:
            continue
        wanted = (norm.ppf(1.0 - ERROR) + norm.ppf(POWER)) ** 2 / separation
        count = max(math.ceil(wanted), 2)
        if count <= MOST_SHOTS:
            power = float(norm.cdf(math.sqrt(count * separation) - norm.ppf(1.0 - ERROR)))
            found.append((count, setting, power))
    if not found:
        return Proposal((effect, rival), _aside(effect, rival), 0, 1.0)
    count, setting, power = min(found, key=lambda one: one[0])
    return Proposal((effect, rival), setting, count, power)


def _aside(effect: str, rival: str) -> str:
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


def _settings(problem: Problem) -> list[tuple[str, Shot]]:
    """List settings within reach: what was done, and one step beyond it."""
    items = problem.shots.items
    typical = sorted(items, key=lambda shot: (shot.velocity_m_s, shot.place))[len(items) // 2]
    if problem.shots.excitation is not Excitation.TAP:
        return []
    velocities = sorted({shot.velocity_m_s for shot in items})
    masses = sorted({shot.mass_kg for shot in items if math.isfinite(shot.mass_kg)}) or [1.0]
    made = []
    for velocity in (velocities[0] * SLOWER, velocities[0], velocities[-1], velocities[-1] * FASTER):
        for mass in (masses[0], masses[-1], masses[-1] * HEAVIER):
            for direction in (1, -1):
                words = f"{velocity * 60000.0:.0f} mm/min, {mass:.3g} kg, direction {direction:+d}"
                shot = replace(typical, velocity_m_s=velocity, mass_kg=mass, direction=direction, group=-1)
                made.append((words, shot))
                if math.isfinite(typical.dwell_s):
                    made += [
                        (f"{words}, after {dwell:g} s at rest", replace(shot, dwell_s=dwell))
                        for dwell in DWELLS
                    ]
    last = max(shot.batch for shot in items)
    if last:
        made += [
            (f"batch {batch + 1} again, after the others", replace(typical, batch=batch, place=typical.shots))
            for batch in range(last + 1)
        ]
    return made


def _separation(problem: Problem, best: Fit, other: Fit, shot: Shot) -> float:
    """Squared distance of the two models' predictions for one shot, its own factor free, in noise units.

    Friction factors that differ between the models count by their spread from shot to shot.
    """
    noise = problem.shots.noise_std
    one = lay_out(
        problem.shots.excitation, problem.shots.gravity_m_s2, problem.shots.stroke_m, (shot,), noise
    )
    single = Problem(one, problem.forward.batches)
    try:
        local = single.first_local()
        a = single.residual(best.effects, best.at, local)
        b = single.residual(other.effects, other.at, local)
        slope = single.own_derivatives(best.effects, best.at, local, a)[0]
    except (PhysicsError, ValueError):
        return 0.0
    difference = a - b
    if not (np.isfinite(difference).all() and np.isfinite(slope).all()):
        return 0.0
    along = float(slope @ slope)
    shift = float(difference @ slope) / along if along > 0.0 else 0.0
    left = difference - shift * slope
    return float(left @ left) / 4.0 + (shift / max(best.spread, 1e-6)) ** 2
