"""Runs the discrepancy study: a row of a file for each campaign, resumable."""

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from impactcell.discrepancy.report.result import result_document
from impactcell.physics.effects import LIBRARY
from tests.benchmarks._discrepancy_plan import calibrated
from tests.discrepancy.study import Job, campaign, hidden, name_effects, scenario

ROWS = Path("bench-results/discrepancy-final.jsonl")


def run(job: Job) -> dict[str, Any]:
    """One row of the study; laws that nobody had listed have a study of their own."""
    started = time.process_time()
    multiples, gaps = calibrated(job)
    row: dict[str, Any] = {
        "key": job.key,
        "multiples": multiples,
        "expected": gaps,
    }
    given = campaign(job, multiples)
    row["made_in_s"] = round(time.process_time() - started, 2)
    library = [effect for effect in LIBRARY if effect != job.removed]
    started = time.process_time()
    found = name_effects(given, seed=job.seed, library=library)
    outcome = result_document(found)
    return row | {
        "verdict": outcome["verdict"],
        "named": [one["effect"] for one in outcome["effects"]],
        "tied": {one["effect"]: one["tied_with"] for one in outcome["effects"]},
        "p": [one["p_value"] for one in outcome["effects"]],
        "where": [one["where"]["phase"] for one in outcome["effects"]],
        "unexplained": outcome["unexplained"],
        "proposals": [one["separates"] for one in outcome["next_experiment"]],
        "gap": outcome["gap"],
        "p_nominal": found.selection.nominal.p_value,
        "p_final": found.selection.final.p_value,
        "covered": covered(job, multiples, outcome),
        "intervals": intervals(job, multiples, outcome),
        "tried": [
            [*one.effects, round(one.deficit, 1), round(one.deficit_std, 1)]
            for one in found.selection.alternatives[:6]
        ],
        "seconds": round(time.process_time() - started, 2),
    }


def intervals(job: Job, multiples: tuple[float, ...], outcome: dict[str, Any]) -> list[list[Any]]:
    """Effect, parameter, truth, estimate and the ends of its interval, of whatever was rightly named."""
    truths = hidden(job, multiples)
    return [
        [one["effect"], name, truth, one["parameters"][name]["value"], one["parameters"][name]["ci95"]]
        for one in outcome["effects"]
        for name, truth in truths.get(one["effect"], {}).items()
    ]


def covered(job: Job, multiples: tuple[float, ...], outcome: dict[str, Any]) -> dict[str, list[bool]]:
    """Whether the intervals hold the truth: of the parameters of rightly named effects, and of the plant."""
    effects = []
    truths = hidden(job, multiples)
    for one in outcome["effects"]:
        for name, truth in truths.get(one["effect"], {}).items():
            effects += _inside(truth, one["parameters"][name], turn=name.endswith("phase_rad"))
    plant = scenario(job, multiples).plant
    known = {
        "stiffness_n_per_m": plant.stiffness_n_per_m,
        "damping_n_s_per_m": plant.damping_n_s_per_m,
        "mu_k": plant.mu_s * plant.ratio,
        "ratio": 1.0 / plant.ratio,
    }
    nominal = [inside for name, truth in known.items() for inside in _inside(truth, outcome["nominal"][name])]
    return {"effects": effects, "nominal": nominal}


def _inside(truth: float | list[float], got: dict[str, Any], *, turn: bool = False) -> list[bool]:
    """Whether an interval holds the truth, one entry a batch; an end that is None is open."""
    made = []
    truths = truth if isinstance(truth, list) else [truth]
    ends = got["ci95"] if isinstance(got["value"], list) else [got["ci95"]]
    for value, (low, high) in zip(truths, ends, strict=True):
        low = -math.inf if low is None else low
        high = math.inf if high is None else high
        turns = (-2.0 * math.pi, 0.0, 2.0 * math.pi) if turn else (0.0,)
        made.append(any(low <= value + one <= high for one in turns))
    return made


def rows(file: Path = ROWS) -> list[dict[str, Any]]:
    """Rows of earlier runs."""
    if not file.exists():
        return []
    lines = file.read_text(encoding="utf-8").splitlines()
    made = [json.loads(line) for line in lines if line.strip()]
    return [row | {"job": json.loads(row["key"])} for row in made]


def study(file: Path, todo: Iterable[Any], workers: int, work: Callable[[Any], dict[str, Any]] = run) -> None:
    """Do what is missing, in order; a row is appended and flushed as soon as it is done.

    A campaign that fails has a row that says so, and does not take the others with it.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    done = {row["key"] for row in rows(file)}
    missing = [job for job in todo if job.key not in done]
    print(f"{len(done)} done, {len(missing)} to do", file=sys.stderr, flush=True)
    with file.open("a", encoding="utf-8") as out, ProcessPoolExecutor(workers) as pool:
        given = {pool.submit(work, task): task for task in missing}
        for future in as_completed(given):
            error = future.exception()
            said = {"key": given[future].key, "verdict": "error", "error": f"{type(error).__name__}: {error}"}
            out.write(json.dumps(said if error else future.result(), allow_nan=True) + "\n")
            out.flush()


def from_command_line(
    jobs: Callable[[int, int], list[Any]],
    run_one: Callable[[Any], dict[str, Any]],
    campaigns: int,
    reporting: tuple[int, Path],
    tuning: tuple[int, Path],
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Run a study as its arguments say; its jobs by their keys, and the rows there are of them.

    `reporting` and `tuning` are the first seed and the file of rows of each; `jobs` takes how many there are,
    and the first seed.
    """
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=Path, help="by default apart for reporting and tuning")
    parser.add_argument("--campaigns", type=int, default=campaigns)
    parser.add_argument("--limit", type=int, help="only the first so many of them")
    parser.add_argument(
        "--tuning", action="store_true", help="seeds that numbers of the search may be set on"
    )
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--table", action="store_true", help="only print the table of the rows there are")
    given = parser.parse_args()
    first, file = tuning if given.tuning else reporting
    plan = {job.key: job for job in jobs(given.campaigns, first)[: given.limit]}
    file = given.rows or file
    if not given.table:
        study(file, list(plan.values()), given.workers, run_one)
    return plan, [row for row in rows(file) if row["key"] in plan]
