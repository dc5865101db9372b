"""Samples as the whole numbers they were measured in, in few bits, checked to come back to the same bits.

The code of a sample is its value in steps of the channel's resolution. Its difference d from the code before
is folded to u = 2 d, or -2 d - 1 where negative, and written after Rice: u >> k zeros, a one, and the lowest
k bits of u, with one k for each `BLOCK` samples. White noise takes some 3 % more than its entropy. Bits fill
words from the lowest on.
"""

import math

import numpy as np
from numpy.typing import NDArray

from impactcell.numerics.jit import FloatArray, compiled

Shifts = NDArray[np.uint8]
Words = NDArray[np.uint32]

BLOCK = 128
"""Samples that share one k: short enough to follow a contact, long enough that k costs little."""
WORD = 32
"""Bits of a word."""
LONGEST_CODE = 31
"""Bits that a difference may take: what is left in a word, and one more, then fit into 63 bits."""


@compiled
def rice_encode(values: FloatArray, resolution: float) -> tuple[bool, Shifts, Words]:
    """Write the codes of `values` in few bits.

    Returns
    -------
    done : bool
        False where a value is no whole multiple of `resolution`, bit for bit, or too far from the one before.
    shifts : ndarray
        k of each block.
    words : ndarray
    """
    count = len(values)
    shifts = np.empty((count + BLOCK - 1) // BLOCK, dtype=np.uint8)
    words = np.empty(count + 1, dtype=np.uint32)
    folded = np.empty(BLOCK, dtype=np.int64)
    before, bits, filled, size = 0, 0, 0, 0
    steps = 1.0 / resolution
    for block in range(len(shifts)):
        first = block * BLOCK
        length, total, largest = min(BLOCK, count - first), 0, 0
        for i in range(length):
            value = values[first + i]
            scaled = np.rint(value * steps)
            if not abs(scaled) < 2.0**53:
                return False, shifts, words
            code = int(scaled)
            # Negative zero is not a multiple that an integer remembers.
            if code * resolution != value or (value == 0.0 and math.copysign(1.0, value) < 0.0):
                return False, shifts, words
            difference = code - before
            before = code
            folded[i] = (difference << 1) ^ (difference >> 63)
            largest |= folded[i]
            total += folded[i]
        k = 0
        while k < LONGEST_CODE and (total > length << (k + 1) or (largest >> k) + 1 + k > LONGEST_CODE):
            k += 1
        if k == LONGEST_CODE or largest >= 1 << LONGEST_CODE:
            return False, shifts, words
        shifts[block] = k
        for i in range(length):
            zeros = folded[i] >> k
            bits |= ((folded[i] & ((1 << k) - 1)) << 1 | 1) << (filled + zeros)
            filled += zeros + 1 + k
            if filled >= WORD:
                words[size] = bits & 0xFFFFFFFF
                size, bits, filled = size + 1, bits >> WORD, filled - WORD
    words[size] = bits
    return True, shifts, words[: size + 1]


@compiled
def rice_decode(shifts: Shifts, words: Words, count: int, resolution: float) -> FloatArray:
    """Give the values back; nan for those that the words do not hold."""
    values = np.full(count, np.nan)
    code, bits, filled, size = 0, 0, 0, 0
    for i in range(min(count, len(shifts) * BLOCK)):
        if filled < LONGEST_CODE and size < len(words):
            bits |= int(words[size]) << filled
            size, filled = size + 1, filled + WORD
        k, zeros = int(shifts[i // BLOCK]), 0
        while zeros + 1 + k < filled and (bits >> zeros) & 1 == 0:
            zeros += 1
        filled -= zeros + 1 + k
        if filled < 0:
            break
        bits >>= zeros + 1
        folded = zeros << k | (bits & ((1 << k) - 1))
        bits >>= k
        code += (folded >> 1) ^ -(folded & 1)
        values[i] = code * resolution
    return values


@compiled
def is_uniform(time_s: FloatArray, rate_hz: float) -> bool:
    """Whether times are those of `records.uniform_times` at this rate, bit for bit."""
    start_s = time_s[0]
    for i in range(len(time_s)):  # noqa: SIM110  # compiled
        if start_s + i / rate_hz != time_s[i]:
            return False
    return True
