"""What the monitored items of one subscription have to report, message by message."""

from collections import OrderedDict
from typing import Final

from impactcell.opcua.subscriptions import notification_encoding
from impactcell.opcua.subscriptions.monitored_item import DataMonitoredItem, EventMonitoredItem

MonitoredItem = DataMonitoredItem | EventMonitoredItem

MAX_NOTIFICATIONS: Final = 200
"""Notifications in one message, where the client sets no lower limit: some 2 ms if none is encoded yet."""
MAX_MESSAGE_BYTES: Final = 64 * 1024
"""Length of a message at which no further notification goes into it, bytes: half a millisecond to encrypt."""


class ReadyItems:
    """Items that have something to report, the first that had it first."""

    def __init__(self) -> None:
        self._items: OrderedDict[int, MonitoredItem] = OrderedDict()

    def __bool__(self) -> bool:
        return bool(self._items)

    def add(self, item: MonitoredItem) -> None:
        """Let an item report."""
        self._items[item.id] = item

    def discard(self, number: int) -> None:
        """Let an item report nothing."""
        self._items.pop(number, None)

    def clear(self) -> None:
        """Let no item report anything."""
        self._items.clear()

    def fit_one_message(self, max_notifications: int) -> bool:
        """Whether one message of so many notifications tells all of it, unless its length ends it before."""
        few = len(self._items) <= max_notifications  # most have one or more: a short way to no
        return few and sum(item.waiting for item in self._items.values()) <= max_notifications

    def take(self, max_notifications: int) -> list[bytes]:
        """Take what one message holds, encoded: data changes, and events.

        It ends, as an item that is asked for its notifications gives one at least.
        """
        room, room_bytes = max_notifications, MAX_MESSAGE_BYTES
        data = list[tuple[int, bytes]]()
        events = list[bytes]()
        while self._items and room > 0 and room_bytes > 0:
            number, item = next(iter(self._items.items()))
            if isinstance(item, DataMonitoredItem):
                values = item.take(room, room_bytes) if item.waiting else []
                data += values
                room -= len(values)
                room_bytes -= sum(len(value) for _, value in values)
            else:
                told = item.take(room, room_bytes) if item.waiting else []
                events += told
                room -= len(told)
                room_bytes -= sum(map(len, told))
            if not item.waiting:
                del self._items[number]
        parts = [notification_encoding.data_changes(data)] if data else []
        return [*parts, notification_encoding.events(events)] if events else parts
