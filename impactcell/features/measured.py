"""A feature of a capture as measured."""

from dataclasses import dataclass
from typing import Final

SEEN_STDS: Final = 3.0
"""Standard deviations above nought from which a figure is no noise about it."""


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

    @property
    def is_seen(self) -> bool:
        """Whether it is above nought by more than its noise."""
        return self.value > SEEN_STDS * self.std
