"""Running autocorrelation of the normalised innovations: what is left in them tells which noise is wrong.

Innovations of a right filter are uncorrelated (Mehra 1970, IEEE Trans. Autom. Control 15:175). A level that
walks more than the filter believes leaves a correlation that fades over many cycles; scatter that is itself
correlated from one estimate to the next leaves one that is gone after a few. Lag one less the far lags is
therefore the scatter's, the far lags are the level's, and neither passes for the other.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from impactcell.records import Samples

LAGS = 8
"""Lags that are followed, in estimates."""
FIRST_FAR = 4
"""Lag from which on a scatter's own correlation is gone: of one of 0.5 a sixteenth is left."""
FAR = LAGS - FIRST_FAR + 1
"""How many far lags there are."""
CLIP = 3.0
"""Normalised innovations count at most as this, outliers too."""


@dataclass(frozen=True, slots=True, eq=False)
class Autocorrelation:
    """Fading sums over the innovations so far.

    Attributes
    ----------
    recent : ndarray, shape (at most LAGS,)
        The last innovations, newest first.
    weight : float
        How many innovations the sums rest on.
    square : float
        Sum of their squares.
    products : ndarray, shape (LAGS,)
        Sums of their products with those before, by lag.
    """

    recent: Samples = field(default_factory=lambda: np.zeros(0))
    weight: float = 0.0
    square: float = 0.0
    products: Samples = field(default_factory=lambda: np.zeros(LAGS))


def update(state: Autocorrelation, innovation: float, memory: float) -> Autocorrelation:
    """Take one normalised innovation, and forget what is more than some `memory` innovations ago."""
    if not math.isfinite(innovation):
        return state
    clipped = max(-CLIP, min(innovation, CLIP))
    kept = 1.0 - 1.0 / memory
    products = kept * state.products
    products[: len(state.recent)] += clipped * state.recent
    return Autocorrelation(
        np.append(clipped, state.recent)[:LAGS],
        kept * state.weight + 1.0,
        kept * state.square + clipped**2,
        products,
    )


def begun_anew(state: Autocorrelation) -> Autocorrelation:
    """Forget the sums; the innovations from here on are of another filter."""
    return Autocorrelation(state.recent[:1])


def next_to(state: Autocorrelation) -> float:
    """Correlation of an innovation with the one before; of white noise normal, variance 1 / weight."""
    return float(state.products[0]) / state.square if state.square > 0.0 else 0.0


def far(state: Autocorrelation) -> float:
    """Mean correlation at the far lags; of white noise normal, variance 1 / (FAR weight)."""
    return float(np.mean(state.products[FIRST_FAR - 1 :])) / state.square if state.square > 0.0 else 0.0
