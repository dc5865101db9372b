"""Noise of which neighbouring samples share a part: hum, drift, or what a filter has made slow."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class SharedPart:
    """A part of noise, of covariance std² exp(-lag / decay) cos(2 pi frequency lag).

    Attributes
    ----------
    std : float
    decay_s : float
        Time over which it is forgotten; inf of a tone that stays in step.
    frequency_hz : float
        0 of noise of first order.
    """

    std: float
    decay_s: float
    frequency_hz: float = 0.0

    def correlation(self, lags_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Correlation with a sample so much earlier."""
        fading = np.exp(-lags_s / self.decay_s)
        return fading * np.cos(2.0 * math.pi * self.frequency_hz * lags_s)


@dataclass(frozen=True, slots=True)
class CorrelatedNoise:
    """Noise of a channel: what differs from sample to sample, and what neighbours share.

    Attributes
    ----------
    white_std : float
    parts : tuple of SharedPart
        Independent of each other.
    step_s : float
        Sampling step of the samples that showed it.
    """

    white_std: float
    parts: tuple[SharedPart, ...]
    step_s: float

    @property
    def std(self) -> float:
        """Standard deviation of one sample."""
        return math.sqrt(self.white_std**2 + sum(part.std**2 for part in self.parts))

    def mean_std(self, count: int) -> float:
        """Give the standard deviation of the mean of so many consecutive samples."""
        shared = sum(part.std**2 * mean_variance(part, count, self.step_s) for part in self.parts)
        return math.sqrt(self.white_std**2 / count + shared)

    def difference_std(self, count: int) -> float:
        """Give that of the difference of the means of the two halves of so many samples.

        With V(n) the variance of the mean of n samples it is 4 V(n/2) - 4 V(n), whatever their covariance.
        """
        half = max(count // 2, 1)
        return 2.0 * math.sqrt(max(self.mean_std(half) ** 2 - self.mean_std(2 * half) ** 2, 0.0))


def mean_variance(part: SharedPart, count: int, step_s: float) -> float:
    """Variance of the mean of so many consecutive samples of a part, over that of one."""
    return variance_of_mean(part.correlation(np.arange(1.0, count) * step_s))


def variance_of_mean(correlation: NDArray[np.float64]) -> float:
    """Variance of the mean of n samples over that of one, by their correlation at lags 1 to n - 1."""
    count = len(correlation) + 1
    shares = 1.0 - np.arange(1.0, count) / count
    return max(1.0 + 2.0 * float(shares @ correlation), 0.0) / count
