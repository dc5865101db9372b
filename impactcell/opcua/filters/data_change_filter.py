"""Whether a new value is worth a notification: triggers, deadbands, index ranges (Part 4, 7.22.2 and 7.27).

Mended: asyncua measures a deadband from the last sample, so that a slow drift is never reported; it does not
know percent deadbands, takes NaN for a change every time, and ignores index ranges.
"""

import math
from typing import Any, Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace, DecodedDataChangeFilter
from impactcell.opcua.binary_codec import StatusCodeError

_NUMBERS: Final = (
    "SByte",
    "Byte",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Float",
    "Double",
)
MAX_DIGITS: Final = 10
"""Longest number of an index range: it is a UInt32 (Part 4, 7.27)."""
NUMERIC: Final = frozenset(ua.VariantType[name] for name in _NUMBERS)


def same(first: Any, second: Any) -> bool:
    """Compare two values; a NaN equals a NaN."""
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(same, first, second))
    if isinstance(first, float) and isinstance(second, float) and math.isnan(first):
        return math.isnan(second)
    return bool(first == second)


class DataChangeFilter:
    """Decides which values of one monitored item are reported."""

    __slots__ = ("_deadband", "_last", "_trigger")

    def __init__(self, trigger: ua.DataChangeTrigger, deadband: float) -> None:
        self._trigger = trigger
        self._deadband = deadband
        self._last: ua.DataValue | None = None

    def fresh(self) -> "DataChangeFilter":
        """Make the same filter with nothing reported yet."""
        return DataChangeFilter(self._trigger, self._deadband)

    def passes(self, data: ua.DataValue) -> bool:
        """Whether to report a value; what was reported is what the next one is compared with."""
        last = self._last
        if last is None or self._differs(last, data):
            self._last = data
            return True
        return False

    def _differs(self, last: ua.DataValue, data: ua.DataValue) -> bool:
        if last.StatusCode != data.StatusCode:
            return True
        if self._trigger == ua.DataChangeTrigger.Status:
            return False
        if (
            self._trigger == ua.DataChangeTrigger.StatusValueTimestamp
            and last.SourceTimestamp != data.SourceTimestamp
        ):
            return True
        first, second = last.Value.Value, data.Value.Value
        if self._deadband <= 0.0:
            return not same(first, second)
        if isinstance(first, list) and isinstance(second, list):
            return len(first) != len(second) or any(map(self._beyond, first, second))
        return self._beyond(first, second)

    def _beyond(self, first: Any, second: Any) -> bool:
        if same(first, second):
            return False
        distance = abs(first - second)
        # A step to or from NaN or infinity is always one.
        return not distance <= self._deadband


def change_filter(space: AddressSpace, node: ua.NodeId, attribute: int, requested: Any) -> DataChangeFilter:
    """Make the filter a client asks for.

    Raises
    ------
    StatusCodeError
        BadFilterNotAllowed or BadDeadbandFilterInvalid.
    """
    if requested is None or isinstance(requested, ua.ExtensionObject):
        return DataChangeFilter(ua.DataChangeTrigger.StatusValue, 0.0)
    # asyncua exports a subclass of what it decodes, so the exported name would let nothing through.
    if not isinstance(requested, DecodedDataChangeFilter):
        raise StatusCodeError(ua.StatusCodes.BadFilterNotAllowed)
    if requested.DeadbandType == ua.DeadbandType.None_:
        return DataChangeFilter(requested.Trigger, 0.0)
    data = space.read_attribute_value(node, ua.AttributeIds.Value)
    if attribute != ua.AttributeIds.Value or data.Value is None or data.Value.VariantType not in NUMERIC:
        raise StatusCodeError(ua.StatusCodes.BadFilterNotAllowed)
    deadband = float(requested.DeadbandValue)
    if requested.DeadbandType == ua.DeadbandType.Absolute and 0.0 <= deadband < math.inf:
        return DataChangeFilter(requested.Trigger, deadband)
    eu_span = _eu_span(space, node)
    if requested.DeadbandType != ua.DeadbandType.Percent or eu_span is None or not 0.0 <= deadband <= 100.0:
        raise StatusCodeError(ua.StatusCodes.BadDeadbandFilterInvalid)
    return DataChangeFilter(requested.Trigger, deadband / 100.0 * eu_span)


def _eu_span(space: AddressSpace, node: ua.NodeId) -> float | None:
    for reference in space[node].references:
        if reference.IsForward and reference.BrowseName == ua.QualifiedName("EURange", 0):
            eu_range = space.read_attribute_value(reference.NodeId, ua.AttributeIds.Value).Value.Value
            return float(eu_range.High - eu_range.Low)
    return None


def parse_range(text: str | None) -> tuple[int, int] | None:
    """Read an index range of one dimension, `3` or `2:5`, both ends included; None for no range.

    >>> parse_range("2:5"), parse_range("3"), parse_range(None)
    ((2, 5), (3, 3), None)

    Raises
    ------
    StatusCodeError
        BadIndexRangeInvalid.
    """
    if not text:
        return None
    first, colon, last = text.partition(":")
    numbers = (first, last) if colon else (first,)
    if not all(len(n) <= MAX_DIGITS and n.isascii() and n.isdigit() for n in numbers):
        raise StatusCodeError(ua.StatusCodes.BadIndexRangeInvalid)
    low, high = int(first), int(last) if colon else int(first)
    if colon and high <= low:
        raise StatusCodeError(ua.StatusCodes.BadIndexRangeInvalid)
    return low, high


def cut(data: ua.DataValue, index_range: tuple[int, int] | None) -> ua.DataValue:
    """Cut a range out of an array, string or byte string; BadIndexRangeNoData where nothing is left of it."""
    if index_range is None or data.Value is None:
        return data
    value = data.Value.Value
    part = value[index_range[0] : index_range[1] + 1] if isinstance(value, list | str | bytes) else None
    if not part:
        nothing = ua.StatusCode(ua.StatusCodes.BadIndexRangeNoData)
        return ua.DataValue(
            None, nothing, SourceTimestamp=data.SourceTimestamp, ServerTimestamp=data.ServerTimestamp
        )
    variant = ua.Variant(part, data.Value.VariantType, is_array=data.Value.is_array)
    return ua.DataValue(variant, data.StatusCode, data.SourceTimestamp, data.ServerTimestamp)
