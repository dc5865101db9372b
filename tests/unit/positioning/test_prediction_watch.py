"""Predictions that are off are noticed soon, and calibrated ones seldom doubted, however long one looks."""

import numpy as np
import pytest
from scipy.stats import norm

from impactcell.positioning.prediction_watch import (
    ALARM,
    CONFIDENT_AGAIN,
    DOUBT,
    PredictionWatch,
    place_bets,
    score_of,
)


def taps_until(alarm: str, shift: float, spread: float, seed: int, most: int = 4000) -> int:
    """Taps until predictions are doubted or alarm; `most` where they never do."""
    rng, state = np.random.default_rng(seed), PredictionWatch()
    for tap in range(1, most + 1):
        state = place_bets(state, shift + spread * rng.standard_normal())
        if getattr(state, alarm):
            return tap
    return most


@pytest.mark.slow
def test_calibrated_predictions_are_seldom_doubted() -> None:
    delays = [taps_until("doubted", 0.0, 1.0, seed) for seed in range(40)]
    assert np.mean(delays) > DOUBT
    assert all(taps_until("alarming", 0.0, 1.0, seed) == 4000 for seed in range(8))


@pytest.mark.parametrize(("shift", "spread", "most"), [(2.0, 1.0, 8), (0.0, 3.0, 8), (-1.0, 1.5, 14)])
def test_what_is_off_is_noticed(shift: float, spread: float, most: int) -> None:
    assert np.median([taps_until("doubted", shift, spread, seed) for seed in range(40)]) <= most
    assert np.median([taps_until("alarming", shift, spread, seed) for seed in range(40)]) <= 4 * most


def test_doubt_ends_when_predictions_are_calibrated_again() -> None:
    state = PredictionWatch()
    for _ in range(10):
        state = place_bets(state, 3.0)
    assert state.doubted
    assert state.evidence > ALARM
    rng = np.random.default_rng(1)
    for _ in range(300):
        state = place_bets(state, rng.standard_normal())
    assert not state.doubted
    assert state.evidence < CONFIDENT_AGAIN * 10


def test_scores_are_standard_normal_where_the_forecast_is_right() -> None:
    z = np.linspace(-3.29, 3.29, 67)
    falling = 5e-3 * np.exp(-0.1 * z)  # less friction, further
    moved = 5e-3 * np.exp(-0.1 * np.random.default_rng(2).standard_normal(4000))
    scores = np.array([score_of(m, falling, z) for m in moved])
    assert abs(scores.mean()) < 0.05
    assert scores.std() == pytest.approx(1.0, abs=0.04)
    assert (np.abs(scores) > norm.isf(0.025)).mean() == pytest.approx(0.05, abs=0.012)
    assert score_of(20e-3, falling, z) > 5.0
    assert score_of(1e-4, falling, z) < -3.0
