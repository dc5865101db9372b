"""Step of time of a table that has no column of it, as given or as the file says beside its columns."""

import math
from collections.abc import Mapping

from impactcell.measurements.numbers import parse_number
from impactcell.measurements.recognition import RATE_WORDS, STEP_WORDS, normalised
from impactcell.measurements.table import Table
from impactcell.measurements.units import Dimension, parse_unit, split_unit


def sampling_step_s(table: Table, constants: Mapping[str, float]) -> float | None:
    """Give the step of a table [s], None where nothing says it or what is said cannot be."""
    if "rate_hz" in constants:
        return 1.0 / constants["rate_hz"]
    for key, text in table.attributes.items():
        step = _step(key, text)
        if step is not None and 0.0 < step < math.inf:
            return step
    return None


def _step(key: str, text: str) -> float | None:
    name, unit_of_key = split_unit(key)
    name = normalised(name)
    number = _first_number(text)
    if number is None or not 0.0 < number < math.inf:
        return None
    if any(word == name or name.startswith(word) for word in RATE_WORDS.split()):
        return 1.0 / (number * (1e3 if "khz" in (key + text).lower() else 1.0))
    if any(word == name or name.startswith(word) for word in STEP_WORDS.split()):
        unit = parse_unit(text.rsplit(maxsplit=1)[-1] if len(text.split()) > 1 else unit_of_key or "")
        return number * (unit.factor if unit and unit.dimension is Dimension.TIME else 1.0)
    return None


def _first_number(text: str) -> float | None:
    first = text.split(maxsplit=1)[0] if text.split() else ""
    value = parse_number(first)
    return value if value is not None else parse_number(first, ",")
