"""Requests and replies of the functions used, as protocol data units: without a frame, a transport or a wait.

A PDU is a function code and its data, at most 253 bytes (Modbus Application Protocol V1.1b3, section 4.1);
what frames it, and which unit it is for, is the transport's to say. Requests are encoded by pymodbus. Replies
are read here, for pymodbus's are neither compared with the request nor fast (31 µs for 125 registers, against
0.3 µs here). Should that change, `tests/unit/fieldbus/test_codec.py` says so.
"""

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from pymodbus.pdu import ModbusPDU
from pymodbus.pdu.bit_message import (
    ReadCoilsRequest,
    ReadDiscreteInputsRequest,
    WriteMultipleCoilsRequest,
    WriteSingleCoilRequest,
)
from pymodbus.pdu.register_message import (
    MaskWriteRegisterRequest,
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    ReadWriteMultipleRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from impactcell.errors import ModbusExceptionError, ProtocolError
from impactcell.fieldbus.register_map.register_types import BIT_TABLES
from impactcell.fieldbus.registers import Words

MAX_READ: Final = 125
"""Registers that one request can read (Modbus Application Protocol V1.1b3, 6.3)."""
MAX_WRITE: Final = 123
"""Registers that one request can write (same, 6.12)."""
MAX_READ_BITS: Final = 2000
"""Coils or discrete inputs that one request can read (same, 6.1)."""
MAX_WRITE_BITS: Final = 1968
"""Coils that one request can write (same, 6.11)."""
MAX_WRITE_WITH_READ: Final = 121
"""Registers that one request can write that reads others (same, 6.17)."""
MAX_PDU: Final = 253
"""Bytes of a PDU (same, section 4.1)."""


class FunctionCode(enum.IntEnum):
    """Function codes of the Modbus Application Protocol V1.1b3 that are used here."""

    READ_COILS = 1
    READ_DISCRETE = 2
    READ_HOLDING = 3
    READ_INPUT = 4
    WRITE_COIL = 5
    WRITE_SINGLE = 6
    WRITE_COILS = 15
    WRITE_MULTIPLE = 16
    MASK_WRITE = 22
    READ_WRITE = 23
    ENCAPSULATED = 43


_READS: Final[Mapping[FunctionCode, tuple[type[ModbusPDU], str]]] = {
    FunctionCode.READ_COILS: (ReadCoilsRequest, "coil"),
    FunctionCode.READ_DISCRETE: (ReadDiscreteInputsRequest, "discrete input"),
    FunctionCode.READ_HOLDING: (ReadHoldingRegistersRequest, "holding register"),
    FunctionCode.READ_INPUT: (ReadInputRegistersRequest, "input register"),
}
"""What encodes the request that reads each table, and what it reads."""
_OF_BITS: Final = (FunctionCode.READ_COILS, FunctionCode.READ_DISCRETE)
"""Functions that read bits, eight a byte."""


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
        Bytes of the PDU of a good reply; 0 where only the reply itself tells.
    reply_prefix : bytes
        How it must begin: function and byte count of a read, the whole echo of a write.
    description : str
        The request in words, for messages.
    measure : callable, optional
        Of a reply whose length only it tells: given the beginning of the PDU, it returns that length, or None
        while that cannot be said, and raises ProtocolError for what no such reply begins with.
    """

    pdu: bytes
    reply_length: int
    reply_prefix: bytes
    description: str
    measure: Callable[[bytes], int | None] | None = None

    @property
    def longest_reply(self) -> int:
        """Bytes that the PDU of a good reply has at most."""
        return MAX_PDU if self.measure is not None else self.reply_length

    def length_of(self, pdu: bytes) -> int | None:
        """Return how long the good reply is that begins with `pdu`; None while that cannot be said."""
        return self.reply_length if self.measure is None else self.measure(pdu)


@lru_cache(maxsize=4096)
def read_request(function: FunctionCode, address: int, count: int) -> Request:
    """Request for `count` registers, or bits, from `address` on (cached: each cycle reads the same blocks).

    Raises
    ------
    ValueError
        If it leaves the register space or asks for more than 125 registers or 2000 bits.
    """
    kind, what = _READS[function]
    most = MAX_READ_BITS if function in _OF_BITS else MAX_READ
    if not 1 <= count <= most or not 0 <= address <= 65_536 - count:
        raise ValueError(f"a request cannot read {_counted(count, what)} from {address}")
    pdu = bytes([function]) + kind(address=address, count=count).encode()
    data = -(-count // 8) if function in _OF_BITS else 2 * count
    return Request(pdu, 2 + data, bytes([function, data]), f"{_counted(count, what)} from {address}")


def write_request(address: int, words: Words, table: str = "holding") -> Request:
    """Request that writes `words` from `address` on: function 6 for one register, 16 for more.

    Of coils each word is one, 0 or not: function 5 for one coil, 15 for more.

    Raises
    ------
    ValueError
        If it leaves the register space or holds more than 123 registers or 1968 coils.
    """
    count = len(words)
    if table in BIT_TABLES:
        return _write_coils(address, [bool(word) for word in words])
    if not 1 <= count <= MAX_WRITE or not 0 <= address <= 65_536 - count:
        raise ValueError(f"a request cannot write {count} registers from {address}")
    description = f"a write of {_counted(count, 'register')} from {address}"
    values = [int(word) for word in words]
    if count == 1:
        single = WriteSingleRegisterRequest(address=address, registers=values)
        pdu = bytes([FunctionCode.WRITE_SINGLE]) + single.encode()
        return Request(pdu, 5, pdu, description)
    multiple = WriteMultipleRegistersRequest(address=address, registers=values)
    pdu = bytes([FunctionCode.WRITE_MULTIPLE]) + multiple.encode()
    return Request(pdu, 5, pdu[:5], description)


def _write_coils(address: int, bits: list[bool]) -> Request:
    count = len(bits)
    if not 1 <= count <= MAX_WRITE_BITS or not 0 <= address <= 65_536 - count:
        raise ValueError(f"a request cannot write {count} coils from {address}")
    description = f"a write of {_counted(count, 'coil')} from {address}"
    if count == 1:
        pdu = bytes([FunctionCode.WRITE_COIL]) + WriteSingleCoilRequest(address=address, bits=bits).encode()
        return Request(pdu, 5, pdu, description)
    pdu = bytes([FunctionCode.WRITE_COILS]) + WriteMultipleCoilsRequest(address=address, bits=bits).encode()
    return Request(pdu, 5, pdu[:5], description)


def mask_write_request(address: int, keep: int, put: int) -> Request:
    """Request that changes bits of a register (function 22): what it shows AND `keep`, with `put` where not.

    Result = (register AND `keep`) OR (`put` AND NOT `keep`) (Modbus Application Protocol V1.1b3, 6.16).
    """
    encoded = MaskWriteRegisterRequest(address=address, and_mask=keep, or_mask=put).encode()
    pdu = bytes([FunctionCode.MASK_WRITE]) + encoded
    return Request(pdu, 7, pdu, f"a change of bits of register {address}")


def read_write_request(address: int, count: int, write_address: int, words: Words) -> Request:
    """Request that writes `words` from `write_address` on, and then reads `count` registers (function 23).

    Raises
    ------
    ValueError
        If it leaves the register space, reads more than 125 registers or writes more than 121.
    """
    if not 1 <= count <= MAX_READ or not 0 <= address <= 65_536 - count:
        raise ValueError(f"a request cannot read {count} registers from {address}")
    written = len(words)
    if not 1 <= written <= MAX_WRITE_WITH_READ or not 0 <= write_address <= 65_536 - written:
        raise ValueError(f"a request cannot write {written} registers from {write_address} and read others")
    encoded = ReadWriteMultipleRegistersRequest(
        read_address=address, read_count=count, write_address=write_address,
        write_registers=[int(word) for word in words],
    ).encode()  # fmt: skip
    read = _counted(count, "holding register")
    description = f"{read} from {address}, after a write of {written} from {write_address}"
    pdu = bytes([FunctionCode.READ_WRITE]) + encoded
    return Request(pdu, 2 + 2 * count, bytes([FunctionCode.READ_WRITE, 2 * count]), description)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def check_reply(request: Request, pdu: bytes) -> bytes:
    """Return the data of a reply: the bytes of registers or bits for a read, nothing for a write.

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
    length = request.length_of(pdu)
    if len(pdu) != length:
        wanted = "more" if length is None else length
        raise ProtocolError(f"{request.description}: answered with {len(pdu)} bytes instead of {wanted}")
    if request.measure is not None and pdu.startswith(prefix):
        return pdu[len(prefix) :]
    raise ProtocolError(f"{request.description}: the answer is for another request")
