"""Notices a column that is wrong by a large factor, as millimetres given for metres."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from impactcell.errors import CampaignError


@dataclass(frozen=True, slots=True)
class PlausibleRatio:
    """A ratio of measured quantities that physics bounds.

    Attributes
    ----------
    low, high : float
        Range of its median over all shots; outside of it a unit is wrong.
    name : str
    columns : str
        Columns whose unit may be wrong.
    column_of_shot : str
        Column that is wrong where a shot's ratio alone is not like the others', its other ratios are.
    apart, far : float
        Factor between a shot's ratio and those of the campaign beyond which it is not like them: where shots
        of the same settings have another one, and wherever it is. Infinite where it is not judged by shot.
    """

    low: float
    high: float
    name: str
    columns: str
    column_of_shot: str = ""
    apart: float = math.inf
    far: float = math.inf


def check_units(ratios_of_shots: Iterable[Mapping[PlausibleRatio, float]]) -> None:
    """Notice a column that is wrong by a large factor.

    Parameters
    ----------
    ratios_of_shots : iterable of mapping
        Ratios of every shot.

    Raises
    ------
    CampaignError
        The median of a ratio is outside of its range.
    """
    values: dict[PlausibleRatio, list[float]] = {}
    for ratios in ratios_of_shots:
        for ratio, value in ratios.items():
            values.setdefault(ratio, []).append(value)
    for ratio, of_shots in values.items():
        median = float(np.median(of_shots))
        if not ratio.low < median < ratio.high:
            told = (
                f"{ratio.name} is {median:.3g}, where about 1 is possible: check the unit of {ratio.columns}"
            )
            factor = f" (off by a factor of about {likely_factor(median, ratio.columns)})" if median else ""
            raise CampaignError(f"{told}{factor}")


def likely_factor(value: float, columns: str) -> str:
    """Factor between units that is nearest to a ratio: a power of 1000, of a velocity also that of mm/min."""
    decades = math.log10(max(value, 1e-300))
    power = 3 * (round(decades / 3.0) or (1 if decades > 0.0 else -1))
    factors = {f"1e{power:+d}": float(power)}
    if "velocity" in columns:
        minute, of_m_per_s = math.log10(60.0), math.log10(6e4)
        factors |= {"60": minute, "1/60": -minute, "6e+4": of_m_per_s, "1/6e+4": -of_m_per_s}
    return min(factors, key=lambda factor: abs(factors[factor] - decades))
