"""What a notebook states of a tap by mistake is refused by name, with the way out."""

import math
import re

import numpy as np
import pytest

import impactcell
from impactcell.errors import CampaignError, CaptureError, PhysicsError, SettingsError

PLANT = {"stiffness_n_per_m": 6.5e5, "damping_n_s_per_m": 465.0, "mu_s": 0.21, "mu_k": 0.16}


def noisy_tap() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(11)
    tap = impactcell.simulate_tap(0.033, 18.9, plant=PLANT)
    force = tap.force_n + rng.normal(0.0, 0.4, tap.force_n.size)
    return tap.time_s, force, tap.position_m + rng.normal(0.0, 1.5e-6, force.size)


@pytest.mark.parametrize(
    ("tap", "options", "message"),
    [
        (("0.04", 18.9), {}, "velocity_m_s is to be one number, not '0.04'"),
        ((None, 18.9), {}, "velocity_m_s is to be one number, not None"),
        ((np.array([0.04, 0.05]), 18.9), {}, "velocity_m_s is to be one number, not array([0.04, 0.05])"),
        ((0.04, None), {}, "mass_kg is to be one number, not None"),
        ((0.04 + 0j, 18.9), {}, "velocity_m_s is to be one number"),
        ((0.04, 18.9, "x"), {}, "stroke_m is to be one number, not 'x'"),
        ((0.04, 18.9, None), {}, "stroke_m is to be one number, not None"),
        ((0.04, 18.9), {"plant": "x"}, "plant is a Plant, or some of its fields by name, not 'x'"),
        ((0.04, 18.9), {"plant": [1]}, "plant is a Plant, or some of its fields by name, not [1]"),
        ((0.04, 18.9), {"plant": {"mu_s": "0.2"}}, "plant: mu_s is to be one number, not '0.2'"),
        ((0.04, 18.9), {"plant": {"mu_s": None}}, "plant: mu_s is to be one number, not None"),
        ((0.04, 18.9), {"plant": {"mu_k": None}}, "plant: mu_k is to be one number, not None"),
        ((0.04, 18.9), {"plant": {"mu_s": [0.2]}}, "plant: mu_s is to be one number, not [0.2]"),
        ((0.04, 18.9), {"plant": {3: 0.2}}, "plant: no field 3"),
        ((0.04, 18.9), {"plant": {"effects": None}}, "plant: effects is to be a mapping"),
        ((0.04, 18.9), {"time_s": "x"}, "time_s is to hold numbers"),
        ((0.04, 18.9), {"time_s": [0.0, math.nan, 0.01]}, "time_s[1] = nan: give a time in s"),
        ((0.04, 18.9), {"time_s": [0.0, 0.01, math.inf]}, "time_s[2] = inf: give a time in s"),
        (
            (0.04, 18.9),
            {"time_s": np.ma.masked_greater([0.0, 0.01, 9.0], 1.0)},
            "time_s[2] = nan: give a time in s",
        ),
        ((0.04, 18.9), {"time_s": [[0.0, 0.01]]}, "time_s is to be of one dimension, not of shape (1, 2)"),
        ((40.0, 18.9), {}, "no actuator taps faster than 10 m/s; if that was meant in mm/s, give 0.04"),
        ((3000.0, 18.9), {}, "if that was meant in mm/min, give 0.05"),
    ],
)  # fmt: skip
def test_a_tap_that_cannot_be_simulated_is_refused_by_name(
    tap: tuple[object, ...], options: dict[str, object], message: str
) -> None:
    with pytest.raises(PhysicsError, match=re.escape(message)):
        impactcell.simulate_tap(*tap, **options)  # type: ignore[arg-type]


def test_stick_and_slip_without_end_gives_no_traces() -> None:
    with pytest.raises(PhysicsError, match=r"pushed it without end\. Command a stroke"):
        impactcell.simulate_tap(0.01, 100.0)


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        (("0.033", 18.9), "velocity_m_s is to be one number, not '0.033'"),
        ((None, 18.9), "velocity_m_s is to be one number, not None"),
        ((np.array([0.033]), 18.9), "velocity_m_s is to be one number, not array([0.033])"),
        ((0.033, None), "mass_kg is to be one number, not None"),
        ((0.033, 18.9, "1"), "stroke_m is to be one number, not '1'"),
        ((0.033, 18.9, 0.0), "stroke_m = 0: give the actuator's travel from first contact in m, above 0"),
        ((0.033, 18.9, -1.0), "stroke_m = -1: give the actuator's travel from first contact in m"),
        ((0.033, 18.9, math.nan), "stroke_m = nan: give the actuator's travel"),
    ],
)
def test_what_is_stated_of_an_estimated_tap_is_refused_by_name(
    stated: tuple[object, ...], message: str
) -> None:
    with pytest.raises(CaptureError, match=re.escape(message)):
        impactcell.estimate(*noisy_tap(), *stated)  # type: ignore[arg-type]


def test_samples_that_are_no_numbers_are_refused_by_name() -> None:
    time_s, _, position = noisy_tap()
    with pytest.raises(CaptureError, match="force_n is to hold numbers"):
        impactcell.estimate(time_s, ["much"] * len(time_s), position, 0.033, 18.9)


def test_what_is_no_path_is_refused_by_name() -> None:
    with pytest.raises(SettingsError, match=r"^model is to be a path, not 5$"):
        impactcell.estimate(*noisy_tap(), 0.033, 18.9, model=5)  # type: ignore[arg-type]
    with pytest.raises(CampaignError, match=r"^campaign is to be a path, not None$"):
        impactcell.discrepancy(None)


@pytest.mark.parametrize("hidden", [1e20, -999.0, 0.0, 500.0])
def test_what_a_mask_hides_is_a_lost_sample(hidden: float) -> None:
    time_s, force, position = noisy_tap()
    lost = np.zeros(len(force), bool)
    lost[40:60] = True
    as_nan = impactcell.estimate(time_s, np.where(lost, math.nan, force), position, 0.033, 18.9)
    masked = np.ma.masked_array(np.where(lost, hidden, force), mask=lost)
    of_masked = impactcell.estimate(time_s, masked, position, 0.033, 18.9)
    assert of_masked.mu_k == as_nan.mu_k
    assert of_masked.mu_s == as_nan.mu_s
    assert "20 lost samples of the force" in of_masked.mu_k.reason


def test_an_infinite_position_is_a_lost_sample() -> None:
    time_s, force, position = noisy_tap()
    estimates = []
    for lost in (math.nan, math.inf, -math.inf):
        position[300] = lost
        estimates.append(impactcell.estimate(time_s, force, position, 0.033, 18.9))
    assert estimates[1].mu_k == estimates[2].mu_k == estimates[0].mu_k


def test_times_that_fall_are_told_with_their_sample() -> None:
    """They were told as a contact that begins late, with a time to subtract."""
    time_s, force, position = noisy_tap()
    with pytest.raises(
        CaptureError, match=r"time_s falls from .* to 0 s: turn all three arrays, as time_s\["
    ):
        impactcell.estimate(time_s[::-1], force[::-1], position[::-1], 0.033, 18.9)
    anew = np.where(np.arange(len(time_s)) < 200, time_s, time_s - time_s[200])
    with pytest.raises(
        CaptureError, match=r"time_s\[200\] = 0 s lies before time_s\[199\] = 0\.0199 s: order"
    ):
        impactcell.estimate(anew, force, position, 0.033, 18.9)
    order = np.random.default_rng(2).permutation(len(time_s))
    with pytest.raises(CaptureError, match=r"order all three arrays by np\.argsort"):
        impactcell.estimate(time_s[order], force[order], position[order], 0.033, 18.9)
