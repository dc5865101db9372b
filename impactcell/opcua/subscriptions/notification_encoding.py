"""Publish responses, put together from parts that are encoded once.

asyncua builds every response from objects and encodes each value again for each subscriber; with 50 clients
that is most of its work.
"""

import struct
from collections.abc import Iterable
from datetime import datetime
from typing import Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import datetime_to_win_epoch

_U32: Final = struct.Struct("<I")
_I32: Final = struct.Struct("<i")
_HEADER: Final = struct.Struct("<BBHqII")
_NOTHING: Final = b"\xff\xff\xff\xff"
# A response header ends with no diagnostics, no string table and no additional header.
_HEADER_TAIL: Final = b"\x00" + _NOTHING + b"\x00\x00\x00"
_MESSAGE: Final = struct.Struct("<Iqi")


def _extension(type_id: int, body: bytes) -> bytes:
    return struct.pack("<BBHBi", 1, 0, type_id, 1, len(body)) + body


def data_changes(items: Iterable[tuple[int, bytes]]) -> bytes:
    """Encode a DataChangeNotification from client handles and encoded values."""
    parts = [_U32.pack(handle) + value for handle, value in items]
    body = _I32.pack(len(parts)) + b"".join(parts) + _NOTHING
    return _extension(ua.ObjectIds.DataChangeNotification_Encoding_DefaultBinary, body)


def events(items: list[bytes]) -> bytes:
    """Encode an EventNotificationList from encoded field lists."""
    body = _I32.pack(len(items)) + b"".join(items)
    return _extension(ua.ObjectIds.EventNotificationList_Encoding_DefaultBinary, body)


def status_change(code: int) -> bytes:
    """Encode a StatusChangeNotification."""
    body = _U32.pack(code) + b"\x00"
    return _extension(ua.ObjectIds.StatusChangeNotification_Encoding_DefaultBinary, body)


def status_codes(codes: Iterable[int]) -> bytes:
    """Encode an array of StatusCodes."""
    values = tuple(codes)
    return struct.pack(f"<i{len(values)}I", len(values), *values)


def notification_message(sequence: int, time: datetime, notifications: list[bytes]) -> bytes:
    """Encode a NotificationMessage; without notifications it keeps the subscription alive."""
    head = _MESSAGE.pack(sequence, datetime_to_win_epoch(time), len(notifications))
    return head + b"".join(notifications)


def _response(type_id: int, handle: int, time: datetime) -> bytes:
    return _HEADER.pack(1, 0, type_id, datetime_to_win_epoch(time), handle, 0) + _HEADER_TAIL


def publish_response(
    handle: int,
    time: datetime,
    subscription: int,
    available: list[int],
    message: bytes,
    results: bytes,
    *,
    more: bool,
) -> bytes:
    """Encode a PublishResponse around an encoded NotificationMessage."""
    return b"".join(
        (
            _response(ua.ObjectIds.PublishResponse_Encoding_DefaultBinary, handle, time),
            _U32.pack(subscription),
            struct.pack(f"<i{len(available)}I", len(available), *available),
            b"\x01" if more else b"\x00",
            message,
            results,
            _NOTHING,
        )
    )


def republish_response(handle: int, time: datetime, message: bytes) -> bytes:
    """Encode a RepublishResponse around an encoded NotificationMessage."""
    return _response(ua.ObjectIds.RepublishResponse_Encoding_DefaultBinary, handle, time) + message
