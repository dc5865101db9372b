"""How far a number is off, in words."""

import math
from collections.abc import Sequence


def late_or_early(coefficients: Sequence[float]) -> str:
    """Say how late a force was recorded."""
    (delay_s,) = coefficients
    return f"a force recorded {two_digits(1e3 * abs(delay_s))} ms {'late' if delay_s > 0.0 else 'early'}"


def off_its_centre(coefficients: Sequence[float]) -> str:
    """Say how far an encoder is off its centre."""
    return f"an encoder that turns {two_digits(1e3 * math.hypot(*coefficients))} mrad off its centre"


def larger_or_smaller(relative: float) -> str:
    """Say by which part of itself a number is off."""
    return f"{two_digits(100.0 * abs(relative))} % {'larger' if relative > 0.0 else 'smaller'}"


def more_or_less(value: float, unit: str) -> str:
    """Say by how much a number is off."""
    return f"{two_digits(abs(value))} {unit} {'larger' if value > 0.0 else 'smaller'}"


def two_digits(value: float) -> str:
    """Write a number with two digits that count.

    >>> two_digits(-0.02345), two_digits(123.0)
    ('-0.023', '120')
    """
    return f"{float(f'{value:.2g}'):g}"
