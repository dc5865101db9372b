"""Gaps of models on blocks, and whether they fall where no model was fitted."""

import math

import numpy as np
from scipy.stats import t as student

from impactcell.discrepancy.machine.evidence import FallOfGap
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.regression.block_sums import Blocks
from impactcell.discrepancy.search import MIN_OPEN_GAP
from impactcell.records import Samples

CLOSED_RESAMPLES = 999
"""Draws of the held-out blocks for the interval of the share that is closed [1]."""
SIGN_DRAWS = 1999
"""Draws of the signs of the blocks: the least p-value is a two-thousandth."""


def sign_flip_p(differences: Samples, seed: int) -> float:
    """One-sided p-value that the sum of differences is above zero, signs of the blocks drawn at random."""
    rng = np.random.default_rng([seed, 8])
    signs = 2.0 * rng.integers(0, 2, (SIGN_DRAWS, len(differences))) - 1.0
    least = differences.sum() - 1e-12 * np.abs(differences).sum()
    return float(1 + np.sum(signs @ differences >= least)) / (1 + SIGN_DRAWS)


def gap(blocks: Blocks, model: FittedModel) -> float:
    """RMS of a model's residuals over the sensors' noise."""
    losses = blocks.losses(model.fit.columns, model.fit.coefficients)
    return math.sqrt(float(losses.sum()) / max(float(blocks.noise.sum()), 1e-300))


def fall_of_gap(
    blocks: Blocks, before: FittedModel, after: FittedModel, seed: int, blocks_after: Blocks | None = None
) -> FallOfGap:
    """How the held-out gap falls from one model to the next, blocks drawn with replacement.

    `blocks_after`: the same blocks at the delay and gravity that were found with the second model.
    """
    now = blocks if blocks_after is None else blocks_after
    losses = [
        one.losses(model.fit.columns, model.fit.coefficients)
        for one, model in ((blocks, before), (now, after))
    ]
    gap_before, gap_after = gap(blocks, before), gap(now, after)
    closed = low = high = math.nan
    if gap_before > MIN_OPEN_GAP:
        closed = (gap_before - gap_after) / (gap_before - 1.0)
        rng = np.random.default_rng([seed, 7])
        shares = []
        for _ in range(CLOSED_RESAMPLES):
            drawn = rng.integers(0, len(blocks), len(blocks))
            noise = max(float(blocks.noise[drawn].sum()), 1e-300)
            one, two = (math.sqrt(float(loss[drawn].sum()) / noise) for loss in losses)
            if one > MIN_OPEN_GAP:
                shares.append((one - two) / (one - 1.0))
        if shares:
            low, high = (float(value) for value in np.quantile(shares, [0.025, 0.975]))
            low, high = min(low, closed), max(high, closed)
    return FallOfGap(gap_before, gap_after, closed, low, high, sign_flip_p(losses[0] - losses[1], seed))


def expected_gap(blocks: Blocks, model: FittedModel) -> tuple[float, float]:
    """Range of the gap where nothing is left: about one, by the scatter between blocks."""
    losses = blocks.losses(model.fit.columns, model.fit.coefficients)
    ratio = losses / np.maximum(blocks.noise, 1e-300)
    if len(ratio) < 2:
        return 0.0, blocks.largest_by_chance
    error = float(ratio.std(ddof=1) / max(ratio.mean(), 1e-300)) / math.sqrt(len(ratio))
    half = float(student.ppf(0.975, len(ratio) - 1)) * error
    return math.sqrt(max(1.0 - half, 0.0)) / 1.05, min(math.sqrt(1.0 + half) * 1.05, blocks.largest_by_chance)
