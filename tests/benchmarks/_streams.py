"""Friction streams with known truth for the tracking benchmarks; units: sd of one estimate, cycles."""

from dataclasses import dataclass

import numpy as np

SLOPE = 3.3e-4
STEP_STD = 1.7
OUTLIERS = 0.01
OUTLIER_STD = 10.0
CYCLES = 10_000


@dataclass(frozen=True)
class Stream:
    """Wear, batch steps every 500-1500 cycles and outliers; `changes` and `steps` are the truth."""

    values: np.ndarray
    changes: np.ndarray
    steps: np.ndarray
    outlier: np.ndarray

    @property
    def batch(self) -> np.ndarray:
        return np.searchsorted(self.changes, np.arange(len(self.values)), side="right")


def stream(seed: int, cycles: int = CYCLES, sizes: tuple[float, ...] = ()) -> Stream:
    """Steps are normal, or of random sign and one of `sizes`."""
    rng = np.random.default_rng([4, seed])
    gaps = rng.integers(500, 1501, cycles // 500 + 1)
    changes = np.cumsum(gaps)
    changes = changes[changes < cycles]
    steps = STEP_STD * rng.normal(size=len(changes))
    if sizes:
        steps = rng.choice(sizes, len(changes)) * rng.choice([-1.0, 1.0], len(changes))
    offset = np.zeros(cycles)
    for change, step in zip(changes, steps, strict=True):
        offset[change:] += step
    values = SLOPE * np.arange(cycles) + offset + rng.normal(size=cycles)
    outlier = rng.random(cycles) < OUTLIERS
    values[outlier] += OUTLIER_STD * rng.normal(size=int(outlier.sum()))
    return Stream(values, changes, steps, outlier)


def oracle_slope(truth: Stream) -> tuple[float, float]:
    """Least squares that knows change times and outliers: slope and its standard deviation."""
    cross = square = 0.0
    batch = truth.batch
    for b in range(len(truth.changes) + 1):
        use = np.flatnonzero((batch == b) & ~truth.outlier)
        t = use - use.mean()
        cross += float(t @ truth.values[use])
        square += float(t @ t)
    return cross / square, square**-0.5
