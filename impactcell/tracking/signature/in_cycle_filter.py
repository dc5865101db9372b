"""The filter within a cycle: position samples in blocks, constant gain once the covariance has converged.

State [position, velocity, acceleration], acceleration a random walk of spectral density q (Bar-Shalom,
Li & Kirubarajan 2001, section 6.2.3)::

    x_{k+1} = F x_k + w,  F = [[1, T, T^2/2], [0, 1, T], [0, 0, 1]],  w ~ N(0, Q)
    z_k = [1, 0, 0] x_k + e,  e ~ N(0, sigma^2)

The same state after the same samples, in however many blocks they came.
"""

from dataclasses import dataclass

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

GAIN_TOLERANCE = 1e-12
"""Relative change of the gain a sample below which it is constant. Our choice."""
STEADY_SAMPLES = 50
"""Samples for which the gain must not change before it is constant. Our choice."""


@dataclass(frozen=True, slots=True, eq=False)
class InCycleFilter:
    """State between blocks.

    Attributes
    ----------
    interval_s : float
        Time between samples.
    position_std : float
        Noise of a sample, metres.
    density : float
        Spectral density of the acceleration's random walk, m^2 / s^5.
    mean : ndarray, shape (3,)
    covariance : ndarray, shape (3, 3)
    gain : ndarray, shape (3,)
        Of the last sample.
    steady : int
        For how many samples the gain has not changed; constant from `STEADY_SAMPLES` on.
    """

    interval_s: float
    position_std: float
    density: float
    mean: Samples
    covariance: Samples
    gain: Samples
    steady: int = 0


def initial_state(
    interval_s: float,
    position_std: float,
    density: float,
    mean: Samples | None = None,
    covariance: Samples | None = None,
) -> InCycleFilter:
    """Begin before the first sample; by default within ten sigma of 0, velocity and acceleration open."""
    return InCycleFilter(
        interval_s,
        position_std,
        density,
        np.zeros(3) if mean is None else np.array(mean, dtype=np.float64),
        np.diag([100.0 * position_std**2, 1.0, 100.0])
        if covariance is None
        else np.array(covariance, dtype=np.float64),
        np.zeros(3),
    )


def process_noise(interval_s: float, density: float) -> Samples:
    """Covariance Q of one step, shape (3, 3)."""
    T = interval_s
    return density * np.array(
        [
            [T**5 / 20.0, T**4 / 8.0, T**3 / 6.0],
            [T**4 / 8.0, T**3 / 3.0, T**2 / 2.0],
            [T**3 / 6.0, T**2 / 2.0, T],
        ]
    )


def update(state: InCycleFilter, position_m: Samples) -> tuple[InCycleFilter, Samples]:
    """Filter one block of samples.

    Parameters
    ----------
    position_m : ndarray, shape (n,)

    Returns
    -------
    state : InCycleFilter
        After the block.
    filtered : ndarray, shape (n, 3)
        Position, velocity and acceleration after each sample.
    """
    filtered = np.empty((len(position_m), 3))
    mean, covariance, gain = state.mean.copy(), state.covariance.copy(), state.gain.copy()
    model = state.interval_s, state.position_std**2, process_noise(state.interval_s, state.density)
    z = np.ascontiguousarray(position_m, dtype=np.float64)
    steady = _filter(z, model, (mean, covariance, gain), state.steady, filtered)
    after_block = InCycleFilter(
        state.interval_s, state.position_std, state.density, mean, covariance, gain, steady
    )
    return after_block, filtered


@compiled
def _filter(
    z: Samples,
    model: tuple[float, float, Samples],
    state: tuple[Samples, Samples, Samples],
    steady: int,
    out: Samples,
) -> int:
    """Filter samples `z` into `out`, shape (n, 3), in place, and give the new `steady`.

    `model` are T, sigma^2 and Q; `state` are mean, covariance and gain, which are written to.
    """
    (T, variance, noise), (mean, covariance, gain) = model, state
    n = len(z)
    x, v, a = mean[0], mean[1], mean[2]
    half = 0.5 * T * T
    k = 0
    while k < n and steady < STEADY_SAMPLES:
        p = covariance
        # P = F P F' + Q, written out; P is symmetric
        p00 = p[0, 0] + 2.0 * T * p[0, 1] + 2.0 * half * p[0, 2] + T * T * p[1, 1]
        p00 += 2.0 * T * half * p[1, 2] + half * half * p[2, 2] + noise[0, 0]
        p01 = (
            p[0, 1] + T * p[0, 2] + T * p[1, 1] + (T * T + half) * p[1, 2] + half * T * p[2, 2] + noise[0, 1]
        )
        p02 = p[0, 2] + T * p[1, 2] + half * p[2, 2] + noise[0, 2]
        p11 = p[1, 1] + 2.0 * T * p[1, 2] + T * T * p[2, 2] + noise[1, 1]
        p12 = p[1, 2] + T * p[2, 2] + noise[1, 2]
        p22 = p[2, 2] + noise[2, 2]
        s = p00 + variance
        k0, k1, k2 = p00 / s, p01 / s, p02 / s
        change = max(abs(k0 - gain[0]) / k0, abs(k1 - gain[1]) / abs(k1), abs(k2 - gain[2]) / abs(k2))
        steady = steady + 1 if change < GAIN_TOLERANCE else 0
        gain[0], gain[1], gain[2] = k0, k1, k2
        # 1 - k0 = variance / s, written so that nothing cancels
        unexplained = variance / s
        covariance[0, 0], covariance[1, 1], covariance[2, 2] = (
            unexplained * p00,
            p11 - k1 * p01,
            p22 - k2 * p02,
        )
        covariance[0, 1] = covariance[1, 0] = unexplained * p01
        covariance[0, 2] = covariance[2, 0] = unexplained * p02
        covariance[1, 2] = covariance[2, 1] = p12 - k1 * p02
        x, v = x + T * v + half * a, v + T * a
        e = z[k] - x
        x, v, a = x + k0 * e, v + k1 * e, a + k2 * e
        out[k, 0], out[k, 1], out[k, 2] = x, v, a
        k += 1
    k0, k1, k2 = gain[0], gain[1], gain[2]
    while k < n:
        x, v = x + T * v + half * a, v + T * a
        e = z[k] - x
        x, v, a = x + k0 * e, v + k1 * e, a + k2 * e
        out[k, 0], out[k, 1], out[k, 2] = x, v, a
        k += 1
    mean[0], mean[1], mean[2] = x, v, a
    return steady
