"""Make a journal that holds something of everything, as the code writes it: a fixture for later code.

``python -m tests.data.make_journal DIRECTORY`` runs the real service against the simulator, twice over one
journal: first a cell that wears, meets three batches and an odd cycle, while people act on it; then one
that brings a part to its target. See README.md beside this file.
"""

import asyncio
import json
import lzma
import sqlite3
import sys
from pathlib import Path
from typing import Any

from impactcell.alarms import EventKind
from impactcell.journal.store import Journal
from impactcell.scada import Actor, Role
from impactcell.service.factory import cell_design
from impactcell.service.operator_commands import OperatorCommands
from impactcell.service.warmup import warm_up
from impactcell.settings import read_cell
from tests.data.contents import described, stored
from tests.integration.processes import simulator, told, write_cell
from tests.integration.watched import Watched, serving

CELL = "press-1"
CYCLES = 84
YEARS_S = 20 * 365 * 86_400.0
"""A shelving that lasts as long as the fixture is of use."""
CELL_FILE: dict[str, Any] = {
    "part": {"mass_kg": 12.0},
    "signature": {"learning_cycles": 15},
    "actuator": {"max_stroke_mm": 1.5, "both_ends": True},
    "positioning": {"tolerance_um": 50.0, "travel_mm": 40.0},
    "alarms": {"wear_limit": 0.24},
}
CAPTURES = 3
"""Captures that the fixture keeps, the last ones: most of a journal is made of them."""
# Few samples: the fixture is to be small.
SENSORS = {
    "force": {"rate_hz": 100_000, "noise_std": 0.4, "longest_s": 0.02},
    "position": {"rate_hz": 10_000, "noise_std": 1.5e-6, "longest_s": 0.2},
}
WEARING: dict[str, Any] = {
    # However long the service takes to start, it misses none: an alarm that is waited for would never come.
    "strikes": {"period_s": 0.25, "cycles": CYCLES, "begin": "with_first_request", "ahead": 8},
    "part": {"mass_kg": 12.0},
    "wear": {"mu_s_per_1000_cycles": 0.6},
    "batches": [
        {"from_cycle": 1, "id": "A"},
        {"from_cycle": 26, "id": "B", "shift": 0.012},
        {"from_cycle": 52, "id": "C", "shift": -0.02, "announced": False},
    ],
    "deviations": [{"cycle": 45, "kind": "bump", "size": 0.5, "at_m": 0.002, "width_m": 0.0004}],
    "faulty_captures": [{"cycle": 20, "kind": "no_force"}],
    "sensors": SENSORS,
}
POSITIONING: dict[str, Any] = {
    "base": "positioning",
    "plant": {"mu_s": 0.23},
    "batches": [{"from_cycle": 1, "id": "D", "shift": 0.01}],
    "positioning": {"pause_s": 0.1, "tasks": [{"target_m": 0.008, "mass_kg": 12.0}]},
    "sensors": SENSORS,
}
OPERATOR = Actor("otto", Role.OPERATOR, "127.0.0.1")
ENGINEER = Actor("eve", Role.ENGINEER, "127.0.0.1")


async def make(directory: Path) -> Path:
    """Run both cells over one journal; its file."""
    # What is compiled before the module starts keeps its ring from being overwritten meanwhile.
    warm_up(cell_design(read_cell(write_cell(directory, 1, **CELL_FILE))))
    async with simulator(directory, **WEARING) as module:
        async with serving(write_cell(directory, module["port"], **CELL_FILE)) as watched:
            await _wearing(watched)
    (directory / "truth.jsonl").unlink()
    async with simulator(directory, **POSITIONING) as module:
        async with serving(write_cell(directory, module["port"], **CELL_FILE)) as watched:
            await _positioning(watched, module)
    journal = directory / f"{CELL}.sqlite"
    _closed(journal)
    return journal


async def _wearing(watched: Watched) -> None:
    """Let the cell wear; people see its alarms, and each is left in another state."""
    act = OperatorCommands(watched.service.running).act_on_condition
    await watched.alarm(CELL, "DeviantCycle", active=True)
    await act(CELL, "DeviantCycle", EventKind.ACKNOWLEDGE, OPERATOR, comment="a chip on the table")
    await act(CELL, "DeviantCycle", EventKind.SHELVE_TIMED, OPERATOR, shelve_s=YEARS_S)
    await watched.alarm(CELL, "BatchShift", active=True)
    await act(CELL, "BatchShift", EventKind.ACKNOWLEDGE, OPERATOR)
    await act(CELL, "BatchShift", EventKind.CONFIRM, OPERATOR)
    await act(
        CELL,
        "BatchShift",
        EventKind.COMMENT,
        ENGINEER,
        comment="supplier changed the coating, µ lower",
    )
    await act(CELL, "ModelGap", EventKind.DISABLE, ENGINEER)
    await act(CELL, "JournalFault", EventKind.SHELVE_ONE_SHOT, OPERATOR)
    await watched.alarm(CELL, "WearLimit", active=True)
    await watched.until(CELL, CYCLES - 2)


async def _positioning(watched: Watched, module: dict[str, Any]) -> None:
    """Bring a part to its target, and begin with another one that the module does not live to see."""
    actions = OperatorCommands(watched.service.running)
    await watched.connected(CELL)
    async with asyncio.timeout(120):
        while not any("inside" in entry for entry in told(module["truth"])):
            await asyncio.sleep(0.05)
        # The module tells it first: while the service's own task runs, no other can begin.
        while not watched.service.running[CELL].task_outcomes:
            await asyncio.sleep(0.05)
    seen = len(watched.snapshots[CELL])
    await actions.set_target(CELL, 0.03, ENGINEER)
    await watched.until(CELL, seen + 1)
    module["running"].process.kill()
    await watched.alarm(CELL, "ModuleConnection", active=True)
    await watched.alarm(CELL, "PositioningFault", active=True)
    await actions.start_batch(CELL, "E", expected=True, actor=OPERATOR)


def _closed(journal: Path) -> None:
    """Put all into the one file, as small as it can be."""
    with Journal(journal, CELL) as store:
        print(f"{store.count()} cycles, {len(store.audit())} actions of people")
    database = sqlite3.connect(journal)
    with database:
        database.execute("DELETE FROM state_backup")  # larger than all else
        kept = "SELECT seq FROM captures ORDER BY seq DESC LIMIT ?"
        database.execute(f"DELETE FROM captures WHERE seq NOT IN ({kept})", (CAPTURES,))
    database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    database.execute("PRAGMA journal_mode = DELETE")
    database.execute("VACUUM")
    database.close()
    with Journal(journal, CELL, read_only=True) as store:
        contents = json.dumps(described(stored(store), store), indent=1, ensure_ascii=False)
    for suffix, data in ((".sqlite.xz", journal.read_bytes()), (".json.xz", contents.encode())):
        packed = journal.with_suffix(suffix)
        packed.write_bytes(lzma.compress(data, preset=9))
        print(f"{packed}: {packed.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    place = Path(sys.argv[1])
    place.mkdir(parents=True, exist_ok=True)
    asyncio.run(make(place))
