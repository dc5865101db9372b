"""What the module's sensors record of a motion. Pure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from impactcell.fieldbus.registers import RegisterMap
from simulator.plant import Motion
from simulator.scenario import Scenario, Sensor

Samples = NDArray[np.float64]
AFTER_SEPARATION_S = 0.001
"""The force is recorded so long after loss of contact, seconds."""
AFTER_STOP_S = 0.002
"""All channels are recorded so long after the part has come to rest, seconds."""
FULL_SCALE_N = 1e6
"""What a saturated force channel shows: beyond the code range of any map."""


@dataclass(frozen=True, slots=True)
class Recording:
    """What the module can record, and how its registers show it.

    Attributes
    ----------
    room : mapping
        Most samples of each channel that the window can show.
    has_one_rate : bool
        All channels are sampled together: at one rate, from one time on, as many of each.
    fixed : mapping
        Rates and starts that are always the same and stand in no register, by the register's name.
    has_starts : bool
        Whether anything says when the first sample was; else it is at first contact.
    """

    room: Mapping[str, int]
    has_one_rate: bool = False
    fixed: Mapping[str, float] = field(default_factory=dict)
    has_starts: bool = True

    @classmethod
    def of(cls, registers: RegisterMap) -> "Recording":
        """Say what a module with this layout can record."""
        names = {*registers.registers, *registers.constants}
        return cls(
            {name: registers[name].count for name in registers.arrays},
            has_one_rate="sample_rate" in names,
            fixed=registers.constants,
            has_starts=any(name.endswith("_start") for name in names),
        )


def record(
    scenario: Scenario, motion: Motion, can: Recording, random: np.random.Generator, faulty: str = ""
) -> tuple[dict[str, Samples], dict[str, float]]:
    """Return samples of every channel in SI, and the header's rates and starts.

    A motion that would not fit is sampled more slowly, so that it is always seen to its end; where the rate
    is fixed, its end is cut off.

    Parameters
    ----------
    faulty : str
        Kind of a faulty capture; empty for a good one.
    """
    rest_s = max(motion.stop_s if math.isfinite(motion.stop_s) else 0.0, motion.halt_s) + AFTER_STOP_S
    apart = motion.separation_s + AFTER_SEPARATION_S if math.isfinite(motion.separation_s) else rest_s
    sensors = {name: getattr(scenario.sensors, name) for name in can.room}
    sensors = {name: sensor for name, sensor in sensors.items() if sensor is not None}
    lasts_s = dict.fromkeys(sensors, rest_s)
    if "force" in lasts_s and not can.has_one_rate:
        lasts_s["force"] = min(apart, rest_s)
    rates = {name: _rate(sensor, lasts_s[name], can.room[name]) for name, sensor in sensors.items()}
    if can.has_one_rate and rates:
        rates = dict.fromkeys(rates, min(rates.values()))
    samples: dict[str, Samples] = {}
    header: dict[str, float] = {}
    for name, sensor in sensors.items():
        rate = can.fixed.get(f"{name}_rate", can.fixed.get("sample_rate", rates[name]))
        start = can.fixed.get(f"{name}_start", can.fixed.get("sample_start"))
        count = max(min(int(lasts_s[name] * rate), can.room[name]), 1)
        time = (
            (np.arange(count) + can.has_starts) / rate if start is None else start + np.arange(count) / rate
        )
        values = {"force": motion.force_n, "position": motion.position_m, "actuator": motion.actuator_m}[
            name
        ](time)
        samples[name] = values + sensor.noise_std * random.standard_normal(count)
        header |= {
            f"{name}_rate": rate,
            f"{name}_start": time[0],
            "sample_rate": rate,
            "sample_start": time[0],
        }
    return _spoil(samples, faulty), header


def reported(
    registers: RegisterMap, header: Mapping[str, float | str], random: np.random.Generator
) -> dict[str, float]:
    """Return the module's own figures, with the errors that its map tells of."""
    told = [name for name in ("peak_force", "sliding_distance") if name in registers]
    stds = {name: registers[name].si_std for name in told if registers[name].std is not None}
    return {name: float(header[name]) + std * random.standard_normal() for name, std in stds.items()}


def _rate(sensor: Sensor, lasts_s: float, room: int) -> int:
    """Rate at which the record fits both its longest duration and its room."""
    most = min(room, max(int(sensor.longest_s * sensor.rate_hz), 1))
    samples_needed = max(int(lasts_s * sensor.rate_hz), 1)
    return max(sensor.rate_hz // math.ceil(samples_needed / most), 1)


def _spoil(samples: dict[str, Samples], faulty: str) -> dict[str, Samples]:
    match faulty:
        case "empty":
            return {}
        case "no_force":
            return {name: values for name, values in samples.items() if name != "force"}
        case "constant_force":
            return samples | {"force": np.full_like(samples["force"], 12.5)}
        case "saturated":
            force = samples["force"]
            return samples | {"force": np.where(force > 0.5 * force.max(), FULL_SCALE_N, force)}
        case "no_separation":
            force = samples["force"]
            return samples | {"force": force[: int(np.argmax(force)) + 1]}
        case "not_a_number":
            force = samples["force"].copy()
            force[len(force) // 3 : len(force) // 2] = np.nan
            return samples | {"force": force}
        case _:
            return samples
