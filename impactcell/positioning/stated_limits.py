"""Limits that a planner is given, held against those of cells: whoever mistakes a unit is told so."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from impactcell.errors import PositioningError
from impactcell.numerics.raster import Raster
from impactcell.positioning.planner_questions import FURTHEST_M, is_number, is_positive, shown
from impactcell.records import MM_PER_MIN
from impactcell.records.plausible_range import meant_in


class Limit(NamedTuple):
    """What a limit of taps must be.

    Attributes
    ----------
    largest : float
        More than that no cell has. Our choice.
    usual : tuple of float
        Where it lies in cells, to tell in which unit it may have been said.
    units : mapping
        Those units, by what one of them is in SI.
    may_lack : bool
        Whether a cell may do without: inf.
    """

    largest: float
    usual: tuple[float, float]
    units: Mapping[str, float]
    may_lack: bool = False


LIMITS: Final = MappingProxyType(
    {
        "tolerance_m": Limit(5e-3, (1e-6, 1e-3), {"µm": 1e-6, "mm": 1e-3}),
        "max_velocity_m_s": Limit(10.0, (0.01, 1.0), {"mm/min": MM_PER_MIN, "mm/s": 1e-3}),
        "max_stroke_m": Limit(0.1, (1e-4, 0.02), {"mm": 1e-3, "µm": 1e-6}, may_lack=True),
        "max_force_n": Limit(math.inf, (0.0, 0.0), {}, may_lack=True),
    }
)


def check_limit(name: str, value: float) -> None:
    """Refuse a limit that no cell has, with what it would be in SI.

    Raises
    ------
    PositioningError
    """
    limit = LIMITS[name]
    if limit.may_lack and value == math.inf:
        return
    if not is_positive(value):
        raise PositioningError(f"tap planner: {name} must be positive, not {shown(value)}")
    if value > limit.largest:
        way_out = meant_in(value, limit.units, limit.usual) or "see its unit"
        raise PositioningError(
            f"tap planner: {name} is {value:g}, where no cell has more than {limit.largest:g}; {way_out}"
        )


def check_raster(name: str, raster: Raster, limit_name: str, limit: float) -> None:
    """Refuse what is no raster, or one without a value up to the limit (SI) of this name.

    Raises
    ------
    PositioningError
    """
    if not isinstance(raster, Raster):
        raise PositioningError(
            f"tap planner: {name} is to be an impactcell.numerics.raster.Raster, Raster(1e-3, 1e-3) say, "
            f"not {raster!r}"
        )
    if not raster.has_up_to(limit):
        raise PositioningError(
            f"tap planner: {name} begins with {raster.least:g}, above {limit_name}, {limit:g}: no tap can be "
            f"commanded; raise {limit_name} to {raster.least:g} at least, or see the unit of the raster, "
            "which is in SI"
        )


def check_sides(two_sided: bool, travel_m: tuple[float, float]) -> None:  # noqa: FBT001
    """Refuse what does not say whether a cell strikes from both ends, and what is no travel of one.

    Raises
    ------
    PositioningError
    """
    if not isinstance(two_sided, bool | np.bool_):
        raise PositioningError(f"tap planner: two_sided is to be True or False, not {two_sided!r}")
    try:
        low, high = (math.fsum((end,)) for end in travel_m)
    except (TypeError, ValueError, OverflowError):
        raise PositioningError(
            f"tap planner: travel_m is to be two positions in m, (0.0, 0.04) say, not {travel_m!r}"
        ) from None
    if not low < high:
        raise PositioningError(f"tap planner: travel_m must be in order, not {travel_m}")
    furthest = max(abs(end) for end in (low, high, 0.0) if math.isfinite(end))
    if furthest > FURTHEST_M:
        raise PositioningError(
            f"tap planner: travel_m is {travel_m}, and no travel ends at {furthest:g} m; if that was meant "
            f"in mm, give ({1e-3 * low:g}, {1e-3 * high:g})"
        )


def check_overshoot_probability(probability: float) -> None:
    """Refuse what is no probability between 0 and 1.

    Raises
    ------
    PositioningError
    """
    if not (is_number(probability) and 0.0 < probability < 1.0):
        raise PositioningError(
            f"tap planner: overshoot_probability lies between 0 and 1, not {shown(probability)}"
        )
