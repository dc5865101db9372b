"""A raster is found however its values were scaled and written, and not where there is none."""

import numpy as np
import pytest

from impactcell.numerics.raster import raster_of

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
