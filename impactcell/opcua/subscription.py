"""One subscription: publishing cycles, keep-alives, retransmission (Part 4, 5.14).

Mended: asyncua throws away what it sends again on Republish and answers with an empty message where it has
nothing, which is why a client falls silent for good after its connection was reset; its lifetime runs only
while there is something to say, it never sends MoreNotifications, and it acknowledges sequence numbers it
never gave.
"""

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any, Final

from asyncua import ua

from impactcell.opcua import notification_encoding
from impactcell.opcua.binary_codec import FaultError
from impactcell.opcua.host_interface import ServerLimits
from impactcell.opcua.monitored_item import DataItem, EventItem
from impactcell.opcua.sessions import PublishRequest, Session
from impactcell.opcua.tcp_connection import Connection

Item = DataItem | EventItem

RETRANSMITTED: Final = 256
MOST_NOTIFICATIONS: Final = 10_000
MAX_LIFETIME_S: Final = 3_600.0
MAX_SEQUENCE: Final = 2**32 - 1


class Subscription:
    """What one client wants to hear of, and what it has been told."""

    def __init__(
        self,
        number: int,
        session: Session,
        wanted: ua.CreateSubscriptionParameters,
        limits: ServerLimits,
        expired: Callable[[Any], None],
    ) -> None:
        self.id = number
        self.session: Session | None = session
        self.owner = session.actor.user if session.actor is not None else ""
        self.items: dict[int, Item] = {}
        self.enabled: bool = wanted.PublishingEnabled
        self.late = False
        self._limits = limits
        self._expired = expired
        self._ready: OrderedDict[int, Item] = OrderedDict()
        self._statuses: list[int] = []
        self._sent: OrderedDict[int, bytes] = OrderedDict()
        self._sequence = 1
        self._said_nothing = 0
        self._unheard = 0
        self._first = True
        self._last_item = 0
        self._timer: asyncio.TimerHandle | None = None
        self._next = 0.0
        self.configure(wanted)
        self._start()

    def configure(self, wanted: ua.CreateSubscriptionParameters | ua.ModifySubscriptionParameters) -> None:
        """Settle the interval and the counts."""
        shortest = self._limits.publishing_interval_s
        interval_s = wanted.RequestedPublishingInterval / 1e3
        # NaN and everything below become the shortest.
        self.interval_s = min(interval_s, MAX_LIFETIME_S) if interval_s > shortest else shortest
        most = max(3, int(MAX_LIFETIME_S / self.interval_s))
        self.keep_alive = min(max(wanted.RequestedMaxKeepAliveCount, 1), max(1, most // 3))
        self.lifetime = min(max(wanted.RequestedLifetimeCount, 3 * self.keep_alive), most)
        self.most = min(wanted.MaxNotificationsPerPublish or MOST_NOTIFICATIONS, MOST_NOTIFICATIONS)
        self.priority: int = wanted.Priority
        self._unheard = 0

    def _start(self) -> None:
        loop = asyncio.get_running_loop()
        self._next = loop.time() + self.interval_s
        self._timer = loop.call_at(self._next, self._tick)

    def _tick(self) -> None:
        loop = asyncio.get_running_loop()
        # A loop that was held up does not make up for cycles it missed.
        self._next = max(self._next + self.interval_s, loop.time())
        self._timer = loop.call_at(self._next, self._tick)
        session = self.session
        if session is None or not session.publish_requests:
            self._unheard += 1
            if self._unheard >= self.lifetime:
                self.close()
                self._expired(self)
                return
        else:
            self._unheard = 0
        self._said_nothing += 1
        if self._first or self._has_news() or self._said_nothing >= self.keep_alive:
            self.late = True
            self.serve()

    def _has_news(self) -> bool:
        return bool(self._statuses) or (self.enabled and bool(self._ready))

    def serve(self) -> None:
        """Answer Publish requests as long as something is due and requests are there."""
        session = self.session
        while (
            self.late and session is not None and session.publish_requests and session.connection is not None
        ):
            self._answer(session.connection, session.publish_requests.popleft())

    def _answer(self, connection: Connection, request: PublishRequest) -> None:
        now = datetime.now(UTC)
        notifications = self._take()
        message = notification_encoding.notification_message(self._sequence, now, notifications)
        if notifications:
            self._sent[self._sequence] = message
            self._sequence = 1 if self._sequence == MAX_SEQUENCE else self._sequence + 1
            while len(self._sent) > RETRANSMITTED:
                self._sent.popitem(last=False)
        self.late = self._has_news()
        self._first = False
        self._said_nothing = self._unheard = 0
        body = notification_encoding.publish_response(
            request.handle, now, self.id, list(self._sent), message, request.results, more=self.late
        )
        connection.respond(request.request_id, request.handle, body)

    def _take(self) -> list[bytes]:
        taken: list[bytes] = []
        if self._statuses:
            taken.append(notification_encoding.status_change(self._statuses.pop(0)))
        if not self.enabled:
            return taken
        left = self.most
        data: list[tuple[int, bytes]] = []
        events: list[bytes] = []
        while self._ready and left > 0:
            number, item = next(iter(self._ready.items()))
            if isinstance(item, DataItem):
                found = item.take(left) if item.waiting else []
                data += found
                left -= len(found)
            else:
                told = item.take(left) if item.waiting else []
                events += told
                left -= len(told)
            if not item.waiting:
                del self._ready[number]
        if data:
            taken.append(notification_encoding.data_changes(data))
        if events:
            taken.append(notification_encoding.events(events))
        return taken

    def ready(self, item: Item) -> None:
        """Learn that an item has something to report."""
        if item.mode == ua.MonitoringMode.Reporting:
            self._ready[item.id] = item

    def next_item_id(self) -> int:
        """Give a number no other item of this subscription has or had.

        Raises
        ------
        FaultError
            BadTooManyMonitoredItems.
        """
        if len(self.items) >= self._limits.items_per_subscription:
            raise FaultError(ua.StatusCodes.BadTooManyMonitoredItems)
        self._last_item += 1
        return self._last_item

    def item(self, number: int) -> Item:
        """Find a monitored item.

        Raises
        ------
        FaultError
            BadMonitoredItemIdInvalid.
        """
        found = self.items.get(number)
        if found is None:
            raise FaultError(ua.StatusCodes.BadMonitoredItemIdInvalid)
        return found

    def remove(self, number: int) -> None:
        """Take an item out."""
        item = self.item(number)
        item.close()
        self._ready.pop(number, None)
        del self.items[number]

    def acknowledge(self, sequence: int) -> int:
        """Forget a message the client has; the status code of the acknowledgement."""
        if self._sent.pop(sequence, None) is None:
            return int(ua.StatusCodes.BadSequenceNumberUnknown)
        return int(ua.StatusCodes.Good)

    def message(self, sequence: int) -> bytes:
        """Find a message that was sent and not acknowledged.

        Raises
        ------
        FaultError
            BadMessageNotAvailable.
        """
        found = self._sent.get(sequence)
        if found is None:
            raise FaultError(ua.StatusCodes.BadMessageNotAvailable)
        self._unheard = 0
        return found

    def available(self) -> list[int]:
        """Sequence numbers that can be sent again."""
        return list(self._sent)

    def move(self, session: Session, *, initial: bool) -> None:
        """Belong to another session; with `initial` every data item reports its present value again."""
        old = self.session
        if old is not None and old is not session and old.publish_requests and old.connection is not None:
            now = datetime.now(UTC)
            request = old.publish_requests.popleft()
            parts = [notification_encoding.status_change(ua.StatusCodes.GoodSubscriptionTransferred)]
            message = notification_encoding.notification_message(self._sequence, now, parts)
            body = notification_encoding.publish_response(
                request.handle, now, self.id, [], message, request.results, more=False
            )
            old.connection.respond(request.request_id, request.handle, body)
        self.session = session
        self._unheard = 0
        if initial:
            for item in self.items.values():
                if (
                    isinstance(item, DataItem)
                    and item.mode == ua.MonitoringMode.Reporting
                    and not item.waiting
                ):
                    item.offer_present()

    def close(self) -> None:
        """End: no further cycle, no item."""
        if self._timer is not None:
            self._timer.cancel()
        for item in self.items.values():
            item.close()
        self.items.clear()
        self._ready.clear()
        self._sent.clear()
