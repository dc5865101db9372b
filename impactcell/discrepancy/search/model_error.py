"""Model error as a quantity: how much a model leaves beside the sensors' noise, and in how many pieces.

What a model leaves is alike in shot after shot, so that more shots do not average it away. Its evidence
counts by independent pieces: as many as correlation lengths go into a shot, times the patterns in which it
differs from shot to shot.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher

from impactcell.discrepancy.data import CHANNELS, IndexArray, PreparedCampaign
from impactcell.discrepancy.model import (
    Fit,
    ParameterEstimate,
    Problem,
    Scores,
    SharedError,
    linearise,
    profile_parameters,
    scores,
)
from impactcell.discrepancy.search.evidence import ModelEvidence
from impactcell.discrepancy.search.residual_map import MapDirections, map_directions
from impactcell.records import Samples

SMALL_CORRELATION = 0.1
"""Correlation, over that of neighbours, at which the sum over lags ends: beyond it there is only noise."""
BINS = 12
"""Parts of a channel of a shot whose means are compared between shots."""
MIN_PIECES = 3.0
"""Fewest independent pieces of a shot: a level, a slope and a bow are always three."""


@dataclass(frozen=True, slots=True)
class ModelError:
    """What a model leaves beside the sensors' noise.

    Attributes
    ----------
    excess : float
        Sum of squared residuals beyond those of the noise [squared noise floors], all shots.
    level : float
        RMS of what is left beside the noise [1 = noise floor].
    pieces_of_shot : float
        Samples of a shot over the integral of their correlation.
    pieces : float
        Independent pieces: those of a shot times the patterns in which what is left differs from shot to
        shot.
    """

    excess: float
    level: float
    pieces_of_shot: float
    pieces: float


def estimate_model_error(problem: Problem, model: Fit) -> ModelError:
    """Level and correlation of what a model leaves, over all shots and channels of a problem.

    White noise is not correlated from one sample to the next: with c_l the mean product of residuals l
    samples apart, what is smooth has a correlation c_l/c_1, of integral 1 + 2 sum c_l/c_1 (Bartlett 1946).
    """
    shots = problem.shots
    segments = [
        segment
        for shot in range(problem.count)
        for segment in _channels_of(
            model.residual[shots.samples_of(shot)], shots.channel[shots.samples_of(shot)]
        )
    ]
    longest = max(len(segment) for segment in segments)
    products, counts = np.zeros(longest), np.zeros(longest)
    for segment in segments:
        size = len(segment)
        spectrum = np.abs(np.fft.rfft(segment, 2 * size)) ** 2
        products[:size] += np.fft.irfft(spectrum)[:size]
        counts[:size] += np.arange(size, 0, -1)
    correlation = products / np.maximum(counts, 1.0)
    excess = float(products[0]) - shots.values.size
    samples = shots.values.size / problem.count
    pieces = max(samples / _integral(correlation), MIN_PIECES)
    level = math.sqrt(max(excess, 0.0) / shots.values.size)
    return ModelError(excess, level, pieces, pieces * _patterns(model.residual, problem))


def share_p_value(before: float, left: ModelError, parameters: int) -> float:
    """Probability that an effect of so many parameters takes this share of a gap which it has no part in.

    F test with the independent pieces of a shot as observations.

    Parameters
    ----------
    before : float
        Excess without the effect.
    left : ModelError
        With it.
    """
    if left.excess <= 0.0:
        return 0.0
    freedom = max(left.pieces - parameters, 1.0)
    ratio = max(before - left.excess, 0.0) / parameters / (left.excess / freedom)
    return float(fisher.sf(ratio, parameters, freedom))


def largest_rival_excess(left: ModelError, probability: float) -> float:
    """Excess up to which a rival is not told from a model that leaves `left`: F of as many pieces each."""
    return left.excess * float(fisher.ppf(probability, left.pieces, left.pieces))


def shared_error(evidence: ModelEvidence) -> SharedError:
    """Estimate the error that all shots share, from the evidence against a fitted model."""
    return shared_error_of(evidence.map, evidence.map_scores)


def shared_error_of(chart: MapDirections, chart_scores: Scores) -> SharedError:
    """Estimate the error that all shots share, from the sizes of the map's shapes against a fitted model.

    In every cell and channel of the map the sizes a_q of its shapes are compared with what they would
    scatter by if shots were all that scatters, v_q: what is left of mean(a² - v) is the variance of a size,
    where it is beyond the scatter of such a mean (two of its standard deviations).
    """
    seen = (chart_scores.information > 0.0) & (chart.channel >= 0)
    information = np.where(seen, chart_scores.information, 1.0)
    by_chance = (chart_scores.each**2).sum(0) / information**2
    variance = np.zeros(len(chart.cell))
    for cell, channel in {*zip(chart.cell[seen].tolist(), chart.channel[seen].tolist(), strict=True)}:
        inside = seen & (chart.cell == cell) & (chart.channel == channel)
        squared, chance = chart_scores.amplitude[inside] ** 2, by_chance[inside]
        ratio = float(np.mean(squared / np.maximum(chance, 1e-300)))
        if ratio > 1.0 + 2.0 * math.sqrt(2.0 / int(inside.sum())):
            variance[inside] = float(np.mean(np.maximum(squared - chance, 0.0)))
    return SharedError(chart.products.shared.sum(0), variance)


def estimate_beside_error(
    problem: Problem, model: Fit, prepared: PreparedCampaign
) -> tuple[ParameterEstimate, ...]:
    """Every shared parameter of a model, its interval widened by the error that all shots share.

    And by what else fits as well beside a coordinate that ends at a bound.
    """
    linearisation = linearise(problem, model)
    chart = map_directions(problem, model, linearisation, prepared)
    shared = shared_error_of(chart, scores(linearisation, chart.products))
    penalty = problem.with_effects(model.effects).penalty_matrix
    return profile_parameters(problem, model, linearisation, shared, penalty)


def _channels_of(residual: Samples, channel: IndexArray) -> list[Samples]:
    parts = [residual[channel == number] for number in range(len(CHANNELS))]
    return [part for part in parts if len(part) > 1]


def _patterns(residual: Samples, problem: Problem) -> float:
    """Patterns in which residuals differ from shot to shot: the participation ratio of their singular values.

    One where all shots leave the same, as many as shots where each leaves something of its own.
    """
    rows = []
    for shot in range(problem.count):
        part = problem.shots.samples_of(shot)
        row = np.zeros((len(CHANNELS), BINS))
        for number in range(len(CHANNELS)):
            samples = residual[part][problem.shots.channel[part] == number]
            if len(samples) >= BINS:
                row[number] = [piece.mean() for piece in np.array_split(samples, BINS)]
        rows.append(row.ravel())
    power = np.linalg.svd(np.array(rows), compute_uv=False) ** 2
    return float(power.sum() ** 2 / max((power**2).sum(), 1e-300))


def _integral(correlation: Samples) -> float:
    """Integral of the correlation of what is smooth, in samples; 1 where nothing is."""
    if len(correlation) < 2 or correlation[1] <= 0.0:
        return 1.0
    relative = correlation[1:] / correlation[1]
    small = np.flatnonzero(relative < SMALL_CORRELATION)
    end = int(small[0]) if len(small) else len(relative)
    return 1.0 + 2.0 * float(relative[:end].sum())
