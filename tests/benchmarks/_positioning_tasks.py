"""Ten thousand positioning tasks on the simulator's own plant, a row each, kept so that a run can go on."""

import csv
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from impactcell.physics import Plant
from impactcell.positioning import Tap, TapPlanner, Unreachable
from impactcell.positioning.planner_posterior import DAMPING, FRICTION, STIFFNESS, with_single_gaussian
from simulator.plant_nominal import nominal_taps

RESULTS = Path("bench-results")
NOMINAL = Plant(stiffness_n_per_m=6.5e5, damping_n_s_per_m=465.0, mu_s=0.2, mu_k=0.152)
RATIO = 0.76
SCATTER = 0.03
TASKS = 100  # of a cell
MOST_TAPS = 100
SEED = 20240808


@dataclass(frozen=True, slots=True)
class Task:
    """One part to be put in place."""

    cell: int
    number: int
    tolerance_m: float
    stiffness: float
    damping: float
    mu_s: float
    batch_changed: bool
    mass_kg: float
    distance_m: float


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of it."""

    cell: int
    number: int
    mass_kg: float
    distance_m: float
    tolerance_m: float
    taps: int
    end: str  # inside, overshot, gave_up, cycling
    remaining_m: float
    slowest_s: float
    steps: int
    planning_s: float


def tasks(cell: int) -> Iterator[Task]:
    """Tasks of a cell: contact off by 10 %, friction wearing by up to 5 %, one batch step of 10 %."""
    rng = np.random.default_rng([SEED, cell])
    stiffness = NOMINAL.stiffness_n_per_m * (1.0 + 0.1 * rng.choice([-1.0, 1.0]))
    damping = NOMINAL.damping_n_s_per_m * (1.0 + 0.1 * rng.choice([-1.0, 1.0]))
    first = rng.uniform(0.12, 0.30)
    wear = rng.uniform(-0.05, 0.05)
    step, when = 0.1 * rng.choice([-1.0, 1.0]), int(rng.integers(20, 80))
    for number in range(TASKS):
        factor = (1.0 + wear * number / TASKS) * (1.0 + (step if number >= when else 0.0))
        yield Task(
            cell=cell,
            number=number,
            tolerance_m=10e-6 if cell % 2 == 0 else 50e-6,
            stiffness=float(stiffness),
            damping=float(damping),
            mu_s=float(np.clip(first * factor, 0.12, 0.30)),
            batch_changed=number == when,
            mass_kg=float(np.exp(rng.uniform(math.log(5.0), math.log(40.0)))),
            distance_m=float(rng.uniform(2e-3, 40e-3)),
        )


class Learned:
    """The planner, starting from the nominal plant, fed by a tracker that is 1 % uncertain."""

    def __init__(self, task: Task) -> None:
        self.rng = np.random.default_rng([SEED + 1, task.cell])
        self.planner = TapPlanner(tolerance_m=task.tolerance_m, plant=NOMINAL)
        self.level = math.nan

    def start(self, task: Task) -> None:
        if task.batch_changed:
            # announced; of the new batch nothing is known yet
            self.planner.observe_friction(self.level, 0.05 * self.level, batch_changed=True)
        elif math.isfinite(self.level):
            self.planner.observe_friction(self.level, 0.01 * self.level)

    def next_tap(self, remaining_m: float, mass_kg: float) -> Tap | Unreachable | None:
        return self.planner.next_tap(remaining_m, mass_kg)

    def observe(self, tap: Tap, moved_m: float, mass_kg: float) -> None:
        self.planner.observe(tap, moved_m, mass_kg)

    def end(self, task: Task) -> None:
        self.level = RATIO * task.mu_s * (1.0 + 0.01 * self.rng.standard_normal())


class Known(Learned):
    """The same, told the cell's contact beforehand, and its friction to 1 %."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        plant = Plant(task.stiffness, task.damping, task.mu_s, RATIO * task.mu_s)
        self.planner = TapPlanner(tolerance_m=task.tolerance_m, plant=plant)
        belief = self.planner.posterior
        std = np.full(belief.mean.size, 1e-4)
        std[[FRICTION, STIFFNESS, DAMPING]] = 0.01, 1e-4, 1e-4
        self.planner.resume(with_single_gaussian(belief, belief.mean, np.diag(std**2)))


class Fixed(Learned):
    """A planner that keeps to the nominal friction and contact, and allows for the 3 % scatter only."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        belief = self.planner.posterior
        self.planner.resume(
            with_single_gaussian(belief, belief.mean, np.diag(np.full(belief.mean.size, 1e-4) ** 2))
        )

    def start(self, task: Task) -> None:
        pass

    def observe(self, tap: Tap, moved_m: float, mass_kg: float) -> None:
        pass


class Proportional(Learned):
    """Gain 0.7 on the remaining distance, by the nominal plant: strikes from 1.5 mm on, pushes below."""

    GAIN = 0.7

    def start(self, task: Task) -> None:
        pass

    def observe(self, tap: Tap, moved_m: float, mass_kg: float) -> None:
        pass

    def next_tap(self, remaining_m: float, mass_kg: float) -> Tap | Unreachable | None:
        if abs(remaining_m) <= self.planner.tolerance_m:
            return None
        if remaining_m < 0.0:
            return Unreachable("too far")
        wanted = self.GAIN * remaining_m
        if remaining_m > 1.5e-3:
            speed = 0.5 * math.sqrt(2.0 * NOMINAL.mu_k * 9.81 * wanted)
            return Tap(min(speed, 0.1), 1.5e-3)
        indentation = NOMINAL.mu_k * mass_kg * 9.81 / NOMINAL.stiffness_n_per_m
        return Tap(0.01, min(wanted + indentation, 1.5e-3))


KINDS = {"learned": Learned, "known": Known, "fixed": Fixed, "proportional": Proportional}


def attempt(player: Learned, task: Task, rng: np.random.Generator) -> Outcome:
    """One task from start to end in closed loop."""
    remaining, taps, steps, planning, slowest, end = task.distance_m, 0, 0, 0.0, 0.0, "cycling"
    player.start(task)
    while taps < MOST_TAPS:
        began = time.thread_time()
        tap = player.next_tap(remaining, task.mass_kg)
        spent = time.thread_time() - began
        steps, planning, slowest = steps + 1, planning + spent, max(slowest, spent)
        if tap is None:
            end = "inside"
            break
        if isinstance(tap, Unreachable):
            end = "overshot" if remaining < 0.0 else "gave_up"
            break
        mu_s = task.mu_s * (1.0 + SCATTER * rng.standard_normal())
        result = nominal_taps(
            task.stiffness, task.damping, mu_s, RATIO * mu_s, task.mass_kg, tap.velocity_m_s, tap.stroke_m
        )
        moved = float(result.displacement_m[0])
        remaining -= moved
        taps += 1
        player.observe(tap, moved, task.mass_kg)
    player.end(task)
    return Outcome(
        task.cell, task.number, task.mass_kg, task.distance_m, task.tolerance_m, taps, end, remaining,
        slowest, steps, planning,
    )  # fmt: skip


def run(kind: str, cells: range, results: Path = RESULTS) -> list[Outcome]:
    """Outcomes of all tasks of these cells; cells that have been run before are read from their file."""
    results.mkdir(exist_ok=True)
    path = results / f"positioning-{kind}.csv"
    done: dict[int, list[Outcome]] = {}
    for outcome in read(path):
        done.setdefault(outcome.cell, []).append(outcome)
    for cell in cells:
        if len(done.get(cell, [])) == TASKS:
            continue
        rng = np.random.default_rng([SEED + 2, cell])
        every = list(tasks(cell))
        player = KINDS[kind](every[0])
        done[cell] = [attempt(player, task, rng) for task in every]
        append(path, done[cell])
        print(f"\r{kind}: cell {cell + 1} of {len(cells)}", end="", file=sys.stderr, flush=True)
    return [outcome for cell in cells for outcome in done[cell]]


def read(path: Path) -> list[Outcome]:
    if not path.exists():
        return []
    types = Outcome.__annotations__
    with path.open(newline="") as file:
        return [Outcome(**{name: types[name](row[name]) for name in types}) for row in csv.DictReader(file)]


def append(path: Path, outcomes: list[Outcome]) -> None:
    names = list(Outcome.__annotations__)
    fresh = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file)
        if fresh:
            writer.writerow(names)
        writer.writerows([[getattr(outcome, name) for name in names] for outcome in outcomes])


def rows(path: Path) -> list[list[str]]:
    """Rows of a file without a header; none where there is no file."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.reader(file))


def append_row(path: Path, row: list[float]) -> None:
    path.parent.mkdir(exist_ok=True)
    with path.open("a", newline="") as file:
        csv.writer(file).writerow(row)
