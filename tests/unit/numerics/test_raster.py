"""A raster is found however its values were scaled and written, and not where there is none."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.errors import RasterError
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
    assert ((codes >= first) & (codes <= first + steps)).all()
    wanted = {min(int(value / step + NEARLY_EQUAL), first + steps) for value in asked}
    assert set(codes.astype(int)) == {code for code in wanted if code >= first}
    assert (given_ <= asked[-1]).all()
    assert raster.has_up_to(asked[-1]) == bool(given_.size)


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


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ((-1e-3,), "a step above 0, not -0.001"),
        ((math.nan,), "a step above 0, not nan"),
        ((math.inf,), "a step above 0, not inf"),
        (("x",), "a step above 0, not 'x'"),
        ((True,), "a step above 0, not True"),
        ((0.0, 0.5), "a step above 0, not 0.0"),
        ((0.0, 0.0, 0.5), "a step above 0, not 0.0"),
        ((1e-3, -0.1), "begins with a number of 0 or more, not -0.1"),
        ((1e-3, math.nan), "begins with a number of 0 or more, not nan"),
        ((1e-3, "0.1"), "begins with a number of 0 or more, not '0.1'"),
        ((1e-3, 0.1, math.nan), "ends with a number, or inf where it has no end, not nan"),
        ((1e-3, 0.1, None), "ends with a number, or inf where it has no end, not None"),
        ((1e-3, 0.5, 0.1), "begins with 0.5 cannot end with 0.1"),
    ],
)
def test_a_raster_that_has_no_values_is_refused(numbers: tuple[float, ...], told: str) -> None:
    with pytest.raises(RasterError, match=re.escape(told)):
        Raster(*numbers)


def test_a_raster_may_be_made_of_whole_numbers_and_of_those_of_numpy() -> None:
    assert Raster(1, 2, 3).at_most(np.array([2.5])).tolist() == [2.0]
    assert Raster(np.float64(0.5), np.int64(1)).least == 1.0
    assert Raster(0.5).least == 0.5
    assert not Raster(0.2).has_up_to(0.1)
