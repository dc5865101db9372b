"""Binary requests in, binary responses out: asyncua's codec behind checks it lacks."""

from typing import Any, Final

from asyncua import ua
from asyncua.common.utils import Buffer, NotEnoughData
from asyncua.ua import ua_binary
from asyncua.ua.ua_binary import nodeid_from_binary, struct_from_binary, struct_to_binary

MAX_NULLS: Final = 10_000
"""Longest array of nulls that is decoded: its elements take no bytes, so that its length bounds nothing."""


class FaultError(Exception):
    """A request that is refused with a status code; the session goes on."""

    def __init__(self, code: int) -> None:
        super().__init__(ua.StatusCode(code).name)
        self.code = code


class DecodingError(Exception):
    """Bytes that are no OPC UA message."""


class StrictBuffer(Buffer):  # type: ignore[misc]
    """A buffer that cannot be read backwards.

    In asyncua a string of length -2 moves the cursor two bytes back; an array of such strings never ends.
    """

    def read(self, size: int) -> bytes:
        """Read and take `size` bytes."""
        if size < 0:
            raise NotEnoughData(f"a length of {size}")
        data: bytes = super().read(size)
        return data

    def copy(self, size: int = -1) -> "StrictBuffer":
        """Return a view of the next `size` bytes, of all that is left by default."""
        if size == -1 or size > len(self):
            size = len(self)
        return StrictBuffer(self._data, self._cur_pos, size)


class _BoundedNull:
    """Nulls, `MAX_NULLS` in one array at most: asyncua builds a list of any length from four bytes."""

    @staticmethod
    def pack(_data: object) -> bytes:
        return b""

    @staticmethod
    def unpack(_data: object) -> None:
        return None

    @staticmethod
    def pack_array(data: list[object] | None) -> bytes:
        packed: bytes = ua_binary.Primitives.Int32.pack(-1 if data is None else len(data))
        return packed

    @staticmethod
    def unpack_array(_data: object, length: int) -> tuple[None, ...]:
        if length > MAX_NULLS:
            raise NotEnoughData(f"an array of {length} nulls")
        return (None,) * max(length, 0)


def bound_null_arrays() -> None:
    """Put the bounded decoder of null arrays in place of asyncua's."""
    ua_binary.Primitives1.Null = ua_binary.Primitives.Null = _BoundedNull()


def decode(kind: type, body: Buffer) -> Any:
    """Decode a structure.

    Raises
    ------
    DecodingError
        The bytes end early, lie about a length, nest too deep or hold a value outside its enumeration.
    """
    try:
        return struct_from_binary(kind, body)
    except (
        ua.UaError,
        ValueError,
        TypeError,
        OverflowError,
        RecursionError,
        KeyError,
        IndexError,
        MemoryError,
    ) as error:
        raise DecodingError(f"{kind.__name__}: {error}") from error


def decode_type(body: Buffer) -> ua.NodeId:
    """Decode the NodeId a message begins with, which names its type."""
    try:
        return nodeid_from_binary(body)
    except (ua.UaError, ValueError, TypeError) as error:
        raise DecodingError(f"type of the message: {error}") from error


def encode(value: object) -> bytes:
    """Encode a structure."""
    data: bytes = struct_to_binary(value)
    return data


def service_fault(handle: int, code: int) -> bytes:
    """Encode the response to a request that is refused as a whole."""
    fault = ua.ServiceFault()
    fault.ResponseHeader.RequestHandle = handle
    fault.ResponseHeader.ServiceResult = ua.StatusCode(code)
    return encode(fault)
