"""Lasting conditions in the log: a line when one begins and a line when it is over, not one a cycle."""

import logging
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from impactcell.process.cell_logger import CellLogger

QUIET_CYCLES: Final = 20
"""Cycles without a condition after which it is over: one that comes and goes is one."""
_NUMBER: Final = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_PLURAL: Final = re.compile(r"\bcycles\b")


@dataclass(slots=True)
class _Condition:
    text: str
    since_cycle: int
    last_cycle: int
    count: int = 1


def kind_of(note: str) -> str:
    """Name the condition that is noted: two notes that differ in their numbers only are of the same one."""
    return _PLURAL.sub("cycle", _NUMBER.sub("#", note))


class ConditionLog:
    """Logs what holds in a cell from cycle to cycle."""

    def __init__(self, log: CellLogger) -> None:
        self._log = log
        self._lasting: dict[str, _Condition] = {}

    def update(self, notes: Iterable[str], cycle: int) -> None:
        """Take what was noted of a cycle."""
        for note in notes:
            kind = kind_of(note)
            known = self._lasting.get(kind)
            if known is None:
                self._log.log(logging.INFO, "%s", note, cycle=cycle)
                self._lasting[kind] = _Condition(note, cycle, cycle)
            elif known.last_cycle != cycle:
                known.last_cycle, known.count = cycle, known.count + 1
        for kind, known in list(self._lasting.items()):
            if not 0 <= cycle - known.last_cycle < QUIET_CYCLES:
                del self._lasting[kind]
                cycles = "1 cycle" if known.count == 1 else f"{known.count} cycles"
                said = "over since cycle %d, %s from %d on: %s"
                self._log.log(logging.INFO, said, known.last_cycle + 1, cycles, known.since_cycle, known.text)
