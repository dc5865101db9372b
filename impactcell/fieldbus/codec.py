"""Requests and replies of the functions used, as protocol data units: without a frame, a transport or a wait.

A PDU is a function code and its data, at most 253 bytes (Modbus Application Protocol V1.1b3, section 4.1);
what frames it, and which unit it is for, is the transport's to say. Requests are encoded by pymodbus. Replies
are read here, for pymodbus's are neither compared with the request nor fast (31 µs for 125 registers, against
0.3 µs here). Should that change, `tests/unit/fieldbus/test_codec.py` says so.
"""

import enum
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from impactcell.errors import ModbusExceptionError, ProtocolError
from impactcell.fieldbus.registers import Words

MAX_READ: Final = 125
"""Registers that one request can read (Modbus Application Protocol V1.1b3, 6.3)."""
MAX_WRITE: Final = 123
"""Registers that one request can write (same, 6.12)."""


class FunctionCode(enum.IntEnum):
    """Function codes of the Modbus Application Protocol V1.1b3 that are used here."""

    READ_HOLDING = 3
    READ_INPUT = 4
    WRITE_SINGLE = 6
    WRITE_MULTIPLE = 16


EXCEPTION_NAMES: Final = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "server device failure",
    5: "acknowledge",
    6: "server device busy",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target device failed to respond",
}
"""Exception codes by their names in section 7 of the specification."""

BUSY: Final = 6
"""Exception code of a server that asks to be asked again later."""


@dataclass(frozen=True, slots=True)
class Request:
    """One request and what a good reply to it looks like.

    Attributes
    ----------
    pdu : bytes
        Function code and data.
    reply_length : int
        Bytes of the PDU of a good reply.
    reply_prefix : bytes
        How it must begin: function and byte count of a read, the whole echo of a write.
    description : str
        The request in words, for messages.
    """

    pdu: bytes
    reply_length: int
    reply_prefix: bytes
    description: str

    @property
    def data_length(self) -> int:
        """Bytes of data of a good reply."""
        return self.reply_length - len(self.reply_prefix)


@lru_cache(maxsize=4096)
def read_request(function: FunctionCode, address: int, count: int) -> Request:
    """Request for `count` registers from `address` on (cached: the same blocks are read every cycle).

    Raises
    ------
    ValueError
        If it leaves the register space or asks for more than 125 registers.
    """
    if not 1 <= count <= MAX_READ or not 0 <= address <= 65_536 - count:
        raise ValueError(f"a request cannot read {count} registers from {address}")
    kind = ReadHoldingRegistersRequest if function == FunctionCode.READ_HOLDING else ReadInputRegistersRequest
    pdu = bytes([function]) + kind(address=address, count=count).encode()
    description = (
        f"{count} {'holding' if function == FunctionCode.READ_HOLDING else 'input'} registers from {address}"
    )
    return Request(pdu, 2 + 2 * count, bytes([function, 2 * count]), description)


def write_request(address: int, words: Words) -> Request:
    """Request that writes `words` from `address` on: function 6 for one register, 16 for more.

    Raises
    ------
    ValueError
        If it leaves the register space or holds more than 123 registers.
    """
    count = len(words)
    if not 1 <= count <= MAX_WRITE or not 0 <= address <= 65_536 - count:
        raise ValueError(f"a request cannot write {count} registers from {address}")
    description = f"a write of {count} registers from {address}"
    values = [int(word) for word in words]
    if count == 1:
        single = WriteSingleRegisterRequest(address=address, registers=values)
        pdu = bytes([FunctionCode.WRITE_SINGLE]) + single.encode()
        return Request(pdu, 5, pdu, description)
    multiple = WriteMultipleRegistersRequest(address=address, registers=values)
    pdu = bytes([FunctionCode.WRITE_MULTIPLE]) + multiple.encode()
    return Request(pdu, 5, pdu[:5], description)


def check_reply(request: Request, pdu: bytes) -> bytes:
    """Return the data of a reply: the registers' bytes for a read, nothing for a write.

    Raises
    ------
    ModbusExceptionError
        If the peer refused.
    ProtocolError
        If function, byte count, echo or length are not those of a reply to `request`.
    """
    prefix = request.reply_prefix
    if len(pdu) == request.reply_length and pdu.startswith(prefix):
        return pdu[len(prefix) :]
    function = request.pdu[0]
    if len(pdu) == 2 and pdu[0] == function | 0x80:
        name = EXCEPTION_NAMES.get(pdu[1], "unknown exception")
        raise ModbusExceptionError(f"{request.description} refused: {name} (exception {pdu[1]})", pdu[1])
    if pdu[0] & 0x7F != function:
        raise ProtocolError(f"{request.description}: answered with function {pdu[0]} instead of {function}")
    if len(pdu) != request.reply_length:
        raise ProtocolError(
            f"{request.description}: answered with {len(pdu)} bytes instead of {request.reply_length}"
        )
    raise ProtocolError(f"{request.description}: the answer is for another request")
