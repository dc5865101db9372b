"""Blocks of many samples: the model's mean over them is not its value in the middle. No noise is drawn."""

import numpy as np
import pytest

from impactcell.features import extract
from impactcell.physics import Plant
from impactcell.prediction import Model, Prior
from impactcell.prediction.block_residuals import add_bends
from impactcell.prediction.waveform import fit
from impactcell.records import as_recorded
from tests.taps import VISCOUS, Tap

MODEL = Model("reference", Plant(6.5e5, 465.0, 0.2, 0.152, effects=VISCOUS), Prior(6500.0, 9.3, 0.0228))


@pytest.mark.parametrize("velocity_m_s", [0.035, 0.05, 0.1])
@pytest.mark.parametrize(
    ("rate_hz", "position_std_m"), [(1e6, 1.5e-6), (1e6, 3e-7), (2e5, 3e-7), (5e5, 5e-6)]
)
def test_a_fast_recorder_bends_no_estimate(
    velocity_m_s: float, rate_hz: float, position_std_m: float
) -> None:
    """At 1 MHz mu_s came out by its standard deviation too low, in every tap alike."""
    tap = Tap(velocity_m_s, stroke_m=1.5e-3)
    found = fit(extract(as_recorded(tap.capture(None, rate_hz, rate_hz, 0.4, position_std_m))), MODEL)
    assert found.mu_s == pytest.approx(tap.mu_s, abs=0.05 * found.mu_s_std)
    assert found.mu_k == pytest.approx(tap.mu_k, abs=0.05 * found.mu_k_std)


def test_a_fast_recorder_of_which_all_is_known_bends_no_estimate() -> None:
    """Of position and force alike: with position alone in order mu_s and mu_k were 0.3 of theirs too low."""
    tap = Tap(0.05, stroke_m=1.5e-3)
    found = fit(extract(tap.capture(None, 1e6, 1e6)), MODEL)
    assert found.mu_s == pytest.approx(tap.mu_s, abs=0.05 * found.mu_s_std)
    assert found.mu_k == pytest.approx(tap.mu_k, abs=0.05 * found.mu_k_std)


def test_means_over_blocks_are_those_of_their_samples() -> None:
    """Each of a cubic's means, and of a second curve beside it, by numpy."""
    samples = np.linspace(0.0, 1.0, 1201)[:-1] - 0.7
    blocks = np.split(samples, [40, 80, 90, 100, 110, 150, 200, 260, 300, 360, 700, 710])
    times, spread = np.array([[block.mean(), block.var()] for block in blocks]).T
    curves = [lambda t: 5.0 + t + (t - 3.0) ** 3, lambda t: 5.0 + 2.0 * t + (t - 3.0) ** 3]
    made = np.concatenate([curve(times) for curve in curves])
    add_bends(made, times, spread)
    for curve, means in zip(curves, made.reshape(2, -1), strict=True):
        meant = np.array([curve(block).mean() for block in blocks])
        inside = slice(2, -2)
        assert np.abs(means - meant)[inside].max() < 0.15 * np.abs(curve(times) - meant)[inside].max()


def test_nothing_is_added_beside_a_jump_nor_to_blocks_without_spread() -> None:
    times = np.arange(12.0)
    curve = np.where(times < 6.0, times**2, times**2 - 50.0)
    made = curve.copy()
    add_bends(made, times, np.ones(12))
    assert made - curve == pytest.approx(np.array([0, 0, 1, 1, 0, 0, 0, 1, 1, 1, 0, 0]), abs=1e-9)
    add_bends(curve, times, np.zeros(12))
    assert curve == pytest.approx(np.where(times < 6.0, times**2, times**2 - 50.0), abs=0.0)
