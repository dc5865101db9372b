"""Writes a campaign as a directory, and its truth beside it.

The writer is the simulator's own, so that the product's reader is tested on files it has not written. The
same scenario gives the same bytes.
"""

import json
import math
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.errors import CampaignError
from simulator.campaign import COLUMNS, MadeShot, make
from simulator.campaign_scenario import CampaignScenario
from simulator.plant import Plant


def write(scenario: CampaignScenario, directory: Path) -> Path:
    """Make the campaign, write it to `directory` and its truth beside it; returns the truth file.

    A directory that is there and empty is filled, as `.` is for a shell that stands in it.

    Raises
    ------
    CampaignError
        One of the two exists already, or cannot be written.
    """
    directory = directory.resolve()
    _check_free(directory)
    truth = directory.with_name(directory.name + ".truth.json")
    _check_free(truth)
    base, shots = make(scenario)
    beside = directory.with_name(f".{directory.name}.partial")
    try:
        shutil.rmtree(beside, ignore_errors=True)
        (beside / "traces").mkdir(parents=True)
        (beside / "campaign.yaml").write_text(_header(scenario), encoding="utf-8")
        (beside / "shots.csv").write_text(_table(scenario, shots), encoding="utf-8")
        for shot in shots:
            (beside / "traces" / f"{shot.plan.number}.csv").write_text(_trace(shot), encoding="utf-8")
        truth.write_text(json.dumps(_truth(scenario, base, shots), indent=1) + "\n", encoding="utf-8")
        if directory.is_dir():
            for part in sorted(beside.iterdir(), reverse=True):  # campaign.yaml last
                part.rename(directory / part.name)
        else:
            beside.rename(directory)
    except OSError as error:
        message = f"{directory}: cannot be written: {error.strerror}"
        raise CampaignError(message) from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)
    return truth


def _check_free(place: Path) -> None:
    if place.exists() and not (place.is_dir() and not any(place.iterdir())):
        message = f"{place}: exists already; choose another name or remove it"
        raise CampaignError(message)


def _header(scenario: CampaignScenario) -> str:
    lines = ["format: 1", f"excitation: {scenario.excitation}", f"gravity_m_s2: {scenario.gravity_m_s2:g}"]
    if scenario.excitation == "tap":
        lines += ["actuator:", f"  stroke_m: {scenario.stroke_m:.9g}"]
    lines.append("sensors:")
    for name in COLUMNS:
        sensor = getattr(scenario.sensors, name)
        if sensor is not None:
            unit = "n" if name == "force" else "m"
            noise = f"{sensor.noise_std:.9g}" if scenario.noise.stated and sensor.noise_std > 0.0 else "null"
            lines.append(f"  {name}: {{rate_hz: {sensor.rate_hz:.9g}, noise_std_{unit}: {noise}}}")
    return "\n".join(lines) + "\n"


def _table(scenario: CampaignScenario, shots: Sequence[MadeShot]) -> str:
    is_tap = scenario.excitation == "tap"
    names = ["shot", *(["velocity_mm_per_min"] if is_tap else []), "mass_kg", "direction", "batch", "dwell_s"]
    starts = any(start != 0.0 for start in scenario.starts_m)
    rows = [names + (["start_m"] if starts else []) + list(scenario.columns)]
    for shot in shots:
        plan = shot.plan
        row = [str(plan.number)] + ([f"{plan.velocity:.9g}"] if is_tap else [])
        row += [f"{plan.mass_kg:.9g}" if scenario.mass_stated else "", str(plan.direction)]
        row += [scenario.batches[plan.batch], f"{plan.dwell_s:.9g}"]
        row += [f"{plan.start_m:.9g}"] if starts else []
        rows.append(row + [f"{value:.9g}" for value in plan.columns.values()])
    return "".join(",".join(row) + "\n" for row in rows)


def _trace(shot: MadeShot) -> str:
    times = np.unique(np.concatenate([time for time, _ in shot.channels.values()]))
    columns = [[f"{time:.9g}" for time in times.tolist()]]
    for time, values in shot.channels.values():
        cells = [""] * len(times)
        for place, value in zip(np.searchsorted(times, time).tolist(), values.tolist(), strict=True):
            cells[place] = f"{value:.9g}"
        columns.append(cells)
    header = ",".join(["time_s", *(COLUMNS[name] for name in shot.channels)])
    return "\n".join([header, *(",".join(row) for row in zip(*columns, strict=True))]) + "\n"


def _truth(scenario: CampaignScenario, base: Plant, shots: Sequence[MadeShot]) -> dict[str, Any]:
    return {
        "effect": "+".join(scenario.hide) or "none",
        "effects": {name: dict(parameters) for name, parameters in base.effects.items()},
        "seed": scenario.seed,
        "base": {"k": base.stiffness_n_per_m, "b": base.damping_n_s_per_m},
        "mus": base.mu_s,
        "ratio": scenario.plant.ratio,
        "shots": [
            {
                "shot": shot.plan.number,
                "mu_s": shot.motion.mu_s,
                "mu_k": shot.motion.mu_k,
                "factor": shot.plan.factor,
                "mass_kg": shot.plan.mass_kg * shot.plan.mass_over_told,
                "velocity_over_told": shot.plan.velocity_over_told,
                "peak_force_n": shot.motion.peak_force_n,
                "sliding_distance_m": _or_none(shot.motion.sliding_distance_m),
                "displacement_m": shot.motion.displacement_m,
            }
            for shot in shots
        ],
    }


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value
