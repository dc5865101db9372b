"""Gain of a sensor whose signal was recorded: newtons a volt, or millivolts a newton as data sheets say.

What moves a part by a spindle, a belt or a rack has a gain as well: millimetres a turn.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from impactcell.measurements.notation.numbers import parse_number
from impactcell.measurements.notation.units import Dimension, MeasuredUnit, parse_unit

SIGNALS = (Dimension.VOLTAGE, Dimension.CURRENT, Dimension.NONE)
"""What a sensor gives instead of what it measures: volts, amperes, counts of a converter."""
TRANSMITTED = {
    Dimension.LENGTH: Dimension.ANGLE,
    Dimension.VELOCITY: Dimension.ANGULAR_VELOCITY,
    Dimension.FORCE: Dimension.TORQUE,
}
"""What a drive may have recorded instead of what it moves."""
COUNT = MeasuredUnit("1", Dimension.NONE, 1.0)
"""A bare number, as of a converter."""


@dataclass(frozen=True, slots=True)
class Gain:
    """What a signal stands for.

    Attributes
    ----------
    text : str
        As it was said.
    signal : MeasuredUnit
        Of what was recorded; a column that says no unit is taken to be in it.
    dimension : Dimension
        Of what is measured.
    factor : float
        Measured over recorded, both in SI; negative where the sensor turns the sign.
    """

    text: str
    signal: MeasuredUnit
    dimension: Dimension
    factor: float

    def measured(self, recorded: MeasuredUnit | None) -> MeasuredUnit | None:
        """Give the unit of what is measured for a column `recorded` in one; None if that is no such signal.

        Examples
        --------
        >>> gain = parse_gain("80 mV/N", (Dimension.FORCE,))
        >>> gain.measured(parse_unit("V"))
        MeasuredUnit(symbol='V at 80 mV/N', dimension=<Dimension.FORCE: 'N'>, factor=12.5, offset=0.0)
        >>> gain.measured(parse_unit("kN")) is None
        True

        A turn's length is one of speeds as well, so that a column of either has to say which it is:

        >>> parse_gain("20 mm/rev", (Dimension.LENGTH,)).measured(parse_unit("rpm")).dimension.value
        'm/s'
        """
        if recorded is None and self.signal.dimension in SIGNALS:
            recorded = self.signal
        if recorded is None:
            return None
        dimension = self.dimension
        if dimension is Dimension.LENGTH and recorded.dimension is Dimension.ANGULAR_VELOCITY:
            dimension = Dimension.VELOCITY
        of = (
            TRANSMITTED[dimension] if self.signal.dimension in TRANSMITTED.values() else self.signal.dimension
        )
        if recorded.dimension is not of:
            return None
        return MeasuredUnit(f"{recorded.symbol} at {self.text}", dimension, recorded.factor * self.factor)


def parse_gain(text: str, dimensions: Sequence[Dimension]) -> Gain | None:
    """Give the gain that `text` writes, of a quantity of one of `dimensions`; None where it is none.

    Measured over recorded, recorded over measured, or measured alone, for one count of a converter. Of what
    is transmitted, the coordinate of translation is what is measured.

    Examples
    --------
    >>> parse_gain("12.5 N/V", (Dimension.FORCE,)).factor, parse_gain("80 mV/N", (Dimension.FORCE,)).factor
    (12.5, 12.5)
    >>> parse_gain("0.5 µm", (Dimension.LENGTH,)).factor
    5e-07
    >>> parse_gain("20 mm/rev", (Dimension.LENGTH, Dimension.ANGLE)).factor * 2.0 * math.pi
    0.02
    >>> parse_gain("12.5", (Dimension.FORCE,)) is None
    True
    """
    match = re.fullmatch(r"([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*([^/]+?)\s*(?:/\s*(.+))?", text.strip())
    value = parse_number(match.group(1)) if match else None
    if match is None or value is None or value == 0.0 or not math.isfinite(value):
        return None
    above, below = parse_unit(match.group(2)), parse_unit(match.group(3)) if match.group(3) else COUNT
    if above is None or below is None:
        return None
    if above.dimension in dimensions and _gives(below, above):
        return Gain(text.strip(), below, above.dimension, value * above.factor / below.factor)
    if below.dimension in dimensions and _gives(above, below):
        return Gain(text.strip(), above, below.dimension, below.factor / (value * above.factor))
    return None


def _gives(signal: MeasuredUnit, measured: MeasuredUnit) -> bool:
    return signal.dimension in SIGNALS or signal.dimension is TRANSMITTED.get(measured.dimension)
