"""The gap of a model on a set of shots, and how surely another model has a smaller one."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher
from scipy.stats import t as student

from impactcell.discrepancy.data import CHANNELS, PHASES, IndexArray, NoiseFloor, ReplicateSpread
from impactcell.discrepancy.model import Fit, Problem, sample_phases, trajectory_of
from impactcell.discrepancy.search.encompassing import (
    Slope,
    acting_shots,
    slope_of_factors,
    slope_of_traces,
)
from impactcell.discrepancy.search.gap import Gap, Part
from impactcell.discrepancy.search.model_error import estimate_model_error
from impactcell.records import Samples

MIN_OPEN_GAP = 1.05
"""Gap before, in noise floors, above which there is something to close; the floor itself is 1."""
RESAMPLES = 1999
"""Draws of the held-out shots: a quantile at 2.5 % rests on fifty of them."""
BOOTSTRAP, SIGN_FLIPS = 7, 8
"""Streams of random numbers of these draws, apart from those of split and tests."""
MAX_P_VALUE = 0.1
"""One-sided error of the held-out shots' test, beside an interval above 0: they confirm what other shots have
found at an error of 1 %, so that both together err once in a thousand."""
FEW_SHOTS = 5.0
"""Shots in which an effect acts, below which signs drawn at random and shots drawn again can tell of nothing:
of four equal signs in a row one in sixteen is by chance, and a draw without any is not rare [1]."""
MIN_CLOSED_SHARE = 0.02
"""Share of the held-out gap that an effect must close: a fall may be certain and still be too small."""
NOISE_TOLERANCE = 0.05
"""Relative error of a stated noise: two digits."""
MAX_EXPECTED_GAP = 1.3
"""No scatter between shots makes a gap of traces beyond this one to be expected."""
TAILS = (0.025, 0.975)
"""Ends of the interval of a share."""
SHOWN, DECIDING = 0.95, 0.99
"""Probability of the range of gaps that is shown, and of the one by which a model is at its floor."""


Share = TypeVar("Share", float, Samples)
"""One share, or one a draw."""


@dataclass(frozen=True, slots=True, eq=False)
class GapChange:
    """How the held-out gap changes from one model to the next.

    Attributes
    ----------
    parts : tuple of Part
        In which it is judged.
    closed, low, high : float
        Share of the gap above the noise floor that is closed, and its 95 % interval over shots; nan where
        there was none.
    p_value : float
        That it does not fall, one-sided: signs of the shots' differences drawn at random; in the friction
        factors, and where an effect acts in few shots, by how its change fits (`encompassing.py`).
    """

    parts: tuple[Part, ...]
    before: Gap
    after: Gap
    closed: float
    low: float
    high: float
    p_value: float

    def is_real(self, max_p: float = MAX_P_VALUE) -> bool:
        """Whether independent shots agree that the gap falls, and by more than a trifle."""
        if self.parts == (Part.FACTORS,) and not self.after.is_narrower(self.before):
            return False
        return self.low > 0.0 and self.closed >= MIN_CLOSED_SHARE and self.p_value <= max_p


@dataclass(frozen=True, slots=True, eq=False)
class GapMeasure:
    """Measures gaps on one set of shots.

    Attributes
    ----------
    problem : Problem
    floor : NoiseFloor
        Only channels whose noise is stated are counted, if there are any: elsewhere it is a lower bound.
    replicates : ReplicateSpread
    seed : int
    """

    problem: Problem
    floor: NoiseFloor
    replicates: ReplicateSpread
    seed: int

    def gap(self, model: Fit) -> Gap:
        """Gap of a model whose parameters of each shot have been fitted."""
        misfit, freedom = self._counted(model)
        return self._gap(misfit, freedom, model.shot_parameters.log_factor)

    def change(self, before: Fit, after: Fit, parts: Sequence[Part] | None = None) -> GapChange:
        """Share of the gap of one model that another one closes; by default in the part that falls most."""
        gaps = self.gap(before), self.gap(after)
        if parts is None:
            falls = {part: gaps[0].of([part]) - gaps[1].of([part]) for part in Part}
            parts = [max(Part, key=lambda part: -math.inf if math.isnan(falls[part]) else falls[part])]
        closed = low = high = math.nan
        by_factors = Part.FACTORS in parts and gaps[0].factor > gaps[0].trace
        by_traces = Part.TRACES in parts and not by_factors
        slope = self._slope(before, after, by_traces=by_traces)
        if gaps[0].of(parts) > MIN_OPEN_GAP:
            closed = _closed_share(gaps[0].of(parts), gaps[1].of(parts))
            if slope is not None and by_traces:
                low, high = self._ends_by_slope(before, gaps, parts, slope)
            else:
                low, high = self._resampled_ends(before, after, parts)
            low, high = min(low, closed), max(high, closed)
        p_value = self._p_value(before, after, parts) if slope is None else slope.p_value
        return GapChange(tuple(parts), *gaps, closed, low, high, p_value)

    def expected(self, model: Fit, probability: float = SHOWN) -> tuple[Gap, Gap]:
        """Range in which the gap lies where nothing is left.

        Traces: about one by as much as the mean of the shots' misfits is uncertain by their own scatter,
        which sees correlated noise too. Friction factors: F with the shots and the replicates' degrees of
        freedom.
        """
        misfit, freedom = self._counted(model)
        per_sample = misfit[freedom > 0.0] / freedom[freedom > 0.0]
        n = len(per_sample)
        tails = np.array([0.5 - 0.5 * probability, 0.5 + 0.5 * probability])
        half = 0.0
        if n > 1:
            error = float(per_sample.std(ddof=1) / max(per_sample.mean(), 1e-300)) / math.sqrt(n)
            half = float(student.ppf(tails[1], n - 1)) * error
        trace = (
            math.sqrt(max(1.0 - half, 0.0)) / (1.0 + NOISE_TOLERANCE),
            min(math.sqrt(1.0 + half) * (1.0 + NOISE_TOLERANCE), MAX_EXPECTED_GAP),
        )
        factor = (math.nan, math.nan)
        if self.replicates.degrees_of_freedom > 0:
            low, high = fisher.ppf(tails, self.problem.count, self.replicates.degrees_of_freedom)
            factor = (math.sqrt(low), math.sqrt(high))
        return Gap(trace[0], factor[0]), Gap(trace[1], factor[1])

    def is_at_floor(self, model: Fit) -> bool:
        """Whether the gap of a model is one that is to be expected where nothing is left."""
        gap, (_, high) = self.gap(model), self.expected(model, DECIDING)
        return gap.trace <= high.trace and not gap.factor > high.factor

    def regions(self, before: Fit, after: Fit) -> tuple[tuple[str, str, float, float], ...]:
        """RMS of two models in every phase and channel: (phase, channel, before, after)."""
        shots = self.problem.shots
        phase = sample_phases(self.problem, trajectory_of(self.problem, after))
        regions = []
        for number, name in enumerate(PHASES):
            for channel, sensor in enumerate(CHANNELS):
                inside = (phase == number) & (shots.channel == channel)
                if inside.any():
                    rms = [float(np.sqrt(np.mean(model.residual[inside] ** 2))) for model in (before, after)]
                    regions.append((name, sensor, rms[0], rms[1]))
        return tuple(regions)

    def _counted(self, model: Fit) -> tuple[Samples, Samples]:
        """Squared residual and degrees of freedom of every shot, over the channels that count."""
        counted = self._counts(self.problem.shots.channel)
        first = self.problem.shots.bounds[:-1]
        misfit = np.add.reduceat(np.where(counted, model.residual**2, 0.0), first)
        freedom = np.add.reduceat(counted.astype(np.float64), first) - len(self.problem.shot_parameter_names)
        return misfit, np.maximum(freedom, 0.0)

    def _counts(self, channel: IndexArray) -> NDArray[np.bool_]:
        """Whether samples of these channels count, shape (N,)."""
        stated = np.array([source == "stated" for source in self.floor.source])
        counts: NDArray[np.bool_] = (stated if stated.any() else ~stated)[channel]
        return counts

    def _gap(self, misfit: Samples, freedom: Samples, log_factor: Samples) -> Gap:
        trace = math.sqrt(float(misfit.sum() / max(float(freedom.sum()), 1.0)))
        spread = self.replicates.spread
        factor = math.sqrt(float(np.mean(log_factor**2))) / spread if spread > 0.0 else math.nan
        return Gap(trace, factor)

    def _slope(self, before: Fit, after: Fit, *, by_traces: bool) -> Slope | None:
        """Slope of what is left on its change, in the factors, or where few shots show it; None elsewhere."""
        if not by_traces:
            return slope_of_factors(before.shot_parameters.log_factor, after.shot_parameters.log_factor)
        shots = self.problem.shots
        counted = self._counts(shots.channel)
        first = shots.bounds[:-1]
        e, left = (np.where(counted, model.residual, 0.0) for model in (before, after))
        acting = acting_shots(np.add.reduceat((e - left) ** 2, first))
        if acting >= FEW_SHOTS:
            return None
        error = estimate_model_error(self.problem, after)
        length = shots.values.size / self.problem.count / error.pieces_of_shot
        return slope_of_traces(e, left, acting, error.level**2 * length, error.pieces_of_shot)

    def _ends_by_slope(
        self, before: Fit, gaps: tuple[Gap, Gap], parts: Sequence[Part], slope: Slope
    ) -> tuple[float, float]:
        """Return the shares closed at the ends of a slope's interval, the factors being as they are."""
        _, freedom = self._counted(before)
        shares = []
        for tail in TAILS:
            square = gaps[0].trace ** 2 - slope.fall(tail) / max(float(freedom.sum()), 1.0)
            left = Gap(math.sqrt(max(square, 0.0)), gaps[1].factor)
            shares.append(_closed_share(gaps[0].of(parts), left.of(parts)))
        return min(shares), max(shares)

    def _resampled_ends(self, before: Fit, after: Fit, parts: Sequence[Part]) -> tuple[float, float]:
        """Return the ends of the share closed, shots drawn again; draws without a gap are left out."""
        rng = np.random.default_rng([self.seed, BOOTSTRAP])
        drawn = rng.integers(0, self.problem.count, (RESAMPLES, self.problem.count))
        gaps = [self._resampled_gaps(model, drawn, parts) for model in (before, after)]
        is_open = gaps[0] > MIN_OPEN_GAP
        if not is_open.any():
            return math.nan, math.nan
        low, high = np.quantile(_closed_share(gaps[0][is_open], gaps[1][is_open]), TAILS)
        return float(low), float(high)

    def _resampled_gaps(self, model: Fit, drawn: IndexArray, parts: Sequence[Part]) -> Samples:
        """Gap in some of its parts, shape (draws,), of the shots `drawn`, shape (draws, n)."""
        misfit, freedom = self._counted(model)
        spread = self.replicates.spread
        gaps = []
        if Part.TRACES in parts:
            gaps.append(np.sqrt(misfit[drawn].sum(1) / np.maximum(freedom[drawn].sum(1), 1.0)))
        if Part.FACTORS in parts and spread > 0.0:
            gaps.append(np.sqrt((model.shot_parameters.log_factor**2)[drawn].mean(1)) / spread)
        return np.max(gaps, axis=0) if gaps else np.full(len(drawn), np.nan)

    def _p_value(self, before: Fit, after: Fit, parts: Sequence[Part]) -> float:
        """Test that shots are as likely to be followed worse as better, signs at random."""
        spread = self.replicates.spread if self.replicates.spread > 0.0 else after.spread
        cost = [
            self._counted(model)[0] * (Part.TRACES in parts)
            + (model.shot_parameters.log_factor / spread) ** 2 * (Part.FACTORS in parts)
            for model in (before, after)
        ]
        difference = cost[0] - cost[1]
        rng = np.random.default_rng([self.seed, SIGN_FLIPS])
        signs = 2.0 * rng.integers(0, 2, (RESAMPLES, self.problem.count)) - 1.0
        least = difference.sum() - 1e-12 * np.abs(difference).sum()
        return float(1 + np.sum(signs @ difference >= least)) / (1 + RESAMPLES)


def _closed_share(before: Share, after: Share) -> Share:
    """Share of what was above the noise floor, 1, that is gone."""
    return (before - after) / (before - 1.0)
