"""What the world sees of one running cell: over OPC UA, on the page, and alarms in the log."""

import logging
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from impactcell.alarms import RULES
from impactcell.process.cell_logger import CellLogger
from impactcell.records import Alarm, Capture, ModuleStatus, Snapshot
from impactcell.web.interface import CellNews, Freshness

if TYPE_CHECKING:
    from impactcell.scada import Server
    from impactcell.web.live_feed import LiveFeed


class CellPublisher:
    """Shows one cell; without a server, as before it has started, only the log hears of it.

    Parameters
    ----------
    cell : str
    alarms : iterable of Alarm
        As they were; one that is active already is not logged again.
    log : CellLogger
    """

    def __init__(self, cell: str, alarms: Iterable[Alarm], log: CellLogger) -> None:
        self.server: Server | None = None
        self.feed: LiveFeed | None = None
        self._cell = cell
        self._active = {alarm.name for alarm in alarms if alarm.active}
        self._log = log

    def publish(self, snapshot: Snapshot, capture: Capture | None = None) -> None:
        """Show a cycle, and what was measured in it."""
        self._put(snapshot=snapshot, capture=capture, freshness=Freshness.LIVE)
        if self.server is not None:
            self.server.publish(self._cell, snapshot)

    def publish_link(self, status: ModuleStatus) -> None:
        """Show the state of the link; without one no value is good."""
        if not status.connected:
            self._put(freshness=Freshness.LOST)
        if self.server is not None and not status.connected:
            self.server.mark_bad(self._cell, time.time_ns())
        self.publish_module(status)

    def publish_module(self, status: ModuleStatus) -> None:
        """Show what has come over the link."""
        self._put(status=status)
        if self.server is not None:
            self.server.module(self._cell, status, time.time_ns())

    def publish_alarms(self, changed: Iterable[Alarm]) -> None:
        """Show conditions that have changed, and log them."""
        alarms = tuple(changed)
        if alarms:
            self._put(alarms=alarms)
        for alarm in alarms:
            self.log_alarm(alarm)
            if self.server is not None:
                self.server.alarm(self._cell, alarm)

    def log_alarm(self, alarm: Alarm) -> None:
        """Log an alarm that comes or goes, but for those that their finder has told of already."""
        if alarm.active != (alarm.name in self._active) and not RULES[alarm.name].logged_by_cause:
            message = "alarm %s is active: %s" if alarm.active else "alarm %s is over: %s"
            level = logging.WARNING if alarm.active else logging.INFO
            self._log.log(level, message, alarm.name, alarm.message, cycle=alarm.cycle or None)
        (self._active.add if alarm.active else self._active.discard)(alarm.name)

    def mark_stale(self, time_ns: int) -> None:
        """Show that the values are of another time."""
        self._put(freshness=Freshness.STALE)
        if self.server is not None:
            self.server.mark_stale(self._cell, time_ns)

    def _put(self, **news: Any) -> None:
        if self.feed is not None:
            self.feed.put(CellNews(self._cell, **news))
