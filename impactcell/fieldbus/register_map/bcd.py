"""Binary coded decimals: four bits a digit, as counters and older controllers show them. Pure."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

NO_BCD: Final = -1
"""What stands for a code with a digit above 9."""


def from_bcd(codes: NDArray[Any]) -> NDArray[np.int64]:
    """Return the numbers that unsigned codes show, `NO_BCD` where one has a digit above 9.

    >>> from_bcd(np.array([0x1234, 0x12A4], dtype=np.uint16)).tolist()
    [1234, -1]
    """
    numbers = np.zeros(codes.shape, dtype=np.int64)
    valid = np.ones(codes.shape, dtype=bool)
    for place in range(2 * codes.dtype.itemsize):
        digits = (codes.astype(np.int64) >> 4 * place) & 0xF
        valid &= digits <= 9
        numbers += digits * 10**place
    return np.where(valid, numbers, NO_BCD)


def to_bcd(numbers: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return the codes that show numbers that are not negative, as `dtype`.

    >>> hex(to_bcd(np.array([1234]), np.dtype(">u2"))[0])
    '0x1234'
    """
    rest = numbers.astype(np.int64)
    codes = np.zeros(rest.shape, dtype=np.int64)
    for place in range(2 * dtype.itemsize):
        codes |= (rest % 10) << 4 * place
        rest = rest // 10
    return codes.astype(dtype)
