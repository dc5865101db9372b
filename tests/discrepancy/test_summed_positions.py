"""A motor that records its speed: noise of a position that is summed up from it adds up."""

import math
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import BaseModel, NumberPrior, TermChoice, investigate_machine
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.report.german_notes import note as german_note
from impactcell.discrepancy.report.machine_result import machine_document
from impactcell.discrepancy.report.machine_sentences import noise_keys
from impactcell.records import Capture, Channel
from tests.discrepancy.machine_study import establish_in

pytestmark = pytest.mark.slow

INERTIA, VISCOUS, STEP_S, NOISE = 1.2e-4, 2e-4, 5e-3, 0.05
"""kg m², N m s/rad, s and rad/s."""
MOTOR = BaseModel(
    coordinate=Coordinate.ROTATION,
    inertia=NumberPrior(INERTIA, math.inf),
    terms=(TermChoice("viscous_friction"),),
    force_offset=NumberPrior(0.0, 1e-3),
)


def speeds(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Torque of random levels and speed at each sample, by the exponentials that they lead to."""
    torque = np.repeat(np.random.default_rng(seed).uniform(-0.012, 0.012, 40), 100)
    decay = math.exp(-VISCOUS * STEP_S / INERTIA)
    speed = np.zeros(torque.size)
    for place in range(1, torque.size):
        final = torque[place - 1] / VISCOUS
        speed[place] = final + (speed[place - 1] - final) * decay
    return torque, speed


@lru_cache
def motor(raster: float = 0.0, stated: float | None = None, *, summed_up: bool = True) -> Campaign:
    """Four records of 20 s: the speed with white noise, or rounded to a raster, and summed up."""
    shots = []
    for seed in range(1, 5):
        torque, speed = speeds(seed)
        noise = np.random.default_rng(100 + seed).normal(0.0, NOISE, speed.size)
        read = raster * np.round(speed / raster) if raster else speed + noise
        time = STEP_S * np.arange(speed.size)
        position = cumulative_trapezoid(read, time, initial=0)
        channel = Channel(time, position, None, summed_up=summed_up, speed_noise_std=stated)
        shots.append(Capture(seed, math.nan, math.nan, Channel(time, torque), channel))
    return Campaign(Excitation.DRIVEN, tuple(shots), coordinate=Coordinate.ROTATION)


@pytest.mark.slow
@pytest.mark.parametrize("raster", [0.0, 0.1])
def test_a_model_that_misses_nothing_leaves_no_gap(raster: float) -> None:
    finding = investigate_machine(motor(raster), MOTOR)
    assert finding.verdict == "no_gap"
    assert 0.5 < finding.fall.after < 1.3
    told = machine_document(finding)
    truth = NOISE if not raster else raster / math.sqrt(12.0)
    assert told["noise_floor"]["noise_std"][1] == pytest.approx(truth, rel=0.5)
    low, high = told["nominal"]["viscous_friction.viscous_coefficient_n_m_s_per_rad"]["ci95"]
    assert low < VISCOUS < high
    [said] = [note for note in told["notes"] if "summed up from a speed in 4 of 4 records" in note]
    assert "state noise_std_rad_per_s in campaign.yaml" in said
    assert german_note(said)[0] == "de"
    assert "noise_std_rad_per_s in campaign.yaml angeben" in german_note(said)[1]
    assert noise_keys(finding) == ["noise_std_n_m", "noise_std_rad_per_s"]


@pytest.mark.slow
def test_a_position_that_is_not_said_to_be_summed_up_has_a_false_gap() -> None:
    """What the mark is for: noise that adds up is a motion otherwise."""
    assert establish_in(motor(summed_up=False), MOTOR).fall.after > 10.0


def test_a_stated_noise_of_the_speed_counts_and_nothing_is_said() -> None:
    finding = investigate_machine(motor(stated=NOISE), MOTOR)
    assert finding.fall.after == pytest.approx(1.0, abs=0.2)
    assert finding.records[0].noise[0] == NOISE
    assert not any("summed up" in note for note in finding.notes)


def test_noise_of_sums_is_that_of_many_draws() -> None:
    [record] = uniform_records(Campaign(Excitation.DRIVEN, motor(stated=1.0).shots[:1]), MOTOR)
    rng = np.random.default_rng(3)
    draws = cumulative_trapezoid(rng.standard_normal((20000, 9)), dx=STEP_S, initial=0)
    weight = np.array([1.0, 0.0, -3.0, 1.0, 2.0, 0.0, -1.0, 1.0, -1.0])
    assert record.noise_gain(weight) == pytest.approx(np.var(draws @ weight), rel=0.05)
    lever = np.arange(-4.0, 5.0)
    second, fourth, sixth = ((lever**power).sum() for power in (2, 4, 6))
    slope = (sixth * lever - fourth * lever**3) / (second * sixth - fourth**2) / STEP_S
    assert record.speed_noise(4) == pytest.approx(np.std(draws @ slope), rel=0.05)
    assert record.position_noise == pytest.approx(STEP_S * math.sqrt(4000))
