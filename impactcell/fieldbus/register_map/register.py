"""One register of a map: its type, its unit, and how its words become a value and back.

Pure. Blocks of words are big-endian 16-bit arrays (`WIRE`), the bytes exactly as Modbus carries them, so a
block becomes an array of samples by a view, not register by register.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from struct import Struct
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactcell.errors import MapError, NotDecimalError
from impactcell.fieldbus.register_map.bcd import NO_BCD, from_bcd, to_bcd
from impactcell.fieldbus.register_map.register_types import KINDS, SI_FACTOR, WIRE, code_range

Words = NDArray[np.uint16]
Value = int | float | str | NDArray[Any]

_NUMBERS: Final = {kind: Struct(f">{code}") for kind, code in zip(KINDS, "HhIiQqHIfdH", strict=True)}
"""The same for a single number, without the detour over an array."""


@dataclass(frozen=True, slots=True)
class Register:
    """One documented value of the map: a number, an array of numbers, or a text.

    Attributes
    ----------
    name : str
        How this project calls it.
    address : int
        Zero-based PDU address of its first register (a 4xxxx or 3xxxx reference is this plus one).
    kind : str
        One of `KINDS`, or `string` (UTF-8, two bytes a register, padded with NUL).
    count : int
        Number of values; above 1 it is an array.
    length : int
        Registers of a string; 0 for numbers.
    table : str
        `holding` (read by function 3), `input` (4), `coil` (1) or `discrete` (2).
    writable : bool
        Whether a client may write it.
    word_order : str
        `big`: the most significant word at the lowest address; `little`: at the highest.
    byte_order : str
        `big`: the most significant byte of a register first, as Modbus has it; `little`: last.
    bit : int or None
        Which bit of the register is the value, 0 the least significant; None: all of them.
    scale : float
        Size of one code, in `unit`.
    offset : float
        Value of code 0, in `unit`.
    unit : str
        Unit of the scaled value; empty for a plain code, which stays an integer.
    not_a_number : int or None
        Code of a sample that was not measured.
    saturation : tuple of int, or None
        Codes at and beyond which the channel is at full scale.
    std : float or None
        Standard deviation of the value, in `unit`, where the module's maker tells it.
    expect : int, str or None
        What a module of this map must show here.
    codes : mapping
        Names of the values of a state register.
    """

    name: str
    address: int
    kind: str
    count: int = 1
    length: int = 0
    table: str = "holding"
    writable: bool = False
    word_order: str = "big"
    byte_order: str = "big"
    bit: int | None = None
    scale: float = 1.0
    offset: float = 0.0
    unit: str = ""
    not_a_number: int | None = None
    saturation: tuple[int, int] | None = None
    std: float | None = None
    expect: int | str | None = None
    codes: Mapping[int, str] = field(default_factory=dict)
    description: str = ""

    @property
    def words_per_value(self) -> int:
        """Registers one value takes."""
        return self.length if self.kind == "string" else KINDS[self.kind].itemsize // 2

    @property
    def words(self) -> int:
        """Registers the whole entry takes."""
        return self.words_per_value * self.count

    @property
    def end(self) -> int:
        """First address after it."""
        return self.address + self.words

    @property
    def si_factor(self) -> float:
        """SI units per code."""
        return self.scale * SI_FACTOR.get(self.unit, 1.0)

    @property
    def si_offset(self) -> float:
        """Value of code 0, SI."""
        return self.offset * SI_FACTOR.get(self.unit, 1.0)

    @property
    def si_std(self) -> float:
        """Standard deviation of the value, SI; nan where the map does not say."""
        return math.nan if self.std is None else self.std * SI_FACTOR.get(self.unit, 1.0)

    @property
    def is_code(self) -> bool:
        """Whether it is a plain integer code, without scale, offset or unit."""
        plain = not self.unit and self.scale == 1.0 and not self.offset
        return plain and self.kind not in ("f32", "f64", "string")

    @property
    def full_scale(self) -> tuple[float, float] | None:
        """Smallest and largest value the channel can show, SI; None where the map does not say."""
        if self.saturation is None:
            return None
        low, high = (code * self.si_factor + self.si_offset for code in self.saturation)
        return low, high

    def raw(self, words: Words) -> NDArray[Any]:
        """Codes in `words`, shape (len(words) // words_per_value,), big-endian dtype of `kind`.

        Raises
        ------
        MapError
            If the words are not a whole number of values, or this is a string.
        """
        if self.kind == "string":
            raise MapError(f"register {self.name} holds text, not codes")
        if words.size % self.words_per_value:
            raise MapError(f"register {self.name}: {words.size} words are no whole number of {self.kind}")
        return self._in_order(words).view(KINDS[self.kind])

    def decode(self, words: Words) -> Value:
        """Value in `words`: text, a number, or an array (also a shorter one than `count`).

        Plain codes stay integers; all else comes in SI as float64, with nan for `not_a_number`. An array of
        decimal codes is float64, too, where one of them has a digit above 9, with nan for that.

        Raises
        ------
        MapError
            If a single value is asked for from the wrong number of words.
        NotDecimalError
            If a single decimal code has a digit above 9.
        """
        if self.kind == "string":
            text = self._in_order(words).tobytes().split(b"\0", 1)[0]
            return text.decode("utf-8", errors="replace").rstrip()
        if self.count == 1:
            return self._number(words)
        raw = self.raw(words)
        if self._is_bcd:
            raw = from_bcd(raw)
        if self.is_code:
            unreadable = self._is_bcd and (raw == NO_BCD).any()
            return np.where(raw == NO_BCD, np.nan, raw) if unreadable else raw.astype(np.int64)
        codes = raw.astype(raw.dtype.newbyteorder("="))
        values: NDArray[np.float64] = np.multiply(codes, self.si_factor, dtype=np.float64)
        if self.offset:
            values += self.si_offset
        if self.not_a_number is not None:
            values[codes == self.not_a_number] = np.nan
        if self._is_bcd:
            values[codes == NO_BCD] = np.nan
        return values

    def _number(self, words: Words) -> int | float:
        if words.size != self.words:
            raise MapError(f"register {self.name} takes {self.words} words, not {words.size}")
        wire = words[::-1] if self.word_order == "little" else words
        wire = wire.astype(WIRE, copy=False)
        if self.byte_order == "little":
            wire = wire.byteswap()
        code: int | float
        (code,) = _NUMBERS[self.kind].unpack(wire.tobytes())
        if self.bit is not None:
            return int(code) >> self.bit & 1
        if self._is_bcd:
            shown = code
            code = int(from_bcd(self._in_order(words).view(KINDS[self.kind]))[0])
            if code == NO_BCD:
                if self.is_code:
                    where = f"register {self.name} ({self.address})"
                    raise NotDecimalError(f"{where} shows {shown:#x}, which is no {self.kind}")
                return math.nan
        if self.is_code:
            return code
        if code == self.not_a_number:
            return math.nan
        value = float(code) * self.si_factor
        return value + self.si_offset if self.offset else value

    @property
    def _is_bcd(self) -> bool:
        return self.kind in ("bcd16", "bcd32")

    def _in_order(self, words: Words) -> Words:
        """Put words and bytes from the map's order into that of `WIRE`, or back."""
        wire = np.ascontiguousarray(words, dtype=WIRE)
        if self.word_order == "little" and self.words_per_value > 1 and self.kind != "string":
            wire = np.ascontiguousarray(wire.reshape(-1, self.words_per_value)[:, ::-1]).reshape(-1)
        return wire.byteswap() if self.byte_order == "little" else wire

    def encode(self, value: ArrayLike | str) -> Words:
        """Words of `value` (SI, text, or an array of at most `count` values), dtype `WIRE`.

        A number beyond the codes' range goes to the nearest end (to `saturation` where that is given), nan to
        `not_a_number`.

        Raises
        ------
        MapError
            If a text or an array is too long, or nan has no code here.
        """
        if self.kind == "string":
            text = str(value).encode()
            if len(text) > 2 * self.length:
                raise MapError(f"register {self.name}: {len(text)} bytes do not fit {self.length} registers")
            return self._in_order(np.frombuffer(text.ljust(2 * self.length, b"\0"), dtype=WIRE).copy())
        if self.bit is not None:
            raise MapError(f"register {self.name} is one bit of a register, which is not written alone")
        codes = self._codes(np.atleast_1d(np.asarray(value)))
        if codes.size > self.count:
            raise MapError(f"register {self.name}: {codes.size} values do not fit {self.count}")
        return self._in_order(codes.view(WIRE))

    def bit_mask(self) -> Words:
        """Word with a 1 where the register has its `bit`, as on the wire, shape (1,).

        Raises
        ------
        MapError
            If it is no single bit.
        """
        if self.bit is None:
            raise MapError(f"register {self.name} is no single bit of a register")
        return self._in_order(np.array([1 << self.bit], dtype=WIRE))

    def _codes(self, values: NDArray[Any]) -> NDArray[Any]:
        dtype, codes_of_type = KINDS[self.kind], code_range(self.kind)
        if codes_of_type is None:
            return ((values.astype(np.float64) - self.si_offset) / self.si_factor).astype(dtype)
        least, most = codes_of_type
        if values.dtype.kind in "iu" and self.is_code:  # exact: u64 does not pass through a float
            if values.size and (int(values.min()) < least or int(values.max()) > most):
                raise MapError(f"register {self.name}: value outside {least}..{most}")
            return to_bcd(values, dtype) if self._is_bcd else values.astype(dtype)
        low, high = self.saturation or (least, most)
        scaled = np.rint((values.astype(np.float64) - self.si_offset) / self.si_factor)
        missing = np.isnan(scaled)
        if missing.any() and self.not_a_number is None:
            raise MapError(f"register {self.name} has no code for a value that is not a number")
        end = float(high) if int(float(high)) <= high else math.nextafter(float(high), 0.0)
        clipped = np.clip(np.where(missing, 0.0, scaled), low, end)
        if self._is_bcd:
            clipped[missing] = self.not_a_number or 0
            return to_bcd(clipped, dtype)
        codes = clipped.astype(dtype)
        if self.not_a_number is not None:
            codes[missing] = self.not_a_number
        return codes
