"""State of the link to one module, and counts of its cycles: kept, told, and logged."""

import logging
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from impactcell.fieldbus.cycles.received_cycle import ReceivedCycle
from impactcell.process.cell_logger import CellLogger
from impactcell.process.condition_log import kind_of
from impactcell.records import ModuleStatus

_NO_SESSION: Final = "; or it was started anew, and how many are lost is not known: no register session tells"
"""Said of a loss over an outage."""
_NOTHING_TELLS: Final = (
    "nothing tells whether the module was started anew before it, and has overwritten others: it has no "
    "register session"
)
"""Said of an outage without a loss."""


class ModuleAccount:
    """What became of one module so far.

    Parameters
    ----------
    cell : str
        The cell's name, for messages.
    log : CellLogger
    on_change : callable, optional
        Called when the connection is made or lost.

    Attributes
    ----------
    status : ModuleStatus
        Of what is counted here: no times, nothing of the connection but whether there is one.
    connections : int
        That there were.
    """

    def __init__(self, cell: str, log: CellLogger, on_change: Callable[[], None] | None) -> None:
        self.status = ModuleStatus()
        self.connections = 0
        self._cell = cell
        self._log = log
        self._on_change = on_change
        self._logged = deque[str](maxlen=16)  # kinds of reasons since there was a connection

    def connect(self, link: object) -> None:
        """Note that there is a connection."""
        self.connections += 1
        if self._changes(connected=True, reason=""):
            self._logged.clear()
            self._log.info("connected to %s", link)
            self._tell()

    def disconnect(self, reason: str, level: int = logging.WARNING, *, answered: bool = False) -> None:
        """Note why there is no connection; the log is told once of each kind of reason.

        `answered`: something answers, and not as the module does.
        """
        if self._changes(connected=False, reason=reason, answered=answered):
            kind = kind_of(reason)
            if kind not in self._logged:
                self._logged.append(kind)
                self._log.log(level, "%s", reason.removeprefix(f"{self._cell}: "))
            self._tell()

    def count(self, received: ReceivedCycle, *, readable: bool, is_doubtful: bool) -> None:
        """Count a cycle, and log what was lost before it, and what is wrong with it.

        `is_doubtful`: nothing tells that the module was not started anew before it.
        """
        status = self.status
        self.status = replace(
            status,
            received=status.received + 1,
            missed=status.missed + received.missed,
            restarts=status.restarts + received.restarted,
            unreadable=status.unreadable + (not readable),
        )
        cycle = received.cycle_id.cycle
        if received.missed:
            are, them = ("is", "it") if received.missed == 1 else ("are", "them")
            why = "was started anew, or had overwritten" if received.restarted else "had overwritten"
            doubt = _NO_SESSION if is_doubtful and not received.restarted else ""
            self._log.warning(
                "%d before it %s lost: the module %s %s%s",
                received.missed, are, why, them, doubt, cycle=cycle,
            )  # fmt: skip
        elif is_doubtful and not received.restarted:
            self._log.info("%s", _NOTHING_TELLS, cycle=cycle)
        for fault in received.faults:
            said = fault.removeprefix(f"{self._cell}: cycle {cycle}").lstrip(": ")
            self._log.warning("%s", said, cycle=cycle)

    def _changes(self, *, connected: bool, reason: str, answered: bool = False) -> bool:
        """Take the state of the link; says whether it is another kind of state than before."""
        before = self.status
        if (before.connected, kind_of(before.reason)) == (connected, kind_of(reason)):
            return False
        self.status = replace(before, connected=connected, reason=reason, answered=answered)
        return True

    def _tell(self) -> None:
        if self._on_change is not None:
            self._on_change()
