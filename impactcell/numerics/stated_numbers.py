"""Numbers that a caller states, one or an array of them: what is none is refused by its name."""

import math

import numpy as np
from numpy.typing import ArrayLike

from impactcell.errors import ImpactCellError
from impactcell.records import Samples


def one_number(name: str, given: object, error: type[ImpactCellError]) -> float:
    """Give what is stated as one number; nan and inf are some.

    Raises
    ------
    ImpactCellError
        Of the type `error`, where it is none: a text, None, an array.

    Examples
    --------
    >>> one_number("mass_kg", np.float32(0.5), ImpactCellError)
    0.5
    """
    try:
        return math.fsum((given,))  # type: ignore[arg-type]  # unlike float it takes no text
    except (TypeError, ValueError, OverflowError):
        raise error(f"{name} is to be one number, not {given!r}") from None


def numbers(name: str, given: ArrayLike, error: type[ImpactCellError]) -> Samples:
    """Give an array of numbers; what a masked one hides is nan.

    Raises
    ------
    ImpactCellError
        Of the type `error`, where it holds anything else.

    Examples
    --------
    >>> numbers("mu_s", np.ma.masked_equal([0.2, -1.0], -1.0), ImpactCellError).tolist()
    [0.2, nan]
    """
    try:
        values: Samples = np.ma.filled(np.ma.asarray(given, np.float64), math.nan)
    except (TypeError, ValueError) as fault:
        raise error(f"{name} is to hold numbers: {fault}") from fault
    return values
