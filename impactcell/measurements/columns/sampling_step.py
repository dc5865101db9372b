"""Step of time of a table that has no column of it, as given or as the file says beside its columns."""

import math
import re
from collections.abc import Mapping

from impactcell.measurements.columns.recognition import RATE_WORDS, STEP_WORDS, normalised
from impactcell.measurements.notation.numbers import doubt_of_line, split_stated
from impactcell.measurements.notation.units import Dimension, parse_unit, split_unit
from impactcell.measurements.table import Table

SAMPLES = re.compile(r"([kM]?)(?:S|Sa|samples?|Messwerte)/(?:s|sec)|([kM]?)sps", re.IGNORECASE)
"""Writings of a number of samples a second."""
THOUSANDS = {"": 1.0, "k": 1e3, "m": 1e6}
"""What stands before them, in lower case."""


def sampling_step_s(table: Table, constants: Mapping[str, float]) -> float | None:
    """Give the step of a table [s], None where nothing says it or what is said cannot be."""
    if "rate_hz" in constants:
        return 1.0 / constants["rate_hz"]
    for key, text in table.attributes.items():
        step = _step(key, text, table.decimal)
        if step is not None and 0.0 < step < math.inf and not doubt_of_line(key, text, table.decimal):
            return step
    return None


def says_step(key: str, text: str) -> bool:
    """Whether what a file says is its rate or its step."""
    return _step(key, text, ".") is not None


def doubt_of_step(table: Table) -> str:
    """Say which line of a table says its step in a way that may be read as another; empty where none does."""
    for key, text in table.attributes.items():
        if _step(key, text, table.decimal) is not None and (doubt := doubt_of_line(key, text, table.decimal)):
            return doubt
    return ""


def _step(key: str, text: str, decimal: str) -> float | None:
    name, unit_of_key = split_unit(key)
    name = normalised(name)
    number, rest = split_stated(text, decimal)
    if number is None or not 0.0 < number < math.inf:
        return None
    unit = rest.strip("[]() ") or unit_of_key or ""
    if any(word == name or name.startswith(word) for word in RATE_WORDS.split()):
        factor = _factor(unit, Dimension.FREQUENCY)
        return None if factor is None else 1.0 / (number * factor)
    if any(word == name or name.startswith(word) for word in STEP_WORDS.split()):
        factor = _factor(unit, Dimension.TIME)
        return None if factor is None else number * factor
    return None


def _factor(unit: str, dimension: Dimension) -> float | None:
    """Factor to SI of a unit as it is written, 1 where none is; None where it is of something else."""
    samples = SAMPLES.fullmatch(unit)
    if samples is not None and dimension is Dimension.FREQUENCY:
        return THOUSANDS[(samples[1] or samples[2] or "").lower()]
    known = parse_unit(unit)
    if known is None:
        return None if unit else 1.0
    return known.factor if known.dimension is dimension else None
