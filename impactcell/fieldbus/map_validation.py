"""What a map file may say about a register: keys, types and ranges, every fault named."""

from collections.abc import Callable, Container, Mapping
from typing import Any, Final

_TABLES: Final = ("holding", "input")
_ORDERS: Final = ("big", "little")
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
    "address": ("an address 0..65535", lambda value: _is_int(value) and 0 <= value < 65_536),
    "type": (
        "u16, i16, u32, i32, u64, i64, bcd16, bcd32, f32, f64 or string",
        lambda value: isinstance(value, str),
    ),
    "count": ("a whole number of at least 1", lambda value: _is_int(value) and value >= 1),
    "length": ("a whole number of registers, at least 1", lambda value: _is_int(value) and value >= 1),
    "table": ("holding or input", lambda value: value in _TABLES),
    "writable": ("true or false", lambda value: isinstance(value, bool)),
    "word_order": ("big or little", lambda value: value in _ORDERS),
    "byte_order": ("big or little", lambda value: value in _ORDERS),
    "bit": ("a bit 0..15", lambda value: _is_int(value) and 0 <= value < 16),
    "offset": ("a number", _is_number),
    "scale": ("a number above 0", lambda value: _is_number(value) and value > 0.0),
    "unit": ("text", lambda value: isinstance(value, str)),
    "not_a_number": ("a code", _is_int),
    "saturation": ("two codes, the lower first", _is_saturation),
    "expect": ("a whole number or text", lambda value: _is_int(value) or isinstance(value, str)),
    "codes": ("whole numbers with their names", _is_codes),
    "description": ("text", lambda value: isinstance(value, str)),
}


def validate_map(
    mapping: Mapping[str, Any], units: Container[str], kinds: Container[str]
) -> tuple[str, dict[str, dict[str, Any]], list[str]]:
    """Name of the map, the arguments of each register that is declared soundly, and all faults found.

    Parameters
    ----------
    mapping : mapping
        A parsed map file: `format`, `name`, `word_order` and the mapping `registers`.
    units, kinds : container of str
        What `unit` and `type` may be.
    """
    faults = [
        f"unknown key {key}" for key in mapping if key not in ("format", "name", "word_order", "registers")
    ]
    name = str(mapping.get("name", "without a name"))
    if mapping.get("format") != 1:
        faults.append("format must be 1")
    order = mapping.get("word_order", "big")
    if order not in _ORDERS:
        faults.append("word_order must be big or little")
    arguments: dict[str, dict[str, Any]] = {}
    for key, entry in mapping["registers"].items():
        entry_faults = list(_entry_faults(entry, units, kinds))
        faults += [f"register {key}: {fault}" for fault in entry_faults]
        if not entry_faults:
            arguments[str(key)] = _arguments(str(key), entry, order)
    return name, arguments, faults


def _entry_faults(entry: object, units: Container[str], kinds: Container[str]) -> list[str]:
    if not isinstance(entry, Mapping):
        return ["must be a mapping with at least address and type"]
    faults = [f"{key} is missing" for key in ("address", "type") if key not in entry]
    for key, value in entry.items():
        if key not in _KEYS:
            faults.append(f"unknown key {key}")
        elif not _KEYS[key][1](value):
            faults.append(f"{key} must be {_KEYS[key][0]}, not {value!r}")
    return faults or _combination_faults(entry, units, kinds)


def _combination_faults(entry: Mapping[str, Any], units: Container[str], kinds: Container[str]) -> list[str]:
    """Say which keys, each of them sound, do not go together."""
    faults: list[str] = []
    kind, unit = entry["type"], entry.get("unit", "")
    if kind != "string" and kind not in kinds:
        faults.append(f"type must be {_KEYS['type'][0]}, not {kind!r}")
    if (kind == "string") != ("length" in entry):
        faults.append("length belongs to type string, and to no other")
    if kind == "string" and "count" in entry:
        faults.append("an array of strings is not supported")
    if unit and unit not in units:
        faults.append(f"unit {unit!r} is not known")
    if kind == "string" and "offset" in entry:
        faults.append("a text has no offset")
    beside_bit = {"count", "scale", "offset", "unit", "not_a_number", "saturation", "codes"} & set(entry)
    if "bit" in entry and (kind != "u16" or entry.get("writable") or beside_bit):
        faults.append("a bit is one of a u16 that is only read, and has no scale, unit or codes")
    if kind in ("f32", "f64", "string") and ("not_a_number" in entry or "saturation" in entry):
        faults.append("not_a_number and saturation are codes of integer types")
    return faults


def _arguments(name: str, entry: Mapping[str, Any], order: str) -> dict[str, Any]:
    values = {key: value for key, value in entry.items() if key != "type"}
    values |= {"name": name, "kind": entry["type"], "word_order": entry.get("word_order", order)}
    if "saturation" in values:
        values["saturation"] = (values["saturation"][0], values["saturation"][1])
    if "scale" in values:
        values["scale"] = float(values["scale"])
    if "offset" in values:
        values["offset"] = float(values["offset"])
    return values
