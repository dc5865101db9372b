"""Process noise that follows the data: innovations of a right filter are uncorrelated (Mehra 1970)."""

import math
from dataclasses import dataclass

MEMORY = 1000.0
"""Cycles after which an innovation is forgotten."""
CERTAIN = 5.0
"""Standard deviations of the lag-one correlation at which the process noise is changed: 1 in 1.7 million."""
FEWEST = 200.0
"""Cycles before which nothing is changed: the correlation of fewer is not normal enough to say `CERTAIN`."""
CLIP = 3.0
"""Normalised innovations count at most as this, outliers too."""
STEP = 4.0
"""Factor by which the process variance is raised or lowered at a time: its standard deviation by two."""
SMALLEST = 1e-6
"""Process variance a cycle where raising starts, and below which lowering ends at none, in the variance of
one estimate: a random walk that takes a million cycles to be as large as the noise."""


@dataclass(frozen=True, slots=True)
class InnovationCorrelation:
    """Running lag-one product of the normalised innovations."""

    last: float = math.nan
    weight: float = 0.0
    product: float = 0.0
    square: float = 0.0


def update(state: InnovationCorrelation, innovation: float) -> tuple[InnovationCorrelation, float]:
    """Take one normalised innovation; also give the factor of the process variance that it makes certain."""
    if not math.isfinite(innovation):
        return state, 1.0
    clipped = max(-CLIP, min(innovation, CLIP))
    if math.isnan(state.last):
        return InnovationCorrelation(clipped), 1.0
    kept = 1.0 - 1.0 / MEMORY
    weight = kept * state.weight + 1.0
    product = kept * state.product + clipped * state.last
    square = kept * state.square + clipped**2
    updated = InnovationCorrelation(clipped, weight, product, square)
    if weight < FEWEST or square <= 0.0:
        return updated, 1.0
    score = product / square * math.sqrt(weight)
    if abs(score) < CERTAIN:
        return updated, 1.0
    return InnovationCorrelation(clipped), STEP if score > 0.0 else 1.0 / STEP


def adapt_process_noise(variance: float, factor: float, unit: float) -> float:
    """Process variance after a change by `factor`; `unit` is the variance of one estimate."""
    if factor > 1.0:
        return min(max(variance * factor, SMALLEST * unit), unit)
    lowered = variance * factor
    return lowered if lowered >= SMALLEST * unit else 0.0
