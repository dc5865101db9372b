"""How an uncertainty is told to people: "±" and every band are two standard deviations, some 95 % of repeats.

Data (JSON, CSV, OPC UA, journal, metrics) hold one standard deviation, and its name says so (`std`).
"""

import math
from typing import Final

TOLD_STDS: Final = 2.0
"""Standard deviations behind a "±" or a band for people: 95.4 % of a normal distribution."""


CYCLE_DIGITS: Final = 3
"""Significant digits of a count of cycles that are still to come."""


def told_cycles(count: float) -> str:
    """Write cycles still to come: whole ones, none that is not sure; `never` where there is no end of them.

    >>> [told_cycles(count) for count in (987.6, 32224.7, float("inf"))]
    ['987', '32200', 'never']
    """
    if not math.isfinite(count):
        return "never"
    unit: int = 10 ** max(len(str(int(count))) - CYCLE_DIGITS, 0)
    return str(int(count) // unit * unit)


def told_cycles_left(left: float, low: float, high: float, form: str) -> str:
    """Write cycles left with their 95 % interval in a form; where the upper one is never, the lower alone.

    >>> [told_cycles_left(1234.5, 987.6, high, "{} ({} to {})") for high in (12345.6, float("inf"))]
    ['1230 (987 to 12300)', 'more than 987']
    """
    if math.isinf(high) and math.isfinite(left) and low >= 1.0:
        return f"more than {told_cycles(low)}"
    return form.format(*map(told_cycles, (left, low, high)))


def plus_minus(value: float, std: float, form: str, std_form: str = "") -> str:
    """Write a value with what is told of its standard deviation, in Python's format specifications.

    What is not known is `none`; a value of which nobody knows how sure it is stands alone.

    >>> [plus_minus(mu, std, ".4f") for mu, std in ((0.203, 0.0005), (math.nan, math.nan), (0.2, math.inf))]
    ['0.2030 ± 0.0010', 'none', '0.2000']
    """
    if math.isnan(value):
        return "none"
    if not math.isfinite(std):
        return f"{value:{form}}"
    return f"{value:{form}} ± {TOLD_STDS * std:{std_form or form}}"
