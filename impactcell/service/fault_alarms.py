"""Alarms of what happens beside the cycles of a cell: its link is lost, its journal cannot be written."""

import time
from typing import Final

from impactcell.alarms import RuleResult
from impactcell.alarms.rules import journal_fault, module_connection
from impactcell.process.cell_logger import CellLogger
from impactcell.process.condition_log import kind_of
from impactcell.records import NOT_CONNECTED_YET, ModuleStatus
from impactcell.service.worker import CellWorker

STANDS_S: Final = 5.0
"""So long another reason of a lost link stands before it is told, seconds: a module that is switched off may
have no route at one attempt and be silent at the next, and there are several a second."""


class SettledReason:
    """Which reason is told: the first one at once, another once it has stood for `STANDS_S`.

    Two that differ in their numbers only are the same, and the first of them is told.
    """

    def __init__(self) -> None:
        self._told = self._seen = ModuleStatus(reason="")
        self._since_s = 0.0

    def update(self, status: ModuleStatus, now_s: float) -> ModuleStatus:
        """Take the link as it is at a time in seconds, without a reason where it stands; what to tell."""
        kind = kind_of(status.reason)
        if not status.reason or not self._told.reason:
            self._told = self._seen = status
        elif kind != kind_of(self._seen.reason):
            self._seen, self._since_s = status, now_s
        elif kind != kind_of(self._told.reason) and now_s - self._since_s >= STANDS_S:
            self._told = self._seen
        return self._told


class FaultAlarms:
    """Raises and clears them, and lets them tell another reason while they stand."""

    def __init__(self, worker: CellWorker, log: CellLogger) -> None:
        self._worker = worker
        self._log = log
        self._link_reason = SettledReason()
        self._journal_told = ""

    async def tell_link(self, status: ModuleStatus) -> None:
        """Tell the state of the link; call it when that has changed, and now and then while it is lost.

        Before the first attempt to connect has failed it is no fault.
        """
        if status.reason == NOT_CONNECTED_YET:
            return
        told = self._link_reason.update(status, time.monotonic())
        result = module_connection.result(told.reason, connected=status.connected, answered=told.answered)
        await self._tell(result)

    async def check_journal(self) -> None:
        """Tell what has happened to the journal, and why it cannot be written."""
        for event in self._worker.take_journal_events():  # a person has to know, also where it is over
            await self._tell_journal(event)
        fault = self._worker.journal_fault
        active = any(a.active for a in self._worker.alarms if a.name == journal_fault.NAME)
        is_news = kind_of(fault) != kind_of(self._journal_told)
        if is_news or bool(fault) != active:
            if fault and is_news:
                self._log.error("%s", fault)
            elif not fault and self._journal_told:
                self._log.info("the journal is written again")
            await self._tell_journal(fault)

    async def _tell_journal(self, fault: str) -> None:
        self._journal_told = fault
        await self._tell(journal_fault.result(fault))

    async def _tell(self, result: RuleResult) -> None:
        await self._worker.apply_rule_result(result, time.time_ns())
