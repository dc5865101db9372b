"""Credible intervals of the waveform's posterior, by quadrature along the coordinate of its kink."""

import math

import numpy as np
from scipy.special import log_ndtr, ndtr, ndtri_exp

from impactcell.prediction.posterior import Posterior
from impactcell.prediction.waveform import MU_K_FORM, MU_S_FORM, WaveformFit
from impactcell.records import Samples

NODES = 300
"""Places along z, of one weight each, at which a cut-off Gaussian is summed up."""


def cdf(posterior: Posterior, of: Samples, at: Samples) -> Samples:
    """Probability that `of` @ theta is below `at`, shape (n,)."""
    total = np.zeros(len(at))
    for side, weight in zip(posterior.sides, posterior.weights.tolist(), strict=True):
        mean, variance = float(of @ side.mean), float(of @ side.covariance @ of)
        if side.sign == 0:
            total += weight * ndtr((at - mean) / math.sqrt(variance))
            continue
        form = posterior.form
        centre, spread = form @ side.mean + posterior.offset, math.sqrt(form @ side.covariance @ form)
        slope = float(of @ side.covariance @ form) / spread**2
        # z at equal steps of its own cut-off distribution: every node has the same weight
        share = (np.arange(NODES) + 0.5) / NODES
        normal = -ndtri_exp(np.log1p(-share) + log_ndtr(side.sign * centre / spread))
        z = side.sign * spread * normal
        rest = math.sqrt(max(variance - slope**2 * spread**2, 1e-30))
        total += weight * ndtr((at[:, None] - mean - slope * z[None, :]) / rest).mean(axis=1)
    return total


def interval(posterior: Posterior, of: Samples, level: float = 0.95) -> tuple[float, float]:
    """Equal-tailed credible interval of `of` @ theta."""
    mean, std = posterior.moments(of)
    ends = []
    for target in (0.5 - 0.5 * level, 0.5 + 0.5 * level):
        low, high = mean - 8.0 * std, mean + 8.0 * std
        for _ in range(4):
            grid = np.linspace(low, high, 33)
            index = int(np.clip(np.searchsorted(cdf(posterior, of, grid), target), 1, 32))
            low, high = float(grid[index - 1]), float(grid[index])
        ends.append(0.5 * (low + high))
    return ends[0], ends[1]


def friction_intervals(waveform: WaveformFit) -> tuple[tuple[float, float], tuple[float, float]]:
    """95 % intervals of mu_s and of mu_k."""
    mu_s, mu_k = (interval(waveform.posterior, of) for of in (MU_S_FORM, MU_K_FORM))
    return (math.exp(mu_s[0]), math.exp(mu_s[1])), (math.exp(mu_k[0]), math.exp(mu_k[1]))
