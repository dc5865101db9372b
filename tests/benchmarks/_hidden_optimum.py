"""Fewest taps for somebody who knows what is hidden: the complete plant, its friction and its scatter.

`python -m tests.benchmarks._hidden_optimum --seeds reporting --cells 6 8 --tasks 25 --every 8 --budget 300`
adds what is not there yet, a row a task of those cells, every so-manieth, and stops after 300 s of processor
time. Outcomes of taps are those of the product's integrator, which agrees with the simulator's to 1e-6, for
the part where it lies: at several remaining distances where the effect goes with the position. Time at rest
is taken in its middle; who knew it before each tap might do a little better.
"""

import argparse
import csv
import math
import time
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from impactcell.physics import Ensemble, Plant, TapInput
from tests.benchmarks._hidden_conditions import (
    SEEDS,
    SENSOR_ONLY,
    CellTask,
    Condition,
    cell_tasks,
    hidden_effects,
)
from tests.benchmarks._hidden_tasks import RESULTS, TAPS_A_TASK
from tests.benchmarks._positioning_optimum import STROKES, VELOCITIES, Samples, Z, fewest_of
from tests.benchmarks._positioning_tasks import RATIO

BY_POSITION = {"position_dependent_friction", "periodic_friction", "friction_patch", "restoring_force"}
"""Effects that act on a part by where it lies."""
POSITIONS = 7
"""Remaining distances at which outcomes are worked out for these."""
NEAREST_M = 5e-5
"""The least of them, m."""
DWELL_S = 3.0
"""Time at rest, s: the middle of 0.3 to 30 s in its logarithm."""
BOUND = 1e-3
"""On overshoot, as the planner's."""
Optimum = dict[tuple[str, int, int], float]
"""Fewest taps by condition, cell and number of the task."""


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
        for stroke in STROKES
    ]  # fmt: skip
    ensemble = Ensemble(taps, tuple(hidden), batches=2)
    theta = ensemble.parameters(plant)
    nodes = [
        ensemble.outputs(theta, 1.0 + condition.friction_scatter * z).displacement_m.reshape(
            VELOCITIES.size, STROKES.size
        )
        for z in Z
    ]
    return np.ascontiguousarray(np.stack(nodes, axis=2))


def fewest(task: CellTask, condition: Condition, shots: int) -> float:
    """Expected taps of the best policy."""
    distances = np.array([task.distance_m])
    if BY_POSITION & set(condition.effects):
        distances = np.geomspace(NEAREST_M, task.distance_m, POSITIONS)
    target = task.start_m + task.distance_m
    tables = np.array([outcomes(task, condition, target - each, shots) for each in distances])
    return fewest_of(tables, distances, task.distance_m, task.tolerance_m, BOUND)[0]


def path_of(results: Path, seeds: str) -> Path:
    return results / f"positioning-hidden-optimum-{seeds}.csv"


def read_optimum(path: Path) -> Optimum:
    """What is there so far; nothing where there is no file."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {(name, int(cell), int(number)): float(taps) for name, cell, number, taps in csv.reader(file)}


def run(path: Path, seeds: str, cells: Iterable[int], tasks: int, every: int, budget_s: float) -> bool:
    """Add what is missing; False where the budget ended first. Sensors' effects move no part otherwise."""
    path.parent.mkdir(exist_ok=True)
    there, began = read_optimum(path), time.process_time()
    for cell in cells:
        for condition in hidden_effects():
            if set(condition.effects) & SENSOR_ONLY:
                continue
            for task in list(cell_tasks(condition, seeds, cell, tasks))[cell % every :: every]:
                if (condition.key, cell, task.number) in there:
                    continue
                if time.process_time() - began > budget_s:
                    return False
                taps = fewest(task, condition, max(int(TAPS_A_TASK * tasks), 1))
                with path.open("a", newline="") as file:
                    csv.writer(file).writerow([condition.key, cell, task.number, taps])
    return True


def over_optimum(taken: Mapping[tuple[str, int, int], int], optimum: Optimum) -> tuple[float, float]:
    """Taps taken over the fewest where these are known, and half its 95 % interval; nan for none."""
    pairs = np.array([(taken[key], optimum[key]) for key in taken if key in optimum])
    if not len(pairs):
        return math.nan, math.nan
    best = pairs[:, 1].mean()
    ratio = float(pairs[:, 0].mean() / best)
    return ratio, 1.96 * float((pairs[:, 0] - ratio * pairs[:, 1]).std()) / best / math.sqrt(len(pairs))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", choices=SEEDS, default="tuning")
    parser.add_argument("--cells", type=int, nargs="+", default=[0])
    parser.add_argument("--tasks", type=int, default=25)
    parser.add_argument("--every", type=int, default=8)
    parser.add_argument("--budget", type=float, default=300.0, help="processor time in s")
    parser.add_argument("--results", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    path = path_of(arguments.results, arguments.seeds)
    complete = run(path, arguments.seeds, arguments.cells, arguments.tasks, arguments.every, arguments.budget)
    print("complete" if complete else "budget used up: run again to go on")


if __name__ == "__main__":
    main()
