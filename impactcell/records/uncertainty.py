"""How an uncertainty is told to people: "±" and every band are two standard deviations, some 95 % of repeats.

Data (JSON, CSV, OPC UA, journal, metrics) hold one standard deviation, and its name says so (`std`).
"""

from typing import Final

TOLD_STDS: Final = 2.0
"""Standard deviations behind a "±" or a band for people: 95.4 % of a normal distribution."""


def plus_minus(value: float, std: float, form: str, std_form: str = "") -> str:
    """Write a value with what is told of its standard deviation, in Python's format specifications.

    >>> plus_minus(0.203, 0.0005, ".4f")
    '0.2030 ± 0.0010'
    """
    return f"{value:{form}} ± {TOLD_STDS * std:{std_form or form}}"
