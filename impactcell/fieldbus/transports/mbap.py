"""Frames of Modbus TCP: the header before a PDU, and a stream of bytes cut into frames. No input or output.

Layout (Modbus Messaging on TCP/IP V1.0b, section 3.1)::

    [ transaction 2 ][ protocol = 0 2 ][ length 2 ][ unit 1 ][ function 1 ][ data ]
                                        length = unit + function + data, 2..254

pymodbus's framer does not hold up: it waits for ever behind a frame of another protocol, knows no largest
length, and takes nine bytes where a header says eight. Should that change,
`tests/unit/fieldbus/test_codec.py` says so.
"""

import struct
from collections.abc import Iterator
from functools import lru_cache
from typing import Final

from impactcell.errors import ProtocolError

HEADER: Final = struct.Struct(">HHHB")
MAX_LENGTH: Final = 254
"""Unit and PDU; a PDU has at most 253 bytes."""
_OTHER_PROTOCOLS: Final = {b"HTTP/": "HTTP", b"SSH-": "SSH", b"\x15\x03": "TLS", b"\x16\x03": "TLS"}
"""What others begin with (RFC 9112, 4; RFC 4253, 4.2; RFC 8446, 5.1: an alert or a handshake)."""
_AFTER_TRANSACTION: Final = struct.Struct(">HHB")


@lru_cache(maxsize=4096)
def head_after_transaction(unit: int, pdu_length: int) -> bytes:
    """Give what stands between the transaction of a frame and its PDU."""
    return _AFTER_TRANSACTION.pack(0, pdu_length + 1, unit)


def not_a_frame(received: bytes, protocol: int, length: int) -> ProtocolError:
    """Say that what has a header of this protocol and length is no frame, and whose it is if known."""
    for begin, name in _OTHER_PROTOCOLS.items():
        if received.startswith(begin):
            return ProtocolError(f"{name} answers there, not Modbus TCP")
    return ProtocolError(
        f"not a Modbus TCP frame: protocol {protocol}, length {length} (2..{MAX_LENGTH}); "
        "something other than Modbus TCP may listen there"
    )


class FrameReader:
    """Cuts a stream of bytes into frames, however it arrives: in pieces, or several at once."""

    __slots__ = ("_buffer",)

    def __init__(self) -> None:
        self._buffer = b""

    @property
    def pending(self) -> int:
        """Bytes that are held back because their frame is not complete."""
        return len(self._buffer)

    def take(self, data: bytes) -> bytes:
        """Hand over what is held back, and `data` behind it, to be fed again where it is not used."""
        buffer, self._buffer = self._buffer, b""
        return buffer + data if buffer else data

    def feed(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        """Take in `data`; yield transaction, unit and PDU of each complete frame.

        Raises
        ------
        ProtocolError
            At a header that is not Modbus TCP; what follows it cannot be trusted, the connection has to go.
        """
        buffer = self._buffer + data if self._buffer else data
        at, size = 0, len(buffer)
        unpack, header = HEADER.unpack_from, HEADER.size
        try:
            while size - at >= header:
                transaction, protocol, length, unit = unpack(buffer, at)
                if protocol or not 2 <= length <= MAX_LENGTH:
                    raise not_a_frame(buffer[at:], protocol, length)
                end = at + 6 + length
                if end > size:
                    break
                pdu = buffer[at + header : end]
                at = end
                yield transaction, unit, pdu
        finally:
            self._buffer = buffer[at:]
