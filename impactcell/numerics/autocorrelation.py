"""Running autocorrelation of normalised innovations: what is left in them tells which noise is wrong.

Innovations of a right filter are uncorrelated (Mehra 1970, IEEE Trans. Autom. Control 15:175). A level that
walks more than the filter believes leaves a correlation that fades over many innovations; scatter that is
itself correlated from one to the next leaves one that is gone after a few. Lag one less the far lags is
therefore the scatter's, the far lags are the level's, and neither passes for the other.
"""

import math
from dataclasses import dataclass

LAGS = 8
"""Lags that are followed."""
FIRST_FAR = 4
"""Lag from which on a scatter's own correlation is gone: of one of 0.5 a sixteenth is left."""
FAR = LAGS - FIRST_FAR + 1
"""How many far lags there are."""
CLIP = 3.0
"""Normalised innovations count at most as this, outliers too."""
NONE = (0.0,) * LAGS
"""Before the first innovation."""


@dataclass(frozen=True, slots=True)
class Autocorrelation:
    """Fading sums over the innovations so far.

    Attributes
    ----------
    recent : tuple of float
        The last `LAGS` innovations, newest first; 0 before the first.
    weight : float
        How many innovations the sums rest on.
    square : float
        Sum of their squares.
    products : tuple of float
        Sums of their products with those before, by lag.
    """

    recent: tuple[float, ...] = NONE
    weight: float = 0.0
    square: float = 0.0
    products: tuple[float, ...] = NONE


def update(state: Autocorrelation, innovation: float, memory: float) -> Autocorrelation:
    """Take one normalised innovation, and forget what is more than some `memory` innovations ago."""
    if not math.isfinite(innovation):
        return state
    clipped = max(-CLIP, min(innovation, CLIP))
    kept = 1.0 - 1.0 / memory
    return Autocorrelation(
        (clipped, *state.recent[:-1]),
        kept * state.weight + 1.0,
        kept * state.square + clipped**2,
        tuple(
            kept * product + clipped * before
            for product, before in zip(state.products, state.recent, strict=True)
        ),
    )


def begun_anew(state: Autocorrelation) -> Autocorrelation:
    """Forget the sums; the innovations from here on are of another filter."""
    return Autocorrelation((state.recent[0], *NONE[1:]))


def next_to(state: Autocorrelation) -> float:
    """Correlation of an innovation with the one before; of white noise normal, variance 1 / weight."""
    return state.products[0] / state.square if state.square > 0.0 else 0.0


def far(state: Autocorrelation) -> float:
    """Mean correlation at the far lags; of white noise normal, variance 1 / (FAR weight)."""
    return sum(state.products[FIRST_FAR - 1 :]) / FAR / state.square if state.square > 0.0 else 0.0
