"""Positioning through the whole service, against the simulator's plant on a faulty fieldbus: a row a task.

`python -m tests.benchmarks._service_tasks --seeds tuning --cells 0 1 --tasks 25` adds the cells that are not
there yet. The benchmark is module, PLC and operator: it serves the registers, puts parts down one after the
other, restarts the module now and then, and sets a target again where a task has stopped with a fault.
"""

import argparse
import asyncio
import contextlib
import csv
import logging
import math
import tempfile
import time
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.errors import PositioningError
from impactcell.fieldbus.cycles.status_block import PositioningStatus
from impactcell.fieldbus.tap_commands import Objection, ObjectionError, TapCommand, TapCommander
from impactcell.journal.audit_entries import AuditEntry
from impactcell.records import Quality
from impactcell.service.cell_task import CellTask
from simulator.device import Device
from simulator.faults import Fault, FaultInjector, FaultKind
from simulator.modbus_server import ModbusServer
from simulator.plant import TapInput
from simulator.scenario import Scenario
from simulator.serving import read_register_map
from tests.benchmarks._hidden_conditions import CellTask as Part
from tests.benchmarks._hidden_conditions import Condition, cell_tasks
from tests.integration.processes import CONFIG, scenario_content, write_cell
from tests.integration.watched import serving

RESULTS = Path("bench-results")
NAME = "press-1"
MAP = CONFIG / "maps" / "fpga-v1.yaml"
ACCELERATION = 25.0
"""Module's seconds in one of ours: a slide of 0.2 s is over at the next look."""
PAUSE_S = 5.0
"""Module's seconds between two parts: a PLC takes one away once it has been told that it is in place."""
PROBABILITY = 1.5e-3
"""Of each kind of fault in a reply; some hundred replies belong to a tap."""
LATE_S, TIMEOUT_MS = 0.4, 300.0
"""How late a late reply is, and how long it is waited for."""
RESTARTS = 0.01
"""Share of strikes during or soon after which the module is started anew."""
IDLE_S = 0.5
"""A part lies so long and nothing happens to it, and the operator sets its target again ..."""
REFUSED = 6
"""... so often; then he takes it away."""
SCATTER = 0.03
"""Of friction, from tap to tap."""
TAPS_A_TASK = 3.8
"""About; over how many strikes friction wears."""
SINGLE_PRECISION = 1e-6
"""Relative error of what registers carry, at most."""
AUDIT = AuditEntry(1, "operator", "SetTarget", "", "Good")


@dataclass(frozen=True, slots=True)
class ServedTask:
    """What became of a part: `end` as the simulator saw it, `reason` the last that the service said.

    `commanded` taps left the planner, `executed` ones struck, `twice` of them more often than commanded;
    `level_error` is that of the tracker's friction at the end, relative; `faults` befell replies meanwhile.
    """

    cell: int
    number: int
    mass_kg: float
    distance_m: float
    tolerance_m: float
    end: str  # inside, overshot, gave_up
    remaining_m: float
    commanded: int
    executed: int
    twice: int
    set_again: int
    faults: int
    restarts: int
    level_error: float
    spent_s: float
    reason: str


@dataclass
class Struck:
    """Commands and strikes since the part was put down: velocity (m/s) and stroke (m)."""

    commanded: list[tuple[float, float]] = field(default_factory=list)
    executed: list[tuple[float, float]] = field(default_factory=list)

    @property
    def twice(self) -> int:
        """Strikes that no command of their own stands behind, in the order of the commands."""
        commands = iter(self.commanded)
        return sum(not any(map(partial(is_same, strike), commands)) for strike in self.executed)


class Module(Device):
    """Counts strikes as they begin, and lets a part be taken away that nobody can put in place."""

    struck = Struck()

    def _strike(self, commanded: TapInput, sequence: int) -> None:
        self.struck.executed.append((commanded.velocity_m_s, commanded.stroke_m))
        super()._strike(commanded, sequence)

    @property
    def part(self) -> int:
        """Number of the part on the table."""
        return self._parts.number

    @property
    def position_m(self) -> float:
        return self._parts.position_m

    @property
    def at_work(self) -> bool:
        """Whether the part on the table is still to be put in place, and nothing moves."""
        return math.isinf(self._parts.due_s) and self._tap is None

    def take_away(self) -> None:
        self._parts.due_s = self._now_s

    @property
    def mu_s(self) -> float:
        """Friction of now, without the scatter of a strike."""
        scenario = self.scenario
        batch = [entry for entry in scenario.batches if entry.from_cycle <= max(self._made, 1)][-1]
        return scenario.plant.mu_s + scenario.wear.mu_s_per_1000_cycles * self._made / 1e3 + batch.shift


class CountedCommander(TapCommander):
    """Notes every command."""

    struck: Struck

    async def tap(self, command: TapCommand, objection: Objection = lambda _: "") -> PositioningStatus:
        self.struck.commanded.append((command.velocity_m_s, command.stroke_m))
        try:
            return await super().tap(command, objection)
        except ObjectionError:
            self.struck.commanded.pop()
            raise


def is_same(strike: tuple[float, float], command: tuple[float, float]) -> bool:
    """Whether the module struck as commanded: the registers have single precision."""
    return all(map(partial(math.isclose, rel_tol=SINGLE_PRECISION), strike, command))


def scenario_of(seeds: str, cell: int, parts: list[Part]) -> Scenario:
    """Cell of these parts: contact 10 % off its model, friction that wears, one batch step, 3 % scatter."""
    draw = np.random.default_rng([len(seeds), cell, 19])
    first, last = parts[0], parts[-1]
    strikes = TAPS_A_TASK * len(parts)
    changed = next(part for part in parts if part.batch_changed)
    step = changed.mu_s - parts[changed.number - 1].mu_s
    worn = (last.mu_s - first.mu_s - step) / strikes * 1e3
    content = scenario_content("positioning", {})
    content |= {
        "acceleration": ACCELERATION,
        "seed": int(draw.integers(1, 2**31)),
        "plant": {
            "stiffness_n_per_m": first.stiffness,
            "damping_n_s_per_m": first.damping,
            "mu_s": first.mu_s,
        },
        "scatter": {"friction": SCATTER},
        "wear": {"mu_s_per_1000_cycles": worn},
        "batches": [
            {"from_cycle": 1, "id": "A"},
            {
                "from_cycle": round(TAPS_A_TASK * changed.number),
                "id": "B",
                "shift": step,
                "announced": cell % 4 < 2,
            },
        ],
        "sensors": {
            "force": {"rate_hz": 20_000, "noise_std": 0.4, "longest_s": 0.2},
            "position": {"rate_hz": 10_000, "noise_std": 1.5e-6, "longest_s": 0.2},
        },
        "positioning": {
            "most_velocity_mm_per_min": 6000.0,
            "most_stroke_m": 0.0015,
            "directions": [1],
            "pause_s": PAUSE_S,
            "tasks": [
                {"target_m": p.distance_m, "mass_kg": p.mass_kg, "tolerance_m": p.tolerance_m} for p in parts
            ],
        },
    }
    return Scenario.model_validate(content)


def cell_of(port: int, tolerance_m: float, directory: Path) -> Path:
    changes: dict[str, Any] = {
        "module": {"port": port, "timeout_ms": TIMEOUT_MS},
        "positioning": {"tolerance_um": tolerance_m * 1e6, "travel_mm": 60.0},
        "actuator": {"stroke_mm": None, "max_stroke_mm": 1.5, "max_velocity_mm_per_min": 6000.0},
        "alarms": {"wear_limit": 0.35},
    }
    return write_cell(directory, port, NAME, **changes)


class Operator:
    """Follows the parts of a cell through the service."""

    def __init__(self, module: Module, cell: CellTask, faults: FaultInjector, seed: list[int]) -> None:
        self.module, self.cell, self.faults = module, cell, faults
        self.random = np.random.default_rng(seed)
        self.restarts = self.set_again = self.refused = 0
        self.idle_since = math.inf
        self.reason = ""
        self.seen_strikes = 0

    async def look(self, now_s: float) -> None:
        """Do what is to be done now."""
        state = self.cell._positioning_state()
        if state.running or not self.module.at_work:
            self.idle_since = math.inf
            return
        self.idle_since = min(self.idle_since, now_s)
        if now_s - self.idle_since < IDLE_S:
            return
        self.idle_since = math.inf
        self.reason = state.reason
        if self.refused >= REFUSED:
            self.module.take_away()
            return
        target_m = self.module.scenario.positioning.tasks[self.module.part - 1].target_m  # type: ignore[union-attr]
        try:
            self.set_again += 1
            await self.cell.set_target(target_m, AUDIT)
            if not self.cell._positioning_state().running:  # in place, says the service
                self.refused += 1
        except PositioningError as error:
            self.refused += 1
            self.reason = str(error)

    def disturbs(self) -> bool:
        """Whether the module is started anew now; drawn once a strike."""
        strikes = len(self.module.struck.executed)
        if strikes == self.seen_strikes:
            return False
        self.seen_strikes = strikes
        return bool(strikes) and self.random.random() < RESTARTS

    def level_error(self) -> float:
        """Of the tracker's friction, relative to the truth; nan where it says that it knows none."""
        snapshot = self.cell.worker.snapshot
        if snapshot is None or snapshot.wear.quality is Quality.BAD:
            return math.nan
        offset = snapshot.batch.offset if math.isfinite(snapshot.batch.offset) else 0.0
        return (snapshot.wear.level + offset) / self.module.mu_s - 1.0


async def run_cell(seeds: str, cell: int, count: int, directory: Path) -> list[ServedTask]:
    """All parts of a cell, one after the other."""
    loop = asyncio.get_running_loop()
    parts = list(cell_tasks(Condition("service"), seeds, cell, count))
    ended: list[Any] = []
    scenario, registers = scenario_of(seeds, cell, parts), read_register_map(MAP)
    module = Module(
        scenario, registers, epoch_ns=time.time_ns(), now_s=loop.time(),
        on_truth=lambda truth: ended.append(truth) if "inside" in truth else None,
    )  # fmt: skip
    faults = FaultInjector(scenario.seed)
    for kind in FaultKind:
        faults.inject(Fault(kind, PROBABILITY, seconds=LATE_S))
    rows: list[ServedTask] = []
    async with contextlib.AsyncExitStack() as stack:
        server = await stack.enter_async_context(
            ModbusServer(module, faults=faults, before=lambda: module.update(loop.time()))
        )
        path = cell_of(server.port, parts[0].tolerance_m, directory)
        watched = await stack.enter_async_context(serving(path))
        served = watched.service.running[NAME]
        assert served._positioning is not None
        commander = CountedCommander(served._positioning._module)
        served._positioning._positioner = commander
        await watched.connected(NAME)
        for part in parts:
            struck = Struck()
            module.struck = commander.struck = struck
            operator = Operator(module, served, faults, [scenario.seed, part.number])
            began, before, ended[:] = time.process_time(), sum(faults.happened.values()), []
            number, position_m = module.part, module.position_m
            while module.part == number and not ended:
                await asyncio.sleep(0.01)
                module.update(loop.time())
                position_m = module.position_m if module.part == number else position_m
                if operator.disturbs():
                    operator.restarts += 1
                    server.drop_clients()
                    module.restart()
                await operator.look(loop.time())
            outcome = ended[0] if ended else {}
            error = operator.level_error()
            while module.part == number and part is not parts[-1]:
                await asyncio.sleep(0.01)
                module.update(loop.time())
            end = "inside" if outcome.get("inside") else "overshot" if outcome.get("overshot") else "gave_up"
            rows.append(
                ServedTask(
                    cell, part.number, part.mass_kg, part.distance_m, part.tolerance_m, end,
                    part.distance_m - float(outcome.get("position_m", position_m)),
                    len(struck.commanded), len(struck.executed), struck.twice, operator.set_again,
                    sum(faults.happened.values()) - before, operator.restarts, error,
                    time.process_time() - began, operator.reason,
                )
            )  # fmt: skip
            print(rows[-1], flush=True) if logging.getLogger().isEnabledFor(logging.INFO) else None
    return rows


def path_of(results: Path, seeds: str) -> Path:
    return results / f"positioning-service-{seeds}.csv"


def read_rows(path: Path) -> list[ServedTask]:
    """Rows of a study so far; none where there is no file."""
    if not path.exists():
        return []
    types = ServedTask.__annotations__
    with path.open(newline="") as file:
        return [ServedTask(**{n: types[n](row[n]) for n in types}) for row in csv.DictReader(file)]


def run(path: Path, seeds: str, cells: list[int], count: int) -> None:
    """Add the cells that are not in the file yet."""
    path.parent.mkdir(exist_ok=True)
    there = {row.cell for row in read_rows(path)}
    names = list(ServedTask.__annotations__)
    for cell in cells:
        if cell in there:
            continue
        with tempfile.TemporaryDirectory() as directory:
            rows = asyncio.run(run_cell(seeds, cell, count, Path(directory)))
        fresh = not path.exists()
        with path.open("a", newline="") as file:
            writer = csv.writer(file)
            if fresh:
                writer.writerow(names)
            writer.writerows([[getattr(row, name) for name in names] for row in rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", choices=("tuning", "reporting"), default="tuning")
    parser.add_argument("--cells", type=int, nargs="+", default=[0])
    parser.add_argument("--tasks", type=int, default=25)
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument(
        "-v", "--verbose", action="store_true", help="rows as they come, and the service's log"
    )
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO if arguments.verbose else logging.CRITICAL)
    run(path_of(arguments.results, arguments.seeds), arguments.seeds, arguments.cells, arguments.tasks)


if __name__ == "__main__":
    main()
