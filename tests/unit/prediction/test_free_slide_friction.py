"""mu_k of free slides against their motion in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.errors import CaptureError
from impactcell.physics import Plant
from impactcell.prediction.free_slide_friction import fit_free_slide, free_slide_friction, is_missed
from impactcell.records import Capture, Channel, Quality, as_recorded

GRAVITY = 9.81
PLANT = Plant(6.5e5, 465.0, 0.2, 0.15)
VISCOUS = {"viscous_friction": {"viscous_coefficient_n_s_per_m": 6.0}}


def slide(
    speed: float,
    mu_k: float,
    noise: float,
    rng: np.random.Generator,
    viscous_per_s: float = 0.0,
    sign: int = 1,
) -> Capture:  # fmt: skip
    """v' = -mu_k g - c v: x = (v_0 + mu_k g / c) (1 - e^-ct) / c - mu_k g t / c until v = 0, then rest."""
    braking, c = GRAVITY * mu_k, max(viscous_per_s, 1e-6)
    stop = math.log1p(c * speed / braking) / c
    times = np.arange(0.0, stop + 0.05, 1e-3)
    moving = np.minimum(times, stop)
    moved = (speed + braking / c) / c * -np.expm1(-c * moving) - braking / c * moving
    position = Channel(times, sign * moved + rng.normal(0.0, noise, times.size), noise)
    return Capture(1, math.nan, 2.0, None, position)


def test_mu_k_of_slides_in_either_direction_from_anywhere() -> None:
    rng = np.random.default_rng(10)
    times = np.arange(60) / 148.0
    for sign in (1.0, -1.0):
        for speed in (0.2, 0.5):
            stop = speed / 2.1
            x = np.where(times < stop, speed * times - 1.05 * times**2, speed**2 / 4.2)
            position = Channel(times, sign * x + rng.normal(0.0, 1e-4, 60), 1e-4)
            found = fit_free_slide(Capture(1, math.nan, 1.0, None, position), GRAVITY)
            assert abs(found.mu_k - 2.1 / GRAVITY) < 4.0 * found.mu_k_std
            elsewhere = replace(position, values=position.values - 3.0 * sign * position.values[-1])
            moved = fit_free_slide(Capture(1, math.nan, 1.0, None, elsewhere), GRAVITY)
            assert moved.mu_k == pytest.approx(found.mu_k, rel=1e-6)
    still = Channel(times, rng.normal(0, 1e-4, 60), 1e-4)
    with pytest.raises(CaptureError, match="did not slide"):
        fit_free_slide(Capture(1, math.nan, 1.0, None, still), GRAVITY)


def test_mu_k_follows_the_scale_of_the_position_and_its_std_says_so() -> None:
    """x = s (v t - mu_k g t² / 2) is the slide of s mu_k: of a scale known to 0.3 % so is mu_k."""
    exact = slide(1.0, 0.2, 2e-5, np.random.default_rng(1))
    noise_alone = fit_free_slide(exact, GRAVITY)
    assert noise_alone.mu_k_std < 1e-4 * noise_alone.mu_k
    for capture, scale_std in ((as_recorded(exact), 0.003), (replace(exact, position_scale_std=0.01), 0.01)):
        found = fit_free_slide(capture, GRAVITY)
        assert found.mu_k_std == pytest.approx(
            math.hypot(noise_alone.mu_k_std, scale_std * found.mu_k), rel=1e-9
        )
        assert free_slide_friction(found).common_std == pytest.approx(scale_std * found.mu_k, rel=1e-12)
    assert exact.position is not None
    larger = replace(exact, position=replace(exact.position, values=1.003 * exact.position.values))
    assert fit_free_slide(larger, GRAVITY).mu_k == pytest.approx(1.003 * noise_alone.mu_k, rel=1e-6)


def test_of_slides_under_constant_friction_none_is_missed_and_their_std_is_right() -> None:
    rng = np.random.default_rng(2)
    fits, pulls = [], []
    for _ in range(100):
        mu_k = 0.2 * (1.0 + 0.02 * rng.normal())
        fits.append(fit_free_slide(slide(rng.uniform(0.5, 1.5), mu_k, 1e-4, rng), GRAVITY))
        pulls.append((fits[-1].mu_k - mu_k) / fits[-1].mu_k_std)
    assert 0.8 < np.sqrt(np.mean(np.square(pulls))) < 1.1
    assert np.mean([one.gap for one in fits]) == pytest.approx(1.0, abs=0.02)
    assert sum(one.chi2 for one in fits) / sum(one.freedom for one in fits) == pytest.approx(1.0, abs=0.2)
    assert not is_missed(fits)
    assert sum(is_missed([one]) for one in fits) <= 1
    assert free_slide_friction(fits[0]).quality is Quality.GOOD


@pytest.mark.parametrize("viscous_per_s", [0.05, 0.5, 3.0])
def test_a_slide_under_another_law_is_missed_and_less_sure(viscous_per_s: float) -> None:
    fit = fit_free_slide(
        slide(1.2, 0.2, 2e-5, np.random.default_rng(3), viscous_per_s=viscous_per_s), GRAVITY
    )
    assert is_missed([fit])
    assert abs(fit.mu_k - 0.2) > 10.0 * fit.mu_k_std
    found = free_slide_friction(fit, "missed", missed=True)
    assert (found.quality, found.reason) == (Quality.UNCERTAIN, "missed")
    assert abs(found.value - 0.2) < 2.0 * found.std


def test_what_no_slide_shows_by_itself_all_of_them_do() -> None:
    rng = np.random.default_rng(4)
    fits = [fit_free_slide(slide(1.0, 0.2, 1e-4, rng, viscous_per_s=0.01), GRAVITY) for _ in range(40)]
    assert sum(is_missed([one]) for one in fits) <= 2
    assert is_missed(fits)


@pytest.mark.parametrize("sign", [1, -1])
def test_what_a_models_effects_do_is_no_friction(sign: int) -> None:
    capture = slide(1.2, 0.2, 2e-5, np.random.default_rng(5), viscous_per_s=3.0, sign=sign)
    found = fit_free_slide(capture, GRAVITY, replace(PLANT, effects=VISCOUS))
    assert not is_missed([found])
    assert abs(found.mu_k - 0.2) < 4.0 * found.mu_k_std
    assert found.mu_k_std < 2e-4
    without = fit_free_slide(capture, GRAVITY, PLANT)
    assert without == fit_free_slide(capture, GRAVITY)
    tilt = replace(PLANT, effects={"surface_tilt": {"tilt_rad": 0.03}})
    tilted = fit_free_slide(slide(1.2, 0.2, 2e-5, np.random.default_rng(6), sign=sign), GRAVITY, tilt)
    # Uphill along +1 gravity brakes as well, and less is left to friction.
    assert tilted.mu_k == pytest.approx(0.2 - sign * math.sin(0.03), abs=1e-4)
    light = replace(capture, mass_kg=0.1)
    with pytest.raises(CaptureError, match="check its mass"):
        fit_free_slide(light, GRAVITY, replace(PLANT, effects=VISCOUS))
