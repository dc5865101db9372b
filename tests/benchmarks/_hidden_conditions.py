"""What a planner's model may lack, one thing after the other: conditions of the study of hidden effects."""

import math
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from simulator.effects import LIBRARY, Parameter
from tests.benchmarks._positioning_tasks import NOMINAL, SCATTER

STRENGTHS = (1.0, 0.3)
"""Of an effect's default."""
SEEDS = {"tuning": 8_300, "reporting": 127_300}
"""Cells drawn while a method is worked on, and cells drawn for its table; never the same."""
NULL = {"exponent": 1.0}
"""Values without effect, where they are not 0."""
UNCHANGED = {
    "time_constant_s", "range_m", "position_m", "width_m", "period_m", "phase_rad", "stribeck_velocity_m_s",
}  # fmt: skip
"""Parameters that say where or when, not how much."""
COMPLIANT = {"presliding_compliance"}
"""Effects that are weaker where their parameter is larger."""
SENSOR_ONLY = {
    "channel_skew", "force_saturation", "force_sensor_gain", "force_sensor_lag", "force_sensor_offset",
    "position_sensor_lag",
}  # fmt: skip
"""Effects on what is measured: no part moves differently."""
HOLDS = 0.8
"""Share of static friction that a restoring force may reach at the target, so that the part stays there."""


@dataclass(frozen=True, slots=True)
class Condition:
    """One row of the study.

    Attributes
    ----------
    effects : mapping
        Hidden in the simulator's plant; the planner's model has none of them.
    friction_scatter, displacement_scatter : float
        Relative standard deviations from tap to tap.
    mass_error : float
        Parts are up to so much lighter or heavier than told.
    unannounced : bool
        The batch step comes without a word; the tracker learns of it with the next task.
    longest_start_m : float
        Tasks start between 0 and here.
    """

    name: str
    strength: float = 1.0
    effects: Mapping[str, Mapping[str, Parameter]] = field(default_factory=dict)
    friction_scatter: float = SCATTER
    displacement_scatter: float = 0.0
    mass_error: float = 0.0
    unannounced: bool = False
    longest_start_m: float = 0.0

    @property
    def key(self) -> str:
        return f"{self.name}@{self.strength:g}"


def draws(condition: Condition, seeds: str, cell: int, what: int) -> np.random.Generator:
    """Draws of a cell: each condition has its own, so that what befalls one says nothing of another."""
    return np.random.default_rng([SEEDS[seeds] + what, zlib.crc32(condition.key.encode()), cell])


def scaled(effect: str, strength: float) -> dict[str, Parameter]:
    """Parameters of an effect at a share of its default strength."""
    parameters: dict[str, Parameter] = {}
    for name, default in LIBRARY[effect].defaults.items():
        null = NULL.get(name, 0.0)
        if name in UNCHANGED:
            parameters[name] = default
        elif not isinstance(default, float):
            parameters[name] = tuple(strength * value for value in default)  # type: ignore[union-attr]
        elif effect in COMPLIANT:
            parameters[name] = default / strength
        else:
            parameters[name] = null + strength * (default - null)
    return parameters


def hidden_effects() -> list[Condition]:
    """Nothing hidden, then each effect at its default strength and at 0.3 of it."""
    conditions = [Condition("none")]
    for effect in LIBRARY:
        conditions += [Condition(effect, s, {effect: scaled(effect, s)}) for s in STRENGTHS]
    return conditions


def other_conditions() -> list[Condition]:
    """Scatter of either kind, a wrong mass, a batch step that nobody announced, starts anywhere."""
    quiet = 0.005
    conditions = [Condition("friction_scatter", s, friction_scatter=s) for s in (0.005, 0.03, 0.08)]
    conditions += [
        Condition("displacement_scatter", s, friction_scatter=quiet, displacement_scatter=s)
        for s in (0.005, 0.03, 0.08)
    ]
    conditions.append(Condition("mass_wrong", 0.05, mass_error=0.05))
    conditions.append(Condition("batch_unannounced", unannounced=True))
    gradient = "position_dependent_friction"
    conditions.append(
        Condition("starts_anywhere", 0.3, {gradient: scaled(gradient, 0.3)}, longest_start_m=0.02)
    )
    return conditions


@dataclass(frozen=True, slots=True)
class CellTask:
    """One part to be put in place; `mass_kg` is what it weighs, `told_kg` what the planner is told."""

    number: int
    tolerance_m: float
    stiffness: float
    damping: float
    mu_s: float
    batch: int
    batch_changed: bool
    mass_kg: float
    told_kg: float
    start_m: float
    distance_m: float


def cell_tasks(condition: Condition, seeds: str, cell: int, count: int) -> Iterator[CellTask]:
    """Tasks of a cell as in the study without hidden effects, with this condition's own draws added."""
    rng = draws(condition, seeds, cell, 0)
    stiffness = NOMINAL.stiffness_n_per_m * (1.0 + 0.1 * rng.choice([-1.0, 1.0]))
    damping = NOMINAL.damping_n_s_per_m * (1.0 + 0.1 * rng.choice([-1.0, 1.0]))
    first = rng.uniform(0.12, 0.30)
    wear = rng.uniform(-0.05, 0.05)
    step, when = 0.1 * rng.choice([-1.0, 1.0]), int(rng.integers(count // 5, count - count // 5))
    pull = condition.effects.get("restoring_force", {}).get("stiffness_n_per_m", 0.0)
    assert isinstance(pull, float)
    for number in range(count):
        factor = (1.0 + wear * number / count) * (1.0 + (step if number >= when else 0.0))
        mu_s = float(np.clip(first * factor, 0.12, 0.30))
        mass = float(np.exp(rng.uniform(math.log(5.0), math.log(40.0))))
        distance = float(rng.uniform(2e-3, 40e-3))
        start = condition.longest_start_m * float(rng.random())
        told = mass / (1.0 + condition.mass_error * float(rng.uniform(-1.0, 1.0)))
        if pull:
            distance = min(distance, HOLDS * mu_s * mass * NOMINAL.gravity_m_s2 / pull - start)
        yield CellTask(
            number=number,
            tolerance_m=10e-6 if cell % 2 == 0 else 50e-6,
            stiffness=float(stiffness),
            damping=float(damping),
            mu_s=mu_s,
            batch=int(number >= when),
            batch_changed=number == when,
            mass_kg=mass,
            told_kg=told,
            start_m=start,
            distance_m=distance,
        )
