"""One subscription: publishing cycles, keep-alives, retransmission (Part 4, 5.14).

Mended: asyncua throws away what it sends again on Republish and answers with an empty message where it has
nothing, which is why a client falls silent for good after its connection was reset; its lifetime runs only
while there is something to say, it never sends MoreNotifications, and it acknowledges sequence numbers it
never gave.
"""

import asyncio
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any, Final

from asyncua import ua

from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.host_interface import ServerLimits
from impactcell.opcua.languages import Languages
from impactcell.opcua.loop_share import LoopShare
from impactcell.opcua.sessions.session_table import PublishRequest, Session
from impactcell.opcua.subscriptions import notification_encoding
from impactcell.opcua.subscriptions.monitored_item import DataMonitoredItem
from impactcell.opcua.subscriptions.ready_items import MAX_NOTIFICATIONS, MonitoredItem, ReadyItems
from impactcell.opcua.subscriptions.retransmission_queue import RetransmissionQueue
from impactcell.opcua.transport.tcp_connection import TcpConnection

QUEUED_VALUES: Final = 100_000
"""Room in the queues of all data items of one subscription; beyond it a queue holds one value."""
MAX_LIFETIME_S: Final = 3_600.0
"""Longest a subscription lives unheard, seconds."""
MAX_SEQUENCE_NUMBER: Final = 2**32 - 1
"""After it comes 1 (Part 4, 7.9)."""


class Subscription:
    """What one client wants to hear of, and what it has been told."""

    def __init__(
        self,
        number: int,
        session: Session,
        parameters: ua.CreateSubscriptionParameters,
        limits: ServerLimits,
        languages: Languages,
        expired: Callable[[Any], None],
    ) -> None:
        self.id = number
        self.session: Session | None = session
        self.owner = session.actor.user if session.actor is not None else ""
        self.items: dict[int, MonitoredItem] = {}
        self.enabled: bool = parameters.PublishingEnabled
        self.late = False
        self._limits = limits
        self._languages = languages
        self._expired = expired
        self._ready_items = ReadyItems()
        self._is_in_line = False
        self._status_changes: list[int] = []
        self._unacknowledged = RetransmissionQueue()
        self._granted = 0
        self._is_closed = False
        self._next_sequence_number = 1
        self._keep_alive_counter = 0
        self._lifetime_counter = 0
        self._first = True
        self._last_item = 0
        self._timer: asyncio.TimerHandle | None = None
        self._next = 0.0
        self.configure(parameters)
        self._start()

    def configure(
        self, parameters: ua.CreateSubscriptionParameters | ua.ModifySubscriptionParameters
    ) -> None:
        """Settle the interval and the counts."""
        shortest = self._limits.publishing_interval_s
        interval_s = parameters.RequestedPublishingInterval / 1e3
        # NaN and everything below become the shortest.
        self.interval_s = min(interval_s, MAX_LIFETIME_S) if interval_s > shortest else shortest
        max_lifetime_count = max(3, int(MAX_LIFETIME_S / self.interval_s))
        self.max_keep_alive_count = min(
            max(parameters.RequestedMaxKeepAliveCount, 1), max(1, max_lifetime_count // 3)
        )
        self.lifetime_count = min(
            max(parameters.RequestedLifetimeCount, 3 * self.max_keep_alive_count), max_lifetime_count
        )
        self.max_notifications = min(
            parameters.MaxNotificationsPerPublish or MAX_NOTIFICATIONS, MAX_NOTIFICATIONS
        )
        self.priority: int = parameters.Priority
        self._lifetime_counter = 0

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
            self._lifetime_counter += 1
            if self._lifetime_counter >= self.lifetime_count:
                self._expired(self)
                return
        else:
            self._lifetime_counter = 0
        self._keep_alive_counter += 1
        if self._first or self._has_news() or self._keep_alive_counter >= self.max_keep_alive_count:
            self.late = True
            self.serve()

    def _has_news(self) -> bool:
        return bool(self._status_changes) or (self.enabled and bool(self._ready_items))

    def serve(self) -> None:
        """Answer Publish requests as long as something is due and requests are there.

        What fits one message is told at once. For each message of more the subscription waits for a turn.
        """
        if self._is_in_line:
            return
        if self._ready_items.fit_one_message(self.max_notifications):
            self._answer()
        self._stand_in_line()

    def _stand_in_line(self) -> None:
        connection = self._listener()
        if connection is not None:
            self._is_in_line = True
            connection.share.turns.call(self._take_turn)

    def _take_turn(self) -> None:
        self._is_in_line = False
        self._answer()
        self._stand_in_line()

    def _answer(self) -> None:
        connection = self._listener()
        if connection is not None and self.session is not None:
            self._respond(connection, self.session.publish_requests.popleft())

    def _listener(self) -> TcpConnection | None:
        """Find who waits for something that is due."""
        session = self.session
        return session.connection if session and self.late and session.publish_requests else None

    def _respond(self, connection: TcpConnection, request: PublishRequest) -> None:
        now = datetime.now(UTC)
        notifications = self._take_notifications()
        message = notification_encoding.notification_message(self._next_sequence_number, now, notifications)
        if notifications:
            self._unacknowledged.keep(self._next_sequence_number, message)
            self._next_sequence_number = (
                1 if self._next_sequence_number == MAX_SEQUENCE_NUMBER else self._next_sequence_number + 1
            )
        self.late = self._has_news()
        self._first = False
        self._keep_alive_counter = self._lifetime_counter = 0
        body = notification_encoding.publish_response(
            request.handle,
            now,
            self.id,
            self._unacknowledged.sequence_numbers(),
            message,
            request.results,
            more=self.late,
        )
        connection.respond(request.request_id, request.handle, body)

    def _take_notifications(self) -> list[bytes]:
        notifications: list[bytes] = []
        if self._status_changes:
            notifications.append(notification_encoding.status_change(self._status_changes.pop(0)))
        return notifications + (self._ready_items.take(self.max_notifications) if self.enabled else [])

    def translated(self, variant: Any) -> Any:
        """Give a value in the language of the session."""
        session = self.session
        return variant if session is None else self._languages.variant(variant, session.language)

    def ready(self, item: MonitoredItem) -> None:
        """Learn that an item has something to report."""
        if item.mode == ua.MonitoringMode.Reporting:
            self._ready_items.add(item)

    def next_item_id(self) -> int:
        """Give a number no other item of this subscription has or had.

        Raises
        ------
        StatusCodeError
            BadTooManyMonitoredItems.
        """
        if len(self.items) >= self._limits.items_per_subscription:
            raise StatusCodeError(ua.StatusCodes.BadTooManyMonitoredItems)
        self._last_item += 1
        return self._last_item

    def check_open(self) -> None:
        """See that the subscription has not ended while a request to it was carried out.

        Raises
        ------
        StatusCodeError
            BadSubscriptionIdInvalid.
        """
        if self._is_closed:
            raise StatusCodeError(ua.StatusCodes.BadSubscriptionIdInvalid)

    def grant_queue(self, item: MonitoredItem, before: int = 0) -> None:
        """Shorten the queue of a data item that is new, or had another length, to the room there is."""
        if isinstance(item, DataMonitoredItem):
            self._granted -= before
            item.shorten(max(QUEUED_VALUES - self._granted, 1))
            self._granted += item.size

    def item(self, number: int) -> MonitoredItem:
        """Find a monitored item.

        Raises
        ------
        StatusCodeError
            BadMonitoredItemIdInvalid.
        """
        item = self.items.get(number)
        if item is None:
            raise StatusCodeError(ua.StatusCodes.BadMonitoredItemIdInvalid)
        return item

    def remove(self, number: int) -> None:
        """Take an item out."""
        item = self.item(number)
        if isinstance(item, DataMonitoredItem):
            self._granted -= item.size
        item.close()
        self._ready_items.discard(number)
        del self.items[number]

    def acknowledge(self, sequence: int) -> int:
        """Forget a message the client has; the status code of the acknowledgement."""
        known = self._unacknowledged.acknowledge(sequence)
        return int(ua.StatusCodes.Good if known else ua.StatusCodes.BadSequenceNumberUnknown)

    def message(self, sequence: int) -> bytes:
        """Find a message that was sent and not acknowledged.

        Raises
        ------
        StatusCodeError
            BadMessageNotAvailable.
        """
        message = self._unacknowledged.message(sequence)
        if message is None:
            raise StatusCodeError(ua.StatusCodes.BadMessageNotAvailable)
        self._lifetime_counter = 0
        return message

    def available_sequence_numbers(self) -> list[int]:
        """Sequence numbers that can be sent again."""
        return self._unacknowledged.sequence_numbers()

    def move(self, session: Session) -> None:
        """Belong to another session."""
        old = self.session
        if old is not None and old is not session and old.publish_requests and old.connection is not None:
            now = datetime.now(UTC)
            request = old.publish_requests.popleft()
            parts = [notification_encoding.status_change(ua.StatusCodes.GoodSubscriptionTransferred)]
            message = notification_encoding.notification_message(self._next_sequence_number, now, parts)
            body = notification_encoding.publish_response(
                request.handle, now, self.id, [], message, request.results, more=False
            )
            old.connection.respond(request.request_id, request.handle, body)
        self.session = session
        self._lifetime_counter = 0

    async def repeat_values(self, share: LoopShare) -> None:
        """Let every data item of which nothing waits report its present value again."""

        def repeat(item: MonitoredItem) -> None:
            is_reporting = item.mode == ua.MonitoringMode.Reporting
            if isinstance(item, DataMonitoredItem) and is_reporting and not item.waiting:
                item.offer_present()

        await share.each(tuple(self.items.values()), repeat)

    def close(self) -> list[MonitoredItem]:
        """End: no further cycle, no item; the items, which are still to be closed."""
        self._is_closed, self.session = True, None
        if self._timer is not None:
            self._timer.cancel()
        items = list(self.items.values())
        self.items.clear()
        self._ready_items.clear()
        self._unacknowledged = RetransmissionQueue()
        return items
