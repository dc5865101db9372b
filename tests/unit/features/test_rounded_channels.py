"""Channels on a coarse raster: their noise is known, and their peaks are not taken for cut off."""

import math

import numpy as np
import pytest

from impactcell.errors import ClippedForceError
from impactcell.features import white_noise_std
from impactcell.features.channels import check_force
from impactcell.features.contact import refuse_clipped
from impactcell.records import Channel, Samples

CONTACT_S = 0.018
TIME_S = np.arange(1, 1500) * 1e-4


def pulse(height: float) -> Samples:
    """Contact as half a sine that begins with a jump, and nothing after it."""
    inside = TIME_S < CONTACT_S
    return np.where(inside, height * np.sin(math.pi * TIME_S / CONTACT_S) + 25.0 * inside, 0.0)


@pytest.mark.parametrize("noise", [0.4, 0.6, 1.0, 3.0])
def test_noise_on_a_raster_is_that_of_sensor_and_rounding(noise: float) -> None:
    rng = np.random.default_rng(4)
    found = [white_noise_std(np.round(pulse(160.0) + rng.normal(0.0, noise, TIME_S.size))) for _ in range(20)]
    assert np.mean(found) == pytest.approx(math.hypot(noise, 1.0 / math.sqrt(12.0)), rel=0.08)


def test_noise_below_a_raster_is_what_rounding_makes() -> None:
    values = np.round(pulse(160.0) + np.random.default_rng(5).normal(0.0, 0.05, TIME_S.size))
    assert white_noise_std(values) == pytest.approx(1.0 / math.sqrt(12.0), rel=0.01)


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3])
def test_a_rounded_peak_is_not_clipped_wherever_it_lies_on_the_raster(noise: float) -> None:
    rng = np.random.default_rng(6)
    for height in np.linspace(60.0, 180.0, 101):
        values = np.round(pulse(height) + rng.normal(0.0, noise, TIME_S.size))
        refuse_clipped(check_force(Channel(TIME_S, values, 0.4)))


@pytest.mark.parametrize("raster", [1e-3, 0.1, 1.0])
def test_a_peak_that_was_cut_off_is_clipped_on_any_raster(raster: float) -> None:
    rng = np.random.default_rng(7)
    for height in np.linspace(100.0, 180.0, 9):
        values = np.round((pulse(height) + rng.normal(0.0, 0.3, TIME_S.size)) / raster) * raster
        cut = np.minimum(values, 90.0)
        with pytest.raises(ClippedForceError, match="in a row stand at 90 N"):
            refuse_clipped(check_force(Channel(TIME_S, cut, 0.4)))
