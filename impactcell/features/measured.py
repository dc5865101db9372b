"""A feature of a capture as measured."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MeasuredFeature:
    """A figure extracted from a capture, with one standard deviation.

    Attributes
    ----------
    value, std : float
        In the SI unit of the figure.
    """

    value: float
    std: float
