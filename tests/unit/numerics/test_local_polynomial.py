"""Polynomials and means by compiled code, against numpy's and against closed forms."""

import math
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.features.channels import check_channel
from impactcell.numerics.local_polynomial import (
    channel_statistics,
    fit_polynomial,
    mean,
    median,
    median_third_difference,
    running_mean,
    value_at,
    value_std,
    widest_cubic,
)
from impactcell.prediction.block_averaging import average_blocks
from impactcell.records import Channel


@given(
    st.integers(1, 3),
    st.integers(8, 400),
    st.floats(-100.0, 100.0),
    st.sampled_from([1e-4, 1.0, 1e3]),
    st.integers(0, 99),
)
def test_a_polynomial_is_that_of_least_squares(
    degree: int, count: int, origin: float, scale: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    u = np.sort(rng.uniform(-1.0, 1.0, count))
    u[0], u[-1] = -1.0, 1.0
    values = 1e3 + rng.normal(size=count) + 5.0 * u**2
    fitted, factor, squares = fit_polynomial(origin + scale * u, values, origin, scale, degree)
    basis = np.vander(u, degree + 1, increasing=True)
    expected, residual, *_ = np.linalg.lstsq(basis, values)
    assert fitted == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert squares == pytest.approx(float(residual[0]), rel=1e-6)
    covariance = np.linalg.inv(basis.T @ basis)
    at = 0.3 ** np.arange(degree + 1)
    assert value_std(factor, 0.3) == pytest.approx(math.sqrt(at @ covariance @ at), rel=1e-6)
    assert value_at(fitted, 0.3) == pytest.approx(float(expected @ at), rel=1e-9)


def test_samples_at_one_time_determine_no_polynomial() -> None:
    fitted, _, _ = fit_polynomial(np.zeros(9), np.arange(9.0), 0.0, 1.0, 2)
    assert not np.isfinite(fitted).all()


@given(st.integers(1, 60), st.integers(1, 12), st.integers(0, 99))
def test_a_running_mean_is_that_of_the_values_about_each(count: int, width: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=count)
    mean = running_mean(values, width)
    for i in range(count):
        near = values[max(0, i - width // 2) : max(0, i - width // 2 + width)]
        assert mean[i] == pytest.approx(near.mean(), abs=1e-12)


def test_a_survey_counts_what_is_wrong() -> None:
    times, values = np.array([0.0, 1.0, 1.0, 3.0]), np.array([2.0, -5.0, math.nan, 7.0])
    assert channel_statistics(times, values)[:4] == (1, False, -5.0, 7.0)
    assert channel_statistics(times[:2], values[:2])[:4] == (0, True, -5.0, 2.0)


@given(st.lists(st.integers(0, 3), min_size=1, max_size=30))
def test_a_plateau_is_the_longest_run_at_the_highest(values: list[int]) -> None:
    highest = max(values)
    runs = [len(list(run)) for value, run in groupby(values) if value == highest]
    assert channel_statistics(np.arange(30.0), np.array(values, dtype=float))[3:] == (highest, max(runs))


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30))
def test_mean_and_median_are_numpys(values: list[float]) -> None:
    assert median(np.array(values)) == np.median(values)
    assert mean(np.array(values)) == np.mean(values)


def test_the_widest_cubic_stops_where_the_record_bends_away() -> None:
    rng = np.random.default_rng(5)
    times = np.arange(4001) * 1e-5
    top = 300.0 - 4e5 * (times - 0.02) ** 2
    found, value, std = widest_cubic(
        times,
        np.where(times < 0.0225, top, 0.0) + rng.normal(0.0, 0.4, 4001),
        0.4,
        (0.02, 1.0, 1.0),
        (2.5e-4, 4e-3, 1e-5),
    )
    assert found
    assert abs(value - 300.0) < 5.0 * std
    assert 0.4 / math.sqrt(500) < std < 0.2


def test_scatter_and_means_of_blocks_hold_all_squares() -> None:
    rng = np.random.default_rng(8)
    times = np.cumsum(rng.uniform(0.2, 1.8, 500)) * 1e-5
    values = 1e3 + 2e4 * times + rng.normal(0.0, 0.3, 500)
    made = average_blocks(check_channel(Channel(times, values, 0.3), "position"), 2e-4, 2e-5, [])
    line = 990.0 + 1.5e4 * made.time_s
    direct = float(np.square((values - 990.0 - 1.5e4 * times) / 0.3).sum())
    between = float(np.square((made.values - line) / made.std).sum())
    sums = made.scatter
    within = float((sums.values - 3e4 * sums.both + 1.5e4**2 * sums.times).sum()) / 0.3**2
    assert between + within == pytest.approx(direct, rel=1e-9)


@given(
    values=st.lists(st.integers(-5, 5) | st.floats(-1e6, 1e6), min_size=4, max_size=60).map(
        lambda drawn: np.array(drawn, dtype=np.float64)
    )
)
def test_median_third_difference_is_numpys_to_the_bit(values: np.ndarray) -> None:
    """Few distinct values, as codes give them, and many."""
    assert median_third_difference(values) == np.median(np.abs(np.diff(values, 3)))


@pytest.mark.parametrize("size", [20_000, 20_001])
def test_median_third_difference_of_ordered_and_of_equal_values(size: int) -> None:
    ordered = np.arange(size, dtype=np.float64) ** 3
    for values in (ordered, -ordered, np.zeros(size)):
        assert median_third_difference(values) == np.median(np.abs(np.diff(values, 3)))
