"""What the world sees of one running cell: over OPC UA, on the page, and alarms in the log."""

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from impactcell.alarms import RULES
from impactcell.numerics.compilation import has_lacked_code
from impactcell.process.cell_logger import CellLogger
from impactcell.records import NOT_CONNECTED_YET, Alarm, Capture, ModuleStatus, PositioningState, Snapshot
from impactcell.web.interface import CellNews, Freshness

if TYPE_CHECKING:
    from impactcell.scada import Server
    from impactcell.web.live_feed import LiveFeed


class CellPublisher:
    """Shows one cell; without a server, as before it has started, only the log hears of it.

    A snapshot is published some time after its cycle was computed, and what people do goes on meanwhile. So
    alarms are shown by `publish_alarms` alone, which the worker calls in the order of their changes, and the
    positioning task as it is at that moment: neither is ever taken out of a snapshot.

    Parameters
    ----------
    cell : str
    alarms : tuple of Alarm
        As they were; one that is active already is not logged again.
    positioning : callable
        The positioning task as it is now.
    log : CellLogger
    """

    def __init__(
        self,
        cell: str,
        alarms: tuple[Alarm, ...],
        positioning: Callable[[], PositioningState],
        log: CellLogger,
    ) -> None:
        self.server: Server | None = None
        self.feed: LiveFeed | None = None
        self._cell = cell
        self._alarms = alarms
        self._positioning = positioning
        self._active = {alarm.name for alarm in alarms if alarm.active}
        self._log = log

    def publish(self, snapshot: Snapshot, capture: Capture | None = None) -> None:
        """Show a cycle, and what was measured in it."""
        snapshot = replace(snapshot, alarms=self._alarms, positioning=self._positioning())
        self._put(snapshot=snapshot, capture=capture, freshness=Freshness.LIVE)
        if self.server is not None:
            self.server.publish(self._cell, snapshot)

    def publish_positioning(self, snapshot: Snapshot) -> None:
        """Show the task as it is between cycles; whether the values of the last cycle are of now stays."""
        snapshot = replace(snapshot, alarms=self._alarms, positioning=self._positioning())
        self._put(snapshot=snapshot)
        if self.server is not None:
            self.server.positioning(self._cell, snapshot, time.time_ns())

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

    def publish_alarms(self, alarms: tuple[Alarm, ...], *, unchanged: bool = False) -> None:
        """Show the conditions that have changed since the last call, or all of them, and log them."""
        before, self._alarms = self._alarms, alarms
        shown = alarms if unchanged else tuple(a for a in alarms if not any(a is b for b in before))
        if shown:
            self._put(alarms=shown)
        for alarm in shown:
            self._log_alarm(alarm)
            if self.server is not None:
                self.server.alarm(self._cell, alarm)

    def _log_alarm(self, alarm: Alarm) -> None:
        """Log an alarm that comes or goes, but for those that their finder has told of already."""
        if alarm.active != (alarm.name in self._active) and not RULES[alarm.name].logged_by_cause:
            message = "alarm %s is active: %s" if alarm.active else "alarm %s is over: %s"
            level = logging.WARNING if alarm.active else logging.INFO
            self._log.log(level, message, alarm.name, alarm.message, cycle=alarm.cycle or None)
        (self._active.add if alarm.active else self._active.discard)(alarm.name)

    def publish_start(self, status: ModuleStatus) -> None:
        """Show where nothing has been tried yet: no value is of now, and no link is lost.

        That the start is one that compiles is known only some time after it has begun: call it now and then.
        """
        if status.reason == NOT_CONNECTED_YET:
            self._put(freshness=Freshness.COMPILING if has_lacked_code() else Freshness.STARTING)

    def mark_stale(self, time_ns: int) -> None:
        """Show that the values are of another time."""
        self._put(freshness=Freshness.STALE)
        if self.server is not None:
            self.server.mark_stale(self._cell, time_ns)

    def _put(self, **news: Any) -> None:
        if self.feed is not None:
            self.feed.put(CellNews(self._cell, **news))
