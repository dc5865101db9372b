"""Monitored items: what waits to be told to a subscriber.

Mended: asyncua drops from a full queue without the overflow bit, ignores discardOldest, queues nothing
while an item only samples, and looks through all items to find one.
"""

from collections import deque
from typing import Any, Final, Protocol

from asyncua import ua

from impactcell.opcua.address_space.node_references import read_attribute
from impactcell.opcua.address_space.variable_store import SharedValue, VariableStore
from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError, encode
from impactcell.opcua.event_notification import EventNotification
from impactcell.opcua.filters.data_change_filter import DataChangeFilter, change_filter, cut, parse_range
from impactcell.opcua.filters.event_filter import EventFilter
from impactcell.opcua.host_interface import ServerLimits

OVERFLOW: Final = 0x0480
"""Bits of a status code: it describes a DataValue, and values before it were lost."""
MIN_EVENT_QUEUE: Final = 100
"""Shortest queue of an event item: a refresh of a few cells fits."""
MAX_EVENT_BYTES: Final = 256 * 1024
"""Longest queue of an event item, bytes."""
OVERFLOW_EVENT: Final = ua.NodeId(ua.ObjectIds.EventQueueOverflowEventType)


class ItemOwner(Protocol):
    """The subscription of an item."""

    def ready(self, item: Any) -> None:
        """Learn that an item has something to report."""

    def translated(self, variant: Any) -> Any:
        """Give a value in the language of the session."""


def with_overflow(data: ua.DataValue) -> ua.DataValue:
    """Mark a value as the first after lost ones."""
    code = data.StatusCode.value if data.StatusCode is not None else 0
    return ua.DataValue(
        data.Value, ua.StatusCode(code | OVERFLOW), data.SourceTimestamp, data.ServerTimestamp
    )


class DataMonitoredItem:
    """Reports the values of one attribute."""

    def __init__(
        self,
        item_id: int,
        request: ua.MonitoredItemCreateRequest,
        timestamps: ua.TimestampsToReturn,
        space: AddressSpace,
        values: VariableStore,
        limits: ServerLimits,
        owner: ItemOwner,
    ) -> None:
        target = request.ItemToMonitor
        self.id = item_id
        self._node, self._attribute = target.NodeId, target.AttributeId
        self._values, self._space, self._limits, self._owner = values, space, limits, owner
        self._range = parse_range(target.IndexRange)
        self._queue: deque[SharedValue] = deque()
        self.mode = request.MonitoringMode
        self._configure(request.RequestedParameters, timestamps)
        if self._attribute == ua.AttributeIds.Value:
            values.add_observer(self._node, self.offer)
        if self.mode != ua.MonitoringMode.Disabled:
            self.offer_present()

    def _configure(self, parameters: ua.MonitoringParameters, timestamps: ua.TimestampsToReturn) -> None:
        self._filter: DataChangeFilter = change_filter(
            self._space, self._node, self._attribute, parameters.Filter
        )
        self.handle: int = parameters.ClientHandle
        self._timestamps = timestamps
        self.size = min(max(parameters.QueueSize, 1), self._limits.queue_per_item)
        self._discard_oldest: bool = parameters.DiscardOldest

    def modify(self, parameters: ua.MonitoringParameters, timestamps: ua.TimestampsToReturn) -> None:
        """Change filter, queue and handle; values that wait stay, as far as the queue holds them."""
        self._configure(parameters, timestamps)
        self.shorten(self.size)

    def shorten(self, size: int) -> None:
        """Have a queue of no more than this length."""
        self.size = min(self.size, size)
        while len(self._queue) > self.size:
            self._queue.popleft()

    @property
    def revised(self) -> tuple[int, Any]:
        """Size of the queue and result of the filter, as the client is told."""
        return self.size, None

    def offer_present(self) -> None:
        """Report the present value, whatever was reported before."""
        self._filter = self._filter.fresh()
        self.offer(SharedValue(self._space.read_attribute_value(self._node, self._attribute)))

    def offer(self, value: SharedValue) -> None:
        """Take in a value that was written."""
        if self.mode == ua.MonitoringMode.Disabled:
            return
        if self._range is not None:
            value = SharedValue(cut(value.data, self._range))
        value = self._translated(value)
        if not self._filter.passes(value.data):
            return
        queue = self._queue
        if len(queue) >= self.size:
            if self._discard_oldest or self.size == 1:
                queue.popleft()
                queue.append(value)
                if self.size > 1:
                    queue[0] = SharedValue(with_overflow(queue[0].data))
            else:
                queue[-1] = SharedValue(with_overflow(value.data))
        else:
            queue.append(value)
        self._owner.ready(self)

    def _translated(self, value: SharedValue) -> SharedValue:
        data = value.data
        variant = self._owner.translated(data.Value)
        if variant is data.Value:
            return value
        return SharedValue(ua.DataValue(variant, data.StatusCode, data.SourceTimestamp, data.ServerTimestamp))

    @property
    def waiting(self) -> int:
        """Number of values that wait to be reported."""
        return len(self._queue) if self.mode == ua.MonitoringMode.Reporting else 0

    def take(self, max_count: int, max_bytes: int) -> list[tuple[int, bytes]]:
        """Take values, encoded, with the client's handle: so many, and none after so many bytes."""
        taken = list[tuple[int, bytes]]()
        while self._queue and len(taken) < max_count and max_bytes > 0:
            encoded = self._queue.popleft().encoded(self._timestamps)
            taken.append((self.handle, encoded))
            max_bytes -= len(encoded)
        return taken

    def set_mode(self, mode: ua.MonitoringMode) -> None:
        """Report, only sample, or do nothing."""
        before, self.mode = self.mode, mode
        if mode == ua.MonitoringMode.Disabled:
            self._queue.clear()
        elif before == ua.MonitoringMode.Disabled:
            self.offer_present()
        if self.waiting:
            self._owner.ready(self)

    def close(self) -> None:
        """Watch no longer; what is still on its way does not arrive."""
        self.mode = ua.MonitoringMode.Disabled
        if self._attribute == ua.AttributeIds.Value:
            self._values.remove_observer(self._node, self.offer)
        self._queue.clear()


class EventMonitoredItem:
    """Reports the events of one notifier."""

    def __init__(
        self,
        item_id: int,
        request: ua.MonitoredItemCreateRequest,
        space: AddressSpace,
        limits: ServerLimits,
        owner: ItemOwner,
    ) -> None:
        self.id = item_id
        self.notifier = request.ItemToMonitor.NodeId
        self._space, self._limits, self._owner = space, limits, owner
        notifies = read_attribute(space, self.notifier, ua.AttributeIds.EventNotifier)
        if notifies is None or not notifies & ua.EventNotifier.SubscribeToEvents.mask:
            raise StatusCodeError(ua.StatusCodes.BadAttributeIdInvalid)
        self._queue: deque[bytes] = deque()
        self._bytes = 0
        self._overflowed = False
        self.mode = request.MonitoringMode
        self._configure(request.RequestedParameters)

    def _configure(self, parameters: ua.MonitoringParameters) -> None:
        self._filter = EventFilter(self._space, parameters.Filter)
        self.handle: int = parameters.ClientHandle
        size = parameters.QueueSize or self._limits.events_per_item
        self._size = min(max(size, MIN_EVENT_QUEUE), self._limits.events_per_item)

    def modify(self, parameters: ua.MonitoringParameters, _timestamps: ua.TimestampsToReturn) -> None:
        """Change filter, queue and handle."""
        self._configure(parameters)

    @property
    def revised(self) -> tuple[int, Any]:
        """Size of the queue and result of the filter, as the client is told."""
        return self._size, self._filter.result

    def offer(self, event: EventNotification) -> None:
        """Take in an event."""
        if self.mode == ua.MonitoringMode.Disabled or not self._filter.passes(event):
            return
        encoded = self._encode(event)
        if self._is_full(len(encoded)):
            self._lose_oldest()
            while len(self._queue) > 1 and self._is_full(len(encoded)):
                self._bytes -= len(self._queue[1])
                del self._queue[1]
        self._queue.append(encoded)
        self._bytes += len(encoded)
        self._owner.ready(self)

    def _is_full(self, more_bytes: int) -> bool:
        return len(self._queue) >= self._size or self._bytes + more_bytes > MAX_EVENT_BYTES

    def _lose_oldest(self) -> None:
        """Let one event that tells of the loss stand where the first lost one stood."""
        if self._overflowed or not self._queue:
            return
        self._overflowed = True
        self._bytes -= len(self._queue.popleft())
        overflow = self._encode(EventNotification(OVERFLOW_EVENT, overflow_event_fields(), frozenset()))
        self._queue.appendleft(overflow)
        self._bytes += len(overflow)

    def _encode(self, event: EventNotification) -> bytes:
        fields = self._filter.select(event)
        fields.ClientHandle = self.handle
        fields.EventFields = [self._owner.translated(field) for field in fields.EventFields]
        return encode(fields)

    @property
    def waiting(self) -> int:
        """Number of events that wait to be reported."""
        return len(self._queue) if self.mode == ua.MonitoringMode.Reporting else 0

    def take(self, max_count: int, max_bytes: int) -> list[bytes]:
        """Take events, encoded: so many, and none after so many bytes."""
        notifications = list[bytes]()
        while self._queue and len(notifications) < max_count and max_bytes > 0:
            notifications.append(self._queue.popleft())
            max_bytes -= len(notifications[-1])
        self._bytes -= sum(map(len, notifications))
        self._overflowed = self._overflowed and bool(self._queue)
        return notifications

    def set_mode(self, mode: ua.MonitoringMode) -> None:
        """Report, only collect, or do nothing."""
        self.mode = mode
        if mode == ua.MonitoringMode.Disabled:
            self._queue.clear()
            self._bytes = 0
        if self.waiting:
            self._owner.ready(self)

    def close(self) -> None:
        """Forget what waits; what is still on its way does not arrive."""
        self.mode = ua.MonitoringMode.Disabled
        self._queue.clear()


def overflow_event_fields() -> dict[tuple[str, ...], ua.Variant]:
    """Fields of the event that tells that others were lost."""
    return {
        ("EventType",): ua.Variant(OVERFLOW_EVENT, ua.VariantType.NodeId),
        ("SourceNode",): ua.Variant(ua.NodeId(ua.ObjectIds.Server), ua.VariantType.NodeId),
        ("SourceName",): ua.Variant("Server", ua.VariantType.String),
        ("Message",): ua.Variant(ua.LocalizedText("Events were lost."), ua.VariantType.LocalizedText),
        ("Severity",): ua.Variant(500, ua.VariantType.UInt16),
    }
