"""The rivals beside model error, and where nothing is hidden, on every third campaign of both studies.

`python -m tests.benchmarks._discrepancy_rivals_beside [--workers 2]` gives them those campaigns of
`_discrepancy_model_error` and `_discrepancy_nulls` that have rows, into files of their own beside those, and
goes on where it was; `--table` only prints. What the rivals are is told in `_discrepancy_rivals`. The real
residuals among the nulls need `shared/data/real`.
"""

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.physics.effects import LIBRARY
from tests.benchmarks import _discrepancy_judge as judge
from tests.benchmarks import _discrepancy_model_error as beside_error
from tests.benchmarks import _discrepancy_nulls as nulls
from tests.benchmarks._discrepancy_rivals import (
    NAMES,
    Row,
    Task,
    answered,
    answers,
    beside,
    generous,
    run,
)
from tests.benchmarks._discrepancy_run import rows, study
from tests.benchmarks.table import Table

EVERY = 3
NULL_ROWS, NULLS = Path("tests/benchmarks/rows/discrepancy-nulls-870000.jsonl"), 870_000
"""Rows and first seed of the study with nothing hidden that the rivals were given."""


def model_error_tasks() -> list[Task]:
    """Every third campaign with an effect beside a model error, as strong as it was made."""
    multiples = {row["key"]: tuple(row["multiples"]) for row in rows(beside_error.ROWS) if "multiples" in row}
    plan = beside_error.jobs(300, beside_error.REPORTING)[::EVERY]
    return [Task(job, multiples[job.key]) for job in plan if job.key in multiples]


def null_tasks() -> list[nulls.NullJob]:
    """Every third campaign with nothing hidden, of each class alike."""
    done = {row["key"] for row in rows(NULL_ROWS)}
    return [job for job in nulls.jobs(500, NULLS)[::EVERY] if job.key in done]


def run_null(job: nulls.NullJob) -> Row:
    """Answers of the rivals where nothing is hidden."""
    return {"key": job.key} | answers(nulls.null_campaign(job), job.seed, tuple(LIBRARY))


def table() -> Table:
    """Shares of both studies, of each method."""
    error = _together(beside_error.ROWS)
    none = _together(NULL_ROWS)
    lines = [
        _line("beside model error: the effect named, or tied with it", error, lambda row: _judged(row)[0]),
        _line("beside model error: anything else named", error, lambda row: _judged(row)[1]),
        _line("nothing hidden, five classes of noise: something named", none, lambda row: bool(row["named"])),
    ]
    for noise in nulls.NOISES:
        among = [pair for pair in none if pair[0]["job"]["noise"] == noise]
        lines.append(_line(f"{noise}: something named", among, lambda row: bool(row["named"])))
    seconds = [
        np.median([row[key] for _, row in (*error, *none) if key in row])
        for key in ("seconds", "sindy_seconds", "lisdd_seconds")
    ]
    ours = np.median([row["seconds"] for row, _ in (*error, *none) if "seconds" in row])
    times = (ours, seconds[0], None, *seconds[1:])
    lines.append(
        [
            "processor time (median)",
            *("(with BIC)" if time is None else f"{time:.1f} s" for time in times),
        ]
    )
    return Table(
        "Discrepancy: rivals beside model error and with nothing hidden",
        ("what", *NAMES.values()),
        lines,
        f"Every third campaign of both, {len(error)} and {len(none)}. An exact confound counts as right.",
    )


def _together(file: Path) -> list[tuple[Row, Row]]:
    """Row of ours and the rivals' of each campaign that both have."""
    ours = {row["key"]: row for row in rows(file)}
    return [(ours[row["key"]], row) for row in rows(beside(file)) if row["key"] in ours]


def _line(what: str, pairs: list[tuple[Row, Row]], holds: Callable[[Row], bool]) -> list[str]:
    """One row of the table; a rival that failed has named nothing."""
    cells = [what]
    for which in NAMES:
        mine = [
            ours if which == "ours" else generous(answered(ours, theirs.get(which, [])))
            for ours, theirs in pairs
        ]
        count = sum(holds({"named": [], "tied": {}} | row) for row in mine)
        cells.append(" · ".join(judge.share(count, len(mine))))
    return cells


def _judged(row: dict[str, Any]) -> tuple[bool, bool]:
    return beside_error.judged(row) if row["named"] else (False, False)


def main() -> None:
    """Run what is missing, then print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--table", action="store_true", help="only print the table of the rows there are")
    given = parser.parse_args()
    if not given.table:
        study(beside(beside_error.ROWS), model_error_tasks(), given.workers, run)
        study(beside(NULL_ROWS), null_tasks(), given.workers, run_null)
    print(table().markdown())


if __name__ == "__main__":
    main()
