"""Where a sensor stands at rest: draws of a known level, on a raster, and of a part that was put back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.numerics.rest_level import rest_level


@pytest.mark.parametrize("count", [5, 30, 400])
@pytest.mark.parametrize("raster", [0.0, 1.0, 3.0, 20.0, 100.0])
def test_a_level_is_within_what_it_says_of_itself(raster: float, count: int) -> None:
    """Noise of 1; the true level lies anywhere between two steps of the raster."""
    draw = np.random.default_rng(7)
    pulls, stds = [], []
    for _ in range(400):
        level = float(draw.uniform(-50.0, 50.0))
        values = level + draw.standard_normal(count)
        noise = float(np.hypot(1.0, raster / np.sqrt(12.0)))
        found, std = rest_level(np.round(values / raster) * raster if raster else values, noise, raster)
        pulls.append((found - level) / std)
        stds.append(std)
    assert float(np.mean(np.abs(pulls) < 2.0)) > 0.92
    assert float(np.abs(pulls).max()) < 4.5
    if raster <= 1.0:
        assert float(np.median(stds)) < 1.3 * np.hypot(1.0, raster) / np.sqrt(count)


def test_only_the_last_rest_counts_where_a_part_was_put_back() -> None:
    draw = np.random.default_rng(2)
    values = np.concatenate([np.full(100, 40.0), np.linspace(40.0, 0.0, 30), np.zeros(120)])
    found, std = rest_level(values + draw.standard_normal(250), 1.0)
    assert found == pytest.approx(0.0, abs=4.0 * std)
    assert std < 0.2


def test_a_spike_before_contact_is_no_rest() -> None:
    values = np.random.default_rng(3).standard_normal(200)
    values[[20, 150]] = 900.0, -400.0
    found, std = rest_level(values, 1.0)
    assert found == pytest.approx(0.0, abs=4.0 * std)


@given(
    values=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60),
    noise=st.floats(0.0, 10.0),
    raster=st.floats(0.0, 10.0),
)
def test_any_samples_have_a_level_among_them(values: list[float], noise: float, raster: float) -> None:
    found, std = rest_level(np.array(values), noise, raster)
    assert min(values) - 1e-9 <= found <= max(values) + 1e-9
    assert np.isfinite(std)
    assert std >= 0.0
