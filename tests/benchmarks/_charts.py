"""Classical control charts on a known baseline, with thresholds from integral equations, and the bound.

The charts are told the true mean and standard deviation, which the tracker has to learn. Run lengths come
from the Fredholm equations of Page (1954) and Crowder (1987), solved by Gauss-Legendre quadrature.
"""

import functools

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from impactcell.numerics.jit import compiled

EWMA_LAMBDA = 0.1
CUSUM_SLACK = 0.5


@functools.cache
def cusum_arl(slack: float, limit: float, shift: float) -> float:
    """ARL of a one-sided CUSUM started at zero."""
    x, w = np.polynomial.legendre.leggauss(120)
    x, w = (x + 1.0) * limit / 2.0, w * limit / 2.0
    # nodes and the atom at zero
    kernel = norm.pdf(x[None, :] - x[:, None] + slack - shift) * w[None, :]
    atom = norm.cdf(-x + slack - shift)
    zero_kernel = norm.pdf(x + slack - shift) * w
    a = np.block(
        [
            [np.eye(len(x)) - kernel, -atom[:, None]],
            [-zero_kernel[None, :], np.array([[1.0 - norm.cdf(slack - shift)]])],
        ]
    )
    return float(np.linalg.solve(a, np.ones(len(x) + 1))[-1])


@functools.cache
def cusum_limit(slack: float, arl: float) -> float:
    above = np.log(2.0 * slack**2 * arl + 10.0) / (2.0 * slack) + 1.0
    return brentq(lambda h: np.log(cusum_arl(slack, h, 0.0) / arl), 0.2, above, xtol=1e-6)


@functools.cache
def optimal_delay(shift: float, arl: float) -> float:
    """Smallest possible mean delay at a mean time between false alarms (Moustakides 1986)."""
    slack = shift / 2.0
    return cusum_arl(slack, cusum_limit(slack, arl), shift)


def ewma_arl(limit: float) -> float:
    x, w = np.polynomial.legendre.leggauss(200)
    x, w = x * limit, w * limit
    lam = EWMA_LAMBDA
    kernel = norm.pdf((x[None, :] - (1 - lam) * x[:, None]) / lam) / lam * w[None, :]
    inside = np.linalg.solve(np.eye(len(x)) - kernel, np.ones(len(x)))
    return float(1.0 + (norm.pdf(x / lam) / lam * w) @ inside)


@compiled
def detect(z: np.ndarray, start: int, kind: int, limit: float) -> int:
    """First alarm of one chart from index 0 on; -1 - index if it comes before `start`."""
    up = down = level = 0.0
    sums = np.zeros(len(z) + 1)
    for t in range(len(z)):
        if kind == 0:
            alarm = abs(z[t]) > limit
        elif kind == 1:
            level += 0.1 * (z[t] - level)
            alarm = abs(level) > limit
        elif kind == 2:
            up, down = max(0.0, up + z[t] - 0.5), max(0.0, down - z[t] - 0.5)
            alarm = max(up, down) > limit
        else:
            sums[t + 1] = sums[t] + z[t]
            best = 0.0
            for k in range(max(0, t + 1 - 300), t + 1):
                best = max(best, (sums[t + 1] - sums[k]) ** 2 / (t + 1 - k))
            alarm = 0.5 * best > limit
        if alarm:
            return t if t >= start else -1 - t
    return len(z)


CHARTS = ("Shewhart", "EWMA", "CUSUM", "GLR")


@functools.cache
def limits(arl: float) -> tuple[float, ...]:
    """Two-sided thresholds of the charts at a mean time between false alarms."""
    shewhart = float(norm.isf(0.5 / arl))
    ewma = brentq(lambda h: np.log(ewma_arl(h) / arl), 0.3, 1.3, xtol=1e-6)
    # two one-sided CUSUMs: 1/ARL = 2/ARL of one (van Dobben de Bruyn 1968)
    return shewhart, ewma, cusum_limit(CUSUM_SLACK, 2.0 * arl), _glr_limit(arl)


def _glr_limit(arl: float) -> float:
    """By simulation at two thresholds, log-linear between and beyond: tails of maxima are."""
    found = []
    for limit in (6.5, 8.0):
        rng = np.random.default_rng(77)
        alarms = cycles = 0
        while cycles < 600_000:
            t = detect(rng.normal(size=100_000), 10**9, 3, limit)
            alarms += t < 0
            cycles += -t if t < 0 else t
        found.append((limit, np.log(cycles / max(alarms, 1))))
    (a, la), (b, lb) = found
    return a + (np.log(arl) - la) * (b - a) / (lb - la)


def delay(kind: int, limit: float, shift: float, runs: int, seed: int) -> np.ndarray:
    """Delays of one chart for a step after 50 cycles in control; runs with an early alarm are left out."""
    delays = []
    length = 50 + int(max(400.0, 200.0 / min(shift, 1.0) ** 2)) * (20 if kind == 0 else 1)
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        z = rng.normal(size=length)
        z[50:] += shift if run % 2 else -shift
        t = detect(z, 50, kind, limit)
        if t >= 0:
            delays.append(t - 50 + 1)
    return np.array(delays, dtype=float)
