"""Units as people write them in a header, and their factors to SI."""

import enum
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache


class Dimension(enum.Enum):
    """What a unit measures; the value names its SI unit."""

    TIME = "s"
    LENGTH = "m"
    ANGLE = "rad"
    FORCE = "N"
    TORQUE = "N m"
    MASS = "kg"
    INERTIA = "kg m²"
    VELOCITY = "m/s"
    ANGULAR_VELOCITY = "rad/s"
    ACCELERATION = "m/s²"
    PRESSURE = "Pa"
    FREQUENCY = "Hz"
    VOLTAGE = "V"
    CURRENT = "A"
    TEMPERATURE = "K"
    NONE = "1"


@dataclass(frozen=True, slots=True)
class MeasuredUnit:
    """A unit.

    Attributes
    ----------
    symbol : str
        As it is printed.
    dimension : Dimension
    factor : float
        A number in this unit times `factor`, and `offset` on top, is in SI.
    offset : float
        Where the unit's zero lies, SI; 0 for all but temperatures.
    """

    symbol: str
    dimension: Dimension
    factor: float
    offset: float = 0.0


_PREFIXES = {"": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "k": 1e3, "M": 1e6}
"""Prefixes of the SI that are met in records of machines, BIPM SI brochure (2019), table 7."""
_SI = (
    ("s", Dimension.TIME, 1.0, "num"),
    ("m", Dimension.LENGTH, 1.0, "numcdk"),
    ("rad", Dimension.ANGLE, 1.0, "um"),
    ("N", Dimension.FORCE, 1.0, "umkM"),
    ("Nm", Dimension.TORQUE, 1.0, "umkM"),
    ("g", Dimension.MASS, 1e-3, "mk"),
    ("Pa", Dimension.PRESSURE, 1.0, "mkM"),
    ("bar", Dimension.PRESSURE, 1e5, "m"),
    ("Hz", Dimension.FREQUENCY, 1.0, "kM"),
    ("V", Dimension.VOLTAGE, 1.0, "um"),
    ("A", Dimension.CURRENT, 1.0, "pnum"),
)
"""Symbol, dimension, factor, and the prefixes it is met with."""
_POUND_KG, _INCH_M, _KILOPOND_N = 0.45359237, 0.0254, 9.80665
"""International yard and pound agreement (1959); standard acceleration of free fall, CGPM 1901."""
_FURTHER = (
    ("min", Dimension.TIME, 60.0),
    ("h", Dimension.TIME, 3600.0),
    ("d", Dimension.TIME, 86_400.0),
    ("in", Dimension.LENGTH, _INCH_M),
    ("mil", Dimension.LENGTH, 1e-3 * _INCH_M),
    ("ft", Dimension.LENGTH, 12.0 * _INCH_M),
    ("deg", Dimension.ANGLE, math.pi / 180.0),
    ("rev", Dimension.ANGLE, 2.0 * math.pi),
    ("kgf", Dimension.FORCE, _KILOPOND_N),
    ("kp", Dimension.FORCE, _KILOPOND_N),
    ("lbf", Dimension.FORCE, _POUND_KG * _KILOPOND_N),
    ("daN", Dimension.FORCE, 10.0),
    ("Nmm", Dimension.TORQUE, 1e-3),
    ("Ncm", Dimension.TORQUE, 1e-2),
    ("t", Dimension.MASS, 1000.0),
    ("lb", Dimension.MASS, _POUND_KG),
    ("kgm2", Dimension.INERTIA, 1.0),
    ("kgcm2", Dimension.INERTIA, 1e-4),
    ("kgmm2", Dimension.INERTIA, 1e-6),
    ("gcm2", Dimension.INERTIA, 1e-7),
    ("psi", Dimension.PRESSURE, _POUND_KG * _KILOPOND_N / _INCH_M**2),
    ("rpm", Dimension.ANGULAR_VELOCITY, 2.0 * math.pi / 60.0),
    ("K", Dimension.TEMPERATURE, 1.0),
    ("%", Dimension.NONE, 0.01),
    ("1", Dimension.NONE, 1.0),
)
"""Symbol, dimension and factor of units that take no prefix (BIPM, The International System of Units)."""
_TEMPERATURES = (("degC", 1.0, 273.15), ("degF", 5.0 / 9.0, 459.67 * 5.0 / 9.0))
"""Symbol, kelvins a degree, and where its zero lies [K] (BIPM; Fahrenheit's by ITS-90)."""
_WORDS = {
    "sec": "s", "second": "s", "seconds": "s", "sekunde": "s", "sekunden": "s", "msec": "ms",
    "millisekunde": "ms", "millisekunden": "ms", "millisecond": "ms", "milliseconds": "ms",
    "mikrosekunde": "us", "mikrosekunden": "us", "microsecond": "us", "microseconds": "us", "usec": "us",
    "minutes": "min", "day": "d", "days": "d", "tag": "d", "tage": "d",
    "newton": "N", "newtons": "N", "kilonewton": "kN", "newtonmeter": "Nm", "meter": "m", "metre": "m",
    "meters": "m", "metres": "m", "millimeter": "mm", "millimetre": "mm", "millimeters": "mm", "micron": "um",
    "microns": "um", "mikrometer": "um", "micrometer": "um", "inch": "in", "inches": "in", '"': "in",
    "degree": "deg", "degrees": "deg", "grad": "deg", "°": "deg", "radian": "rad", "radians": "rad",
    "lbs": "lb", "°c": "degC", "°f": "degF", "u/min": "rpm", "1/min": "rpm", "1/s": "Hz", "volt": "V",
    "ampere": "A", "kilogram": "kg", "kilogramm": "kg", "percent": "%", "-": "1", "hz": "Hz", "khz": "kHz",
    "kn": "kN", "dan": "daN", "pa": "Pa", "mpa": "MPa", "hertz": "Hz", "kilohertz": "kHz",
    "megahertz": "MHz",
}  # fmt: skip
"""Other writings of a unit, in lower case; of prefixes that case tells apart (mPa, MPa) `_SI` has both."""
_IN_CAPITALS = frozenset((
    "s", "us", "min", "mm", "cm", "um", "mil", "ft", "deg", "rad", "rev", "rpm", "kg", "lb", "kgf", "lbf",
    "kp", "bar", "psi",
))  # fmt: skip
"""Units that capitals cannot confuse with others, as terse exports write them; of MS the M is also mega."""
_RATES = {
    (Dimension.LENGTH, 1): Dimension.VELOCITY,
    (Dimension.LENGTH, 2): Dimension.ACCELERATION,
    (Dimension.ANGLE, 1): Dimension.ANGULAR_VELOCITY,
}
"""What a dimension becomes over a power of time."""
_SUFFIX_WORDS = {"n": "N", "nm": "nm", "v": "V", "a": "A", "k": "K", "hz": "Hz", "kn": "kN", "pa": "Pa"}
"""Units of a name in lower case, as in `force_n`, that lower case would hide."""
_SPEED_SUFFIXES = (("m", "s"), ("mm", "s"), ("m", "min"), ("mm", "min"), ("rad", "s"))
"""Ends of a name that are a speed and no time, as in velocity_mm_min."""

_TORQUES = ("torque", "moment", "tau", "trq")
"""Names of what is in N m where "nm" stands behind them, for no torque is in nanometres."""
_NO_LENGTHS = frozenset((
    "tau", "torque", "trq", "force", "effort", "dq", "qd", "ddq", "qdd", "omega", "vel", "velocity",
    "speed", "dtheta", "u", "i", "current", "voltage",
))  # fmt: skip
"""Names of what is in no metres: there "_m" says that it was measured, or of the motor."""
_SEPARATORS = (" ?/ ?", " in ", ", ", " ", "_")
"""What stands between a name and its unit, in the order in which they are believed."""
_ONE_WORD = re.compile("(?!1 ?/ ?s|1 / )[^ /]+(?: ?/ ?[^ /]+)?")
"""A unit that may stand behind a name without anything between them."""


@cache
def _symbols() -> dict[str, MeasuredUnit]:
    table = {}
    for symbol, dimension, factor, prefixes in _SI:
        for prefix in ("", *prefixes):
            table[prefix + symbol] = MeasuredUnit(prefix + symbol, dimension, _PREFIXES[prefix] * factor)
    for symbol, dimension, factor in _FURTHER:
        table[symbol] = MeasuredUnit(symbol, dimension, factor)
    for symbol, factor, offset in _TEMPERATURES:
        table[symbol] = MeasuredUnit(symbol, Dimension.TEMPERATURE, factor, offset)
    return table


def parse_unit(text: str) -> MeasuredUnit | None:
    """Give the unit that `text` writes, None where it is none that is known.

    Examples
    --------
    >>> parse_unit("[mm/min]").factor * 60.0
    0.001
    >>> parse_unit("kg·m²").dimension.value
    'kg m²'
    >>> parse_unit("°C").offset
    273.15
    >>> parse_unit("furlong") is None
    True
    """
    shown = text.strip().strip("[]()").strip()
    plain = re.sub(r"[\s·⋅*.]|\^", "", shown.replace("²", "2").replace("µ", "u").replace("μ", "u"))
    if not plain:
        return None
    unit = _single(plain) or _rate(plain)
    return None if unit is None else replace(unit, symbol=shown)


def _single(plain: str) -> MeasuredUnit | None:
    symbols = _symbols()
    lower = plain.lower()
    known = symbols.get(plain) or symbols.get(_WORDS.get(lower, ""))
    return known or (symbols[lower] if plain.isupper() and lower in _IN_CAPITALS else None)


def _rate(plain: str) -> MeasuredUnit | None:
    """Something by time, as mm/min, m/s2 or deg/s."""
    above, slash, below = plain.partition("/")
    if not slash:
        return None
    power = 2 if below.endswith("2") else 1
    upper, lower = _single(above), _single(below.removesuffix("2"))
    if upper is None or lower is None or lower.dimension is not Dimension.TIME:
        return None
    dimension = _RATES.get((upper.dimension, power))
    return None if dimension is None else MeasuredUnit(plain, dimension, upper.factor / lower.factor**power)


def split_unit(header: str) -> tuple[str, str | None]:
    """Take the unit off a column's name: `Force [N]`, `Kraft (N)`, `F / N`, `Weg in mm`, `position_mm`.

    Returns
    -------
    name : str
    unit : str or None
        As written; None where the name holds none. What stands in brackets is taken for a unit only if it is
        one, or if the brackets are square.

    Examples
    --------
    >>> split_unit("Kraft in kN"), split_unit("velocity_mm_per_min"), split_unit("Force")
    (('Kraft', 'kN'), ('velocity', 'mm/min'), ('Force', None))

    Of several slashes the first that leaves a unit separates, as DIN 461 has it:

    >>> split_unit("v / mm/min"), split_unit("dx/dt / mm/s")
    (('v', 'mm/min'), ('dx/dt', 'mm/s'))

    What the name says counts: no torque is in nanometres, and none in metres.

    >>> split_unit("torque_nm"), split_unit("tau_m")
    (('torque', 'Nm'), ('tau_m', None))
    """
    name, unit = _split(" ".join(header.split()))
    if unit == "nm" and any(word in name.lower() for word in _TORQUES):
        return name, "Nm"
    if unit == "m" and header.strip().endswith("_m") and name.lower() in _NO_LENGTHS:
        return header.strip(), None
    return name, unit


def split_units(headers: Sequence[str]) -> list[tuple[str, str | None]]:
    """Take the units off the names of a table: where "_m" is none behind one name, it is none behind others.

    Examples
    --------
    >>> split_units(["q_m", "tau_m"]), split_units(["x_m", "F_N"])
    ([('q_m', None), ('tau_m', None)], [('x', 'm'), ('F', 'N')])
    """
    found = [split_unit(header) for header in headers]
    if any(unit is None and name.endswith("_m") for name, unit in found):
        return [
            (header.strip(), None) if unit == "m" and header.strip().endswith("_m") else (name, unit)
            for header, (name, unit) in zip(headers, found, strict=True)
        ]
    return found


def _split(text: str) -> tuple[str, str | None]:
    bracket = re.fullmatch(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\)|\{([^{}]*)\})", text)
    if bracket:
        name, *units = bracket.groups()
        unit = next(part for part in units if part is not None).strip()
        if parse_unit(unit) or bracket.group(2) is not None:
            return name, unit or None
    if "/" in text and " " not in text and parse_unit(text):
        return text, text  # a unit alone, and no `m` in seconds
    found = [
        (text[: match.start()], text[match.end() :])
        for separator in _SEPARATORS
        for match in re.finditer(separator, text)
        if _parts_unit(text, match)
    ]
    if found:
        return max(found, key=lambda parts: len(parts[1]))
    return _suffix(text)


def _parts_unit(text: str, separator: re.Match[str]) -> bool:
    """Whether a unit stands behind a separator, and a name before it."""
    name, unit = text[: separator.start()], text[separator.end() :]
    if not name or not parse_unit(unit):
        return False
    match separator[0]:
        case " ":
            # Of one sign is rather a name, and so is a number: in `Zeit 1 / s` the slash separates.
            return len(unit) > 1 and not name.endswith("_") and bool(_ONE_WORD.fullmatch(unit))
        case "_":
            return len(unit.partition("/")[0]) > 1 and "/" in unit  # v_m/s is rather v_m in seconds
        case _:
            return True


def _suffix(text: str) -> tuple[str, str | None]:
    parts = text.split("_")
    for count in range(min(4, len(parts) - 1), 0, -1):
        tail = parts[-count:]
        unit = "".join("/" if part == "per" else _SUFFIX_WORDS.get(part, part) for part in tail)
        unit = {"Nm": "Nm", "kgm2": "kgm2", "m/s": "m/s", "ms": "ms", "m/s2": "m/s2"}.get(unit, unit)
        if tuple(tail) in _SPEED_SUFFIXES:
            unit = "/".join(tail)
        # What is called "u_in" goes in; where inches are meant, the name ends in "inch".
        if parse_unit(unit) and parts[0] and unit not in ("1", "t", "h", "d", "in"):
            return "_".join(parts[:-count]), unit
    return text, None
