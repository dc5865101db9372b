"""`kill -9` at random moments: one journal, many lives of the service, and a module that goes on."""

import asyncio
import random
import re
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from impactcell import cell as core
from impactcell.alarms import AlarmSettings, initial_state
from impactcell.cell.preprocessing import BatchNaming
from impactcell.errors import JournalError
from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import unpack_state
from impactcell.records import PositioningState
from impactcell.serialization import pack
from impactcell.service.factory import cell_design
from impactcell.settings import read_cell
from tests.integration.forked import forked
from tests.integration.processes import simulator, write_cell

PERIOD_S = 0.5
LONGEST_LIFE = 2.0
"""A service is killed within so many periods after it has connected."""
OVERWRITTEN = r"cycle=(\d+) (\d+) before it (?:is|are) lost: the module had overwritten"


@dataclass(frozen=True)
class Outcome:
    """What the journal holds after the crashes.

    Attributes
    ----------
    cycles : list of int
        In the order of the journal.
    overwritten : int
        Cycles of which a service said that the module no longer had them: its starts took longer than the
        ring lasts.
    lost : int
        All others that are not in the journal.
    same_state : bool
        Whether the stored state is, bit for bit, that of a run without crashes over the same captures.
    """

    cycles: list[int]
    overwritten: int
    lost: int
    same_state: bool

    @property
    def right(self) -> bool:
        """Every cycle that the module held once, in order, and the state of an uninterrupted run."""
        return self.same_state and not self.lost and self.cycles == sorted(set(self.cycles))


async def crash(directory: Path, kills: int, seed: int, period_s: float = PERIOD_S) -> Outcome:
    """Kill a service so many times; let the last one live until it has caught up."""
    moments = random.Random(seed)
    told: list[str] = []
    # No batch is announced: announcements are not in the captures, of which the replay is made.
    one_batch = [{"from_cycle": 1, "id": "A"}]
    strikes = {"period_s": period_s}
    async with simulator(directory, strikes=strikes, deviations=[], batches=one_batch) as module:
        path = write_cell(directory, module["port"])
        for _ in range(kills):
            async with forked("impactcell", "run", str(path)) as service:
                await service.line("connected to")
                await asyncio.sleep(moments.uniform(0.0, LONGEST_LIFE * period_s))
                service.process.kill()
                await service.process.wait()
            told += service.lines
        async with forked("impactcell", "run", str(path)) as service:
            await service.line("connected to")
            while _stored(directory) <= kills:
                await asyncio.sleep(0.1)
        told += service.lines
    return judged(path, directory / "press-1.sqlite", told)


def _stored(directory: Path) -> int:
    try:
        with Journal(directory / "press-1.sqlite", "press-1", read_only=True) as journal:
            return journal.count()
    except JournalError:  # not made yet
        return 0


def judged(cell_file: Path, journal_file: Path, told: list[str]) -> Outcome:
    """Read the journal, replay its captures through a fresh cell, and compare its gaps with what was said."""
    design = cell_design(read_cell(cell_file))
    state, cycles = core.initial_state(design), []
    with Journal(journal_file, "press-1", read_only=True) as journal:
        stored = unpack_state(journal.state() or b"", state)
        for capture in journal.captures():
            state = core.step(design, state, capture, PositioningState()).state
            cycles.append(capture.cycle)
    # Alarms of the link come between the cycles and are not in the captures.
    same = _without_alarms(stored.cell) == _without_alarms(state)
    said = {int(m[1]): int(m[2]) for line in told if (m := re.search(OVERWRITTEN, line))}
    gaps = {after: after - before - 1 for before, after in pairwise(cycles) if after > before + 1}
    lost = sum(size for cycle, size in gaps.items() if said.get(cycle) != size)
    return Outcome(cycles, sum(gaps.values()) - lost, lost, same)


def _without_alarms(state: core.CellState) -> bytes:
    return pack(replace(state, alarms=initial_state(AlarmSettings()), batch=BatchNaming()))
