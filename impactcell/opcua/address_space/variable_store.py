"""Values of variables as they are now, and who is told when they change."""

import logging
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace, AttributeValue, struct_to_binary
from impactcell.opcua.binary_codec import encoding_fault
from impactcell.opcua.fan_out import FanOut

GOOD: Final = ua.StatusCode(ua.StatusCodes.Good)
NOT_ENCODABLE: Final = ua.StatusCode(ua.StatusCodes.BadEncodingError)
"""Of a variable whose value cannot be sent."""
_log = logging.getLogger(__name__)


RASTER_NS: Final = 1_000
"""Raster of all times that are told, nanoseconds: OPC UA keeps 100 ns, Python's datetime 1 µs."""


def moment(time_ns: int) -> datetime:
    """UTC time of nanoseconds since 1970, on the raster."""
    seconds, rest = divmod(time_ns, 1_000_000_000)
    return datetime.fromtimestamp(seconds, UTC).replace(microsecond=rest // RASTER_NS)


def nanoseconds(time: datetime) -> int:
    """Nanoseconds since 1970 of a time; without a zone it is UTC, as OPC UA sends it."""
    aware = time if time.tzinfo is not None else time.replace(tzinfo=UTC)
    since = aware - datetime(1970, 1, 1, tzinfo=UTC)
    return ((since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds) * 1_000


class SharedValue:
    """A value that was written once and goes out to many: each form of it is encoded once.

    asyncua encodes, and deep-copies, a value again for every monitored item that reports it.
    """

    __slots__ = ("_encoded", "data")

    def __init__(self, data: ua.DataValue) -> None:
        self.data = data
        self._encoded: dict[ua.TimestampsToReturn, bytes] = {}

    def encoded(self, timestamps: ua.TimestampsToReturn) -> bytes:
        """Binary form with the timestamps that were asked for."""
        encoding = self._encoded.get(timestamps)
        if encoding is None:
            encoding = self._encoded[timestamps] = struct_to_binary(with_timestamps(self.data, timestamps))
        return encoding


def with_timestamps(data: ua.DataValue, timestamps: ua.TimestampsToReturn) -> ua.DataValue:
    """Copy a value with only the timestamps that were asked for."""
    source = timestamps in (ua.TimestampsToReturn.Source, ua.TimestampsToReturn.Both)
    server = timestamps in (ua.TimestampsToReturn.Server, ua.TimestampsToReturn.Both)
    return ua.DataValue(
        Value=data.Value,
        StatusCode=data.StatusCode,
        SourceTimestamp=data.SourceTimestamp if source else None,
        ServerTimestamp=(data.ServerTimestamp or datetime.now(UTC)) if server else None,
    )


ValueObserver = Callable[[SharedValue], None]


class StoredVariable:
    """A variable that is written often: its place in the address space need not be looked up each time.

    A value that cannot be sent gets no farther than here: it would take others along, of the same message or
    request. The variable keeps the one before and is Bad, which the log tells once.
    """

    __slots__ = ("_attribute", "_fan_out", "_node", "observers")

    def __init__(self, node: ua.NodeId, attribute: AttributeValue, fan_out: FanOut) -> None:
        self._node = node
        self._attribute = attribute
        self._fan_out = fan_out
        self.observers: dict[ValueObserver, None] = {}

    @property
    def data(self) -> ua.DataValue:
        """Present value."""
        return self._attribute.value

    def write(self, data: ua.DataValue) -> None:
        """Replace the value and tell all who watch it."""
        if data.Value is not None and (fault := encoding_fault(data.Value)):
            data = self._not_encodable(data, fault)
        self._attribute.value = data
        if self.observers:
            self._fan_out.deliver(self.observers, SharedValue(data))

    def _not_encodable(self, data: ua.DataValue, fault: str) -> ua.DataValue:
        before = self.data
        if before.StatusCode != NOT_ENCODABLE:
            name = self._node.Identifier
            _log.error("%s: %s; the node is Bad until it has a value that can be sent", name, fault)
        return ua.DataValue(before.Value, NOT_ENCODABLE, data.SourceTimestamp, data.ServerTimestamp)

    def set_status(self, status: ua.StatusCode, time: datetime) -> None:
        """Replace the status and keep the last value; do nothing where the status is the same."""
        data = self.data
        if data.StatusCode != status:
            self.write(ua.DataValue(data.Value, status, time, datetime.now(UTC)))


class VariableStore:
    """The one way a variable is written once the server runs.

    asyncua sets the value of a variable with a Bad status to null. Here it is kept: an operator wants to
    see the last value, marked as what it is.
    """

    def __init__(self, space: AddressSpace) -> None:
        self._space = space
        self._fan_out = FanOut()
        self._variables: dict[ua.NodeId, StoredVariable] = {}

    def variable(self, node: ua.NodeId) -> StoredVariable:
        """Find a variable."""
        stored = self._variables.get(node)
        if stored is None:
            attribute = self._space[node].attributes[ua.AttributeIds.Value]
            stored = self._variables[node] = StoredVariable(node, attribute, self._fan_out)
        return stored

    def write(self, node: ua.NodeId, data: ua.DataValue) -> None:
        """Replace the value and tell all who watch it."""
        self.variable(node).write(data)

    def set_value(self, node: ua.NodeId, value: object, kind: ua.VariantType, time: datetime) -> None:
        """Replace value and source timestamp; the status is Good."""
        self.write(node, ua.DataValue(ua.Variant(value, kind), GOOD, time, datetime.now(UTC)))

    def add_observer(self, node: ua.NodeId, observer: ValueObserver) -> None:
        """Call `observer` with every value written from now on."""
        self.variable(node).observers[observer] = None

    def remove_observer(self, node: ua.NodeId, observer: ValueObserver) -> None:
        """Undo `add_observer`."""
        self.variable(node).observers.pop(observer, None)
