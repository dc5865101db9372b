"""Blocks whose noise neighbours share: what each adds to those before it, which nothing shares any more.

A Kalman filter (1960) follows the parts of the noise through the blocks. What it does not foresee of a block,
its innovation, is independent of all others, so that least squares on innovations weigh correlated noise as
it is: the covariance R of the blocks is L S L' with S diagonal, and the innovations of y are L^-1 y. The same
filter goes through the data, the model, its derivatives and every disturbance, for it is linear.

A block is the mean of some samples. Noise of first order has its value x at the last of them and their mean
for a state: by x before, a gap g before the first of m samples of step s, with a = exp(-g / decay) and
r = exp(-s / decay), the next x is a r^(m-1) x and the mean a c x, c = (1 - r^m) / (m (1 - r)), beside what is
new in both. A tone turns its value and, a quarter of a period later, that; its mean over a block is its value
in the middle times a factor. Of one that fades, blocks share with each other what its unfading kind would,
but the mean of one scatters by less: so much is taken off what each has of its own.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import CorrelatedNoise, Samples, SharedPart
from impactcell.records.correlated_noise import mean_variance

LEAST_WHITE = 1e-6
"""White share of a block's variance that is always there: an exact tone would else be foreseen exactly."""

LONGEST_DECAY_S = 1e6
"""Time over which a tone is forgotten at most [s]: in no record."""


@dataclass(frozen=True, slots=True, eq=False)
class Whitening:
    """The filter of one channel's blocks.

    Attributes
    ----------
    std : ndarray, shape (n,)
        Standard deviation of the innovation of each block.
    transition : ndarray, shape (n, p, 2, 2)
        From the two states of each part at the block before to those at this.
    loading : ndarray, shape (n, 2 p)
        What a block shows of the states.
    gains : ndarray, shape (n, 2 p)
    """

    std: Samples
    transition: Samples
    loading: Samples
    gains: Samples

    def innovations(self, curves: Samples) -> Samples:
        """Give what is not foreseen of curves that follow each other, shape (c n,), or lie above, (c, n)."""
        rows = curves.reshape(-1, len(self.std))
        return _innovations(rows, self.transition, self.loading, self.gains).reshape(curves.shape)

    def restored(self, innovations: Samples) -> Samples:
        """Give the curve that has these innovations, shape (n,)."""
        return _restored(innovations, self.transition, self.loading, self.gains)


def whitening(noise: CorrelatedNoise, times: Samples, count: Samples, factor: Samples) -> Whitening:
    """Make the filter for blocks of `count` samples whose standard deviations are `factor` times as large."""
    shape = len(times), len(noise.parts)
    transition, renewed = np.zeros((*shape, 2, 2)), np.zeros((*shape, 2, 2))
    loading = np.zeros((*shape, 2))
    for k, part in enumerate(noise.parts):
        of_part = _tone if part.frequency_hz else _first_order
        transition[:, k], renewed[:, k], loading[:, k] = of_part(part, times, count, noise.step_s)
    whole = noise.std**2
    faded = sum(_faded(part, count, noise.step_s) for part in noise.parts if part.frequency_hz)
    own = np.maximum(noise.white_std**2 / count - faded, LEAST_WHITE * whole)
    own += (factor**2 - 1.0) * whole / count
    shown = loading.reshape(len(times), -1)
    gains, variance = _gains(transition, renewed, shown, own)
    return Whitening(np.sqrt(variance), transition, shown, gains)


def within_block_std(noise: CorrelatedNoise, block_s: float) -> float:
    """Give the standard deviation of samples about the mean of their block, as of white noise."""
    count = max(round(block_s / noise.step_s), 2)
    within = (noise.std**2 - noise.mean_std(count) ** 2) * count / (count - 1.0)
    return math.sqrt(max(within, LEAST_WHITE * noise.std**2))


def _first_order(
    part: SharedPart, times: Samples, count: Samples, step_s: float
) -> tuple[Samples, Samples, Samples]:
    """Transition, variance of what is new and loading of noise of first order, in each block."""
    half_s = 0.5 * (count - 1.0) * step_s
    kept = np.zeros(len(times))  # nothing is known before the first block
    kept[1:] = np.exp(-np.maximum(times[1:] - half_s[1:] - times[:-1] - half_s[:-1], 0.0) / part.decay_s)
    forgotten = math.exp(-step_s / part.decay_s)
    in_mean = (1.0 - forgotten**count) / (count * (1.0 - forgotten))
    at_last = forgotten ** (count - 1.0)
    transition, renewed = np.zeros((len(times), 2, 2)), np.empty((len(times), 2, 2))
    transition[:, 0, 0], transition[:, 1, 0] = kept * at_last, kept * in_mean
    renewed[:, 0, 0] = 1.0 - (kept * at_last) ** 2
    renewed[:, 0, 1] = renewed[:, 1, 0] = in_mean * (1.0 - kept**2 * at_last)
    renewed[:, 1, 1] = _mean_variances(part, count, step_s) - (kept * in_mean) ** 2
    return transition, part.std**2 * renewed, np.tile([0.0, 1.0], (len(times), 1))


def _tone(
    part: SharedPart, times: Samples, count: Samples, step_s: float
) -> tuple[Samples, Samples, Samples]:
    """Transition, variance of what is new and loading of a tone, in each block."""
    apart = np.append(math.inf, np.diff(times))
    kept = np.exp(-apart / min(part.decay_s, LONGEST_DECAY_S))
    angle = 2.0 * math.pi * part.frequency_hz * np.append(0.0, apart[1:])
    cosine, sine = kept * np.cos(angle), kept * np.sin(angle)
    transition = np.array([[cosine, -sine], [sine, cosine]]).transpose(2, 0, 1)
    renewed = part.std**2 * (1.0 - kept**2)[:, None, None] * np.eye(2)
    shown = np.sqrt(_mean_variances(replace(part, decay_s=math.inf), count, step_s))
    return transition, renewed, np.column_stack([shown, np.zeros(len(times))])


def _faded(part: SharedPart, count: Samples, step_s: float) -> Samples:
    """Variance by which the mean of each block of a tone scatters less than of one that does not fade."""
    unfading = _mean_variances(replace(part, decay_s=math.inf), count, step_s)
    return part.std**2 * (unfading - _mean_variances(part, count, step_s))


def _mean_variances(part: SharedPart, count: Samples, step_s: float) -> Samples:
    """Variance of the mean of each block over that of a sample."""
    sizes, of_size = np.unique(count, return_inverse=True)
    return np.array([mean_variance(part, int(size), step_s) for size in sizes])[of_size]


@compiled
def _gains(transition: Samples, renewed: Samples, loading: Samples, own: Samples) -> tuple[Samples, Samples]:
    """Gains of the filter, shape (n, 2 p), and variances of the innovations, shape (n,).

    The states begin at 0: all of the first block is new.
    """
    blocks, size = loading.shape
    covariance, turned = np.zeros((size, size)), np.zeros((size, size))
    gains, variances, shown = np.empty((blocks, size)), np.empty(blocks), np.empty(size)
    for i in range(blocks):
        for j in range(0, size, 2):
            turn = transition[i, j // 2]
            for k in range(size):
                x, y = covariance[j, k], covariance[j + 1, k]
                turned[j, k] = turn[0, 0] * x + turn[0, 1] * y
                turned[j + 1, k] = turn[1, 0] * x + turn[1, 1] * y
        for j in range(0, size, 2):
            turn = transition[i, j // 2]
            for k in range(size):
                x, y = turned[k, j], turned[k, j + 1]
                covariance[k, j] = turn[0, 0] * x + turn[0, 1] * y
                covariance[k, j + 1] = turn[1, 0] * x + turn[1, 1] * y
            covariance[j : j + 2, j : j + 2] += renewed[i, j // 2]
        variance = own[i]
        for k in range(size):
            shown[k] = 0.0
            for j in range(size):
                shown[k] += covariance[k, j] * loading[i, j]
            variance += loading[i, k] * shown[k]
        variances[i] = variance
        for k in range(size):
            gains[i, k] = shown[k] / variance
            for j in range(size):
                covariance[k, j] -= gains[i, k] * shown[j]
    return gains, variances


@compiled
def _foresee(state: Samples, transition: Samples, loading: Samples) -> float:
    """Take the states to the next block, in place, and give what they show there."""
    foreseen = 0.0
    for j in range(len(transition)):
        x, y = state[2 * j], state[2 * j + 1]
        state[2 * j] = transition[j, 0, 0] * x + transition[j, 0, 1] * y
        state[2 * j + 1] = transition[j, 1, 0] * x + transition[j, 1, 1] * y
        foreseen += loading[2 * j] * state[2 * j] + loading[2 * j + 1] * state[2 * j + 1]
    return foreseen


@compiled
def _innovations(rows: Samples, transition: Samples, loading: Samples, gains: Samples) -> Samples:
    left, states = np.empty(rows.shape), np.zeros((len(rows), gains.shape[1]))
    for i in range(len(gains)):
        for row in range(len(rows)):
            left[row, i] = rows[row, i] - _foresee(states[row], transition[i], loading[i])
            for k in range(gains.shape[1]):
                states[row, k] += gains[i, k] * left[row, i]
    return left


@compiled
def _restored(innovations: Samples, transition: Samples, loading: Samples, gains: Samples) -> Samples:
    whole, state = np.empty(len(gains)), np.zeros(gains.shape[1])
    for i in range(len(gains)):
        whole[i] = innovations[i] + _foresee(state, transition[i], loading[i])
        for k in range(gains.shape[1]):
            state[k] += gains[i, k] * innovations[i]
    return whole
