"""What a caller states of a tap, held against what taps are: whoever mistakes a unit is told so."""

import os
from os import PathLike
from pathlib import Path
from typing import Final

import numpy as np

from impactcell.errors import CaptureError, ImpactCellError, PhysicsError
from impactcell.records import MM_PER_MIN, Samples
from impactcell.records.plausible_range import meant_in

FASTEST_M_S: Final = 10.0
"""Beyond it nothing is an actuator's velocity: ten times that of the fastest drives. Our choice."""
USUAL_M_S: Final = (1e-3, 1.0)
"""Where velocities of taps lie: 60 to 60 000 mm/min."""


def check_fastest(velocity_m_s: float, error: type[ImpactCellError]) -> None:
    """Refuse a velocity that no actuator has, with what it would be in metres a second.

    Raises
    ------
    ImpactCellError
        Of the type `error`.
    """
    if not velocity_m_s > FASTEST_M_S:
        return
    way_out = meant_in(velocity_m_s, {"mm/min": MM_PER_MIN, "mm/s": 1e-3}, USUAL_M_S) or "check its unit"
    raise error(
        f"velocity_m_s = {velocity_m_s:g}: no actuator taps faster than {FASTEST_M_S:g} m/s; {way_out}"
    )


def check_ascending(time_s: Samples) -> None:
    """Refuse times that fall, with the sample that does; what is no number or there twice counts as lost.

    Raises
    ------
    CaptureError
    """
    places = np.flatnonzero(np.isfinite(time_s))
    steps = np.diff(time_s[places])
    if not (steps < 0.0).any():
        return
    if (steps <= 0.0).all():
        raise CaptureError(
            f"time_s falls from {time_s[places[0]]:.6g} to {time_s[places[-1]]:.6g} s: turn all three "
            "arrays, as time_s[::-1]"
        )
    first = int(np.argmax(steps < 0.0))
    before, falls = places[first], places[first + 1]
    raise CaptureError(
        f"time_s[{falls}] = {time_s[falls]:.6g} s lies before time_s[{before}] = {time_s[before]:.6g} s: "
        "order all three arrays by np.argsort(time_s); where a clock began anew, give the samples of one tap"
    )


def check_sample_times(time_s: Samples) -> None:
    """Refuse times at which nothing can be sampled.

    Raises
    ------
    PhysicsError
    """
    if time_s.ndim != 1:
        raise PhysicsError(f"time_s is to be of one dimension, not of shape {time_s.shape}")
    lost = np.flatnonzero(~np.isfinite(time_s))
    if len(lost):
        raise PhysicsError(f"time_s[{lost[0]}] = {time_s[lost[0]]:g}: give a time in s, or leave it out")


def a_path(name: str, given: str | PathLike[str], error: type[ImpactCellError]) -> Path:
    """Give the path of a file or directory.

    Raises
    ------
    ImpactCellError
        Of the type `error`, where it is none.
    """
    if not isinstance(given, str | os.PathLike):
        raise error(f"{name} is to be a path, not {given!r}")
    return Path(given)
