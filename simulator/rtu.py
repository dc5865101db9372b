"""RTU frames of a simulated module: requests cut out of a stream, replies with their CRC, and faults.

Written apart from the product, and from pymodbus. Layout (Modbus over Serial Line V1.02, 2.5.1)::

    [ unit 1 ][ function 1 ][ data ][ CRC-16 2, low byte first ]
"""

import random
import struct
from typing import Final

from simulator.client_connection import ClientConnection
from simulator.faults import Fault, FaultKind, corrupt

_LONGEST: Final = 256
"""Bytes of a frame (2.5.1)."""
_FIXED: Final = {1: 8, 2: 8, 3: 8, 4: 8, 5: 8, 6: 8, 22: 10, 43: 7}
"""Bytes of requests whose length is always the same, by function."""
_COUNTED: Final = {15: 6, 16: 6, 23: 10}
"""Where a request has the number of bytes that follow, by function."""
_LINE_FAULTS: Final = (FaultKind.WRONG_TRANSACTION, FaultKind.WRONG_PROTOCOL)
"""What there is no place for in an RTU frame; a flipped bit comes instead."""


def crc16(data: bytes) -> bytes:
    """CRC-16 of the specification (6.2.2: polynomial 0xA001, begun with 0xFFFF), low byte first.

    >>> crc16(bytes.fromhex("0207")).hex()
    '4112'
    """
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc.to_bytes(2, "little")


def request_length(frame: bytes) -> int | None:
    """Bytes of the request that `frame` begins with; None while that cannot be said.

    Raises
    ------
    ValueError
        No request of a function that is known.
    """
    if len(frame) < 2:
        return None
    function = frame[1]
    if function in _FIXED:
        return _FIXED[function]
    if function not in _COUNTED:
        raise ValueError(function)
    at = _COUNTED[function]
    return at + 1 + frame[at] + 2 if len(frame) > at else None


class RtuConnection(ClientConnection):
    """RTU frames on a serial line or a TCP connection."""

    def data_received(self, data: bytes) -> None:
        """Answer requests; what is damaged stays without an answer (called by asyncio)."""
        server = self._server
        if server.before is not None:
            server.before()
        self._buffer += data
        replies: list[bytes] = []
        while self._buffer:
            try:
                length = request_length(self._buffer)
            except ValueError:
                length = len(self._buffer)  # of a function that nobody knows; the CRC says if it is one
            if length is None or len(self._buffer) < length:
                if len(self._buffer) > _LONGEST:
                    self._buffer = b""
                break
            frame, self._buffer = self._buffer[:length], self._buffer[length:]
            if len(frame) < 4 or crc16(frame[:-2]) != frame[-2:]:
                self._buffer = b""
                break
            pdu = server.answer(frame[0], frame[1:-2])
            if pdu is not None:
                reply = frame[:1] + pdu
                self._reply(reply + crc16(reply), replies)
        self._send(b"".join(replies))

    def _corrupt(self, fault: Fault, reply: bytes, draw: random.Random) -> bytes:
        """Corrupt as a faulty device does, its CRC being right, or as a line does."""
        if fault.kind is FaultKind.TRUNCATED:
            return reply[: draw.randrange(1, len(reply))]
        if fault.kind in _LINE_FAULTS:
            at, bit = draw.randrange(len(reply)), draw.randrange(8)
            return reply[:at] + bytes([reply[at] ^ 1 << bit]) + reply[at + 1 :]
        mbap = struct.pack(">HHH", 0, 0, len(reply) - 2) + reply[:-2]
        wrong = corrupt(fault, mbap, draw)[6:]
        if fault.kind is FaultKind.WRONG_LENGTH and wrong == reply[:-2]:  # its header lied, and there is none
            wrong = wrong[:-1]
        return wrong + crc16(wrong)
