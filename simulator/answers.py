"""Replies of a device to requests, by function (Modbus Application Protocol V1.1b3, section 6). Pure.

Written apart from the product, and from pymodbus.
"""

import struct
from collections.abc import Callable, Mapping
from typing import Final, Protocol

import numpy as np

from impactcell.fieldbus.registers import WIRE, Words

_ADDRESS_COUNT: Final = struct.Struct(">HH")
_MASK: Final = struct.Struct(">HHH")
_READ_WRITE: Final = struct.Struct(">HHHHB")
_ON, _OFF = 0xFF00, 0x0000
"""What function 5 writes (6.5)."""
_MOST_BITS, _MOST_BITS_WRITTEN = 2000, 1968
"""Bits in a request (6.1, 6.11)."""
_MOST_READ, _MOST_WRITTEN, _MOST_WRITTEN_READING = 125, 123, 121
"""Registers in a request (6.3, 6.12, 6.17)."""
_SPACE: Final = 65_536
"""Addresses of a table."""
_CATEGORIES: Final = {1: (0, 3), 2: (0, 128), 3: (0, 256)}
"""Objects that each code of a device identification asks for: basic, regular, extended (6.21)."""
_ONE_OBJECT: Final = 4
"""Code that asks for a single object (6.21)."""
_MORE: Final = 0xFF
"""What says that further objects follow (6.21)."""
_ROOM: Final = 240
"""Bytes of objects in one reply: some less than fit, as devices have it."""


class RegisterDevice(Protocol):
    """What the server needs of a device; `table` is holding, input, coil or discrete."""

    def read(self, table: str, address: int, count: int) -> Words:
        """Return registers or bits; LookupError where there is no such address, BlockingIOError if busy."""

    def write(self, address: int, words: Words) -> None:
        """Write holding registers; LookupError as above, ValueError for a value that is refused."""


def answer(device: RegisterDevice, function: int, pdu: bytes) -> bytes:
    """Return the reply PDU of a device; raises what `RegisterDevice` raises.

    Raises
    ------
    NotImplementedError
        There is no such function.
    ValueError, IndexError, struct.error
        The request is not as it must be.
    """
    if function not in _FUNCTIONS:
        raise NotImplementedError(function)
    return _FUNCTIONS[function](device, pdu)


def _checked(address: int, count: int, most: int) -> None:
    if not 1 <= count <= most:
        raise ValueError(count)
    if address + count > _SPACE:
        raise LookupError(address)


def _read_registers(device: RegisterDevice, pdu: bytes) -> bytes:
    address, count = _ADDRESS_COUNT.unpack(pdu[1:])
    _checked(address, count, _MOST_READ)
    words = device.read("holding" if pdu[0] == 3 else "input", address, count)
    if words.dtype is not WIRE:
        words = words.astype(WIRE, copy=False)
    return bytes((pdu[0], 2 * count)) + words.tobytes()


def _read_bits(device: RegisterDevice, pdu: bytes) -> bytes:
    address, count = _ADDRESS_COUNT.unpack(pdu[1:])
    _checked(address, count, _MOST_BITS)
    bits = device.read("coil" if pdu[0] == 1 else "discrete", address, count)
    packed = np.packbits(np.asarray(bits) != 0, bitorder="little").tobytes()
    return bytes((pdu[0], len(packed))) + packed


def _write_register(device: RegisterDevice, pdu: bytes) -> bytes:
    address, _ = _ADDRESS_COUNT.unpack(pdu[1:])
    device.write(address, np.frombuffer(pdu, dtype=WIRE, offset=3))
    return pdu


def _write_registers(device: RegisterDevice, pdu: bytes) -> bytes:
    address, count = _ADDRESS_COUNT.unpack_from(pdu, 1)
    _checked(address, count, _MOST_WRITTEN)
    if len(pdu) != 6 + 2 * count or pdu[5] != 2 * count:
        raise ValueError(count)
    device.write(address, np.frombuffer(pdu, dtype=WIRE, offset=6))
    return pdu[:5]


def _write_coil(device: RegisterDevice, pdu: bytes) -> bytes:
    address, value = _ADDRESS_COUNT.unpack(pdu[1:])
    if value not in (_ON, _OFF):
        raise ValueError(value)
    _write_bits(device, address, [value == _ON])
    return pdu


def _write_coils(device: RegisterDevice, pdu: bytes) -> bytes:
    address, count = _ADDRESS_COUNT.unpack_from(pdu, 1)
    _checked(address, count, _MOST_BITS_WRITTEN)
    size = -(-count // 8)
    if len(pdu) != 6 + size or pdu[5] != size:
        raise ValueError(count)
    bits = np.unpackbits(np.frombuffer(pdu, np.uint8, offset=6), bitorder="little")
    _write_bits(device, address, bits[:count].tolist())
    return pdu[:5]


def _write_bits(device: RegisterDevice, address: int, bits: list[int] | list[bool]) -> None:
    write_coils = getattr(device, "write_coils", None)
    if write_coils is None:
        raise NotImplementedError(address)
    write_coils(address, np.array(bits).astype(WIRE))


def _mask_write(device: RegisterDevice, pdu: bytes) -> bytes:
    address, keep, put = _MASK.unpack(pdu[1:])
    (before,) = device.read("holding", address, 1).tolist()
    device.write(address, np.array([(before & keep) | (put & ~keep & 0xFFFF)], dtype=WIRE))
    return pdu


def _read_write(device: RegisterDevice, pdu: bytes) -> bytes:
    address, count, write_address, written, size = _READ_WRITE.unpack_from(pdu, 1)
    _checked(address, count, _MOST_READ)
    _checked(write_address, written, _MOST_WRITTEN_READING)
    if size != 2 * written or len(pdu) != 10 + size:
        raise ValueError(size)
    device.write(write_address, np.frombuffer(pdu, dtype=WIRE, offset=10))
    words = device.read("holding", address, count)
    return bytes((pdu[0], 2 * count)) + words.astype(WIRE, copy=False).tobytes()


def _identify(device: RegisterDevice, pdu: bytes) -> bytes:
    identification: Mapping[int, str] | None = getattr(device, "identification", None)
    _, interface, code, first = pdu
    if identification is None or interface != 14:
        raise NotImplementedError(interface)
    if code == _ONE_OBJECT:
        if first not in identification:
            raise LookupError(first)
        numbers = [first]
    else:
        if code not in _CATEGORIES:
            raise ValueError(code)
        numbers = [number for number in sorted(identification) if number in range(*_CATEGORIES[code])]
        numbers = [number for number in numbers if number >= first] or numbers  # from the start, if unknown
    objects, count, following = b"", 0, 0
    for number in numbers:
        text = identification[number].encode()[:_ROOM]
        if objects and len(objects) + 2 + len(text) > _ROOM:
            following = number
            break
        objects += bytes((number, len(text))) + text
        count += 1
    head = bytes((pdu[0], interface, code, 0x82, _MORE if following else 0, following, count))
    return head + objects


_FUNCTIONS: Final[Mapping[int, Callable[[RegisterDevice, bytes], bytes]]] = {
    1: _read_bits,
    2: _read_bits,
    3: _read_registers,
    4: _read_registers,
    5: _write_coil,
    6: _write_register,
    15: _write_coils,
    16: _write_registers,
    22: _mask_write,
    23: _read_write,
    43: _identify,
}
"""What answers each function."""
