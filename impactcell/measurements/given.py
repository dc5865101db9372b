"""What the user says of his files, on the command line or in a YAML, instead of letting it be guessed."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from impactcell.campaign import Excitation
from impactcell.errors import MeasurementError, SettingsError
from impactcell.measurements.columns.given_values import Given
from impactcell.measurements.columns.recognition import CHANNELS, VOCABULARY, ColumnMeaning
from impactcell.measurements.notation.gains import Gain, parse_gain
from impactcell.measurements.notation.numbers import parse_number
from impactcell.measurements.notation.units import Dimension, parse_unit
from impactcell.measurements.taps.cutting import NO_TRIGGER
from impactcell.process import yaml_loader
from impactcell.records.plausible_range import STROKE

CONSTANTS: dict[str, tuple[tuple[Dimension, ...], str]] = {
    "mass": ((Dimension.MASS, Dimension.INERTIA), "18.9 kg"),
    "velocity": ((Dimension.VELOCITY, Dimension.ANGULAR_VELOCITY), "3000 mm/min"),
    "direction": ((Dimension.NONE,), "1 or -1"),
    "stroke": ((Dimension.LENGTH, Dimension.ANGLE), "1.5 mm"),
    "rate": ((Dimension.FREQUENCY,), "10 kHz"),
    "gravity": ((Dimension.ACCELERATION,), "9.81 m/s2"),
    "dwell": ((Dimension.TIME,), "30 s"),
}
"""What can be said to hold for all shots: its units, and an example."""
NAMES = {"rate": "rate_hz"}
"""Names of constants that carry their unit."""
OTHERS = (ColumnMeaning.COVARIATE, ColumnMeaning.IGNORED)
"""What several columns can be: said once for each, or as a list in a file."""
_MARK = " and a decimal point, without separators of thousands"
"""What a number with a comma may have meant otherwise."""
_WITH_UNIT = re.compile(r"([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(.*)")
"""A number, and whatever is its unit."""
LONGEST_DELAY_S = 1.0
"""Longest time [s] that a channel may be moved: beyond it the channels are of different events."""
SECTIONS = ("columns", "units", "gains", "signs", "delays", "constants")
"""Blocks of a mapping file; beside them `excitation`, `trigger` and `lost`."""


def read_given(
    said: Mapping[str, Sequence[str]],
    file: Path | None = None,
    excitation: str | None = None,
    trigger: str | None = None,
) -> Given:
    """Put together what was said as `NAME=VALUE` and in a file; what was said goes before the file.

    Raises
    ------
    MeasurementError
        Every name and value that is not known.
    """
    sections, from_file, others, lost = _read(file) if file is not None else ({}, {}, {}, frozenset())
    for section in SECTIONS:
        for text in said.get(section, ()):
            name, equals, value = text.partition("=") if section != "units" else _split_last(text)
            if not equals or not name.strip() or not value.strip():
                raise MeasurementError(f"{text!r} is not NAME=VALUE")
            if section == "columns" and name.strip() in OTHERS:
                others[value.strip()] = ColumnMeaning(name.strip())
            else:
                sections.setdefault(section, {})[name.strip()] = value.strip()
    faults: list[str] = []
    given = Given(
        {q: name for key, name in sections.get("columns", {}).items() if (q := _quantity(key, faults))},
        sections.get("units", {}),
        {
            q: _sign(key, text, faults)
            for key, text in sections.get("signs", {}).items()
            if (q := _quantity(key, faults))
        },
        _excitation(excitation or from_file.get("excitation"), faults),
        _trigger(trigger or from_file.get("trigger"), faults),
        {
            NAMES.get(key, key): _constant(key, text, faults)
            for key, text in sections.get("constants", {}).items()
        },
        others,
        {
            q: gain
            for key, text in sections.get("gains", {}).items()
            if (q := _quantity(key, faults)) and (gain := _gain(q, text, faults))
        },
        {
            q: _delay(q, text, faults)
            for key, text in sections.get("delays", {}).items()
            if (q := _quantity(key, faults))
        },
        lost,
    )
    if faults:
        raise MeasurementError("\n".join(faults))
    return given


def _split_last(text: str) -> tuple[str, str, str]:
    return text.rpartition("=")


def _read(
    file: Path,
) -> tuple[dict[str, dict[str, str]], dict[str, str], dict[str, ColumnMeaning], frozenset[str]]:
    """Blocks of a file, excitation and trigger, columns that are covariates or ignored, lost words."""
    try:
        content, positions = yaml_loader.load(file)
    except SettingsError as error:
        raise MeasurementError(str(error)) from error
    known = (*SECTIONS, "excitation", "trigger", "lost")
    if not isinstance(content, dict):
        raise MeasurementError(f"{file}: has to hold blocks {', '.join(SECTIONS)}, excitation and trigger")
    faults: list[str] = []
    sections: dict[str, dict[str, str]] = {}
    single: dict[str, str] = {}
    others: dict[str, ColumnMeaning] = {}
    lost: frozenset[str] = frozenset()

    def fault(message: str, *location: str | int) -> None:
        faults.append(yaml_loader.format_error(file, positions.key(location), message))

    for key, value in content.items():
        if key not in known:
            fault(f"unknown key {key!r}; known: {', '.join(known)}", key)
        elif key == "lost":
            words = value if isinstance(value, list) else [value]
            if not all(isinstance(word, str | float) for word in words):
                fault("lost has to be a list of words, as [OVER, Error]", key)
            lost = frozenset(str(word).strip().lower() for word in words)
        elif key not in SECTIONS:
            single[key] = str(value)
        elif not isinstance(value, dict):
            fault(f"{key} has to be a block of `name: value`", key)
        else:
            for name, item in value.items():
                several = key == "columns" and name in OTHERS
                listed = item if several and isinstance(item, list) else [item]
                if not all(isinstance(part, str | int | float) for part in listed):
                    fault(f"{key}.{name} has to be a text or a number", key, name)
                elif several:
                    others |= {str(column): ColumnMeaning(name) for column in listed}
                else:
                    sections.setdefault(key, {})[str(name)] = str(item)
    if faults:
        raise MeasurementError("\n".join(faults))
    return sections, single, others, lost


def _quantity(key: str, faults: list[str]) -> ColumnMeaning | None:
    if key in set(ColumnMeaning):
        return ColumnMeaning(key)
    faults.append(f"{key!r} is no quantity; known: {', '.join(ColumnMeaning)}")
    return None


def _sign(key: str, text: str, faults: list[str]) -> int:
    if key not in CHANNELS:
        faults.append(f"{key} cannot be turned; a sign is of {', '.join(CHANNELS)}")
    if text in ("1", "+1", "-1"):
        return int(text)
    faults.append(f"the sign of {key} is {text!r}; it has to be 1 or -1")
    return 1


def _delay(quantity: ColumnMeaning, text: str, faults: list[str]) -> float:
    if quantity not in CHANNELS:
        faults.append(f"{quantity} cannot be moved; a delay is of {', '.join(CHANNELS)}")
        return 0.0
    match = _WITH_UNIT.fullmatch(text)
    value = parse_number(match.group(1)) if match else None
    unit = parse_unit(match.group(2)) if match else None
    if value is None or unit is None or unit.dimension is not Dimension.TIME or not math.isfinite(value):
        mark = _MARK if "," in text else ""
        faults.append(
            f"the delay of {quantity} is {text!r}; write it with its unit{mark}, as {quantity}=0.5 ms"
        )
        return 0.0
    delay = value * unit.factor
    if abs(delay) > LONGEST_DELAY_S:
        faults.append(f"the delay of {quantity} is {text!r}; more than {LONGEST_DELAY_S:g} s is no delay")
    return delay


def _gain(quantity: ColumnMeaning, text: str, faults: list[str]) -> Gain | None:
    if quantity not in CHANNELS:
        faults.append(f"{quantity} has no gain; one is of {', '.join(CHANNELS)}")
        return None
    dimensions = VOCABULARY[quantity].dimensions
    gain = parse_gain(text, dimensions)
    if gain is None:
        unit = dimensions[0].value
        faults.append(
            f"the gain of {quantity} is {text!r}; write it with its units, as {quantity}=12.5 {unit}/V or "
            f"{quantity}=80 mV/{unit}, or {quantity}=0.01 {unit} for one count of a converter"
            f"{'' if quantity is ColumnMeaning.FORCE else f', or {quantity}=20 mm/rev of a spindle'}"
        )
    return gain


def _excitation(text: str | None, faults: list[str]) -> Excitation | None:
    if text is None or text in set(Excitation):
        return None if text is None else Excitation(text)
    faults.append(f"excitation {text!r} is not known; say one of {', '.join(Excitation)}")
    return None


def _trigger(text: str | None, faults: list[str]) -> float | str | None:
    if text is None or text == NO_TRIGGER:
        return text
    match = re.fullmatch(r"(\S+?)\s*([a-zA-Z]*)", text.strip())
    value = parse_number(match.group(1)) if match and "," not in match.group(1) else None
    unit = parse_unit(match.group(2) or "N") if match else None
    fits = unit is not None and unit.dimension in (Dimension.FORCE, Dimension.TORQUE)
    if value is None or unit is None or not fits or not 0.0 < value < math.inf:
        faults.append(f"trigger {text!r} is neither a force, as '5 N', nor {NO_TRIGGER}")
        return None
    return value * unit.factor


def _constant(key: str, text: str, faults: list[str]) -> float:
    if key not in CONSTANTS:
        faults.append(f"{key!r} cannot be set; known: {', '.join(CONSTANTS)}")
        return math.nan
    dimensions, example = CONSTANTS[key]
    match = _WITH_UNIT.fullmatch(text)
    value = parse_number(match.group(1)) if match else None
    unit = parse_unit(match.group(2) or "1") if match else None
    if value is None or unit is None or unit.dimension not in dimensions or not math.isfinite(value):
        faults.append(
            f"{key} is {text!r}; write it with its unit{_MARK if ',' in text else ''}, as {key}={example}"
        )
        return math.nan
    number = value * unit.factor
    if number == 0.0 or (number < 0.0 and key != "direction"):
        faults.append(f"{key} is {text!r}; it has to be positive")
    elif key == "stroke" and unit.dimension is Dimension.LENGTH and (doubt := STROKE.doubt(1e3 * number)):
        faults.append(f"{key} is {text!r}: {doubt}")
    return number
