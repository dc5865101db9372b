"""Films that lost single frames: what noise is read off them, and how it counts at equal steps."""

import math
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import BaseModel, NumberPrior, investigate_machine
from impactcell.discrepancy.machine.records.smoothing import test_function as function_of_test
from impactcell.discrepancy.machine.records.uneven_steps import at_equal_steps
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord, uniform_records
from impactcell.features import white_noise_std
from impactcell.records import Capture, Channel

NOISE, STEP_S, SECONDS, GRAVITY = 8e-3, 1.0 / 30.0, 40.0, 19.62
"""rad, s, s, and m g l over the inertia, 1/s²."""
BOB = BaseModel(
    Coordinate.ROTATION, inertia=NumberPrior(1.0), gravity_torque=NumberPrior(GRAVITY, math.inf), terms=()
)


@lru_cache
def swing(release: float) -> np.ndarray:
    """Angles of a bob without friction, by another integrator than the workflow's."""
    time = STEP_S * np.arange(round(SECONDS / STEP_S))
    run = solve_ivp(
        lambda _, state: (state[1], -GRAVITY * math.sin(state[0])),
        (0.0, SECONDS), (release, 0.0), t_eval=time, rtol=1e-9, atol=1e-11,
    )  # fmt: skip
    return np.asarray(run.y[0])


def filmed(lost: float, seed: int, release: float = 0.9) -> Capture:
    """A film of it with white noise, without a share of its frames."""
    rng = np.random.default_rng(seed)
    angle = swing(release) + rng.normal(0.0, NOISE, swing(release).size)
    is_kept = rng.random(angle.size) >= lost
    is_kept[[0, -1]] = True
    time = STEP_S * np.flatnonzero(is_kept)
    return Capture(seed, math.nan, math.nan, None, Channel(time, angle[is_kept]))


def campaign(*shots: Capture) -> Campaign:
    return Campaign(Excitation.FREE_SLIDE, shots, coordinate=Coordinate.ROTATION)


def recorded(*shots: Capture) -> tuple[UniformRecord, ...]:
    return uniform_records(campaign(*shots), BOB)


@pytest.mark.parametrize("lost", [0.15, 0.4])
def test_lost_frames_are_no_noise(lost: float) -> None:
    """With 15 % of them lost 14 mrad were told for 8."""
    told = [record.sensor_noise[0] for record in recorded(*(filmed(lost, seed) for seed in range(1, 7)))]
    assert np.mean(told) == pytest.approx(NOISE, rel=0.1)
    assert max(told) < 1.2 * NOISE


def test_where_none_is_lost_all_is_as_it_was() -> None:
    shot = filmed(0.0, 1)
    assert shot.position is not None
    [record] = recorded(shot)
    assert record.noise == (white_noise_std(shot.position.values), 0.0)
    assert record.sensor_noise == record.noise
    assert record.position_span == 1.0
    assert np.array_equal(
        record.position, np.interp(record.time_s, shot.position.time_s, shot.position.values)
    )


def test_samples_at_odd_times_show_their_noise() -> None:
    """No third difference is over equal steps, and a parabola moves none."""
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.uniform(0.5, 1.5, 4000))
    noise = rng.normal(0.0, 0.3, time.size)
    assert white_noise_std(noise, time) == pytest.approx(0.3, rel=0.05)
    parabola = 5.0 - 3.0 * time + 0.2 * time**2
    assert white_noise_std(parabola + noise, time) == pytest.approx(white_noise_std(noise, time), rel=1e-4)
    assert white_noise_std(parabola + noise) > 0.6


def test_what_lies_between_is_on_a_cubic() -> None:
    """A line misses a lost frame by 9 mrad."""
    angle = swing(0.9)
    time = STEP_S * np.arange(angle.size)
    is_kept = np.arange(angle.size) % 7 != 3
    laid_out = at_equal_steps(time[is_kept], angle[is_kept], time)
    assert np.abs(laid_out - angle).max() < 1e-3
    assert np.abs(np.interp(time, time[is_kept], angle[is_kept]) - angle).max() > 7e-3


def test_noise_of_rows_is_what_it_is_in_the_mean() -> None:
    """Of sums under a test function, by many films of a bob at rest."""
    weight, _ = function_of_test(12, STEP_S)
    sums, told = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        is_kept = rng.random(1000) >= 0.15
        is_kept[[0, -1]] = True
        time = STEP_S * np.flatnonzero(is_kept)
        noise = rng.normal(0.0, NOISE, time.size)
        [record] = recorded(Capture(1, math.nan, math.nan, None, Channel(time, noise, NOISE)))
        sums.append(np.convolve(record.position, weight, "valid"))
        told.append(record.noise_gain(weight) * record.noise[0] ** 2)
    assert np.sqrt(np.mean(told)) == pytest.approx(np.std(np.concatenate(sums)), rel=0.05)


@pytest.mark.slow
def test_a_model_that_misses_nothing_leaves_its_noise() -> None:
    """It left 0.67 to 0.81 of it."""
    shots = [filmed(0.15, seed, release) for seed, release in enumerate((0.5, 0.9, 1.2, 0.8), 1)]
    finding = investigate_machine(campaign(*shots), BOB)
    assert finding.verdict == "no_gap"
    assert finding.fall.after == pytest.approx(1.0, abs=0.2)
    assert finding.train_gaps[1] == pytest.approx(1.0, abs=0.15)
