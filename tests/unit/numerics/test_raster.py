"""A raster is found however its values were scaled and written, and not where there is none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.numerics.raster import ANY_VALUE, NEARLY_EQUAL, Raster, raster_of

CODES = np.random.default_rng(2).integers(-400, 9000, 700)


@pytest.mark.parametrize("step", [1.0, 0.5, 5e-6, 0.0122, 10.0 / 2**15])
def test_the_raster_of_codes_that_were_scaled_is_found(step: float) -> None:
    assert raster_of(step * CODES) == pytest.approx(step, rel=1e-3)


def test_a_code_that_was_written_with_few_digits_keeps_its_raster() -> None:
    written = np.array([float(f"{0.0122 * code:.4f}") for code in CODES])
    assert raster_of(written + 0.03) == pytest.approx(0.0122, rel=1e-2)


def test_noise_of_a_float_lies_on_no_raster() -> None:
    assert raster_of(np.random.default_rng(3).normal(size=700)) is None
    assert raster_of(np.array([1.0, np.nan, 1.0])) is None


@given(
    st.sampled_from([1e-6, 1.0 / 60e3, 0.1, 0.3, 1.0, 7.0]),
    st.sampled_from([1, 3, 12]),
    st.integers(1, 400),
    st.lists(st.floats(0.0, 1.0), min_size=1, max_size=30),
)
def test_values_of_a_raster_are_the_largest_up_to_what_is_asked_for(
    step: float, first: int, steps: int, shares: list[float]
) -> None:
    raster = Raster(step, first * step, (first + steps) * step)
    asked = np.unique(1.1 * raster.last * np.array(shares))
    given_ = raster.at_most(asked)
    codes = np.rint(given_ / step)
    np.testing.assert_allclose(given_, codes * step, rtol=2 * NEARLY_EQUAL)
    assert (np.diff(codes) > 0).all()
    assert codes[0] >= first
    assert codes[-1] <= first + steps
    wanted = {min(int(value / step + NEARLY_EQUAL), first + steps) for value in asked}
    assert set(codes.astype(int)) == ({code for code in wanted if code >= first} or {first})
    if asked[-1] >= raster.first:
        assert given_[-1] <= asked[-1]


def test_a_limit_that_is_a_whole_number_of_steps_is_reached_and_not_passed() -> None:
    for steps in range(1, 2000):
        for step in (0.1, 1e-4, 1.0 / 60e3, 0.7e-6):
            limit = float(f"{steps * step:.15g}")
            (reached,) = Raster(step, step, 1e4).at_most(np.array([limit]))
            assert reached <= limit
            assert reached == pytest.approx(steps * step, rel=1e-9)


def test_any_value_is_left_as_it_is() -> None:
    asked = np.array([0.1, 0.1, np.inf])
    assert ANY_VALUE.at_most(asked) is asked
