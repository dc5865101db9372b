"""Declared standard deviations that tell all, part or nothing of the spread; the spread is drawn here."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import logsumexp
from scipy.stats import norm

from impactcell.tracking.wear_batch import declared_std_calibration, noise_scale
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import FrictionObservation, TrackerState, initial_state
from impactcell.tracking.wear_batch.tracker import update

DECLARED = np.array([0.0018, 0.0023, 0.0056, 0.0061])  # as of a waveform fit at four velocities
SPREADS = {
    "all of it": DECLARED,
    "nothing": np.full(4, 0.0028),
    "a quarter, beside what all share": np.sqrt(0.002**2 + 0.25 * DECLARED**2),
}
CYCLES = 300


def followed(spread: np.ndarray, seed: int, knowledge: BatchKnowledge) -> tuple[TrackerState, int]:
    """State after a stream that neither wears nor changes, and the shifts found in it."""
    state, draw, shifts = initial_state(), np.random.default_rng(seed), 0
    for cycle in range(1, CYCLES + 1):
        value = 0.2 + spread[cycle % 4] * draw.standard_normal()
        reading = FrictionObservation(cycle, value, float(DECLARED[cycle % 4]), cycle * 10**9, "A")
        tracked = update(TrackerSettings(batch=knowledge), state, reading)
        state, shifts = tracked.state, shifts + (tracked.shift is not None)
    return state, shifts


@pytest.mark.slow
@pytest.mark.parametrize("knowledge", BatchKnowledge)
@pytest.mark.parametrize("spread", SPREADS.values(), ids=SPREADS)
def test_the_variance_is_that_of_the_estimates_and_no_shift_is_invented(spread, knowledge):
    ratios, shifts = [], 0
    for seed in range(8):
        state, found = followed(spread, seed, knowledge)
        shifts += found
        ratios.append([noise_scale.variance(state.noise, std) for std in DECLARED] / spread**2)
    # of 300 squared differences, whose mean scatters by 10 %, and of exponents a quarter apart
    assert np.mean(ratios, axis=0) == pytest.approx(1.0, rel=0.25)
    assert shifts == 0  # 10 (known) and 9 (unknown) of "nothing" where what is declared is believed


def test_velocities_that_change_late_change_the_belief_late():
    """For 600 cycles all declare the same, which says nothing; then it turns out to be no guide."""
    noise, draw = noise_scale.NoiseScale(), np.random.default_rng(2)
    for cycle in range(1200):
        std = float(DECLARED[cycle % 4]) if cycle >= 600 else float(DECLARED[2])
        noise, _ = noise_scale.update(
            noise, 0.2 + 0.0028 * draw.standard_normal(), std, late=False, other_batch=False
        )
        if cycle == 599:
            assert np.exp(
                noise.exponent_posterior[:, declared_std_calibration.LOG_PROBABILITY]
            ) == pytest.approx(declared_std_calibration.PRIOR)
    used = [noise_scale.variance(noise, std) for std in DECLARED]
    assert used == pytest.approx([0.0028**2] * 4, rel=0.3)


@given(
    differences=st.lists(st.floats(0.0, 1e12), max_size=20),
    ratios=st.lists(st.floats(1e-6, 1e6), min_size=20, max_size=20),
    std=st.floats(1e-9, 10.0),
)
def test_a_belief_stays_one_and_leaves_the_usual_estimate_alone(differences, ratios, std):
    belief = declared_std_calibration.prior_posterior()
    for place, (squared, ratio) in enumerate(zip(differences, ratios, strict=False)):
        belief = declared_std_calibration.update(belief, squared, ratio * std, std, std, place + 1.0)
    assert math.fsum(np.exp(belief[:, declared_std_calibration.LOG_PROBABILITY])) == pytest.approx(1.0)
    assert np.all(belief[:, declared_std_calibration.SCALE] > 0.0)
    assert declared_std_calibration.calibrated_std(belief, std, std) == std
    wide = [
        declared_std_calibration.calibrated_std(belief, factor * std, std)
        for factor in (0.5, 0.9, 1.1, 2.0, 5.0, 10.0)
    ]
    assert wide == sorted(wide)
    assert wide[-1] == pytest.approx(2.0 * wide[-2])  # far off: in proportion


def test_exponents_go_from_no_belief_to_all_of_it_in_equal_steps():
    """Each alone, sure: the usual standard deviation, the declared one, and geometric steps between them."""
    usual, declared = 0.002, 0.005
    calibrated = []
    for row in range(5):
        belief = declared_std_calibration.prior_posterior()
        belief[:, declared_std_calibration.LOG_PROBABILITY] = -np.inf
        belief[row, declared_std_calibration.LOG_PROBABILITY] = 0.0
        calibrated.append(declared_std_calibration.calibrated_std(belief, declared, usual))
    assert calibrated == pytest.approx(np.geomspace(usual, declared, 5))


def test_a_difference_changes_the_belief_by_bayes_rule():
    """The density of a difference: 98 % normal, 2 % with one of the two estimates ten times as wide."""
    rng, usual, belief = np.random.default_rng(3), 0.002, declared_std_calibration.prior_posterior()
    column = declared_std_calibration.LOG_PROBABILITY
    for place in range(30):
        std, last = usual * np.exp(rng.normal(size=2))
        difference = usual * rng.normal() * (25.0 if place % 7 == 3 else 1.4)
        # the difference of two usual estimates has twice the variance of one
        squared = difference**2 / (2.0 * usual**2)
        expected = []
        for exponent, before in zip(np.linspace(0.0, 1.0, 5), belief, strict=True):
            spread = math.sqrt(
                0.5
                * ((std / usual) ** (2.0 * exponent) + (last / usual) ** (2.0 * exponent))
                * before[declared_std_calibration.SCALE]
            )
            density = 0.98 * norm.pdf(math.sqrt(squared), scale=spread) + 0.02 * norm.pdf(
                math.sqrt(squared), scale=spread * math.sqrt((10.0**2 + 1.0) / 2.0)
            )
            # successive differences share an estimate: two thirds of what one says is new
            expected.append(before[column] + 2.0 / 3.0 * math.log(density))
        belief = declared_std_calibration.update(belief, squared, std, last, usual, place + 1.0)
        floored = np.maximum(np.array(expected) - max(expected), -10.0)
        assert belief[:, column] == pytest.approx(floored - logsumexp(floored))
