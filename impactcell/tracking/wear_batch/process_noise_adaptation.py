"""Process noise that follows the data: innovations of a right filter are uncorrelated (Mehra 1970)."""

import math

from impactcell.numerics import autocorrelation
from impactcell.numerics.autocorrelation import Autocorrelation

MEMORY = 1000.0
"""Cycles after which an innovation is forgotten."""
CERTAIN = 5.0
"""Standard deviations of the correlation at which the process noise is changed: 1 in 1.7 million."""
FEWEST = 200.0
"""Cycles before which nothing is changed: the correlation of fewer is not normal enough to say `CERTAIN`."""
STEP = 4.0
"""Factor by which the process variance is raised or lowered at a time: its standard deviation by two."""
SMALLEST = 1e-6
"""Process variance a cycle where raising starts, and below which lowering ends at none, in the variance of
one estimate: a random walk that takes a million cycles to be as large as the noise."""


def update(state: Autocorrelation, innovation: float) -> tuple[Autocorrelation, float]:
    """Take one normalised innovation; also give the factor of the process variance that it makes certain.

    A level that walks more than is believed shows at the far lags, where the scatter's own correlation is
    gone; one that walks less shows at lag one, as that of a filter which follows the scatter.
    """
    updated = autocorrelation.update(state, innovation, MEMORY)
    if updated.weight < FEWEST:
        return updated, 1.0
    root = math.sqrt(updated.weight)
    if autocorrelation.far(updated) * root * math.sqrt(autocorrelation.FAR) > CERTAIN:
        return autocorrelation.begun_anew(updated), STEP
    if autocorrelation.next_to(updated) * root < -CERTAIN:
        return autocorrelation.begun_anew(updated), 1.0 / STEP
    return updated, 1.0


def adapt_process_noise(variance: float, factor: float, unit: float) -> float:
    """Process variance after a change by `factor`; `unit` is the variance of one estimate."""
    if factor > 1.0:
        return min(max(variance * factor, SMALLEST * unit), unit)
    lowered = variance * factor
    return lowered if lowered >= SMALLEST * unit else 0.0
