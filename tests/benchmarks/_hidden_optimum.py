"""Fewest taps for somebody who knows what is hidden: the complete plant, its friction and its scatter.

`python -m tests.benchmarks._hidden_optimum --seeds reporting --cells 6 7 --tasks 25 --every 12 --budget 300`
adds what is not there yet, a row a task of those cells, every so-manieth, and stops after 300 s of processor
time; `--left` takes the tasks that a study left outside instead, from their start and from where they were
left. Outcomes of taps are those of the product's integrator, which agrees with the simulator's to 1e-6, at
every second stroke and seven nodes of friction, with monotone cubics between them (taps differ by 0.2 %), for
the part where it lies: at several remaining distances where the effect goes with the position. Time at rest
is taken in its middle; who knew it before each tap might do a little better.
"""

import argparse
import csv
import math
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from impactcell.physics import Ensemble, Plant, TapInput
from tests.benchmarks._hidden_conditions import (
    SEEDS,
    SENSOR_ONLY,
    CellTask,
    Condition,
    cell_tasks,
    hidden_effects,
)
from tests.benchmarks._hidden_tasks import RESULTS, TAPS_A_TASK, read_attempts
from tests.benchmarks._hidden_tasks import path_of as attempts_path
from tests.benchmarks._positioning_optimum import STROKES, VELOCITIES, Samples, Z, fewest_of
from tests.benchmarks._positioning_tasks import RATIO

BY_POSITION = {"position_dependent_friction", "periodic_friction", "friction_patch", "restoring_force"}
"""Effects that act on a part by where it lies."""
POSITIONS = 7
"""Remaining distances at which outcomes are worked out for these."""
NEAREST_M = 5e-5
"""The least of them, m."""
NEAREST = 1.1
"""Tolerances that a task is taken to have left at least, where the grid of the optimum begins."""
DWELL_S = 3.0
"""Time at rest, s: the middle of 0.3 to 30 s in its logarithm."""
BOUND = 1e-3
"""On overshoot, as the planner's."""
SIMULATED_STROKES = STROKES[np.unique(np.append(np.arange(0, STROKES.size, 2), STROKES.size - 1))]
"""Of those that the optimum chooses from, m."""
SIMULATED_Z = np.linspace(Z[0], Z[-1], 7)
"""Nodes of friction, in standard deviations."""


class Best(NamedTuple):
    """Expected taps, and the probability of an overshoot or of a place from which nothing leads on."""

    taps: float
    missed: float


class Left(NamedTuple):
    """The probability to miss of a task that was left outside: from its start, and from where it was left."""

    from_start: float
    from_there: float


Key = tuple[str, int, int]
"""Condition, cell and number of the task."""
Optimum = dict[Key, Best]


def outcomes(task: CellTask, condition: Condition, start_m: float, shots: int) -> Samples:
    """Displacements (m) of a part at `start_m`, shape (velocities, strokes, nodes)."""
    hidden = {name: values for name, values in condition.effects.items() if name not in SENSOR_ONLY}
    plant = Plant(task.stiffness, task.damping, task.mu_s, RATIO * task.mu_s, effects=hidden)
    shot = min(1 + round(TAPS_A_TASK * task.number), shots)
    taps = [
        TapInput(
            velocity, task.mass_kg, stroke, start_m=start_m, dwell_s=DWELL_S,
            shot=shot, shots=shots, batch=task.batch,
        )
        for velocity in VELOCITIES
        for stroke in SIMULATED_STROKES
    ]  # fmt: skip
    ensemble = Ensemble(taps, tuple(hidden), batches=2)
    theta = ensemble.parameters(plant)
    nodes = [
        ensemble.outputs(theta, 1.0 + condition.friction_scatter * z).displacement_m.reshape(
            VELOCITIES.size, SIMULATED_STROKES.size
        )
        for z in SIMULATED_Z
    ]
    by_node = PchipInterpolator(SIMULATED_Z, np.stack(nodes, axis=2), axis=2)(Z)
    return np.ascontiguousarray(PchipInterpolator(SIMULATED_STROKES, by_node, axis=1)(STROKES))


def fewest(task: CellTask, condition: Condition, shots: int, remaining_m: float) -> Best:
    """Expected taps of the best policy for what remains of a task."""
    distances = np.array([remaining_m])
    if BY_POSITION & set(condition.effects) and remaining_m > NEAREST_M:
        distances = np.geomspace(NEAREST_M, remaining_m, POSITIONS)
    target = task.start_m + task.distance_m
    tables = np.array([outcomes(task, condition, target - each, shots) for each in distances])
    return Best(*fewest_of(tables, distances, remaining_m, task.tolerance_m, BOUND))


def path_of(results: Path, seeds: str, kind: str = "optimum") -> Path:
    return results / f"positioning-hidden-{kind}-{seeds}.csv"


def read_rows(path: Path) -> dict[Key, tuple[float, float]]:
    """What is there so far; nothing where there is no file."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {
            (row[0], int(row[1]), int(row[2])): (float(row[3]), float(row[4])) for row in csv.reader(file)
        }


def read_optimum(path: Path) -> Optimum:
    return {key: Best(*values) for key, values in read_rows(path).items()}


def read_left(path: Path) -> dict[Key, Left]:
    return {key: Left(*values) for key, values in read_rows(path).items()}


def sampled(
    seeds: str, cells: Iterable[int], tasks: int, every: int
) -> Iterator[tuple[Condition, int, CellTask]]:
    """Every so-manieth task of the cells. Sensors' effects move no part otherwise and are left out."""
    for cell in cells:
        for condition in hidden_effects():
            if not set(condition.effects) & SENSOR_ONLY:
                for task in list(cell_tasks(condition, seeds, cell, tasks))[cell % every :: every]:
                    yield condition, cell, task


def run(path: Path, seeds: str, cells: Iterable[int], tasks: int, every: int, budget_s: float) -> bool:
    """Add what is missing; False where the budget ended first."""
    shots = max(int(TAPS_A_TASK * tasks), 1)
    there, began = read_rows(path), time.process_time()
    for condition, cell, task in sampled(seeds, cells, tasks, every):
        if (condition.key, cell, task.number) in there:
            continue
        if time.process_time() - began > budget_s:
            return False
        append(path, (condition.key, cell, task.number), fewest(task, condition, shots, task.distance_m))
    return True


def run_left(path: Path, studied: Path, seeds: str, tasks: int, first: int, budget_s: float) -> bool:
    """The same of the tasks from the `first` on that a study left outside and before their target."""
    shots = max(int(TAPS_A_TASK * tasks), 1)
    there, began = read_rows(path), time.process_time()
    conditions = {condition.key: condition for condition in hidden_effects()}
    for attempt in read_attempts(studied):
        key = (attempt.condition, attempt.cell, attempt.number)
        outside = attempt.number >= first and attempt.end in {"gave_up", "cycling"}
        if not outside or attempt.condition not in conditions or key in there:
            continue
        if time.process_time() - began > budget_s:
            return False
        condition = conditions[attempt.condition]
        task = list(cell_tasks(condition, seeds, attempt.cell, tasks))[attempt.number]
        there_m = max(attempt.remaining_m, NEAREST * task.tolerance_m)
        ways = [fewest(task, condition, shots, each) for each in (task.distance_m, there_m)]
        append(path, key, Left(*(way.missed for way in ways)))
    return True


def append(path: Path, key: Key, values: Best | Left) -> None:
    path.parent.mkdir(exist_ok=True)
    with path.open("a", newline="") as file:
        csv.writer(file).writerow([*key, *values])


def over_optimum(taken: Mapping[Key, int], optimum: Optimum) -> tuple[float, float, int]:
    """Taps taken over the fewest known, half its 95 % interval, and of how many tasks; nan for none."""
    pairs = np.array([(taken[key], optimum[key].taps) for key in taken if key in optimum])
    if not len(pairs):
        return math.nan, math.nan, 0
    best = pairs[:, 1].mean()
    ratio = float(pairs[:, 0].mean() / best)
    half = 1.96 * float((pairs[:, 0] - ratio * pairs[:, 1]).std()) / best / math.sqrt(len(pairs))
    return ratio, half, len(pairs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", choices=SEEDS, default="tuning")
    parser.add_argument("--cells", type=int, nargs="+", default=[0])
    parser.add_argument("--tasks", type=int, default=25)
    parser.add_argument("--every", type=int, default=8)
    parser.add_argument("--budget", type=float, default=300.0, help="processor time in s")
    parser.add_argument("--left", metavar="LABEL", help="the tasks that a study left outside")
    parser.add_argument("--first", type=int, default=10, help="task from which on that counts")
    parser.add_argument("--results", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    results, seeds, tasks, budget = arguments.results, arguments.seeds, arguments.tasks, arguments.budget
    if arguments.left:
        studied = attempts_path(results, seeds, arguments.left)
        complete = run_left(path_of(results, seeds, "left"), studied, seeds, tasks, arguments.first, budget)
    else:
        complete = run(path_of(results, seeds), seeds, arguments.cells, tasks, arguments.every, budget)
    print("complete" if complete else "budget used up: run again to go on")


if __name__ == "__main__":
    main()
