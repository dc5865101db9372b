"""What comes in answer to one request, looked at byte by byte. No input or output.

pymodbus forgives much: it hunts for a frame in garbage, drops one that is for another request and goes on
waiting, and gives out whatever the peer took for an answer. So its clients are handed only the bytes of a
frame that is complete, alone, and a reply to the request; at the first byte that is not, this raises.

Frames (Modbus Messaging on TCP/IP V1.0b, 3.1; Modbus over Serial Line V1.02, 2.5.1)::

    MBAP  [ transaction 2 ][ protocol = 0 2 ][ length 2 ][ unit 1 ][ PDU ]
    RTU   [ unit 1 ][ PDU ][ CRC-16 2 ]
"""

import struct
from typing import Final, Protocol

from pymodbus.framer import FramerRTU

from impactcell.errors import ProtocolError
from impactcell.fieldbus.codec import Request, check_reply
from impactcell.fieldbus.transports.mbap import HEADER, MAX_LENGTH, not_a_frame

_CRC_LENGTH: Final = 2
"""Bytes of the CRC that ends an RTU frame (Modbus over Serial Line V1.02, section 2.5.1.2)."""
_EXCEPTION_LENGTH: Final = 2
"""Bytes of the PDU of a refusal."""


class ReplyWatch(Protocol):
    """Watches what comes in answer to one request."""

    def take(self, received: bytes) -> bytes | None:
        """Look at all that has come since the request went out.

        Returns
        -------
        bytes or None
            Data of the reply; None while it is not complete.

        Raises
        ------
        ProtocolError
            This is not, and cannot become, the reply.
        ModbusExceptionError
            The device refuses.
        """


class MbapWatch:
    """Watches for a reply in the frame of Modbus TCP, of TLS and of UDP.

    `datagram`: a reply is one datagram, and comes whole or not at all.
    """

    def __init__(self, transaction: int, device_id: int, request: Request, *, datagram: bool) -> None:
        self._transaction, self._device_id = transaction, device_id
        self._request = request
        self._datagram = datagram

    def take(self, received: bytes) -> bytes | None:
        """See `ReplyWatch.take`."""
        if len(received) >= HEADER.size:
            transaction, protocol, length, unit = HEADER.unpack_from(received)
            if protocol or not 2 <= length <= MAX_LENGTH:
                raise not_a_frame(received, protocol, length)
            if transaction != self._transaction:
                raise ProtocolError(f"an answer to transaction {transaction}, which is not open")
            if unit != self._device_id:
                raise ProtocolError(f"an answer from device {unit} to {self._request.description}")
            if len(received) > 6 + length:
                raise ProtocolError("more bytes than were asked for")
            if len(received) == 6 + length:
                return check_reply(self._request, received[HEADER.size :])
        if self._datagram:
            raise ProtocolError(f"a datagram of {len(received)} bytes, which is no whole frame")
        return None


class RtuWatch:
    """Watches for a reply in an RTU frame; its length is known beforehand, for it stands nowhere in it."""

    def __init__(self, device_id: int, request: Request) -> None:
        self._device_id = device_id
        self._request = request

    def take(self, received: bytes) -> bytes | None:
        """See `ReplyWatch.take`."""
        if received[0] != self._device_id:
            raise ProtocolError(f"an answer from device {received[0]} to {self._request.description}")
        if len(received) < 2:
            return None
        refused = received[1] == self._request.pdu[0] | 0x80
        if not refused:
            check_function(self._request, received[1])
        pdu_length = _EXCEPTION_LENGTH if refused else self._request.length_of(received[1:])
        if pdu_length is None:
            return None
        size = 1 + pdu_length + _CRC_LENGTH
        if len(received) > size:
            raise ProtocolError("more bytes than were asked for")
        if len(received) < size:
            return None
        (crc,) = struct.unpack_from(">H", received, size - _CRC_LENGTH)
        if not FramerRTU.check_CRC(received[:-_CRC_LENGTH], crc):
            raise ProtocolError(f"{self._request.description}: the CRC of the answer does not fit")
        return check_reply(self._request, received[1:-_CRC_LENGTH])


def check_function(request: Request, function: int) -> None:
    """Raise ProtocolError if `function` is not the one of a good reply to `request`."""
    if function != request.pdu[0]:
        raise ProtocolError(
            f"{request.description}: answered with function {function} instead of {request.pdu[0]}"
        )
