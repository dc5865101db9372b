"""Where a quantity of a tap lies, and what is said of one that is hardly meant."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final


def meant_in(value: float, units: Mapping[str, float], usual: tuple[float, float], verb: str = "give") -> str:
    """Say in which other unit a number was meant, and what to give then; empty where it is usual in none.

    Parameters
    ----------
    units : mapping
        By what one of them is in the unit that is asked for; the first that makes the number usual is told.
    usual : tuple of float
        Where it lies, in that unit.

    Examples
    --------
    >>> meant_in(40.0, {"mm/s": 1e-3}, (1e-3, 1.0))
    'if that was meant in mm/s, give 0.04'
    """
    low, high = usual
    meant = next((unit for unit, one in units.items() if low <= one * value <= high), None)
    return f"if that was meant in {meant}, {verb} {units[meant] * value:g}" if meant else ""


@dataclass(frozen=True, slots=True)
class PlausibleRange:
    """Where a quantity of a tap lies, and what else it may have been said in.

    Attributes
    ----------
    name, unit : str
    low, high : float
        Our choice: some two orders of magnitude to either side of the paper's prototype.
    others : mapping
        Other units by what one of them is in `unit`.
    of : str
        What has such a quantity, in the plural.
    """

    name: str
    unit: str
    low: float
    high: float
    others: Mapping[str, float]
    of: str = "taps"

    def doubt(self, value: float) -> str:
        """Say that a value is hardly meant, and the unit in which it would be; empty where it may be."""
        if self.low <= value <= self.high or not math.isfinite(value):
            return ""
        unit = f" {self.unit}" if self.unit else ""
        way_out = meant_in(value, self.others, (self.low, self.high), "write") or "check its unit"
        return (
            f"{self.name} of {value:g}{unit} is hardly meant, where {self.of} have {self.low:g} to "
            f"{self.high:g}{unit}: {way_out}"
        )


STROKE: Final = PlausibleRange("a stroke", "mm", 0.01, 100.0, {"m": 1e3, "µm": 1e-3})
STROKE_M: Final = PlausibleRange("a stroke", "m", 1e-5, 0.1, {"mm": 1e-3, "µm": 1e-6})
"""The same for a stroke that is written in metres."""
GRAVITY: Final = PlausibleRange("gravity", "m/s²", 1.0, 30.0, {"cm/s²": 1e-2, "mm/s²": 1e-3})
