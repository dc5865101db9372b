"""Samples as the whole numbers they were measured in, checked to come back to the same bits."""

import math

import numpy as np

from impactcell.compiled import Reals, Wholes, compiled


@compiled
def folded_differences(values: Reals, resolution: float) -> tuple[int, Wholes]:
    """Differences d of the codes of `values`, as 2 d, or -2 d - 1 where negative.

    Returns
    -------
    largest : int
        No folded difference is larger; -1 where a value is no whole multiple of `resolution`, bit for bit.
    folded : ndarray, shape (n,)
    """
    folded = np.empty(len(values), dtype=np.int64)
    before, largest = 0, 0
    for i in range(len(values)):
        value = values[i]
        scaled = np.rint(value / resolution)
        if not abs(scaled) < 2.0**53:
            return -1, folded
        code = int(scaled)
        # Negative zero is not a multiple that an integer remembers.
        if code * resolution != value or (value == 0.0 and math.copysign(1.0, value) < 0.0):
            return -1, folded
        difference = code - before
        folded[i] = (difference << 1) ^ (difference >> 63)
        largest |= folded[i]
        before = code
    return largest, folded


@compiled
def unfolded(folded: Wholes, resolution: float) -> Reals:
    """Give the values back from their folded differences."""
    values = np.empty(len(folded))
    code = 0
    for i in range(len(folded)):
        code += (folded[i] >> 1) ^ -(folded[i] & 1)
        values[i] = code * resolution
    return values


@compiled
def is_uniform(time_s: Reals, rate_hz: float) -> bool:
    """Whether times are those of `records.uniform_times` at this rate, bit for bit."""
    start_s = time_s[0]
    for i in range(len(time_s)):  # noqa: SIM110  # compiled
        if start_s + i / rate_hz != time_s[i]:
            return False
    return True
