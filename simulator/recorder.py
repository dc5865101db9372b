"""What the module's sensors record of a motion. Pure."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from simulator.plant import Motion
from simulator.scenario import Scenario, Sensor

Samples = NDArray[np.float64]
AFTER_SEPARATION_S = 0.001
"""The force is recorded so long after loss of contact, seconds."""
AFTER_STOP_S = 0.002
"""All channels are recorded so long after the part has come to rest, seconds."""
FULL_SCALE_N = 1e6
"""What a saturated force channel shows: beyond the code range of any map."""


def record(
    scenario: Scenario, motion: Motion, room: Mapping[str, int], random: np.random.Generator, faulty: str = ""
) -> tuple[dict[str, Samples], dict[str, float]]:
    """Return samples of every channel in SI, and the header's rates and starts.

    Parameters
    ----------
    room : mapping
        Most samples of each channel that the window can show. A motion that would not fit is sampled more
        slowly, so that it is always seen to its end.
    faulty : str
        Kind of a faulty capture; empty for a good one.
    """
    rest_s = max(motion.stop_s if math.isfinite(motion.stop_s) else 0.0, motion.halt_s) + AFTER_STOP_S
    apart = motion.separation_s + AFTER_SEPARATION_S if math.isfinite(motion.separation_s) else rest_s
    samples: dict[str, Samples] = {}
    header: dict[str, float] = {}
    for name in ("force", "position", "actuator"):
        sensor: Sensor | None = getattr(scenario.sensors, name)
        if sensor is None or name not in room:
            continue
        lasts_s = min(apart, rest_s) if name == "force" else rest_s
        rate = _rate(sensor, lasts_s, room[name])
        count = max(min(int(lasts_s * rate), room[name]), 1)
        time = np.arange(1, count + 1) / rate
        values = {"force": motion.force_n, "position": motion.position_m, "actuator": motion.actuator_m}[
            name
        ](time)
        samples[name] = values + sensor.noise_std * random.standard_normal(count)
        header[f"{name}_rate"] = rate
        header[f"{name}_start"] = 1.0 / rate
    return _spoil(samples, faulty), header


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
