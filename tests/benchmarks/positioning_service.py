"""Positioning through the whole service: 500 tasks against the simulator's plant, faults of the fieldbus on.

Reads what `python -m tests.benchmarks._service_tasks --seeds reporting` has gathered and adds what is
missing; a cell is not run twice. `--quick` runs, or takes, the first two cells.
"""

from collections.abc import Sequence

import numpy as np

from tests.benchmarks._service_tasks import (
    PROBABILITY,
    RESTARTS,
    RESULTS,
    ServedTask,
    path_of,
    read_rows,
    run,
)
from tests.benchmarks.positioning import Share
from tests.benchmarks.table import Table

SEEDS = "reporting"
CELLS, QUICK_CELLS = 20, 2
TASKS = 25
"""Of a cell."""
LEARNING = 10
"""First tasks of a cell, which may end outside."""


def share(rows: Sequence[ServedTask], end: str) -> Share:
    return Share(sum(row.end == end for row in rows), len(rows))


def table(rows: Sequence[ServedTask]) -> Table:
    """What became of the parts, and whether every strike had a command of its own."""
    over, inside = share(rows, "overshot"), share(rows, "inside")
    settled = share([row for row in rows if row.number >= LEARNING], "inside")
    commanded, executed = sum(r.commanded for r in rows), sum(r.executed for r in rows)
    twice = sum(row.twice for row in rows)
    faults, restarts = sum(row.faults for row in rows), sum(row.restarts for row in rows)
    seen = [abs(row.level_error) for row in rows if np.isfinite(row.level_error)]
    return Table(
        "Positioning through the service, faults of the fieldbus on",
        ("what", "bar", "measured", "95 % interval"),
        [
            (
                "tasks that overshoot",
                "0.1 %",
                bold(str(over), bar=over.hits <= 1e-3 * over.of),
                over.interval,
            ),
            ("strikes without a command of their own", "0", bold(str(twice), bar=not twice), ""),
            ("taps commanded / strikes of the module", "", f"{commanded} / {executed}", ""),
            ("inside the tolerance", "", str(inside), inside.interval),
            (
                "inside after ten tasks",
                "99.5 %",
                bold(str(settled), bar=settled.hits >= 0.995 * settled.of),
                settled.interval,
            ),
            ("taps a task", "", f"{executed / max(len(rows), 1):.2f}", ""),
            (
                "error of the tracker's friction at the end of a task, median / 95th percentile",
                "",
                " / ".join(f"{100.0 * np.percentile(seen, q):.2f} %" for q in (50, 95)),
                "",
            ),
            ("faulty replies / restarts of the module", "", f"{faults} / {restarts}", ""),
            ("targets set again by the operator", "", str(sum(r.set_again for r in rows)), ""),
        ],
        f"{len(rows)} tasks in {len({row.cell for row in rows})} cells: contact 10 % off its model, friction "
        "0.12 to 0.3 that wears, a batch step of 10 % (unannounced in half of the cells), 3 % scatter, "
        "5 to 40 kg, 2 to 40 mm, 10 µm and 50 µm in turn. Friction comes from the service's own tracker. "
        f"Each of 17 kinds of fault befalls {100.0 * PROBABILITY:g} % of the "
        f"replies, and {100.0 * RESTARTS:g} % of the strikes the module is started anew. Strikes are counted "
        "in the simulator as they begin, commands as they leave the planner, and compared in their order.",
    )  # fmt: skip


def bold(text: str, *, bar: bool) -> str:
    """A missed bar is bold."""
    return text if bar else f"**{text}**"


def tables(quick: bool = False) -> list[Table]:
    path, cells = path_of(RESULTS, SEEDS), list(range(QUICK_CELLS if quick else CELLS))
    run(path, SEEDS, cells, TASKS)
    return [table([row for row in read_rows(path) if row.cell in cells])]
