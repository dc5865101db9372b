"""Which shots would tell tied effects apart, how many of them, and with what power.

A setting is looked for by the distance of two models' predictions; what it promises is then simulated: shots
of one model with its noise and scatter, judged by both.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.stats import norm

from impactcell.discrepancy.data import CellLimits, PreparedShot, ShotSet, concatenate_shots
from impactcell.discrepancy.model import Fit, Problem, refit_shot_parameters
from impactcell.errors import PhysicsError
from impactcell.physics import Kind
from impactcell.physics.effect_names import COLUMN_PREFIX
from impactcell.physics.effects import LIBRARY, find_effect
from impactcell.physics.free_column_forms import printed
from impactcell.records import Samples

POWER = 0.9
"""Probability with which the shots proposed tell two effects apart."""
SIGNIFICANCE = 0.025
"""One-sided error of the test that they are proposed for."""
MAX_SHOTS = 400
"""More shots than that are no proposal."""
SIMULATED_SHOTS = 40
"""Shots of a setting that are simulated: their scatter is known to a ninth."""
FEW_SHOTS = 20
"""A setting that takes no more than that when it is simulated is proposed, whatever others take."""
MAX_SIMULATED_SETTINGS = 3
"""Settings, the cheapest first, that are simulated until one keeps what it promises."""
SIMULATION = 9
"""Stream of random numbers of these shots, apart from those of other draws."""
LATE_CHANNELS = frozenset({"force_sensor_lag", "channel_skew", "position_sensor_lag"})
"""Effects that make a channel late: no weight at rest shows them."""
UNLIMITED = CellLimits()
"""Limits of a cell of which nothing is known."""


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
    problem: Problem,
    best: Fit,
    rivals: Sequence[tuple[str, str, Fit]],
    batches: Sequence[str],
    limits: CellLimits = UNLIMITED,
    ties: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> tuple[Proposal, ...]:
    """For each tie the cheapest setting that breaks it.

    Parameters
    ----------
    problem : Problem
    best : Fit
    rivals : sequence of (effect, rival effect, fit of the rival's model)
    batches : sequence of str
        Names of the batches, in order of appearance.
    limits : CellLimits
        Of the cell in which the shots would be made.
    ties : mapping
        Of each effect all that is tied with it, columns of `shots.csv` among them.
    """
    settings = problem.shots.excitation.settings_within_reach(
        problem.shots.items, best.shot_parameters.mass_kg, batches, limits
    )
    experiments = [
        _cheapest_experiment(problem, best, fit, settings, (effect, rival)) for effect, rival, fit in rivals
    ]
    return (*experiments, *_other_orders(ties))


def _other_orders(ties: Mapping[str, Sequence[str]]) -> Iterator[Proposal]:
    """Say what tells effects from the columns that are tied with them."""
    for effect, tied in ties.items():
        for rival in (name for name in tied if name.startswith(COLUMN_PREFIX)):
            (column,) = find_effect(rival).columns
            setting = f"the same settings again, column {printed(column)} in another order"
            yield Proposal((effect, rival), setting, 0, 1.0)


def _cheapest_experiment(
    problem: Problem,
    best: Fit,
    rival_fit: Fit,
    settings: Sequence[tuple[str, PreparedShot]],
    effects: tuple[str, str],
) -> Proposal:
    feasible: dict[float, tuple[int, str, PreparedShot]] = {}
    for setting, shot in settings:
        separation = _separation(problem, best, rival_fit, shot)
        count = _shots_needed(math.sqrt(max(separation, 0.0)))
        if count <= MAX_SHOTS:  # a dwell that no effect goes with changes nothing
            feasible.setdefault(separation, (count, setting, shot))
    proposals = []
    for _, setting, shot in sorted(feasible.values(), key=lambda one: one[0])[:MAX_SIMULATED_SETTINGS]:
        per_shot = simulated_separation(problem, best, rival_fit, shot)
        count = _shots_needed(per_shot)
        if count <= MAX_SHOTS:
            power = float(norm.cdf(math.sqrt(count) * per_shot - norm.ppf(1.0 - SIGNIFICANCE)))
            proposals.append(Proposal(effects, setting, count, power))
        if count <= FEW_SHOTS:
            break
    nothing = Proposal(effects, _separate_measurement(*effects), 0, 1.0)
    return min(proposals, key=lambda proposal: proposal.shots, default=nothing)


def _shots_needed(per_shot: float) -> int:
    """Shots that reach the power, from the mean difference of a shot over its standard deviation."""
    if per_shot <= 0.0:
        return MAX_SHOTS + 1
    needed = ((norm.ppf(1.0 - SIGNIFICANCE) + norm.ppf(POWER)) / per_shot) ** 2
    return max(math.ceil(min(needed, MAX_SHOTS + 1.0)), 2)


def simulated_separation(problem: Problem, best: Fit, rival_fit: Fit, shot: PreparedShot) -> float:
    """Log-likelihood by which simulated shots prefer the model that made them: mean over standard deviation.

    Each shot has noise and a friction factor of its own, which both models fit to it. 0 where the plant has
    no answer.
    """
    shots = concatenate_shots(
        problem.shots.excitation,
        problem.shots.gravity_m_s2,
        problem.shots.stroke_m,
        (shot,) * SIMULATED_SHOTS,
        problem.shots.noise_std,
    )
    rng = np.random.default_rng(SIMULATION)
    try:
        model = Problem(shots, problem.batches, best.effects)
        guess = model.initial_guess()
        scatter = best.spread * rng.standard_normal(SIMULATED_SHOTS)
        residual = model.residual(best.theta, replace(guess, log_factor=scatter))
        made = shots.values + shots.unwhiten(rng.standard_normal(residual.size) - residual)
        simulated = Problem(_with_values(shots, made), problem.batches, best.effects)
        preferred, other = (refit_shot_parameters(simulated, fit) for fit in (best, rival_fit))
    except (PhysicsError, ValueError):
        return 0.0
    difference = preferred.log_likelihood(simulated.shots) - other.log_likelihood(simulated.shots)
    if not np.isfinite(difference).all():
        return 0.0
    return float(difference.mean()) / max(float(difference.std(ddof=1)), 1e-12)


def _with_values(shots: ShotSet, values: Samples) -> ShotSet:
    """Put other samples into the same shots."""
    items = []
    for place, shot in enumerate(shots.items):
        ends = np.cumsum([len(channel) for channel in shot.values])[:-1]
        force, position, actuator = np.split(values[shots.samples_of(place)], ends)
        items.append(replace(shot, values=(force, position, actuator)))
    return concatenate_shots(
        shots.excitation, shots.gravity_m_s2, shots.stroke_m, tuple(items), shots.noise_std
    )


def _separate_measurement(effect: str, rival: str) -> str:
    """Say what breaks an exact confound: a measurement outside of the shots."""
    kinds = {LIBRARY[effect].kind, LIBRARY[rival].kind}
    names = {effect, rival}
    if "mass_error" in names:
        return (
            "weigh the part: if it weighs other than told, correct its mass, else the force sensor's scale"
            if "force_sensor_gain" in names
            else "weigh the part"
        )
    if names & LATE_CHANNELS:
        return (
            "the same settings at a higher sampling rate: at first contact it shows what makes a channel late"
        )
    if Kind.SENSOR in kinds:
        return "load the force sensor with a known weight: no shot tells its error from the plant's own"
    if "surface_tilt" in names and Kind.BETWEEN_SHOTS in kinds:
        return "level the table with a spirit level, and do the same again: what is left then is no tilt"
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
