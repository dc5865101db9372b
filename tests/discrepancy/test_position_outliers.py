"""Outliers of a position that are far from its noise and small against its range."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.discrepancy.machine.records.channel_values import (
    cleaned_position,
    without_outliers,
    without_spikes,
)
from impactcell.records import Samples

STEP_S, NOISE = 2e-3, 2e-5


def swing(seed: int, count: int = 2000, noise: float = NOISE) -> Samples:
    """A swing of 1.2 rad that dies away, as it is read."""
    time = STEP_S * np.arange(count)
    wave: Samples = 1.2 * np.exp(-0.1 * time) * np.cos(5.5 * time)
    return wave + np.random.default_rng(seed).normal(0.0, noise, count)


def dying_motion(seed: int) -> tuple[Samples, float]:
    """A motion at its fastest where the record begins, or ends, and at rest for most of it; and its noise."""
    rng = np.random.default_rng(seed)
    place, fades = np.arange(rng.integers(200, 1500)), rng.uniform(12.0, 80.0)
    noise = 10.0 ** rng.uniform(-5.0, -3.0)
    swings = np.exp(-place / fades) * np.cos(
        2.0 * np.pi * place / rng.uniform(24.0, 80.0) + 6.3 * rng.random()
    )
    coasts = np.maximum(1.0 - place / fades, 0.0) ** 2
    motion = [swings, coasts, np.exp(-place / fades)][seed % 3] + rng.normal(0.0, noise, len(place))
    return motion[:: rng.choice([-1, 1])].copy(), noise


@given(seed=st.integers(0, 100_000))
def test_a_motion_that_dies_away_loses_nothing(seed: int) -> None:
    """The rest sets what is usual, and where a record begins nothing is on the other side of a sample."""
    read, _ = dying_motion(seed)
    for values, replaced in (cleaned_position(read), without_spikes(read), without_outliers(read)):
        assert replaced == 0
        assert (values == read).all()


def test_a_cart_let_go_in_motion_keeps_its_first_samples() -> None:
    """0.79 kg on 250 N/m with 6 N s/m from -0.12 m at 3 m/s, 100 samples/s, for 1 to 8 s."""
    for length_s in (1.0, 2.0, 4.0, 8.0):
        time = np.arange(0.0, length_s, 0.01)
        decay, turning = 6.0 / (2.0 * 0.791), np.sqrt(250.0 / 0.791 - (6.0 / (2.0 * 0.791)) ** 2)
        wave = -0.12 * np.cos(turning * time) + (3.0 - 0.12 * decay) / turning * np.sin(turning * time)
        read = wave * np.exp(-decay * time) + np.random.default_rng(1).normal(0.0, 2e-4, time.size)
        values, replaced = cleaned_position(read)
        assert (replaced, values.tolist()) == (0, read.tolist())


@given(
    seed=st.integers(0, 100_000),
    where=st.sampled_from([0, 1, 2, 3, -1, -2, -3]) | st.integers(0, 199),
    size=st.floats(0.4, 2.0),
    sign=st.sampled_from([-1.0, 1.0]),
)
def test_a_spike_of_such_a_motion_is_found_and_no_other(
    seed: int, where: int, size: float, sign: float
) -> None:
    sound, noise = dying_motion(seed)
    read = sound.copy()
    read[where] += sign * size
    values, replaced = cleaned_position(read)
    assert replaced == 1
    assert np.flatnonzero(values != read).tolist() == [where % len(read)]
    assert abs(values[where] - sound[where]) < 0.1 + 30.0 * noise


@given(seed=st.integers(0, 100_000), where=st.sampled_from([0, 1, 2, -1, -2, -3]), size=st.floats(150, 3000))
def test_an_outlier_at_either_end_is_replaced_and_no_other(seed: int, where: int, size: float) -> None:
    """It alone, and not with the one beside whose roughness is seen."""
    sound = swing(seed, 1000)
    read = sound.copy()
    read[where] += size * NOISE
    values, replaced = without_outliers(read)
    assert replaced == 1
    assert np.flatnonzero(values != read).tolist() == [where % len(read)]
    assert abs(values - sound)[where] < 30.0 * NOISE


def test_a_force_that_rings_and_rests_loses_nothing() -> None:
    """Four samples in a period, each alone and far from the running median."""
    place = np.arange(3000)
    for phase in np.linspace(0.0, 3.0, 7):
        ringing = np.exp(-place / 60.0) * np.cos(0.5 * np.pi * place + phase)
        read = 100.0 * ringing + np.random.default_rng(7).normal(0.0, 0.1, place.size)
        assert without_spikes(read)[1] == 0


@given(
    seed=st.integers(0, 100_000),
    places=st.sets(st.integers(5, 1990), min_size=1, max_size=8),
    size=st.floats(30.0, 5000.0),
    sign=st.sampled_from([-1.0, 1.0]),
)
def test_outliers_are_replaced_and_nothing_else(
    seed: int, places: set[int], size: float, sign: float
) -> None:
    """Any that no third is near; what is put in their places is as near as the noise allows."""
    faulty = np.array(sorted(places))
    apart = np.diff(faulty)
    sound = swing(seed)
    read = sound.copy()
    read[faulty] += sign * size * NOISE
    values, replaced = without_outliers(read)
    if (apart > 14).all():
        assert replaced == len(faulty)
        assert np.abs(values - sound)[faulty].max() < 12.0 * NOISE
    others = np.setdiff1d(np.arange(len(read)), np.concatenate([faulty + shift for shift in range(-3, 4)]))
    assert (values[others] == read[others]).all()


@pytest.mark.parametrize("apart", [1, 2, 3])
def test_two_near_each_other_are_replaced(apart: int) -> None:
    sound = swing(3)
    read = sound.copy()
    read[[700, 700 + apart]] += 200.0 * NOISE
    values, replaced = without_outliers(read)
    assert replaced == 2
    assert np.abs(values - sound).max() < 12.0 * NOISE


def test_the_running_median_does_not_see_them() -> None:
    """4 mrad of 2.4 rad: what is found here is not found there."""
    read = swing(4)
    read[900] += 200.0 * NOISE
    assert without_spikes(read)[1] == 0
    assert without_outliers(read)[1] == 1


def test_a_kink_is_motion() -> None:
    """A part that is struck, and one that is stopped within a sample."""
    time = STEP_S * np.arange(1000)
    struck = np.maximum(time - 0.777, 0.0) * 2.0 + np.random.default_rng(1).normal(0.0, NOISE, 1000)
    stopped = np.minimum(time, 1.3333) * 0.5 + np.random.default_rng(2).normal(0.0, NOISE, 1000)
    for read in (struck, stopped):
        values, replaced = without_outliers(read)
        assert replaced == 0
        assert (values == read).all()


def test_a_coarse_encoder_and_one_at_rest_lose_nothing() -> None:
    time = STEP_S * np.arange(4000)
    coarse = np.round(0.05 * np.sin(3.0 * time) / 1e-3) * 1e-3
    step = np.where(time < 4.0, 0.0, 1e-3)
    for read in (coarse, step, np.zeros(4000), np.zeros(5), np.ones(40)):
        values, replaced = without_outliers(read)
        assert replaced == 0
        assert (values == read).all()


def test_what_is_rough_all_over_is_left_as_it_is() -> None:
    rng = np.random.default_rng(5)
    read = np.where(rng.random(2000) < 0.2, 1.0, 0.0) * rng.normal(size=2000) + rng.normal(0.0, 1e-3, 2000)
    values, replaced = without_outliers(read)
    assert replaced == 0
    assert (values == read).all()
