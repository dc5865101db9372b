"""Closed loops on the simulator's own plant with something hidden in it: a row a task, resumed where it was.

`python -m tests.benchmarks._hidden_tasks --seeds tuning --cells 0 1 --tasks 50 --budget 300` adds the cells
that are not there yet and stops after 300 s of processor time; `--only viscous_friction none` takes some.
"""

import argparse
import csv
import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from impactcell.positioning import Tap, TapPlanner, Unreachable
from simulator.plant import Plant, TapInput, simulate_tap
from simulator.plant_integrator import NeverAtRestError
from simulator.plant_nominal import nominal_taps
from tests.benchmarks._hidden_conditions import (
    SEEDS,
    SENSOR_ONLY,
    CellTask,
    Condition,
    cell_tasks,
    draws,
    hidden_effects,
    other_conditions,
)
from tests.benchmarks._positioning_tasks import MOST_TAPS, NOMINAL, RATIO

RESULTS = Path("bench-results")
LEVEL_ERROR = 0.01
"""Relative error of the friction that the tracker tells."""
RESOLUTION_M = 1e-6
"""Of the encoder: displacements that differ by less are one."""
FURTHEST_NUISANCE = 0.7
"""Of the logarithms of k, b and friction over the plant's own: a factor of two."""
NUISANCE_STARTS = (np.zeros(3), np.array([-0.25, 0.0, 0.0]), np.array([0.0, 0.25, 0.0]))
"""Of these logarithms, from where the nearest explanation without the effect is looked for."""
TAPS_A_TASK = 3.3
"""About; how many shots an effect that grows from shot to shot takes a cell to have."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """What became of a task."""

    condition: str
    cell: int
    number: int
    mass_kg: float
    distance_m: float
    tolerance_m: float
    taps: int
    end: str  # inside, overshot, gave_up, cycling
    remaining_m: float
    told: int  # whether the planner has said by now that its model lacks something
    steps: int
    planning_s: float
    slowest_s: float
    tellable: float = (
        math.nan
    )  # what somebody who knows the effect has seen of it by now: expected ln of odds


def nominal_displacements(taps: np.ndarray, logs: np.ndarray) -> np.ndarray:
    """Displacements (m) without an effect, ln k, ln b and ln mu off by so much.

    `taps` has k, b, mu_s, mass, velocity and stroke in a row, SI.
    """
    stiffness, damping, friction = np.exp(logs)
    k, b, mu_s, mass, velocity, stroke = taps.T
    mu_s = friction * mu_s
    moved: np.ndarray = nominal_taps(
        stiffness * k, damping * b, mu_s, RATIO * mu_s, mass, velocity, stroke
    ).displacement_m
    return moved


class Cell:
    """A plant with something hidden in it, the planner that works on it, a tracker that is 1 % off."""

    def __init__(self, condition: Condition, seeds: str, cell: int, tasks: Sequence[CellTask]) -> None:
        self.condition, self.number = condition, cell
        self.rng = draws(condition, seeds, cell, 1)
        self.planner = TapPlanner(tolerance_m=tasks[0].tolerance_m, plant=NOMINAL)
        self.level = math.nan
        self.shots = max(int(TAPS_A_TASK * len(tasks)), 1)
        self.shot = 0
        self.seen: list[np.ndarray] = []
        self.hidden = {
            name: parameters for name, parameters in condition.effects.items() if name not in SENSOR_ONLY
        }

    def moved(self, task: CellTask, tap: Tap, position_m: float) -> float:
        """Displacement of the part by a tap; nan where it never comes to rest."""
        self.shot += 1
        mu_s = task.mu_s * (1.0 + self.condition.friction_scatter * self.rng.standard_normal())
        error = 1.0 + self.condition.displacement_scatter * self.rng.standard_normal()
        dwell_s = float(np.exp(self.rng.uniform(math.log(0.3), math.log(30.0))))
        if not self.hidden:
            nominal = nominal_taps(
                task.stiffness, task.damping, mu_s, RATIO * mu_s, task.mass_kg, tap.velocity_m_s, tap.stroke_m
            )
            return error * float(nominal.displacement_m[0])
        plant = Plant(task.stiffness, task.damping, mu_s, RATIO * mu_s, effects=self.hidden)
        strike = TapInput(
            tap.velocity_m_s, task.mass_kg, tap.stroke_m, start_m=position_m, dwell_s=dwell_s,
            shot=self.shot, shots=self.shots, batch=task.batch,
        )  # fmt: skip
        try:
            motion = simulate_tap(plant, strike)
        except NeverAtRestError:
            return math.nan
        self.factor = motion.mu_k / plant.mu_k
        self.seen.append(self.beside_nominal(task, tap, mu_s, motion.displacement_m))
        return error * motion.displacement_m

    def beside_nominal(self, task: CellTask, tap: Tap, mu_s: float, moved_m: float) -> np.ndarray:
        """What a tap did, how far taps like it scatter (m), and what the plant without the effect needs."""
        nominal = np.array(
            [task.stiffness, task.damping, mu_s, task.mass_kg, tap.velocity_m_s, tap.stroke_m], dtype=float
        )
        plain = nominal_displacements(nominal[None], np.zeros(3))[0]
        by_percent = nominal_displacements(nominal[None], np.array([0.0, 0.0, math.log(1.01)]))[0] - plain
        by_friction = 100.0 * self.condition.friction_scatter * by_percent
        by_itself = self.condition.displacement_scatter * plain
        return np.array([moved_m, math.hypot(by_friction, by_itself, RESOLUTION_M), *nominal])

    def tellable(self) -> float:
        """Half the squared effect that no other friction, k and b explain: the expected log odds.

        So much a likelihood ratio test with the effect known would see, all nuisances fitted to the taps.
        """
        if not self.seen:
            return 0.0
        seen = np.array(self.seen)
        moved, std, nominal = seen[:, 0], seen[:, 1], seen[:, 2:]
        fits = [
            least_squares(
                lambda logs: (moved - nominal_displacements(nominal, logs)) / std,
                start,
                bounds=(-FURTHEST_NUISANCE, FURTHEST_NUISANCE),
            )
            for start in NUISANCE_STARTS
        ]
        return min(float(fit.cost) for fit in fits)

    def attempt(self, task: CellTask) -> Attempt:
        """One task from start to end in closed loop."""
        planner, position, target = self.planner, task.start_m, task.start_m + task.distance_m
        taps, steps, planning, slowest, end = 0, 0, 0.0, 0.0, "cycling"
        announced = task.batch_changed and not self.condition.unannounced
        if math.isfinite(self.level):
            std = (0.05 if announced else LEVEL_ERROR) * self.level
            planner.observe_friction(self.level, std, batch_changed=announced)
        self.factor = 1.0
        while taps < MOST_TAPS:
            began = time.thread_time()
            tap = planner.next_tap(target - position, task.told_kg, position)
            spent = time.thread_time() - began
            steps, planning, slowest = steps + 1, planning + spent, max(slowest, spent)
            if tap is None:
                end = "inside"
                break
            if isinstance(tap, Unreachable):
                end = "overshot" if target < position else "gave_up"
                break
            moved = self.moved(task, tap, position)
            taps += 1
            if math.isnan(moved):
                end = "gave_up"
                break
            position += moved
            planner.observe(tap, moved, task.told_kg)
        self.level = RATIO * task.mu_s * self.factor * (1.0 + LEVEL_ERROR * self.rng.standard_normal())
        return Attempt(
            self.condition.key, self.number, task.number, task.mass_kg, task.distance_m, task.tolerance_m,
            taps, end, target - position, int(planner.predictions.lacking), steps, planning,
            slowest, self.tellable(),
        )  # fmt: skip


def path_of(results: Path, seeds: str, label: str) -> Path:
    return results / f"positioning-hidden-{seeds}-{label}.csv"


def read_attempts(path: Path) -> list[Attempt]:
    """Rows of a study so far; none where there is no file."""
    if not path.exists():
        return []
    types = Attempt.__annotations__
    with path.open(newline="") as file:
        return [
            Attempt(**{name: types[name](row[name]) for name in types if name in row})
            for row in csv.DictReader(file)
        ]


def run_cell(condition: Condition, seeds: str, cell: int, count: int) -> list[Attempt]:
    tasks = list(cell_tasks(condition, seeds, cell, count))
    played = Cell(condition, seeds, cell, tasks)
    return [played.attempt(task) for task in tasks]


def run(
    path: Path, conditions: Iterable[Condition], seeds: str, cells: Iterable[int], count: int, budget_s: float
) -> bool:
    """Add the cells that are not in the file yet; False where the budget ended first."""
    path.parent.mkdir(exist_ok=True)
    there = {(attempt.condition, attempt.cell) for attempt in read_attempts(path)}
    names = list(Attempt.__annotations__)
    began, conditions = time.process_time(), list(conditions)
    for cell in cells:
        for condition in conditions:
            if (condition.key, cell) in there:
                continue
            if time.process_time() - began > budget_s:
                return False
            rows = run_cell(condition, seeds, cell, count)
            fresh = not path.exists()
            with path.open("a", newline="") as file:
                writer = csv.writer(file)
                if fresh:
                    writer.writerow(names)
                writer.writerows([[getattr(row, name) for name in names] for row in rows])
    return True


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", choices=SEEDS, default="tuning")
    parser.add_argument("--label", default="now", help="rows of different versions of the code never mix")
    parser.add_argument("--cells", type=int, nargs="+", default=[0])
    parser.add_argument("--tasks", type=int, default=100)
    parser.add_argument("--budget", type=float, default=300.0, help="processor time in s")
    parser.add_argument("--only", nargs="*", default=[], help="names of conditions")
    parser.add_argument("--results", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    conditions = [
        condition
        for condition in [*hidden_effects(), *other_conditions()]
        if not arguments.only or condition.name in arguments.only or condition.key in arguments.only
    ]
    path = path_of(arguments.results, arguments.seeds, arguments.label)
    complete = run(path, conditions, arguments.seeds, arguments.cells, arguments.tasks, arguments.budget)
    print("complete" if complete else "budget used up: run again to go on")


if __name__ == "__main__":
    main()
