"""Values of variables as they are now, and who is told when they change."""

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final

from asyncua import ua
from asyncua.server.address_space import AddressSpace
from asyncua.ua.ua_binary import struct_to_binary

from impactcell.records import Quality

GOOD: Final = ua.StatusCode(ua.StatusCodes.Good)
UNCERTAIN: Final = ua.StatusCode(ua.StatusCodes.Uncertain)
BAD: Final = ua.StatusCode(ua.StatusCodes.Bad)
NO_COMMUNICATION: Final = ua.StatusCode(ua.StatusCodes.BadNoCommunication)
LAST_USABLE: Final = ua.StatusCode(ua.StatusCodes.UncertainNoCommunicationLastUsableValue)
WAITING: Final = ua.StatusCode(ua.StatusCodes.BadWaitingForInitialData)

STATUS: Final = {Quality.GOOD: GOOD, Quality.UNCERTAIN: UNCERTAIN, Quality.BAD: BAD}


def moment(time_ns: int) -> datetime:
    """UTC time of nanoseconds since 1970; OPC UA keeps 100 ns, Python's datetime 1 µs."""
    seconds, rest = divmod(time_ns, 1_000_000_000)
    return datetime.fromtimestamp(seconds, UTC).replace(microsecond=rest // 1000)


def nanoseconds(time: datetime) -> int:
    """Nanoseconds since 1970 of a time; without a zone it is UTC, as OPC UA sends it."""
    aware = time if time.tzinfo is not None else time.replace(tzinfo=UTC)
    since = aware - datetime(1970, 1, 1, tzinfo=UTC)
    return ((since.days * 86_400 + since.seconds) * 1_000_000 + since.microseconds) * 1_000


class Sample:
    """A value that was written once and goes out to many: each form of it is encoded once.

    asyncua encodes, and deep-copies, a value again for every monitored item that reports it.
    """

    __slots__ = ("_encoded", "data")

    def __init__(self, data: ua.DataValue) -> None:
        self.data = data
        self._encoded: dict[ua.TimestampsToReturn, bytes] = {}

    def encoded(self, timestamps: ua.TimestampsToReturn) -> bytes:
        """Binary form with the timestamps that were asked for."""
        found = self._encoded.get(timestamps)
        if found is None:
            found = self._encoded[timestamps] = struct_to_binary(with_timestamps(self.data, timestamps))
        return found


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


Watcher = Callable[[Sample], None]


class Values:
    """The one way a variable is written once the server runs.

    asyncua sets the value of a variable with a Bad status to null. Here it is kept: an operator wants to
    see the last value, marked as what it is.
    """

    def __init__(self, space: AddressSpace) -> None:
        self._space = space
        self._watchers: dict[ua.NodeId, list[Watcher]] = {}

    def read(self, node: ua.NodeId) -> ua.DataValue:
        """Present value of a variable."""
        return self._space.read_attribute_value(node, ua.AttributeIds.Value)

    def write(self, node: ua.NodeId, data: ua.DataValue) -> None:
        """Replace the value and tell all who watch it."""
        self._space[node].attributes[ua.AttributeIds.Value].value = data
        watchers = self._watchers.get(node)
        if watchers:
            sample = Sample(data)
            for watcher in tuple(watchers):
                watcher(sample)

    def put(
        self,
        node: ua.NodeId,
        value: object,
        kind: ua.VariantType,
        time: datetime,
        status: ua.StatusCode = GOOD,
    ) -> None:
        """Replace value, status and source timestamp."""
        self.write(node, ua.DataValue(ua.Variant(value, kind), status, time, datetime.now(UTC)))

    def restate(self, node: ua.NodeId, status: ua.StatusCode, time: datetime) -> None:
        """Replace the status and keep the last value; do nothing where the status is the same."""
        data = self.read(node)
        if data.StatusCode != status:
            self.write(node, ua.DataValue(data.Value, status, time, datetime.now(UTC)))

    def watch(self, node: ua.NodeId, watcher: Watcher) -> None:
        """Call `watcher` with every value written from now on."""
        self._watchers.setdefault(node, []).append(watcher)

    def unwatch(self, node: ua.NodeId, watcher: Watcher) -> None:
        """Undo `watch`."""
        watchers = self._watchers.get(node, [])
        if watcher in watchers:
            watchers.remove(watcher)
        if not watchers:
            self._watchers.pop(node, None)
