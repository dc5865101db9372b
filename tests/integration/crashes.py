"""`kill -9` at random moments: one journal, many lives of the service, and a module that goes on."""

import asyncio
import random
from dataclasses import dataclass, replace
from pathlib import Path

from impactcell import cell as core
from impactcell import values
from impactcell.intake import BatchSaid
from impactcell.journal.store import Journal
from impactcell.records import PositioningState
from impactcell.service.design import cell_design
from impactcell.service.worker import Durable
from impactcell.settings import read_cell
from tests.integration.processes import simulator, started, write_cell

PERIOD_S = 1.0
LONGEST_LIFE_S = 2.0
"""A service is killed within this time after it has connected."""


@dataclass(frozen=True)
class Outcome:
    """What the journal holds after the crashes.

    Attributes
    ----------
    cycles : list of int
        In the order of the journal.
    same_state : bool
        Whether the stored state is, bit for bit, that of a run without crashes over the same captures.
    """

    cycles: list[int]
    same_state: bool

    @property
    def right(self) -> bool:
        """Every cycle once, in order, and the state of an uninterrupted run."""
        first, last = self.cycles[0], self.cycles[-1]
        return self.same_state and self.cycles == list(range(first, last + 1))


async def crash(directory: Path, kills: int, seed: int) -> Outcome:
    """Kill a service so many times; let the last one live until it has caught up."""
    moments = random.Random(seed)
    async with simulator(directory, strikes={"period_s": PERIOD_S}, deviations=[]) as module:
        path = write_cell(directory, module["port"])
        for _ in range(kills):
            async with started("impactcell", "run", str(path)) as service:
                await service.line("connected to")
                await asyncio.sleep(moments.uniform(0.0, LONGEST_LIFE_S))
                service.process.kill()
                await service.process.wait()
        async with started("impactcell", "run", str(path)) as service:
            await service.line("connected to")
            await asyncio.sleep(2 * PERIOD_S)
    return judged(path, directory / "press-1.sqlite")


def judged(cell_file: Path, journal_file: Path) -> Outcome:
    """Read the journal and replay its captures through a fresh cell."""
    design = cell_design(read_cell(cell_file))
    state, cycles = core.initial_state(design), []
    with Journal(journal_file, "press-1", read_only=True) as journal:
        stored = values.loads(Durable, journal.state() or b"")
        for capture in journal.captures():
            state = core.step(design, state, capture, PositioningState()).state
            cycles.append(capture.cycle)
    # Alarms of the link come between the cycles and are not in the captures.
    same = _without_alarms(stored.state) == _without_alarms(state)
    return Outcome(cycles, same)


def _without_alarms(state: core.CellState) -> bytes:
    return values.dumps(replace(state, alarms=None, batch=BatchSaid()))  # type: ignore[arg-type]
