"""Runs the study of laws invented: campaigns that leave something in which there is no law to be found.

`python -m tests.benchmarks._null_laws_run --turns 4` adds the campaigns that are not there yet, one of each
kind a turn; `--budget 300` stops after 300 s of processor time. Rows go to a file, one a campaign. Kinds:

- `scatter`: friction coefficients, and their ratio, scatter from shot to shot, and no setting is repeated;
- `outliers`: one sample in two hundred errs by some ten standard deviations, with heavy tails;
- `wander`: in contact the force and the position err by a smooth random curve, another one for each shot;
- `drift`: the force's zero walks at random from shot to shot, and its gain with it;
- `coloured`: noise that is correlated over milliseconds beside the white one that is stated;
- `faint`: as `wander`, but so small that a law that took most of it would pass;
- `settings`: each setting (speed, mass, direction) has a friction of its own, that goes with nothing.
"""

import argparse
import json
import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.campaign import Campaign
from impactcell.discrepancy.workflow import investigate
from impactcell.records import Capture, Samples
from simulator.campaign import make
from simulator.campaign_scenario import CampaignScenario
from tests.discrepancy.study import Job, recorded, scenario

ROWS = Path("bench-results/null_laws.jsonl")
FIRST_SEED = 5_000_000
"""Seeds on which this may be tuned."""
SHOTS = 30
RATE_HZ = 2000.0
SCATTER = {"friction_scatter": 0.05, "ratio_scatter": 0.03}
OUTLIER_SHARE, OUTLIER_SIZE = 0.005, 10.0
WANDER_SIZE, WANDER_HZ, WANDER_WAVES = 2.0, (40.0, 400.0), 8
"""RMS in standard deviations of the noise, band of its frequencies, and how many there are."""
DRIFT_SIZE, GAIN_DRIFT = 0.6, 0.004
"""Step from a shot to the next, in standard deviations of the noise; and of the gain [1]."""
FAINT_SIZE = 0.7
"""The same RMS of what is faint."""
SETTING_SCATTER = (0.92, 0.96, 1.0, 1.04, 1.08)
"""Frictions of the settings over the plant's."""
COLOUR_SIZE, COLOUR_TIME_S = 1.0, 3e-3
"""In standard deviations of the stated noise, and its correlation time."""
Random = np.random.Generator


def _outliers(rng: Random, time_s: Samples, std: float) -> Samples:
    hit = rng.random(time_s.size) < OUTLIER_SHARE
    error: Samples = np.where(hit, OUTLIER_SIZE * std * rng.standard_t(2.0, time_s.size), 0.0)
    return error


def _wander(rng: Random, time_s: Samples, std: float) -> Samples:
    frequencies = rng.uniform(*WANDER_HZ, WANDER_WAVES)
    phases = rng.uniform(0.0, 2.0 * math.pi, WANDER_WAVES)
    waves = np.sin(2.0 * math.pi * np.outer(time_s, frequencies) + phases) - np.sin(phases)
    error: Samples = WANDER_SIZE * std * math.sqrt(2.0 / WANDER_WAVES) * waves.sum(axis=1) * (time_s > 0.0)
    return error


def _faint(rng: Random, time_s: Samples, std: float) -> Samples:
    return _wander(rng, time_s, std * FAINT_SIZE / WANDER_SIZE)


def _coloured(rng: Random, time_s: Samples, std: float) -> Samples:
    kept = math.exp(-1.0 / (RATE_HZ * COLOUR_TIME_S))
    error = np.empty(time_s.size)
    last = rng.standard_normal()
    for i, kick in enumerate(rng.standard_normal(time_s.size)):
        last = kept * last + math.sqrt(1.0 - kept**2) * kick
        error[i] = last
    return COLOUR_SIZE * std * error


ERRORS: dict[str, Callable[[Random, Samples, float], Samples]] = {
    "outliers": _outliers,
    "wander": _wander,
    "coloured": _coloured,
    "faint": _faint,
}
KINDS = ("scatter", "drift", *ERRORS, "settings")


def null_campaign(kind: str, seed: int) -> Campaign:
    """Make a campaign that leaves something, and hides no law."""
    plan = scenario(Job("removed", (), seed, shots=SHOTS, replicates=kind != "scatter"))
    sensors = plan.sensors.model_dump()
    changes: dict[str, Any] = {
        "sensors": {name: one and one | {"rate_hz": RATE_HZ} for name, one in sensors.items()}
    }
    if kind == "scatter":
        changes |= SCATTER
    plan = CampaignScenario.model_validate(plan.model_dump() | changes)
    rng = np.random.default_rng([seed, 11])
    if kind == "settings":
        return _of_settings(plan, rng)
    campaign = recorded(plan, make(plan)[1])
    if kind == "drift":
        return _drifting(campaign, rng)
    if kind in ERRORS:
        return replace(campaign, shots=tuple(_erring(shot, ERRORS[kind], rng) for shot in campaign.shots))
    return campaign


def _erring(shot: Capture, error: Callable[[Random, Samples, float], Samples], rng: Random) -> Capture:
    changed = {}
    for name in ("force", "position"):
        channel = getattr(shot, name)
        added = error(rng, channel.time_s, channel.noise_std)
        changed[name] = replace(channel, values=channel.values + added)
    return replace(shot, **changed)


def _of_settings(plan: CampaignScenario, rng: Random) -> Campaign:
    """Take each setting's shots from a campaign whose plant has another friction."""
    made = []
    for factor in SETTING_SCATTER:
        plant = plan.plant.model_copy(update={"mu_s": factor * plan.plant.mu_s})
        made.append(make(plan.model_copy(update={"plant": plant}))[1])
    which: dict[tuple[float, float, int], int] = {}
    shots = []
    for place, shot in enumerate(made[0]):
        setting = (shot.plan.velocity, shot.plan.mass_kg, shot.plan.direction)
        shots.append(made[which.setdefault(setting, int(rng.integers(len(made))))][place])
    return recorded(plan, shots)


def _drifting(campaign: Campaign, rng: Random) -> Campaign:
    shots = []
    zero, gain = 0.0, 1.0
    for shot in campaign.shots:
        force = shot.force
        if force is None or force.noise_std is None:
            raise ValueError(shot.cycle)
        zero += DRIFT_SIZE * force.noise_std * rng.standard_normal()
        gain += GAIN_DRIFT * rng.standard_normal()
        shots.append(replace(shot, force=replace(force, values=gain * force.values + zero)))
    return replace(campaign, shots=tuple(shots))


def run(kind: str, seed: int) -> dict[str, Any]:
    """One row of the study."""
    campaign = null_campaign(kind, seed)
    started = time.process_time()
    found = investigate(campaign, seed=seed)
    row: dict[str, Any] = {
        "key": f"{kind} {seed}",
        "kind": kind,
        "verdict": found.verdict,
        "added": list(found.added),
        "seconds": round(time.process_time() - started, 1),
        "law": None,
    }
    if found.law is not None:
        finding = found.law
        row["law"] = {
            "place": finding.term.form.place,
            "form": None if finding.proposed is None else finding.proposed.functional_form,
            "refused": finding.refused,
            "before": finding.change.before.trace,
            "after": finding.change.after.trace,
        }
    return row


def main() -> None:
    """Add what is not there yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=4)
    parser.add_argument("--budget", type=float, default=math.inf, help="processor time [s]")
    parser.add_argument("--only", default="", choices=["", *KINDS], help="one kind alone")
    arguments = parser.parse_args()
    ROWS.parent.mkdir(exist_ok=True)
    known = {json.loads(line)["key"] for line in ROWS.read_text().splitlines()} if ROWS.exists() else set()
    begun = time.process_time()
    for turn in range(arguments.turns):
        for number, kind in enumerate(KINDS):
            seed = FIRST_SEED + 20 * turn + number
            if arguments.only not in {"", kind} or f"{kind} {seed}" in known:
                continue
            if time.process_time() - begun > arguments.budget:
                return
            with ROWS.open("a") as rows:
                rows.write(json.dumps(run(kind, seed)) + "\n")


if __name__ == "__main__":
    main()
