"""A series tracked through the public API."""

import math

import numpy as np
import pytest

import impactcell
from impactcell.errors import SeriesError


def series(slope: float = 0.0, step: float = 0.0, at: int = 250, count: int = 400) -> np.ndarray:
    cycles = np.arange(count)
    noise = np.random.default_rng(3).normal(0.0, 0.002, count)
    return 0.2 + slope * cycles + step * (cycles >= at) + noise


def test_wear_is_followed() -> None:
    tracked = impactcell.track(np.arange(1000), series(2e-5, count=1000), np.full(1000, 0.002), limit=0.24)
    assert tracked.wear.rate_per_cycle == pytest.approx(2e-5, abs=4.0 * tracked.wear.rate_std)
    assert tracked.level[-1] == tracked.wear.level
    assert tracked.used == 1000
    left = (0.24 - 0.2 - 2e-5 * 999) / 2e-5
    assert tracked.wear.cycles_to_limit_low < left < tracked.wear.cycles_to_limit_high


def test_a_batch_that_is_not_told_is_found() -> None:
    tracked = impactcell.track(np.arange(400), series(step=0.02), np.full(400, 0.002))
    (shift,) = tracked.alarms
    assert shift.alarm == "BatchShift"
    assert shift.evidence.change_cycle == 250
    assert shift.evidence.size == pytest.approx(0.02, abs=4.0 * shift.evidence.size_std)


def test_a_batch_that_is_told_is_believed() -> None:
    batch = ["A"] * 250 + ["B"] * 150
    tracked = impactcell.track(np.arange(400), series(step=0.02), np.full(400, 0.002), batch=batch)
    assert tracked.batch.batch_id == "B"
    assert tracked.batch_offset[-1] == pytest.approx(0.02, abs=1e-3)
    assert tracked.level[-1] == pytest.approx(0.2, abs=1e-3)


def test_standard_deviations_may_be_left_out() -> None:
    tracked = impactcell.track(np.arange(400), series())
    assert tracked.wear.level == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize(
    ("cycle", "mu_s", "std", "message"),
    [
        ([], [], [], "no cycles"),
        ([1, 2], [0.2], [0.1, 0.1], "of one length"),
        ([1, 2], [0.2, 0.2], [0.1], "of one length"),
        ([0.5, 2], [0.2, 0.2], [0.1, 0.1], r"cycle\[0\] = 0.5"),
        ([1, math.nan], [0.2, 0.2], [0.1, 0.1], r"cycle\[1\] = nan"),
        ([-1, 2], [0.2, 0.2], [0.1, 0.1], r"cycle\[0\] = -1"),
        ([1, 1e300], [0.2, 0.2], [0.1, 0.1], r"cycle\[1\] = 1e\+300 is larger"),
        ([1, 2], ["a", 0.2], [0.1, 0.1], "mu_s is to hold numbers"),
        ([4, 3, 2, 1], [0.2] * 4, [0.1] * 4, "sort them by cycle"),
    ],
)
def test_what_is_no_series_is_refused(
    cycle: list[float], mu_s: list[float], std: list[float], message: str
) -> None:
    with pytest.raises(SeriesError, match=message):
        impactcell.track(cycle, mu_s, std)


@pytest.mark.parametrize("limit", [math.nan, 0.0, -math.inf])
def test_a_limit_that_is_no_friction_is_refused(limit: float) -> None:
    with pytest.raises(SeriesError, match="limit"):
        impactcell.track([1, 2], [0.2, 0.2], limit=limit)


def test_no_limit_is_none_and_words_are_no_limit() -> None:
    assert impactcell.track([1, 2], [0.2, 0.2], 0.002, limit=None).alarms == ()
    with pytest.raises(SeriesError, match="limit is to hold numbers"):
        impactcell.track([1, 2], [0.2, 0.2], limit="worn")  # type: ignore[arg-type]


def test_one_standard_deviation_stands_for_all() -> None:
    one = impactcell.track(np.arange(100), series(count=100), 0.002)
    each = impactcell.track(np.arange(100), series(count=100), np.full(100, 0.002))
    assert (one.wear.level, one.wear.level_std) == (each.wear.level, each.wear.level_std)


def test_what_a_masked_array_hides_is_missing() -> None:
    hidden = np.arange(100) % 5 == 0
    masked = impactcell.track(np.arange(100), np.ma.masked_array(series(count=100), hidden), 0.002)
    missing = impactcell.track(np.arange(100), np.where(hidden, math.nan, series(count=100)), 0.002)
    assert masked.used == 80
    assert masked.wear.level == missing.wear.level


class NA:
    """As the NA of pandas: a comparison with it is neither true nor false."""

    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, other: object) -> "NA":  # type: ignore[override]
        return self

    def __bool__(self) -> bool:
        raise TypeError("boolean value of NA is ambiguous")


@pytest.mark.parametrize(
    ("batch", "message"),
    [
        (5, r"batch = 5: give a batch for each cycle, \['A', 'A', 'B'\] say, or leave it out"),
        (np.array([["A", "B"], ["C", "D"]]), r"batch\[0\] is to be the name of one batch, not array"),
    ],
)
def test_batches_that_are_none_are_refused(batch: object, message: str) -> None:
    with pytest.raises(SeriesError, match=message):
        impactcell.track([1, 2], [0.2, 0.2], batch=batch)  # type: ignore[arg-type]


@pytest.mark.parametrize("limit", [[], [0.25, 0.3]])
def test_a_limit_is_one_number(limit: list[float]) -> None:
    with pytest.raises(SeriesError, match=f"limit is to be one number, not {len(limit)}$"):
        impactcell.track([1, 2], [0.2, 0.2], limit=limit)  # type: ignore[arg-type]


@pytest.mark.slow
def test_batches_that_a_table_leaves_out_are_none() -> None:
    def tracked(*names: object) -> impactcell.TrackedSeries:
        batch = [name for name in names for _ in range(50)]
        return impactcell.track(np.arange(100), series(count=100), 0.002, batch=batch)

    for absent in (math.nan, "", np.ma.masked, NA()):
        assert tracked(absent, absent).wear.level == tracked(None, None).wear.level
        assert tracked("A", absent).wear.level == tracked("A", None).wear.level
    assert tracked(1, 2).batch.batch_id == "2"
