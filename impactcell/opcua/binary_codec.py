"""Binary requests in, binary responses out: asyncua's codec behind checks it lacks."""

from typing import Any

from asyncua import ua

from impactcell.opcua.asyncua_adapter import (
    Buffer,
    nodeid_from_binary,
    struct_from_binary,
    struct_to_binary,
)


class StatusCodeError(Exception):
    """A request that is refused with a status code; the session goes on."""

    def __init__(self, code: int) -> None:
        super().__init__(ua.StatusCode(code).name)
        self.code = code


class DecodingError(Exception):
    """Bytes that are no OPC UA message."""


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
