"""Predictions that are off are noticed soon, and calibrated ones seldom doubted, however long one looks."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from impactcell.positioning.prediction_watch import (
    ALARM,
    CONFIDENT_AGAIN,
    DOUBT,
    FURTHEST,
    PredictionWatch,
    as_measured,
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


def after(scores: np.ndarray, state: PredictionWatch | None = None) -> PredictionWatch:
    """Watch after these scores."""
    watch = PredictionWatch() if state is None else state
    for score in scores:
        watch = place_bets(watch, float(score))
    return watch


@pytest.mark.parametrize("outlier", [-FURTHEST, -5.0, 5.0, FURTHEST])
@pytest.mark.parametrize("seed", range(4))
def test_a_single_tap_however_far_off_is_doubted_and_not_told(outlier: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    state = after(np.append(rng.standard_normal(30), outlier))
    assert state.doubted
    assert not state.alarming
    for _ in range(60):
        state = place_bets(state, rng.standard_normal())
        assert not state.alarming


def test_three_taps_in_a_row_that_are_far_off_are_told() -> None:
    assert not after(np.full(2, FURTHEST)).alarming
    assert after(np.full(3, FURTHEST)).alarming


def test_no_bet_that_is_told_wins_on_average() -> None:
    """An integral over a standard normal score: the expectation of e, bounded, is 1 at most."""
    scores = np.linspace(-12.0, 12.0, 4801)
    share = norm.pdf(scores) * (scores[1] - scores[0])
    won = np.array([np.exp(place_bets(PredictionWatch(), float(s)).told_log_sums) for s in scores])
    expected = share @ won
    assert (expected <= 1.0 + 1e-9).all()
    assert (expected > 0.6).all()


def test_since_when_and_by_how_much_predictions_are_off_is_told() -> None:
    rng = np.random.default_rng(6)
    state = after(rng.standard_normal(40))
    taps = 0
    while not state.alarming:
        state, taps = place_bets(state, -2.0 + 0.3 * rng.standard_normal()), taps + 1
    assert taps - 3 <= state.off_taps <= taps
    assert state.mean_score == pytest.approx(-2.0, abs=0.4)
    assert after(np.zeros(30), state).off_taps == 0


def test_a_band_as_a_sensor_shows_it_is_wider_by_what_the_sensor_scatters() -> None:
    z = np.linspace(-3.29, 3.29, 67)
    falling = 200e-6 - 3e-6 * z
    measured = as_measured(falling, z, 4.0e-6)
    rng = np.random.default_rng(2)
    moved = 200e-6 + math.hypot(3e-6, math.sqrt(4.0**2 - 0.5**2) * 1e-6) * rng.standard_normal(4000)
    scores = np.array([score_of(m, measured, z) for m in moved])
    assert scores.std() == pytest.approx(1.0, abs=0.04)
    assert as_measured(falling, z, 0.5e-6) is falling
    nothing = as_measured(np.zeros(67), z, 4.0e-6)  # a tap that moves nothing, for sure
    assert abs(score_of(4e-6, nothing, z)) < 1.2
    assert score_of(40e-6, nothing, z) > 5.0
