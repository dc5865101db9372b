"""Friction streams with known truth for the tracking benchmarks; units: sd of one estimate, cycles.

Settings of the tracker were chosen on streams with seeds below `REPORTED`. The rows that are reported come
from seeds beyond it, on which nothing was chosen.
"""

from dataclasses import dataclass

import numpy as np

SLOPE = 3.3e-4
STEP_STD = 1.7
OUTLIERS = 0.01
OUTLIER_STD = 10.0
CYCLES = 10_000
REPORTED = 2_000_000


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


def false_alarms(found: np.ndarray, truth: Stream) -> int:
    """Alarms before the first change, and second ones between two changes."""
    batch = np.searchsorted(truth.changes, found, side="right")
    return int((batch == 0).sum()) + sum(int((batch == b).sum()) - 1 for b in set(batch.tolist()) - {0})


def first_alarms(found: np.ndarray, truth: Stream, room: int = 500) -> list[tuple[float, float]]:
    """Size of each step and cycles to its first alarm, inf if there is none before the next step.

    Steps with fewer than `room` cycles after them are left out: the end of the stream cuts them off.
    """
    ends = np.append(truth.changes[1:], len(truth.values))
    seen = []
    for change, end, step in zip(truth.changes, ends, truth.steps, strict=True):
        if len(truth.values) - change < room:
            continue
        after = found[(found >= change) & (found < end)]
        seen.append((abs(float(step)), float(after[0] - change + 1) if len(after) else np.inf))
    return seen
