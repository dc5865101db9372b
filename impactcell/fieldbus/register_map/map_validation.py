"""What a map file may say about a register: keys, types and ranges, every fault named."""

import difflib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from impactcell.fieldbus.register_map.map_registers import CONSTANTS
from impactcell.fieldbus.register_map.register_types import (
    BIT_TABLES,
    KINDS,
    SI_FACTOR,
    TABLES,
    WRITABLE_TABLES,
    code_range,
)

_ORDERS: Final = ("big", "little")
MASK_WRITE, READ_WRITE = 22, 23
"""Functions that only some modules have: mask write register, and read/write multiple registers."""
_LARGEST: Final = 1e300
"""A scale or offset with which the largest code is still a number."""


def _is_int(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _LARGEST


def _is_codes(value: object) -> bool:
    return isinstance(value, Mapping) and all(
        _is_int(key) and isinstance(text, str) for key, text in value.items()
    )


def _is_saturation(value: object) -> bool:
    return (
        isinstance(value, list | tuple)
        and len(value) == 2
        and all(map(_is_int, value))
        and value[0] < value[1]
    )


_KEYS: Final[Mapping[str, tuple[str, Callable[[Any], bool]]]] = {
    "address": (
        "an address 0..65535 (a reference 4nnnnn is holding register nnnnn - 1)",
        lambda value: _is_int(value) and 0 <= value < 65_536,
    ),
    "type": (
        "u16, i16, u32, i32, u64, i64, bcd16, bcd32, f32, f64, bit or string",
        lambda value: isinstance(value, str),
    ),
    "count": ("a whole number of at least 1", lambda value: _is_int(value) and value >= 1),
    "length": ("a whole number of registers, at least 1", lambda value: _is_int(value) and value >= 1),
    "table": ("holding, input, coil or discrete", lambda value: value in TABLES),
    "writable": ("true or false", lambda value: isinstance(value, bool)),
    "word_order": ("big or little", lambda value: value in _ORDERS),
    "byte_order": ("big or little", lambda value: value in _ORDERS),
    "bit": ("a bit 0..15", lambda value: _is_int(value) and 0 <= value < 16),
    "offset": ("a number", _is_number),
    "scale": ("a number above 0", lambda value: _is_number(value) and value > 0.0),
    "unit": ("text", lambda value: isinstance(value, str)),
    "not_a_number": ("a code of its type", _is_int),
    "saturation": ("two codes, the lower first", _is_saturation),
    "std": ("a number above 0", lambda value: _is_number(value) and value > 0.0),
    "expect": ("a whole number or text", lambda value: _is_int(value) or isinstance(value, str)),
    "codes": ("whole numbers with their names", _is_codes),
    "description": ("text", lambda value: isinstance(value, str)),
}


_CONSTANT_KEYS: Final[Mapping[str, tuple[str, Callable[[Any], bool]]]] = {
    "value": ("a number", _is_number),
    "unit": _KEYS["unit"],
    "description": _KEYS["description"],
}
"""Keys of an entry that stands for a register: the module has none, for it is always the same."""
_TOP: Final = ("format", "name", "word_order", "functions", "gaps", "registers")


@dataclass(frozen=True, slots=True)
class ValidatedMap:
    """What is sound in a map file, and what is not.

    Attributes
    ----------
    registers : dict
        Arguments of each register that is declared soundly, by name.
    constants : dict
        Value of each constant that is, SI.
    functions : tuple of int
        Of `MASK_WRITE` and `READ_WRITE`, those that the module has.
    gaps : bool
        Whether addresses between its registers can be read.
    faults : list of str
        All that is wrong.
    """

    name: str
    registers: dict[str, dict[str, Any]]
    constants: dict[str, float]
    functions: tuple[int, ...]
    gaps: bool
    faults: list[str]


def validate_map(mapping: Mapping[str, Any]) -> ValidatedMap:
    """Look through a parsed map file: `format`, `name`, `registers` and the like, `_TOP`."""
    faults = [f"unknown key {key}" for key in mapping if key not in _TOP]
    if mapping.get("format") != 1:
        faults.append("format must be 1")
    order = mapping.get("word_order", "big")
    if order not in _ORDERS:
        faults.append("word_order must be big or little")
    functions = mapping.get("functions", [])
    if not isinstance(functions, list) or any(
        not _is_int(each) or each not in (MASK_WRITE, READ_WRITE) for each in functions
    ):
        faults.append(f"functions must be a list of {MASK_WRITE} and {READ_WRITE}, those that the module has")
        functions = []
    gaps = mapping.get("gaps", True)
    if not isinstance(gaps, bool):
        faults.append("gaps must be true or false: whether addresses between the registers can be read")
    name = str(mapping.get("name", "without a name"))
    validated = ValidatedMap(name, {}, {}, tuple(functions), bool(gaps), faults)
    for key, entry in mapping["registers"].items():
        is_constant = isinstance(entry, Mapping) and "value" in entry
        entry_faults = _constant_faults(key, entry) if is_constant else _entry_faults(entry, functions)
        faults += [f"register {key}: {fault}" for fault in entry_faults]
        if entry_faults:
            continue
        if is_constant:
            validated.constants[str(key)] = _constant(entry)
        else:
            validated.registers[str(key)] = _arguments(str(key), entry, order)
    return validated


def _constant_faults(name: object, entry: Mapping[str, Any]) -> list[str]:
    if name not in CONSTANTS:
        return [f"cannot be a constant; only {', '.join(CONSTANTS)} can"]
    faults = _key_faults(entry, _CONSTANT_KEYS)
    if not faults and entry.get("unit") and entry["unit"] not in SI_FACTOR:
        faults.append(f"unit {entry['unit']!r} is not known")
    if not faults and name == "direction" and entry["value"] not in (-1, 1):
        faults.append("value must be 1 or -1")
    elif not faults and not (name == "direction" or str(name).endswith("_start") or entry["value"] > 0.0):
        faults.append("value must be above 0")
    return faults


def _constant(entry: Mapping[str, Any]) -> float:
    value: float = entry["value"]  # a direction is a whole number and stays one
    return value * SI_FACTOR[entry["unit"]] if entry.get("unit") else value


def _key_faults(entry: Mapping[Any, Any], keys: Mapping[str, tuple[str, Callable[[Any], bool]]]) -> list[str]:
    faults = []
    for key, value in entry.items():
        if key not in keys:
            near = difflib.get_close_matches(str(key), keys, n=1)
            faults.append(f"unknown key {key}{f'; did you mean {near[0]}?' if near else ''}")
        elif not keys[key][1](value):
            faults.append(f"{key} must be {keys[key][0]}, not {value!r}")
    return faults


def _entry_faults(entry: object, functions: list[int]) -> list[str]:
    if not isinstance(entry, Mapping):
        return ["must be a mapping with at least address and type"]
    faults = [f"{key} is missing" for key in ("address", "type") if key not in entry]
    faults += _key_faults(entry, _KEYS)
    faults = faults or [*_combination_faults(entry), *_bit_faults(entry, functions)]
    return faults or [*_code_faults(entry), *_expect_faults(entry)]


def _combination_faults(entry: Mapping[str, Any]) -> list[str]:
    """Say which keys, each of them sound, do not go together."""
    faults: list[str] = []
    kind, unit = entry["type"], entry.get("unit", "")
    if kind != "string" and kind not in KINDS:
        faults.append(f"type must be {_KEYS['type'][0]}, not {kind!r}")
    if (kind == "string") != ("length" in entry):
        faults.append("length belongs to type string, and to no other")
    if kind == "string" and "count" in entry:
        faults.append("an array of strings is not supported")
    if unit and unit not in SI_FACTOR:
        faults.append(f"unit {unit!r} is not known")
    if kind == "string" and not {"offset", "std"}.isdisjoint(entry):
        faults.append("a text has no offset and no std")
    if kind in ("f32", "f64", "string") and ("not_a_number" in entry or "saturation" in entry):
        faults.append("not_a_number and saturation are codes of integer types")
    table = entry.get("table", "holding")
    if entry.get("writable") and table not in WRITABLE_TABLES:
        faults.append(f"table {table} can only be read")
    return faults


def _bit_faults(entry: Mapping[str, Any], functions: list[int]) -> list[str]:
    """Say what does not go together about single bits: of a register, or in a table of bits."""
    in_table = entry.get("table", "holding") in BIT_TABLES
    faults = []
    if in_table != (entry["type"] == "bit"):
        faults.append("coils and discrete inputs are of type bit, and nothing else is")
    number_only = {"scale", "offset", "unit", "not_a_number", "saturation", "std"} & set(entry)
    if in_table and ({"bit", "word_order", "byte_order"} & set(entry) or number_only):
        faults.append("a coil or a discrete input has no order, scale or unit")
    if "bit" in entry:
        if entry["type"] != "u16" or {"count", "codes"} & set(entry) or number_only:
            faults.append("a bit is one of a u16, and has no scale, unit or codes")
        if entry.get("writable") and MASK_WRITE not in functions:
            faults.append(
                f"a bit of a register is written by function {MASK_WRITE}, which is not in functions"
            )
    return faults


def _code_faults(entry: Mapping[str, Any]) -> Iterator[str]:
    """Say which codes a register of its type never shows."""
    said = [("not_a_number", entry["not_a_number"])] if "not_a_number" in entry else []
    said += [("saturation", code) for code in entry.get("saturation", ())]
    if _is_plain(entry):
        said += [("codes: key", code) for code in entry.get("codes", ())]
    for key, code in said:
        yield from _range_faults(key, code, entry["type"])


def _expect_faults(entry: Mapping[str, Any]) -> Iterator[str]:
    """Say why a register can never show what it must."""
    expect, kind = entry.get("expect"), entry["type"]
    if expect is None:
        return
    if entry.get("count", 1) > 1:
        yield "expect belongs to a single value"
    elif (kind == "string") != isinstance(expect, str):
        yield f"expect must be {'text, in quotes' if kind == 'string' else 'a whole number'}, not {expect!r}"
    elif isinstance(expect, str):
        size, room = len(expect.encode(errors="replace")), 2 * entry["length"]
        if size > room:
            yield f"expect has {size} bytes, {entry['length']} registers hold {room}"
        elif expect != expect.rstrip() or "\0" in expect:
            yield f"expect must end without a space and have no NUL, not {expect!r}: it is read up to there"
    elif _is_plain(entry):
        yield from _range_faults("expect", expect, "bit" if "bit" in entry else kind)


def _is_plain(entry: Mapping[str, Any]) -> bool:
    """Whether what an entry shows is its code."""
    return not entry.get("unit") and entry.get("scale", 1.0) == 1.0 and not entry.get("offset")


def _range_faults(key: str, code: int, kind: str) -> Iterator[str]:
    """Say that no register of a type shows a code, and which one its bits mean there."""
    shown = code_range(kind)
    if shown is None or shown[0] <= code <= shown[1]:
        return
    least, most = shown
    meant, values = "", 2 ** (8 * KINDS[kind].itemsize)
    if kind.startswith("bcd"):
        meant = "; a code with a digit above 9 is no number anyway" if key == "not_a_number" else ""
    elif kind != "bit" and key != "saturation" and -values // 2 <= code < values:
        meant = f"; write {(code - least) % values + least}"
    yield f"{key} {code} is outside of {kind}, {least} to {most}{meant}"


def _arguments(name: str, entry: Mapping[str, Any], order: str) -> dict[str, Any]:
    values = {key: value for key, value in entry.items() if key != "type"}
    values |= {"name": name, "kind": entry["type"], "word_order": entry.get("word_order", order)}
    if "saturation" in values:
        values["saturation"] = (values["saturation"][0], values["saturation"][1])
    values |= {key: float(values[key]) for key in ("scale", "offset", "std") if key in values}
    return values
