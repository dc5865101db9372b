"""Positioning by taps: 10 000 closed-loop tasks on the simulator's own plant, and what could be done at best.

Cells of 100 tasks: stiffness and damping 10 % off nominal, friction 0.12 to 0.3 wearing by up to 5 %, one
announced batch step of 10 %, masses 5 to 40 kg, targets 2 to 40 mm, 3 % scatter of friction from tap to tap,
tolerance 10 µm and 50 µm in turn. The planner starts from the nominal plant in every cell.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import beta

from tests.benchmarks._positioning_optimum import fewest_taps
from tests.benchmarks._positioning_tasks import RATIO, RESULTS, SCATTER, Outcome, append_row, rows, run, tasks
from tests.benchmarks.table import Table

CELLS = 100
RIVAL_CELLS = 20
OPTIMUM_CELLS = 20
OPTIMUM_EVERY = 10  # of the tasks of those cells, every so-manieth
CLASSES = ((5.0, 12.0), (12.0, 20.0), (20.0, 40.0))
LEARNING = 10


@dataclass(frozen=True, slots=True)
class Share:
    """A proportion and its 95 % Clopper-Pearson interval."""

    hits: int
    of: int

    def __str__(self) -> str:
        return f"{100.0 * self.hits / max(self.of, 1):.3f} % ({self.hits} of {self.of})"

    @property
    def interval(self) -> str:
        low = float(beta.ppf(0.025, self.hits, self.of - self.hits + 1)) if self.hits else 0.0
        high = float(beta.ppf(0.975, self.hits + 1, self.of - self.hits)) if self.hits < self.of else 1.0
        return f"{100.0 * low:.3f} to {100.0 * high:.3f} %"


def share(outcomes: Sequence[Outcome], happened: Callable[[Outcome], bool]) -> Share:
    return Share(sum(map(happened, outcomes)), len(outcomes))


def overshot(outcome: Outcome) -> bool:
    return outcome.end == "overshot"


def inside(outcome: Outcome) -> bool:
    return outcome.end == "inside"


def of_class(outcomes: Sequence[Outcome], low: float, high: float) -> list[Outcome]:
    return [outcome for outcome in outcomes if low <= outcome.mass_kg < high]


def closed_loop(learned: Sequence[Outcome]) -> Table:
    steady = [outcome for outcome in learned if outcome.number >= LEARNING]
    settled = share(steady, inside)
    rows_ = [["inside the tolerance, after ten tasks", ">= 99.5 %", str(settled), settled.interval]]
    every = share(learned, overshot)
    rows_.append(["tasks that overshoot, overall", "<= 0.1 %", str(every), every.interval])
    for low, high in CLASSES:
        part = share(of_class(learned, low, high), overshot)
        rows_.append([f"tasks that overshoot, {low:g} to {high:g} kg", "<= 0.2 %", str(part), part.interval])
    cycling = share(learned, lambda outcome: outcome.end == "cycling")
    rows_.append(["limit cycles (more than 100 taps)", "0", str(cycling.hits), cycling.interval])
    most = max(outcome.taps for outcome in learned)
    rows_.append(["most taps of one task", "", str(most), ""])
    mean = sum(outcome.planning_s for outcome in learned) / sum(outcome.steps for outcome in learned)
    rows_.append(["planning step, mean", "< 3 ms", f"{1e3 * mean:.2f} ms", ""])
    # the slowest step of each task: its 99th percentile over steps is at most that over tasks
    worst = np.sort([outcome.slowest_s for outcome in learned])[::-1]
    steps = sum(outcome.steps for outcome in learned)
    slow = worst[min(round(0.01 * steps), worst.size - 1)]
    rows_.append(["planning step, 99th percentile", "< 20 ms", f"<= {1e3 * slow:.1f} ms", ""])
    return Table(
        "Positioning: closed loop with learning, judged on the simulator's plant",
        ["what", "bar", "measured", "95 % interval"],
        rows_,
        f"{len(learned)} tasks in {len(learned) // 100} cells; CPU time of one thread for a planning step.",
    )


def ratios(kinds: dict[str, Sequence[Outcome]], cells: int, every: int) -> Table:
    path = RESULTS / "positioning-optimum.csv"
    known = {(int(cell), int(number)): float(taps) for cell, number, taps in rows(path)}
    chosen = [task for cell in range(cells) for task in list(tasks(cell))[cell % every :: every]]
    for n, task in enumerate(chosen):
        if (task.cell, task.number) in known:
            continue
        plant = np.array([task.stiffness, task.damping, task.mu_s, RATIO * task.mu_s, 0.0])
        fewest, _ = fewest_taps(task.distance_m, task.mass_kg, plant, SCATTER, task.tolerance_m, 1e-3)
        known[task.cell, task.number] = fewest
        append_row(path, [task.cell, task.number, fewest])
        print(f"\roptimum: {n + 1} of {len(chosen)}", end="", file=sys.stderr, flush=True)
    table = []
    for kind, bar, label in (
        ("known", "<= 1.03", "contact known"),
        ("learned", "<= 1.08", "contact learned, first tasks included"),
    ):
        taken = {(outcome.cell, outcome.number): outcome.taps for outcome in kinds[kind]}
        pairs = np.array(
            [
                [taken[t.cell, t.number], known[t.cell, t.number]]
                for t in chosen
                if (t.cell, t.number) in taken
            ]
        )
        best = pairs[:, 1].mean()
        ratio = pairs[:, 0].mean() / best
        spread = 1.96 * float((pairs[:, 0] - ratio * pairs[:, 1]).std()) / best / math.sqrt(len(pairs))
        table.append(
            [f"taps / optimum, {label}", bar, f"{ratio:.3f}", f"{ratio - spread:.3f} to {ratio + spread:.3f}"]
        )
    return Table(
        "Positioning: mean number of taps beside the optimum",
        ["what", "bar", "measured", "95 % interval"],
        table,
        f"Optimum by dynamic programming that knows plant, friction and scatter, with the same bound on "
        f"overshoot; {len(chosen)} of the tasks. It is solved on a grid and no sharper than about 1 %.",
    )


def beside_rivals(kinds: dict[str, Sequence[Outcome]], cells: int) -> Table:
    table = []
    for low, high in CLASSES:
        for kind in ("learned", "fixed", "proportional"):
            part = of_class([outcome for outcome in kinds[kind] if outcome.cell < cells], low, high)
            delivered = sum(map(inside, part))
            spent = sum(outcome.taps for outcome in part)
            over = share(part, overshot)
            table.append(
                [
                    f"{low:g} to {high:g} kg",
                    kind,
                    f"{spent / max(delivered, 1):.2f}",
                    str(over),
                    over.interval,
                ]
            )
    return Table(
        "Positioning: beside a fixed-friction and a proportional planner on the same tasks",
        ["mass", "planner", "taps for each part delivered", "overshot", "95 % interval"],
        table,
        "fixed: the same planner kept to the nominal plant; proportional: 0.7 of what remains, by the "
        f"nominal plant, strikes above 1.5 mm and pushes below. {cells} cells of 100 tasks; "
        "at most 100 taps a task.",
    )


def tables(*, quick: bool = False) -> list[Table]:
    cells, rivals, optimum, every = (
        (6, 2, 2, 10) if quick else (CELLS, RIVAL_CELLS, OPTIMUM_CELLS, OPTIMUM_EVERY)
    )
    kinds: dict[str, Sequence[Outcome]] = {
        "learned": run("learned", range(cells)),
        "known": run("known", range(optimum)),
        "fixed": run("fixed", range(rivals)),
        "proportional": run("proportional", range(rivals)),
    }
    return [closed_loop(kinds["learned"]), ratios(kinds, optimum, every), beside_rivals(kinds, rivals)]
