"""Binary requests in, binary responses out: asyncua's codec behind checks it lacks."""

from typing import Any, Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import (
    Buffer,
    StrictBuffer,
    encoded_pieces,
    field_decoders,
    nodeid_from_binary,
    struct_from_binary,
    struct_to_binary,
    variant_to_binary,
)
from impactcell.opcua.loop_share import LoopShare

MAX_OPERATIONS: Final = 10_000
"""Operations in one request where a service sets no other limit."""
MAX_RESPONSE_BYTES: Final = 1024 * 1024
"""Longest response; sixteen chunks to encrypt, some 8 ms."""
NOT_DECODED: Final = (
    ua.UaError,
    ValueError,
    TypeError,
    OverflowError,
    RecursionError,
    KeyError,
    IndexError,
    MemoryError,
)
"""What asyncua raises at bytes that are no message."""
NOT_ENCODED: Final = (ua.UaError, ValueError, TypeError, OverflowError)
"""What it raises at a value that its type does not hold: a number out of range, half a character."""


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
    except NOT_DECODED as error:
        raise DecodingError(f"{kind.__name__}: {error}") from error


async def decode_parameters(kind: type, body: StrictBuffer, share: LoopShare) -> Any:
    """Decode the parameters of a service, one operation after the other.

    Raises
    ------
    DecodingError
        As `decode`; or one operation has more values than is taken.
    StatusCodeError
        BadTooManyOperations.
    """
    values: dict[str, Any] = {}
    try:
        for name, decoder, is_array in field_decoders(kind):
            body.begin_piece()
            if not is_array:
                values[name] = decoder(body)
                continue
            values[name] = elements = []
            length = int.from_bytes(body.read(4), "little", signed=True)
            if length > MAX_OPERATIONS:
                raise StatusCodeError(ua.StatusCodes.BadTooManyOperations)
            for _ in range(length):
                body.begin_piece()
                elements.append(decoder(body))
                await share.give_way()
        return kind(**values)
    except NOT_DECODED as error:
        raise DecodingError(f"{kind.__name__}: {error}") from error


def decode_type(body: Buffer) -> ua.NodeId:
    """Decode the NodeId a message begins with, which names its type."""
    try:
        return nodeid_from_binary(body)
    except (ua.UaError, ValueError, TypeError) as error:
        raise DecodingError(f"type of the message: {error}") from error


async def encode_response(response: object, share: LoopShare) -> bytes:
    """Encode a response, one result after the other.

    Raises
    ------
    StatusCodeError
        BadResponseTooLarge: to encrypt it would keep the loop for longer than a turn may last.
    """
    pieces, size = list[bytes](), 0
    for piece in encoded_pieces(response):
        pieces.append(piece)
        size += len(piece)
        if size > MAX_RESPONSE_BYTES:
            raise StatusCodeError(ua.StatusCodes.BadResponseTooLarge)
        await share.give_way()
    return b"".join(pieces)


def encode(value: object) -> bytes:
    """Encode a structure."""
    data: bytes = struct_to_binary(value)
    return data


def encoding_fault(value: ua.Variant) -> str:
    """Say why a value cannot be sent; empty where it can."""
    try:
        variant_to_binary(value)
    except NOT_ENCODED as error:
        return str(error)
    return ""


def service_fault(handle: int, code: int) -> bytes:
    """Encode the response to a request that is refused as a whole."""
    fault = ua.ServiceFault()
    fault.ResponseHeader.RequestHandle = handle
    fault.ResponseHeader.ServiceResult = ua.StatusCode(code)
    return encode(fault)
