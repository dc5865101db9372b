"""Stored values and aggregates as HistoryData, put together without an object for each (Part 6, 5.2)."""

import struct
from collections.abc import Iterable
from typing import Final

from asyncua import ua

from impactcell.opcua.history.history_aggregates import AggregateValue
from impactcell.opcua.host_interface import HistoricalValue

HISTORY_DATA: Final = ua.NodeId(ua.ObjectIds.HistoryData_Encoding_DefaultBinary)
TICK_NS: Final = 100
"""Unit of a DateTime, nanoseconds (Part 6, 5.2.2.5)."""
TICKS_TO_1970: Final = 116_444_736_000_000_000
"""From 1601, where a DateTime begins, to 1970."""
_COUNT: Final = struct.Struct("<i")
_VALUE_BIT, _STATUS_BIT, _SOURCE_BIT, _SERVER_BIT = 1, 2, 4, 8
"""Bits of a DataValue's mask that say what follows (Part 6, 5.2.2.17)."""


class DataValueEncoder:
    """Encodes the DataValues of one answer.

    Parameters
    ----------
    timestamps : TimestampsToReturn
    is_count : bool
        Whether values are Int32, as those of Count, and not Double.
    """

    def __init__(self, timestamps: ua.TimestampsToReturn, *, is_count: bool = False) -> None:
        source = timestamps in (ua.TimestampsToReturn.Source, ua.TimestampsToReturn.Both)
        server = timestamps in (ua.TimestampsToReturn.Server, ua.TimestampsToReturn.Both)
        self._times = source + server
        mask = _STATUS_BIT | (_SOURCE_BIT if source else 0) | (_SERVER_BIT if server else 0)
        kind = ua.VariantType.Int32 if is_count else ua.VariantType.Double
        self._head = bytes((mask | _VALUE_BIT, kind.value))
        self._empty_head = bytes((mask,))
        times = "q" * self._times
        self._tail = struct.Struct(f"<{'i' if is_count else 'd'}I{times}")
        self._empty_tail = struct.Struct(f"<I{times}")

    def encode(self, value: HistoricalValue | AggregateValue) -> bytes:
        """Encode one value; its time is that of source and server."""
        times = (value.time_ns // TICK_NS + TICKS_TO_1970,) * self._times
        if value.value is None:
            return self._empty_head + self._empty_tail.pack(value.status, *times)
        return self._head + self._tail.pack(value.value, value.status, *times)


def history_data(values: Iterable[bytes]) -> ua.ExtensionObject:
    """Make a HistoryData of encoded DataValues."""
    parts = tuple(values)
    return ua.ExtensionObject(HISTORY_DATA, b"".join((_COUNT.pack(len(parts)), *parts)))
