"""Positioning with something hidden: the simulator's own plant, each effect in turn, and none.

Reads what `python -m tests.benchmarks._hidden_tasks --seeds reporting` has gathered, and says how much that
is; runs a little of it where there is nothing yet. `python -m tests.benchmarks.positioning_hidden` stores
what the figure of `impactcell figures` is drawn from; `--seeds tuning` takes those of the tuning.
"""

import argparse
import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from impactcell.figures import hidden_effects as figure
from impactcell.positioning.model_hypotheses import GAP_EVIDENCE
from tests.benchmarks._hidden_conditions import Condition, hidden_effects, other_conditions
from tests.benchmarks._hidden_optimum import BOUND, Key, Left, Optimum, over_optimum, read_left, read_optimum
from tests.benchmarks._hidden_optimum import path_of as optimum_path
from tests.benchmarks._hidden_tasks import RESULTS, Attempt, path_of, read_attempts, run
from tests.benchmarks.positioning import Share
from tests.benchmarks.table import Table

SEEDS = "reporting"
LABEL = "now"
LEARNING = 10
"""First tasks of a cell, which may end outside."""
QUICK_TASKS = 20
"""Of one cell of each condition, where nothing has been gathered."""
SAME_PROMISE = 1.000001 * BOUND
"""Of the probability to miss; what a lot between two policies makes is the bound but for rounding."""
COLUMNS = (
    "hidden", "tasks", "overshot", "95 % interval", "inside after ten", "left outside / by the optimum",
    "taps a task", "over the optimum", "tasks until told / tellable",
    "before: overshot, inside after ten, taps",
)  # fmt: skip
"""Of the tables."""


class Known(NamedTuple):
    """What was worked out for somebody who knows the effect: fewest taps, and tasks left outside."""

    optimum: Optimum
    left: dict[Key, Left]


def share(attempts: Sequence[Attempt], happened: Callable[[Attempt], bool]) -> Share:
    return Share(sum(map(happened, attempts)), len(attempts))


def overshot(attempt: Attempt) -> bool:
    return attempt.end == "overshot"


def inside(attempt: Attempt) -> bool:
    return attempt.end == "inside"


def tasks_until_told(attempts: Sequence[Attempt]) -> list[float]:
    """Tasks of each cell until it was told that something is missing; inf where it never was."""
    cells = {attempt.cell for attempt in attempts}
    return [
        min((a.number + 1.0 for a in attempts if a.cell == cell and a.told), default=math.inf)
        for cell in cells
    ]


def tasks_until_tellable(attempts: Sequence[Attempt]) -> float:
    """Median over the cells of the tasks after which somebody who knows the effect would have told it.

    Effects that change the displacement no more than scatter does never get there; inf for these, and where
    it was not worked out.
    """
    cells = {attempt.cell for attempt in attempts}
    first = [
        min(
            (a.number + 1.0 for a in attempts if a.cell == cell and a.tellable >= GAP_EVIDENCE),
            default=math.inf,
        )
        for cell in cells
    ]
    return float(np.median(first))


def earlier(attempts: Sequence[Attempt]) -> str:
    """What the planner without a discrepancy made of the same tasks; empty where that was not run."""
    if not attempts:
        return ""
    settled = share([a for a in attempts if a.number >= LEARNING], inside)
    percent = 100.0 * settled.hits / max(settled.of, 1)
    taps = np.mean([a.taps for a in attempts])
    return f"{share(attempts, overshot).hits} of {len(attempts)}, {percent:.1f} %, {taps:.2f}"


def told_beside_oracle(told: float, tellable: float) -> str:
    return " / ".join("-" if math.isinf(tasks) else f"{tasks:g}" for tasks in (told, tellable))


def beside_optimum(attempts: Sequence[Attempt], optimum: Optimum, bar: float) -> str:
    """Taps over those of somebody who knows the effect, with its interval; empty where they are not known."""
    taken = {(a.condition, a.cell, a.number): a.taps for a in attempts}
    ratio, half, of = over_optimum(taken, optimum)
    if math.isnan(ratio):
        return ""
    text = f"{ratio:.2f} ({ratio - half:.2f}-{ratio + half:.2f}) of {of}"
    return text if ratio <= bar else f"**{text}**"


def beside_left(attempts: Sequence[Attempt], left: dict[Key, Left]) -> str:
    """Tasks after ten that end outside, before their target; and how many the optimum would have left.

    The optimum knows the effect and keeps the same promise: from the start of these tasks, and from where
    they were left. Empty where there is none, and where it was not worked out for all.
    """
    outside = [a for a in attempts if a.number >= LEARNING and a.end in {"gave_up", "cycling"}]
    known = [left[key] for a in outside if (key := (a.condition, a.cell, a.number)) in left]
    if not outside or len(known) < len(outside):
        return str(len(outside)) if outside else ""
    from_start = sum(task.from_start > SAME_PROMISE for task in known)
    from_there = sum(task.from_there > SAME_PROMISE for task in known)
    return f"{len(outside)} / {from_start}, {from_there}"


def row(
    condition: Condition, attempts: Sequence[Attempt], before: Sequence[Attempt], known: Known
) -> list[str]:
    """One condition; a missed bar is bold."""
    over = share(attempts, overshot)
    settled = share([a for a in attempts if a.number >= LEARNING], inside)
    low = float(over.interval.split(" ")[0])
    told = float(np.median(tasks_until_told(attempts)))
    percent = f"{100.0 * settled.hits / max(settled.of, 1):.1f} %"
    return [
        condition.name if condition.strength == 1.0 else f"{condition.name}, {condition.strength:g}",
        str(len(attempts)),
        str(over.hits) if low <= 0.3 else f"**{over.hits}**",
        over.interval,
        percent if settled.hits >= 0.98 * settled.of else f"**{percent}**",
        beside_left(attempts, known.left),
        f"{np.mean([a.taps for a in attempts]):.2f}",
        beside_optimum(attempts, known.optimum, 1.2),
        told_beside_oracle(told, tasks_until_tellable(attempts)),
        earlier(before),
    ]


def by_condition(
    title: str, conditions: Sequence[Condition], attempts: Sequence[Attempt], before: Sequence[Attempt],
    known: Known,
) -> Table:  # fmt: skip
    rows: list[list[str]] = []
    every: list[Attempt] = []
    every_before: list[Attempt] = []
    for condition in conditions:
        part = [attempt for attempt in attempts if attempt.condition == condition.key]
        part_before = [attempt for attempt in before if attempt.condition == condition.key]
        if part:
            rows.append(row(condition, part, part_before, known))
            every += part
            every_before += part_before
    over, settled = share(every, overshot), share([a for a in every if a.number >= LEARNING], inside)
    outside = beside_left(every, known.left)
    too_far = str(over) if over.hits <= 1e-3 * over.of else f"**{over}**"
    in_place = str(settled) if settled.hits >= 0.995 * settled.of else f"**{settled}**"
    totals = ["all", str(len(every)), too_far, over.interval, in_place, outside]
    taps, beside = f"{np.mean([a.taps for a in every]):.2f}", beside_optimum(every, known.optimum, 1.05)
    rows.append([*totals, taps, beside, "", earlier(every_before)])
    return Table(
        title, COLUMNS, rows,
        "Bars: overshoot 1 in 1000 over all, the interval of each row holds 0.3 %; inside 99.5 % over all, "
        "98 % in each row. Left outside: tasks after ten that end before their target; beside them, how many "
        "of these the optimum that knows the effect could not bring in within the same promise, from their "
        "start and from where they were left. Taps over those of somebody who knows the effect (dynamic "
        "programming, of some of the tasks) 1.05 over all, 1.2 in each row. Told: median over the cells, - "
        "where fewer than half of them told it; beside it, when a likelihood ratio test that knows the "
        "effect would have told it as surely. Effects "
        "on the force sensor move no part otherwise. Seeds apart from those the method was made with.",
    )  # fmt: skip


def tables() -> list[Table]:
    effects, others = hidden_effects(), other_conditions()
    path = path_of(RESULTS, SEEDS, LABEL)
    if not path.exists():
        run(path, [*effects, *others], SEEDS, [0], QUICK_TASKS, math.inf)
    attempts, before = read_attempts(path), read_attempts(path_of(RESULTS, SEEDS, "before"))
    left = read_left(optimum_path(RESULTS, SEEDS, "left"))
    known = Known(read_optimum(optimum_path(RESULTS, SEEDS)), left)
    topics = (
        ("Positioning with an effect hidden, by effect", effects),
        ("Positioning with other scatter, mass, batches and starts", others),
    )
    there = {attempt.condition for attempt in attempts}
    return [
        by_condition(title, conditions, attempts, before, known)
        for title, conditions in topics
        if any(condition.key in there for condition in conditions)
    ]


def counts(version: str, attempts: Sequence[Attempt]) -> list[figure.ConditionCount]:
    """Rows of the figure, in the order of the conditions."""
    rows = []
    for condition in [*hidden_effects(), *other_conditions()]:
        part = [attempt for attempt in attempts if attempt.condition == condition.key]
        if part:
            over, taps = share(part, overshot).hits, sum(attempt.taps for attempt in part)
            rows.append(figure.ConditionCount(condition.key, version, len(part), over, taps))
    return rows


def store(seeds: str) -> Path:
    """Write what the figure is drawn from: the tasks that both versions were given, where there are any."""
    versions = [name for name, _, _ in figure.VERSIONS]
    attempts = {name: read_attempts(path_of(RESULTS, seeds, name)) for name in versions}
    both = set.intersection(*({(a.condition, a.cell) for a in part} for part in attempts.values()))
    if not both:
        names = ", ".join(str(path_of(RESULTS, seeds, name)) for name in versions)
        raise SystemExit(f"nothing to draw: no task is in both of {names}")
    path = Path(figure.__file__).with_name(figure.STORED)
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["condition", "version", "tasks", "overshot", "taps"])
        for name, part in attempts.items():
            same = [a for a in part if (a.condition, a.cell) in both]
            writer.writerows(
                [c.condition, c.version, c.tasks, c.overshot, c.taps] for c in counts(name, same)
            )
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", choices=("tuning", "reporting"), default=SEEDS)
    print(store(parser.parse_args().seeds))


if __name__ == "__main__":
    main()
