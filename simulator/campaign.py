"""Makes a campaign: shots in a design, struck on the simulator's plant, and what sensors show of them.

Everything random comes from one seed; the same scenario gives the same shots.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from simulator.campaign_scenario import CampaignScenario, SensorScenario
from simulator.plant import Motion, Plant, Shot, TapInput, simulate_driven, simulate_free_slide, simulate_tap
from simulator.scenario_file import MM_PER_MIN

Samples = NDArray[np.float64]
COLUMNS = {"force": "force_n", "position": "position_m", "actuator": "actuator_m"}
"""Column of each sensor in the files, which is also what the motion calls it."""


@dataclass(frozen=True, slots=True)
class PlannedShot:
    """One row of the design. `velocity` is in mm/min for a tap, m/s for a free slide."""

    number: int
    velocity: float
    mass_kg: float
    direction: int
    start_m: float
    batch: int
    dwell_s: float
    factor: float
    ratio_factor: float
    strength: float
    columns: Mapping[str, float]
    velocity_over_told: float = 1.0
    mass_over_told: float = 1.0


@dataclass(frozen=True, slots=True)
class MadeShot:
    """A shot with its motion, its noisy channels (time, values) and the plant that made it."""

    plan: PlannedShot
    plant: Plant
    motion: Motion
    channels: Mapping[str, tuple[Samples, Samples]]


def make(scenario: CampaignScenario) -> tuple[Plant, tuple[MadeShot, ...]]:
    """Strike every shot of a scenario; the base plant, before scatter, and the shots in order."""
    design, noise, columns, told = (
        np.random.default_rng(seed) for seed in np.random.SeedSequence(scenario.seed).spawn(4)
    )
    base = _base_plant(scenario, design)
    plans = tuple(
        _off_told(scenario, _with_columns(scenario, plan, columns), told) for plan in _plan(scenario, design)
    )
    return base, tuple(_shot(scenario, base, plan, len(plans), noise) for plan in plans)


def _base_plant(scenario: CampaignScenario, random: np.random.Generator) -> Plant:
    spread = 1.0 + scenario.plant.spread * random.uniform(-1.0, 1.0, 3)
    mu_s = scenario.plant.mu_s * spread[2]
    return Plant(
        stiffness_n_per_m=float(scenario.plant.stiffness_n_per_m * spread[0]),
        damping_n_s_per_m=float(scenario.plant.damping_n_s_per_m * spread[1]),
        mu_s=float(mu_s),
        mu_k=float(mu_s * scenario.plant.ratio),
        gravity_m_s2=scenario.gravity_m_s2,
        effects=scenario.hidden(),
    )


def _plan(scenario: CampaignScenario, random: np.random.Generator) -> Iterator[PlannedShot]:
    speeds = {"tap": scenario.velocities_mm_per_min, "free_slide": scenario.speeds_m_s, "driven": [math.nan]}
    points = [
        (velocity, mass, direction, start)
        for velocity in speeds[scenario.excitation]
        for mass in scenario.masses_kg
        for direction in ([1] if scenario.excitation == "driven" else scenario.directions)
        for start in scenario.starts_m
        for _ in range(scenario.replicates)
    ]
    count = scenario.shots or len(points)
    chosen: list[int] = []
    while len(chosen) < count:
        again = np.arange(len(points)) if scenario.order == "as_listed" else random.permutation(len(points))
        chosen += again.tolist()
    low, high = scenario.dwell_s
    for number, place in enumerate(chosen[:count], 1):
        velocity, mass, direction, start = points[place]
        jitter = 1.0 + scenario.velocity_jitter * random.uniform(-1.0, 1.0)
        yield PlannedShot(
            number=number,
            velocity=float(velocity * jitter),
            mass_kg=mass,
            direction=direction,
            start_m=start,
            batch=(number - 1) * len(scenario.batches) // count,
            dwell_s=round(float(np.exp(random.uniform(np.log(low), np.log(high)))), 1),
            factor=_above_zero(random, 1.0, scenario.friction_scatter),
            ratio_factor=_above_zero(random, 1.0, scenario.ratio_scatter),
            strength=1.0,
            columns={},
        )


def _with_columns(scenario: CampaignScenario, plan: PlannedShot, random: np.random.Generator) -> PlannedShot:
    """Draw the further columns of a shot; friction goes with them as the scenario says."""
    values = {
        name: float(random.uniform(column.low, column.high)) for name, column in scenario.columns.items()
    }
    factor, strength = plan.factor, 1.0
    for name, column in scenario.columns.items():
        factor *= _factor(column.friction, values[name])
        strength *= _factor(column.strength, values[name])
    return replace(plan, factor=factor, strength=strength, columns=values)


def _off_told(scenario: CampaignScenario, plan: PlannedShot, random: np.random.Generator) -> PlannedShot:
    """Draw how far velocity and mass of a shot are from what is told of them."""
    told = scenario.told
    return replace(
        plan,
        velocity_over_told=_above_zero(random, 1.0 + told.velocity_error, told.velocity_scatter),
        mass_over_told=_above_zero(random, 1.0 + told.mass_error, told.mass_scatter),
    )


def _above_zero(random: np.random.Generator, mean: float, scatter: float) -> float:
    """Draw from a normal distribution, again and again where that is not above 0; `mean` is."""
    while (drawn := mean + scatter * random.standard_normal()) <= 0.0:
        pass
    return drawn


def _factor(table: Sequence[tuple[float, float]], value: float) -> float:
    """Give the factor at a column's value; 1 where there is no table."""
    if not table:
        return 1.0
    at, factors = zip(*table, strict=True)
    return float(np.interp(value, at, factors))


def _at_strength(plant: Plant, strength: float) -> Plant:
    """Multiply the first parameter of each hidden effect, its strength."""
    effects: dict[str, Mapping[str, Any]] = {}
    for identifier, parameters in plant.effects.items():
        first, *_ = parameters
        value = parameters[first]
        scaled = [strength * one for one in value] if isinstance(value, Sequence) else strength * value
        effects[identifier] = {**parameters, first: scaled}
    return replace(plant, effects=effects)


def _shot(
    scenario: CampaignScenario, base: Plant, plan: PlannedShot, shots: int, random: np.random.Generator
) -> MadeShot:
    plant = replace(base, mu_s=base.mu_s * plan.factor, mu_k=base.mu_k * plan.factor * plan.ratio_factor)
    if any(column.strength for column in scenario.columns.values()):
        plant = _at_strength(plant, plan.strength)
    covariates = Shot(plan.direction, plan.start_m, plan.dwell_s, plan.number, shots, plan.batch)
    drive: _Drive | None = None
    match scenario.excitation:
        case "tap":
            strike = TapInput(
                velocity_m_s=plan.velocity * plan.velocity_over_told * MM_PER_MIN,
                mass_kg=plan.mass_kg * plan.mass_over_told,
                stroke_m=scenario.stroke_m,
                direction=plan.direction,
                start_m=plan.start_m,
                dwell_s=plan.dwell_s,
                shot=plan.number,
                shots=shots,
                batch=plan.batch,
            )
            motion = simulate_tap(plant, strike)
        case "free_slide":
            motion = simulate_free_slide(plant, plan.mass_kg, plan.velocity, covariates)
        case _:
            drive = _Drive(scenario, random)
            motion = simulate_driven(
                plant, plan.mass_kg, drive.force_n, scenario.drive.duration_s, covariates
            )
    # The actuator's laws may outlast the part's last stop; nothing of interest happens after either.
    last = motion.end_s if drive is not None else max(motion.stop_s, 0.0) + scenario.tail_s
    channels = {}
    for name, column in COLUMNS.items():
        sensor = getattr(scenario.sensors, name)
        if sensor is None:
            continue
        time = np.arange(1, max(int(last * sensor.rate_hz + 1e-6), 1) + 1) / sensor.rate_hz
        if drive is not None and name == "force":
            shown = drive.force_n(time - motion.sensor_delay_s, lag_s=motion.sensor_lag_s)
            values = np.array([motion.sensed(force) for force in shown])
        else:
            values = getattr(motion, column)(time)
        channels[name] = _measured(scenario, sensor, time, values, random)
    return MadeShot(plan, plant, motion, channels)


class _Drive:
    """Sum of sines in random phase: smooth, and band-limited well below any sampling rate."""

    def __init__(self, scenario: CampaignScenario, random: np.random.Generator) -> None:
        drive = scenario.drive
        frequencies = random.uniform(drive.band_hz[0], drive.band_hz[1], drive.lines)
        self._rates = 2.0 * np.pi * frequencies
        self._phases = random.uniform(0.0, 2.0 * np.pi, drive.lines)
        self._amplitude = drive.rms_n * math.sqrt(2.0 / drive.lines)

    def force_n(self, time: Any, lag_s: float = 0.0) -> Any:
        """Force, or what a first-order lag shows of it once it has settled."""
        response = 1.0 / (1.0 + 1j * self._rates * lag_s)
        angles = np.multiply.outer(time, self._rates) + self._phases + np.angle(response)
        return self._amplitude * (np.abs(response) * np.sin(angles)).sum(axis=-1)


def _measured(
    scenario: CampaignScenario,
    sensor: SensorScenario,
    time: Samples,
    values: Samples,
    random: np.random.Generator,
) -> tuple[Samples, Samples]:
    noise = random.standard_normal(len(time))
    if scenario.noise.colour == "coloured":
        # First-order autoregressive noise of unit variance, stationary from the first sample on.
        keep = math.exp(-1.0 / (sensor.rate_hz * scenario.noise.correlation_time_s))
        noise[1:] *= math.sqrt(1.0 - keep * keep)
        noise = lfilter([1.0], [1.0, -keep], noise)
    measured = values + sensor.noise_std * noise
    if sensor.resolution > 0.0:
        measured = np.rint(measured / sensor.resolution) * sensor.resolution
    lost = int(sensor.gap_share * len(time))
    if lost:
        first = int(random.integers(0, len(time) - lost + 1))
        keep_them = np.ones(len(time), dtype=bool)
        keep_them[first : first + lost] = False
        return time[keep_them], measured[keep_them]
    return time, measured
