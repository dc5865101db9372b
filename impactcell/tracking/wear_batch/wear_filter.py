"""Friction over time with the batch known: a Kalman filter on filterpy, state [level, slope, offsets].

Measurement of cycle n in batch i, and what passes between cycles::

    z_n = level_n + offset_i + e,   e ~ N(0, R)
    level_{n+1} = level_n + slope_n + w_1,   slope_{n+1} = slope_n + w_2

The first batch is the reference, its offset zero. Every later batch has an offset of its own in the
state, so that a batch that comes back is recognised and the size of a shift has its exact variance.
Outliers are clipped after Huber (1964): beyond c standard deviations R is inflated until the innovation
moves the state as one of c standard deviations would; beyond 2 c its influence falls off again.
"""

import math
from dataclasses import dataclass

import numpy as np
from filterpy import kalman

from impactcell.records import Samples

KEPT_BATCHES = 12
"""Batches with an offset in the state; more are forgotten, the longest unseen first, and what they leave
unknown stays in level and slope."""


@dataclass(frozen=True, slots=True, eq=False)
class WearFilter:
    """State of the filter.

    Attributes
    ----------
    batches : tuple of str
        The reference batch (None where it had no name, or its material has changed under the same one), then
        those with an offset in the state, least recently seen first.
    current : str
        The present batch.
    mean : ndarray, shape (2 + len(batches) - 1,)
        Level, slope a cycle, offsets.
    covariance : ndarray, shape (n, n)
    """

    batches: tuple[str | None, ...]
    current: str
    mean: Samples
    covariance: Samples


@dataclass(frozen=True, slots=True)
class Innovation:
    """What a measurement was beyond its prediction, and the prediction's standard deviation."""

    value: float
    std: float


def initial_state(value: float, variance: float, slope_std: float, batch: str) -> WearFilter:
    """Begin with one measurement; its batch is the reference."""
    return WearFilter((batch,), batch, np.array([value, 0.0]), np.diag([variance, slope_std**2]))


def from_bank(mean: Samples, covariance: Samples, batch: str) -> WearFilter:
    """Go on from the bank's state [total, slope, offset, shift]; the present batch becomes the reference."""
    return WearFilter((batch,), batch, mean[:2].copy(), covariance[:2, :2].copy())


def beside_reference(
    mean: Samples, covariance: Samples, batch: str, reference: str | None = None
) -> WearFilter:
    """Go on from the bank's state [total, slope, offset, shift] with a batch that is not the reference.

    Level = total - offset, slope and the batch's offset are the bank's; the reference may have no name.
    """
    taken = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    return WearFilter((reference, batch), batch, taken @ mean, taken @ covariance @ taken.T)


def restart_after_change(state: WearFilter, mean: Samples, covariance: Samples) -> WearFilter:
    """Go on from the bank's state after the present batch changed without a new name.

    What the filter took in since the change is wrong, and the bank has it right. Offsets of batches before
    are given up.
    """
    reference = None if state.current == state.batches[0] else state.batches[0]
    return beside_reference(mean, covariance, state.current, reference)


def restart_at_rate(state: WearFilter, mean: Samples, covariance: Samples) -> WearFilter:
    """Take the present friction and its slope from the bank after wear has changed its rate.

    Level and slope of the filter lag behind; offsets of the batches stay: level = total - present offset.
    """
    place = _offset_index(state.batches, state.current)
    means, covariances = state.mean.copy(), state.covariance.copy()
    means[:2], covariances[:2], covariances[:, :2] = mean[:2], 0.0, 0.0
    covariances[:2, :2] = covariance[:2, :2]
    if place:
        means[0] -= state.mean[place]
        covariances[0, 0] += state.covariance[place, place]
        covariances[0, 2:] = covariances[2:, 0] = -state.covariance[place, 2:]
    return WearFilter(state.batches, state.current, means, covariances)


def predict(state: WearFilter, cycles: int, level_variance: float, slope_variance: float) -> WearFilter:
    """Predict over `cycles` cycles; the variances are those of the random walks, a cycle."""
    n = len(state.mean)
    transition = np.eye(n)
    transition[0, 1] = cycles
    noise = np.zeros((n, n))
    noise[0, 0] = level_variance * cycles + slope_variance * cycles**3 / 3.0
    noise[0, 1] = noise[1, 0] = slope_variance * cycles**2 / 2.0
    noise[1, 1] = slope_variance * cycles
    mean, covariance = kalman.predict(state.mean, state.covariance, F=transition, Q=noise)
    return WearFilter(state.batches, state.current, mean, covariance)


def switch_batch(state: WearFilter, batch: str, step_variance: float) -> WearFilter:
    """Go on with another batch: one seen before, or a new one with an offset unknown to `step_variance`."""
    batches, mean, covariance = state.batches, state.mean, state.covariance
    if batch in batches[1:]:
        order = [
            0,
            1,
            *(i + 1 for i in range(1, len(batches)) if batches[i] != batch),
            batches.index(batch) + 1,
        ]
        batches = (batches[0], *(b for b in batches[1:] if b != batch), batch)
        mean, covariance = mean[order], covariance[np.ix_(order, order)]
    elif batch != batches[0]:
        if len(batches) > KEPT_BATCHES:
            kept = [i for i in range(len(mean)) if i != 2]
            batches, mean, covariance = (batches[0], *batches[2:]), mean[kept], covariance[np.ix_(kept, kept)]
        n, before = len(mean), _offset_index(batches, state.current)
        # a new offset is the present one and a step
        batches, mean = (*batches, batch), np.append(mean, mean[before] if before else 0.0)
        grown = np.zeros((n + 1, n + 1))
        grown[:n, :n] = covariance
        if before:
            grown[n, :n] = grown[:n, n] = covariance[before]
            grown[n, n] = covariance[before, before]
        grown[n, n] += step_variance
        covariance = grown
    return WearFilter(batches, batch, mean, covariance)


def update(
    state: WearFilter, value: float, variance: float, threshold: float, lag: int = 0, batch: str | None = None
) -> tuple[WearFilter, Innovation]:
    """Update with one measurement, `lag` cycles late, of `batch` (the present one if None)."""
    design = np.zeros((1, len(state.mean)))
    design[0, :2] = 1.0, -lag
    if place := _offset_index(state.batches, state.current if batch is None else batch):
        design[0, place] = 1.0
    row = design[0]
    predicted = float(row @ state.covariance @ row)
    innovation, std = value - float(row @ state.mean), math.sqrt(predicted + variance)
    ratio = abs(innovation) / std / threshold
    if ratio > 1.0:
        # beyond twice the threshold it is no measurement of this quantity: it counts less the farther it is
        ratio *= max(1.0, 0.5 * ratio)
        # gain x innovation as if the innovation were at the threshold: P / (P + R) shrinks by 1 / ratio
        variance = (predicted + variance) * ratio - predicted
    mean, covariance = kalman.update(
        state.mean, state.covariance, np.array([value]), np.array([[variance]]), design
    )
    symmetric = (covariance + covariance.T) / 2.0
    return WearFilter(state.batches, state.current, mean, symmetric), Innovation(innovation, std)


def friction(state: WearFilter) -> tuple[float, float]:
    """Friction of the present batch, its level and offset together, and its standard deviation."""
    value, variance = float(state.mean[0]), float(state.covariance[0, 0])
    if own := _offset_index(state.batches, state.current):
        value += float(state.mean[own])
        variance += float(state.covariance[own, own] + 2.0 * state.covariance[0, own])
    return value, math.sqrt(max(variance, 0.0))


def offset(state: WearFilter, batch: str) -> tuple[float, float]:
    """Offset of a batch from the reference batch, and its standard deviation."""
    return contrast(state, batch, state.batches[0])


def contrast(state: WearFilter, batch: str, other: str | None) -> tuple[float, float]:
    """Offset of `batch` minus that of `other`, and its standard deviation."""
    size = variance = 0.0
    a, b = _offset_index(state.batches, batch), _offset_index(state.batches, other)
    if a:
        size, variance = float(state.mean[a]), float(state.covariance[a, a])
    if b:
        size, variance = size - float(state.mean[b]), variance + float(state.covariance[b, b])
    if a and b:
        variance -= 2.0 * float(state.covariance[a, b])
    return size, math.sqrt(max(variance, 0.0))


def _offset_index(batches: tuple[str | None, ...], batch: str | None) -> int:
    """Place of a batch's offset in the state; 0 for the reference batch, which has none."""
    return 0 if batch == batches[0] else 1 + batches.index(batch)
