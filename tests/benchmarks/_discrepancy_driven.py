"""Discrepancy workflow on driven records: hidden effects against answers, on the simulator's own plant.

`python -m tests.benchmarks._discrepancy_driven [--rows FILE] [--table]`: a row a record in FILE, appended as
it is done; what is there already is not done again. Plant, mass, drive, rates and noise are drawn for each.
"""

import argparse
import json
import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.campaign import Campaign, Excitation, Sensor
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.workflow import investigate
from impactcell.errors import ImpactCellError
from impactcell.records import Capture, Channel
from simulator.campaign import make
from simulator.campaign_scenario import CampaignScenario
from tests.benchmarks._discrepancy_run import rows
from tests.benchmarks.table import Table

ROWS = Path("bench-results/discrepancy-driven.jsonl")
SEED = 7000
DURATION_S = 16.0
LISTED: dict[str, dict[str, float]] = {
    "viscous_friction": {"viscous_coefficient_n_s_per_m": 12.0},
    "surface_tilt": {"tilt_rad": 0.004},
    "quadratic_drag": {"drag_coefficient_n_s2_per_m2": 25.0},
    "force_sensor_lag": {"time_constant_s": 0.003},
    "restoring_force": {"stiffness_n_per_m": 20.0},
    "stribeck_friction": {"friction_increase": 0.02, "stribeck_velocity_m_s": 0.05},
    "position_dependent_friction": {"gradient_per_m": 0.4},
    "periodic_friction": {"amplitude": 0.08, "period_m": 0.02, "phase_rad": 0.7},
    "force_sensor_gain": {"relative_error": 0.04},
    "presliding_compliance": {"stiffness_n_per_m": 3e6},
}
UNLISTED: dict[str, dict[str, float]] = {
    "machine_vibration": {"force_n": 6.0, "frequency_hz": 9.0},
    "late_friction": {"amplitude": 0.2, "start_s": 5.0, "time_constant_s": 0.5},
    "magnetic_pull": {"force_n": 8.0, "position_m": 0.0, "width_m": 0.02},
}
SAME = (
    {"surface_tilt", "force_sensor_offset"},
    {"force_sensor_gain", "mass_error"},
    {"force_sensor_lag", "channel_skew"},
)
"""What a slow drive cannot tell apart, or hardly."""


@dataclass(frozen=True)
class Job:
    """One record: what is hidden in it, its seed, and the colour of its noise."""

    hidden: str
    seed: int
    coloured: bool


def jobs() -> Iterator[Job]:
    """Yield all records: first what is without an effect, then round after round of the effects."""
    for number in range(6):
        yield Job("", SEED + number, coloured=number % 2 == 1)
    for turn in range(2):
        names = (*LISTED, *UNLISTED) if turn == 0 else tuple(LISTED)
        for place, effect in enumerate(names):
            yield Job(effect, SEED + 100 * (turn + 1) + place, coloured=turn == 1)


def scenario(job: Job) -> CampaignScenario:
    """The simulator's scenario of a job."""
    rng = np.random.default_rng([job.seed, 5])
    rate = float(rng.choice([1000.0, 2000.0, 5000.0]))
    mass, mu_s = float(rng.uniform(5.0, 20.0)), float(rng.uniform(0.15, 0.25))
    strengths = {**LISTED, **UNLISTED}.get(job.hidden)
    return CampaignScenario.model_validate(
        {
            "format": 1,
            "excitation": "driven",
            "seed": job.seed,
            "plant": {"mu_s": mu_s, "ratio": float(rng.uniform(0.7, 0.9))},
            "masses_kg": [mass],
            "replicates": 1,
            "sensors": {
                "force": {"rate_hz": rate, "noise_std": float(rng.uniform(0.1, 0.4))},
                "position": {"rate_hz": rate, "noise_std": float(rng.uniform(1e-6, 4e-6))},
            },
            "noise": {"colour": "coloured" if job.coloured else "white", "correlation_time_s": 1e-3},
            "drive": {
                "rms_n": float(mass * mu_s * 9.81 * rng.uniform(1.2, 2.0)),
                "band_hz": [0.7, float(rng.uniform(3.0, 7.0))],
                "lines": int(rng.choice([3, 6, 12])),
                "duration_s": DURATION_S,
            },
            "hide": [job.hidden] if job.hidden else [],
            "strengths": {job.hidden: strengths} if strengths else {},
        }
    )


def record(job: Job) -> Campaign:
    """Make the record of a job, without going through files."""
    plan = scenario(job)
    (shot,) = make(plan)[1]
    sensors = {name: getattr(plan.sensors, name) for name in ("force", "position")}
    force, position = (Channel(*shot.channels[name], sensors[name].noise_std) for name in sensors)
    capture = Capture(1, math.nan, shot.plan.mass_kg, force, position, dwell_s=shot.plan.dwell_s)
    return Campaign(
        Excitation.DRIVEN,
        (capture,),
        sensors={name: Sensor(one.rate_hz, one.noise_std) for name, one in sensors.items()},
        columns=("shot", "mass_kg"),
    )


def run(job: Job) -> dict[str, Any]:
    """One row of the study."""
    given = record(job)
    started = time.process_time()
    row: dict[str, Any] = {"key": json.dumps(asdict(job), sort_keys=True), **asdict(job)}
    try:
        found = investigate(given, seed=job.seed)
    except (ImpactCellError, ValueError, np.linalg.LinAlgError) as error:
        return row | {"verdict": "error", "error": f"{type(error).__name__}: {error}"}
    outcome = result_document(found)
    return row | {
        "verdict": outcome["verdict"],
        "named": [one["effect"] for one in outcome["effects"]],
        "tied": {one["effect"]: one["tied_with"] for one in outcome["effects"]},
        "parameters": {one["effect"]: one["parameters"] for one in outcome["effects"]},
        "unexplained": outcome["unexplained"],
        "gap": outcome["gap"],
        "p_nominal": found.selection.nominal.p_value,
        "p_final": found.selection.final.p_value,
        "blocks": [len(found.prepared.shots), len(found.training), len(found.held_out)],
        "tried": [[*one.effects, round(one.deficit, 1)] for one in found.selection.alternatives[:6]],
        "seconds": round(time.process_time() - started, 1),
    }


def judged(row: dict[str, Any]) -> str:
    """Judge an answer: named or tied with what is hidden, or with what is the same to such a record."""
    if row["verdict"] in {"error", "no_gap", "unknown"}:
        listed = set(row.get("named", ())) - {row["hidden"]}
        return f"{row['verdict']}, but {'+'.join(sorted(listed))}" if listed else str(row["verdict"])
    if len(row["named"]) == 1:
        group = {row["named"][0], *row["tied"][row["named"][0]]}
        if row["hidden"] in group:
            return "named" if len(group) == 1 else "tied with it"
        if any(row["named"][0] in same and row["hidden"] in same for same in SAME):
            return "its near equivalent"
    return "wrong: " + "+".join(row["named"])


def table(file: Path = ROWS) -> Table:
    """Hidden effect against answers, gaps and CPU time."""
    found = rows(file)
    lines = []
    for effect in ("", *LISTED, *UNLISTED):
        mine = [row for row in found if row["hidden"] == effect]
        answers = [judged(row) for row in mine]
        gaps = [row["gap"]["held_out"] for row in mine if "gap" in row]
        seconds = [row["seconds"] for row in mine if "seconds" in row]
        if not mine:
            continue
        name = effect or "nothing"
        lines.append(
            [
                f"{name}, not in any library" if effect in UNLISTED else name,
                "; ".join(f"{answers.count(one)} {one}" for one in sorted(set(answers))),
                ", ".join(f"{gap['before']:.2f}" for gap in gaps),
                ", ".join(f"{gap['after']:.2f}" for gap in gaps),
                ", ".join(f"{one:.0f}" for one in seconds),
            ]
        )
    note = f"{len(found)} records of {DURATION_S:.0f} s, white and coloured noise; gaps are held out."
    columns = ("hidden", "answers", "gap before", "gap after", "CPU [s]")
    return Table("Discrepancy: driven records", columns, lines, note)


def main() -> None:
    """Run the study, or print its table only."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--table", action="store_true", help="only print the table of the rows there are")
    given = parser.parse_args()
    if not given.table:
        given.rows.parent.mkdir(parents=True, exist_ok=True)
        done = {row["key"] for row in rows(given.rows)}
        for job in jobs():
            if json.dumps(asdict(job), sort_keys=True) not in done:
                row = run(job)
                with given.rows.open("a", encoding="utf-8") as out:
                    out.write(json.dumps(row) + "\n")
    print(table(given.rows).markdown())


if __name__ == "__main__":
    main()
