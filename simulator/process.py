"""Which strike comes next, and which plant it meets: wear, batch, scatter, deviation, new effects. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from simulator.effects import Parameter
from simulator.plant import Plant, TapInput
from simulator.scenario import DEVIATION_EFFECT, Batch, Deviation, Scenario, Strikes
from simulator.scenario_file import MM_PER_MIN


@dataclass(frozen=True, slots=True)
class StrikeConditions:
    """What one strike meets, and why.

    Attributes
    ----------
    batch : Batch
        The batch that is really there, announced or not.
    deviation : str
        Kind of a deviant cycle; empty for a normal one.
    random : Generator
        For what is measured of this strike: the same for the same strike, whatever came before.
    """

    plant: Plant
    batch: Batch
    deviation: str
    random: np.random.Generator


def scheduled_tap(scenario: Scenario, strikes: Strikes, made: int) -> TapInput:
    """Next strike of a schedule after so many; the part is put back after every one."""
    velocities, directions = strikes.velocities_mm_per_min, strikes.directions
    if strikes.order == "in_turn":
        velocity = velocities[made % len(velocities)]
        direction = directions[made % len(directions)]
    else:
        random = np.random.default_rng([scenario.seed, made, 1])
        velocity = float(random.choice(velocities))
        direction = 1 if random.choice(directions) == 1 else -1
    return TapInput(velocity * MM_PER_MIN, scenario.part.mass_kg, strikes.stroke_m, direction)


def strike_conditions(scenario: Scenario, number: int, start_m: float, direction: int) -> StrikeConditions:
    """Plant met by the strike of this number, counted from 1, on a part that lies at `start_m`.

    The number is that of the scenario's cycles; a restart of the module changes its counter, not this.
    """
    random = np.random.default_rng([scenario.seed, number])
    plant = scenario.plant
    batch = [entry for entry in scenario.batches if entry.from_cycle <= number][-1]
    wear = scenario.wear
    last = number if wear.until_cycle is None else min(number, wear.until_cycle)
    worn = wear.mu_s_per_1000_cycles * max(last - wear.from_cycle, 0) / 1000.0
    factor = 1.0 + scenario.scatter.friction * random.standard_normal()
    ratio = plant.ratio * (1.0 + scenario.scatter.ratio * random.standard_normal())
    effects: dict[str, Mapping[str, Parameter]] = dict(plant.effects)
    for appearance in scenario.appearances:
        if appearance.from_cycle <= number:
            effects |= appearance.effects
    deviation = next((entry for entry in scenario.deviations if entry.cycle == number), None)
    if deviation is not None:
        if deviation.kind == "level":
            factor *= 1.0 + deviation.size
        else:
            effects[DEVIATION_EFFECT[deviation.kind]] = _along_stroke(deviation, start_m, direction)
    mu_s = (plant.mu_s + worn + batch.shift) * factor
    return StrikeConditions(
        plant=Plant(
            stiffness_n_per_m=plant.stiffness_n_per_m,
            damping_n_s_per_m=plant.damping_n_s_per_m,
            mu_s=max(float(mu_s), 1e-3),
            mu_k=max(float(mu_s * min(ratio, 1.0)), 1e-3),
            gravity_m_s2=plant.gravity_m_s2,
            effects=effects,
        ),
        batch=batch,
        deviation="" if deviation is None else deviation.kind,
        random=random,
    )


def _along_stroke(deviation: Deviation, start_m: float, direction: int) -> Mapping[str, Parameter]:
    """Parameters in table coordinates of a deviation that is told along the stroke."""
    match deviation.kind:
        case "bump":
            place = start_m + direction * deviation.at_m
            return {"amplitude": deviation.size, "position_m": place, "width_m": deviation.width_m}
        case "tilt":
            return {"gradient_per_m": direction * deviation.size}
        case _:
            phase = -2.0 * np.pi * start_m / deviation.period_m
            return {"amplitude": deviation.size, "period_m": deviation.period_m, "phase_rad": float(phase)}
