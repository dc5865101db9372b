"""What is known of wear at some slopes, said at others: the blocks that it came from are gone."""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples
from impactcell.tracking.wear_batch.block_filter import DROPPED, Segments, copy_present


@compiled
def relay(
    grid: Samples, segments: Segments, onto: Samples, moved: Segments, normal: tuple[float, float]
) -> Samples:
    """Write to `moved`, all zero before, what the segments of the nearest of `grid` say at slopes `onto`.

    Returns the log evidence of each, over that of the slope that it comes from. Beyond the ends of the grid
    nothing was seen: there it falls at least as that of a normal distribution of the mean and standard
    deviation in `normal`. A tail that stayed level would take all the probability as it grows longer.
    """
    mean, std = normal
    evidence = np.empty(len(onto))
    for k in range(len(onto)):
        j = int(np.argmin(np.abs(grid - onto[k])))
        apart, top, total = onto[k] - grid[j], -np.inf, 0.0
        count = copy_present(segments[j], moved[k])
        for i in range(count):
            segment = moved[k, i]
            curvature = min(segment.log_curvature, 0.0)  # what grows without end is no density
            gained = apart * (segment.log_by_slope + 0.5 * apart * curvature)
            segment.log_by_slope += apart * curvature
            segment.level += apart * segment.level_by_slope
            segment.total += apart * segment.total_by_slope
            segment.probability = math.log(segment.probability) + gained
            top = max(top, segment.probability)
        for i in range(count):
            total += math.exp(moved[k, i].probability - top)
        evidence[k] = top + math.log(total)
        kept = 0
        for i in range(count):
            share = math.exp(moved[k, i].probability - evidence[k])
            moved[k, i].probability = 0.0
            if share > DROPPED:
                moved[k, kept] = moved[k, i]
                moved[k, kept].probability = share
                kept += 1
        if not grid[0] <= onto[k] <= grid[-1]:
            fall = 0.5 * ((onto[k] - mean) ** 2 - (grid[j] - mean) ** 2) / std**2
            evidence[k] = min(evidence[k], -max(fall, 0.0))
    return evidence
