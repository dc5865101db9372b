"""Does the extended model close the gap on shots that were never used? Opened once."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data import CHANNELS, PHASES, NoiseFloor, ReplicateSpread
from impactcell.discrepancy.model import Fit, Problem, sample_phases, trajectory_of
from impactcell.records import Samples

MIN_OPEN_GAP = 1.05
"""Gap before, in noise floors, above which there is something to close; the floor itself is 1."""

RESAMPLES = 1999
"""Draws of the held-out shots: a quantile at 2.5 % rests on fifty of them."""
RESAMPLING = 7
"""Stream of random numbers of these draws, apart from those of split and tests."""


@dataclass(frozen=True, slots=True, eq=False)
class Gap:
    """Gap of one model on one set of shots, in units of the noise floor.

    Attributes
    ----------
    trace : float
        RMS of the trace residuals over the sensors' noise.
    factor : float
        Spread of the friction factors about their law over their replicate spread; nan without replicates.
    """

    trace: float
    factor: float

    @property
    def whole(self) -> float:
        """The larger of the two."""
        return self.trace if math.isnan(self.factor) else max(self.trace, self.factor)


@dataclass(frozen=True, slots=True, eq=False)
class Validation:
    """Gaps of the nominal model (before) and of the extended one (after), in training and held out.

    Attributes
    ----------
    closed, low, high : float
        Share of the held-out gap above the noise floor that was closed, and its 95 % interval over shots; nan
        where there was none.
    regions : tuple of (phase, channel, before, after)
        Held-out RMS region by region.
    """

    train_before: Gap
    train_after: Gap
    before: Gap
    after: Gap
    closed: float
    low: float
    high: float
    regions: tuple[tuple[str, str, float, float], ...]


def gap(problem: Problem, model: Fit, floor: NoiseFloor, replicates: ReplicateSpread) -> Gap:
    """Gap of a model whose parameters of each shot have been fitted.

    Only channels whose noise is stated are counted, if there are any: elsewhere the floor is a lower bound.
    """
    misfit, freedom = _counted_misfit(problem, model, floor)
    return _gap(misfit, freedom, model.shot_parameters.log_factor, replicates.spread)


def _counted_misfit(problem: Problem, model: Fit, floor: NoiseFloor) -> tuple[Samples, Samples]:
    """Squared residual and degrees of freedom of every shot, over the channels that count."""
    is_stated = np.array([source == "stated" for source in floor.source])
    counting_channels = is_stated if is_stated.any() else ~is_stated
    counted = counting_channels[problem.shots.channel]
    starts = problem.shots.bounds[:-1]
    misfit = np.add.reduceat(np.where(counted, model.residual**2, 0.0), starts)
    freedom = np.add.reduceat(counted.astype(np.float64), starts) - len(problem.shot_parameter_names)
    return misfit, np.maximum(freedom, 0.0)


def _gap(misfit: Samples, freedom: Samples, log_factor: Samples, spread: float) -> Gap:
    """Gap from squared residual, degrees of freedom and log friction factor of every shot."""
    trace = math.sqrt(float(misfit.sum() / max(float(freedom.sum()), 1.0)))
    factor = math.sqrt(float(np.mean(log_factor**2))) / spread if spread > 0.0 else math.nan
    return Gap(trace, factor)


def validate(
    training: tuple[Problem, Fit, Fit],
    held_out: tuple[Problem, Fit, Fit],
    floor: NoiseFloor,
    replicates: ReplicateSpread,
    seed: int,
) -> Validation:
    """Gaps of two models on training and held-out shots, and the share that the second one closes.

    Parameters
    ----------
    training, held_out : tuple of Problem, Fit and Fit
        Shots, and the model before and after, its parameters of each shot fitted to them.
    """
    problem, before, after = held_out
    gap_before, gap_after = (gap(problem, model, floor, replicates) for model in (before, after))
    closed = low = high = math.nan
    if gap_before.whole > MIN_OPEN_GAP:
        closed = _closed_share(gap_before, gap_after)
        draws = _resampled_shares(held_out, floor, replicates, seed)
        if draws:
            low, high = (float(x) for x in np.quantile(draws, [0.025, 0.975]))
            low, high = min(low, closed), max(high, closed)
    return Validation(
        gap(training[0], training[1], floor, replicates),
        gap(training[0], training[2], floor, replicates),
        gap_before,
        gap_after,
        closed,
        low,
        high,
        _regions(problem, before, after),
    )


def _resampled_shares(
    held_out: tuple[Problem, Fit, Fit], floor: NoiseFloor, replicates: ReplicateSpread, seed: int
) -> list[float]:
    """Share of the gap that is closed in shots drawn with replacement; draws without a gap are left out."""
    problem, *models = held_out
    rng = np.random.default_rng([seed, RESAMPLING])
    counted = [_counted_misfit(problem, model, floor) for model in models]
    shares = []
    for _ in range(RESAMPLES):
        drawn = rng.integers(0, problem.count, problem.count)
        before, after = (
            _gap(misfit[drawn], freedom[drawn], model.shot_parameters.log_factor[drawn], replicates.spread)
            for (misfit, freedom), model in zip(counted, models, strict=True)
        )
        if before.whole > MIN_OPEN_GAP:
            shares.append(_closed_share(before, after))
    return shares


def _closed_share(before: Gap, after: Gap) -> float:
    """Share of what was above the noise floor, 1, that is gone."""
    return (before.whole - after.whole) / (before.whole - 1.0)


def _regions(
    problem: Problem, held_before: Fit, held_after: Fit
) -> tuple[tuple[str, str, float, float], ...]:
    phase = sample_phases(problem, trajectory_of(problem, held_after))
    regions = []
    for number, name in enumerate(PHASES):
        for channel, sensor in enumerate(CHANNELS):
            in_region = (phase == number) & (problem.shots.channel == channel)
            if in_region.any():
                rms = [
                    float(np.sqrt(np.mean(model.residual[in_region] ** 2)))
                    for model in (held_before, held_after)
                ]
                regions.append((name, sensor, rms[0], rms[1]))
    return tuple(regions)
