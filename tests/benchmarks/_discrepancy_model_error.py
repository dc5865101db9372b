"""Discrepancy beside model error: one effect of the library over a smooth law that no library has.

`python -m tests.benchmarks._discrepancy_model_error [--campaigns 300]` makes them on the simulator's own
plant. The effect alone makes a gap of 1.5 to 6, the model error alone is 0.2 to 2 noise floors. A row a
campaign goes to `--rows`, and the next run goes on from there; `--table` only prints. Seeds of the report are
from 56 000 000 on, those for setting numbers of the search (`--tuning`) from 600 000 on.
"""

import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.workflow import investigate
from tests.benchmarks import _discrepancy_judge as judge
from tests.benchmarks._discrepancy_plan import CONFOUNDED, EARLIER, calibrated
from tests.benchmarks._discrepancy_run import covered, from_command_line, intervals
from tests.benchmarks.table import Table
from tests.discrepancy.study import Job, campaign

ROWS = Path("tests/benchmarks/rows/discrepancy-model-error-56000000.jsonl")
TUNING_ROWS = Path("bench-results/discrepancy-model-error-tuning.jsonl")
WANDERING = "wandering_force"
GAPS = (1.5, 6.0)
"""Gap that the effect alone makes, even in its logarithm."""
LEVELS = (0.2, 2.0)
"""Model error alone, RMS beside the noise [1 = noise floor], even in its logarithm."""
REPORTING, TUNING = 56_000_000, 600_000
"""First seeds."""


def jobs(campaigns: int, first: int) -> list[Job]:
    """Every effect in turn, the order differing from turn to turn."""
    names = EARLIER
    turns = -(-campaigns // len(names))
    order = [
        names[i]
        for turn in range(turns)
        for i in np.random.default_rng([first, turn]).permutation(len(names))
    ]
    made = []
    for seed, effect in enumerate(order[:campaigns], first):
        gap = _even(np.random.default_rng([seed, 3]), GAPS)
        made.append(Job("model_error", (effect, WANDERING), seed, target=round(gap, 3), shots=40))
    return made


def level(job: Job) -> float:
    """Level of the model error of a campaign."""
    return _even(np.random.default_rng([job.seed, 6]), LEVELS)


def _even(rng: np.random.Generator, bounds: tuple[float, float]) -> float:
    low, high = map(math.log, bounds)
    return math.exp(float(rng.uniform(low, high)))


def run(job: Job) -> dict[str, Any]:
    """One row of the study."""
    (multiple,), (gap,) = calibrated(replace(job, hidden=job.hidden[:1]))
    error = replace(job, hidden=(WANDERING,), target=round(math.hypot(1.0, level(job)), 3))
    (wandering,), (beside,) = calibrated(error)
    multiples = (multiple, wandering)
    given = campaign(job, multiples)
    started = time.process_time()
    with patch("impactcell.discrepancy.workflow.find_law", lambda *_: None):  # has a study of its own
        found = investigate(given, seed=job.seed)
    outcome = result_document(found)
    return {
        "key": job.key,
        "multiples": multiples,
        "expected": [gap, beside],
        "verdict": outcome["verdict"],
        "named": [one["effect"] for one in outcome["effects"]],
        "unconfirmed": outcome["unconfirmed"],
        "outdone": outcome["outdone"],
        "tied": {one["effect"]: one["tied_with"] for one in outcome["effects"]},
        "remaining": outcome["remaining"],
        "gap": outcome["gap"],
        "tried": [[*one.effects, round(one.deficit, 1)] for one in found.selection.alternatives[:6]],
        "covered": covered(job, multiples, outcome),
        "intervals": intervals(job, multiples, outcome),
        "seconds": round(time.process_time() - started, 2),
    }


def judged(row: dict[str, Any]) -> tuple[bool, bool]:
    """Whether the effect is established, by name or tied; and whether anything else is."""
    effect = row["job"]["hidden"][0]
    groups = [{name, *row["tied"].get(name, [])} for name in row["named"]]
    right = [effect in group or bool(group & judge.equivalents(effect) & CONFOUNDED) for group in groups]
    return any(right), not all(right)


def table(found: list[dict[str, Any]]) -> Table:
    """Bars of the study, and how it depends on the level of the model error."""
    answers = [judged(row) for row in found if row["verdict"] != judge.ERROR]
    total = len(found)
    lines = [
        ["effect established", ">= 85 %", *judge.share(sum(right for right, _ in answers), total)],
        ["anything else established", "<= 5 %", *judge.share(sum(wrong for _, wrong in answers), total)],
        ["no gap said", "-", *judge.share(sum(row["verdict"] == "no_gap" for row in found), total)],
    ]
    for low, high in ((0.2, 0.6), (0.6, 1.2), (1.2, 2.0)):
        among = [row for row in found if low <= row["level"] < high and row["verdict"] != judge.ERROR]
        count = sum(judged(row)[0] for row in among)
        lines.append([f"established, model error {low} to {high}", "-", *judge.share(count, len(among))])
    inside = [one for row in found if row["verdict"] != judge.ERROR for one in row["covered"]["effects"]]
    lines.append(
        [
            "parameters of effects inside their 95 % intervals",
            "93.5-96.5 %",
            *judge.share(sum(inside), len(inside)),
        ]
    )
    note = f"{total} campaigns of 40 shots; effect alone: gap 1.5 to 6, model error: 0.2 to 2 noise floors."
    return Table("Discrepancy: beside model error", ("what", "bar", "measured", "95 % interval"), lines, note)


def main() -> None:
    """Run what the arguments say, then print the table."""
    plan, found = from_command_line(jobs, run, 300, (REPORTING, ROWS), (TUNING, TUNING_ROWS))
    print(table([row | {"level": level(plan[row["key"]])} for row in found]).markdown())


if __name__ == "__main__":
    main()
