"""Keeps the process noise honest: innovations of a right filter are uncorrelated (Mehra 1970)."""

import math
from dataclasses import dataclass

MEMORY = 1000.0  # cycles
CERTAIN = 5.0  # standard deviations of the lag-one correlation at which the process noise is changed
FEWEST = 200.0
CLIP = 3.0  # an outlier counts at most as much as this
SMALLEST = 1e-6  # of one estimate's variance a cycle: where raising starts, and lowering ends at none


@dataclass(frozen=True, slots=True)
class InnovationCorrelation:
    """Running lag-one product of the normalised innovations."""

    last: float = math.nan
    weight: float = 0.0
    product: float = 0.0
    square: float = 0.0


def update(monitor: InnovationCorrelation, innovation: float) -> tuple[InnovationCorrelation, float]:
    """Take one normalised innovation; also say by what the process variance is to be multiplied."""
    if not math.isfinite(innovation):
        return monitor, 1.0
    clipped = max(-CLIP, min(innovation, CLIP))
    if math.isnan(monitor.last):
        return InnovationCorrelation(clipped), 1.0
    kept = 1.0 - 1.0 / MEMORY
    weight = kept * monitor.weight + 1.0
    product = kept * monitor.product + clipped * monitor.last
    square = kept * monitor.square + clipped**2
    fresh = InnovationCorrelation(clipped, weight, product, square)
    if weight < FEWEST or square <= 0.0:
        return fresh, 1.0
    score = product / square * math.sqrt(weight)
    if abs(score) < CERTAIN:
        return fresh, 1.0
    return InnovationCorrelation(clipped), 4.0 if score > 0.0 else 0.25


def adapt_process_noise(variance: float, factor: float, unit: float) -> float:
    """Process variance after a change by `factor`; `unit` is the variance of one estimate."""
    if factor > 1.0:
        return min(max(variance * factor, SMALLEST * unit), unit)
    lowered = variance * factor
    return lowered if lowered >= SMALLEST * unit else 0.0
