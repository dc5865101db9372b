"""Equations (4) to (6) where mass, velocity and scales are told a little wrong. Truth: the simulator."""

import math

import numpy as np
import pytest

from impactcell.features import MeasuredFeature
from impactcell.physics import Plant, TapInput
from impactcell.prediction import Model, Prior, calibrate, estimate, printed_predictor
from impactcell.prediction.equations import by_distance, by_force, combined
from impactcell.prediction.linearised_model import EXACT, RecorderStd
from impactcell.prediction.mass_interpolation import interpolate_mass
from impactcell.records import (
    FORCE_SCALE_STD,
    MASS_STD,
    POSITION_SCALE_STD,
    VELOCITY_STD,
    Coefficient,
    as_recorded,
)
from tests.taps import VISCOUS, Tap

PLANT = Plant(6.5e5, 465.0, 0.2, 0.152, effects=VISCOUS)
PRINTED = Model("printed", PLANT, Prior(6500.0, 9.3, 0.0228), (printed_predictor(),))
FRICTIONS = np.linspace(0.15, 0.25, 9)


@pytest.mark.parametrize("velocity_m_s", [0.055, 0.08, 0.1])
def test_what_was_told_moves_the_equations_as_its_standard_deviation_says(velocity_m_s: float) -> None:
    """One error at a time, made in what the equations are given, against what it adds to their variance."""
    wrong_by = {"velocity": 0.005, "force": 0.01, "position": 0.003}

    def found(wrong: str, sense: float, told_std: RecorderStd) -> list[Coefficient]:
        off = 1.0 + sense * wrong_by[wrong]
        velocity = velocity_m_s * (off if wrong == "velocity" else 1.0)
        mixed = interpolate_mass(PRINTED, 18.9, velocity)
        true = interpolate_mass(PRINTED, 18.9, velocity_m_s)
        peak_n = true.peak_force(0.2, velocity_m_s) * (off if wrong == "force" else 1.0)
        slide_m = true.sliding_distance(0.2, velocity_m_s) * (off if wrong == "position" else 1.0)
        peak, slide = MeasuredFeature(peak_n, 0.05), MeasuredFeature(slide_m, 1e-6)
        one = by_force(PRINTED, mixed, velocity, peak, told_std)
        two = by_distance(PRINTED, mixed, velocity, slide, told_std)
        return [one, two, combined(PRINTED, mixed, velocity, (one, peak), (two, slide), told_std)]

    for place, wrong in ((2, "velocity"), (3, "force"), (4, "position")):
        known = np.where(np.arange(5) == place, wrong_by[wrong], 0.0).tolist()
        told_std = (known[0], known[1], known[2], known[3], known[4])
        off = zip(*(found(wrong, sense, EXACT) for sense in (1.0, -1.0)), strict=True)
        shifts = [0.5 * (more.value - less.value) for more, less in off]
        for shift, exact, told in zip(
            shifts, found(wrong, 0.0, EXACT), found(wrong, 0.0, told_std), strict=True
        ):
            added = told.std**2 - exact.std**2
            assert told.value == exact.value
            assert math.sqrt(max(added, 0.0)) == pytest.approx(abs(shift), rel=0.02, abs=2e-5)
            assert told.common_std**2 - exact.common_std**2 == pytest.approx(added, abs=1e-12)


@pytest.mark.slow
def test_errors_of_what_was_told_are_covered() -> None:
    """Mass, velocity and scales off by what is told of them, all else exact."""
    tap = TapInput(0.1, 18.9, halts_at_separation=True)
    known = Prior(65.0, 0.093, 0.00023)
    model = Model("m", PLANT, known, calibrate(PLANT, tap, [18.9], np.linspace(0.05, 0.1, 9), FRICTIONS))
    told_std = 0.0, MASS_STD, VELOCITY_STD, FORCE_SCALE_STD, POSITION_SCALE_STD
    rng, pulls = np.random.default_rng(2), []
    for _ in range(80):
        mass, speed, force, place = np.exp(np.array(told_std[1:]) * rng.standard_normal(4))
        told_m_s = float(rng.uniform(0.055, 0.095))
        made = Tap(told_m_s / speed, float(rng.uniform(0.16, 0.24)), mass_kg=18.9 / mass)
        motion, mixed = made.motion(), interpolate_mass(model, 18.9, told_m_s)
        peak = MeasuredFeature(force * motion.peak_force_n, 0.05)
        slide = MeasuredFeature(place * motion.sliding_distance_m, 1e-6)
        one = by_force(model, mixed, told_m_s, peak, told_std)
        two = by_distance(model, mixed, told_m_s, slide, told_std)
        three = combined(model, mixed, told_m_s, (one, peak), (two, slide), told_std)
        pulls.append([(given.value - made.mu_s) / given.std for given in (one, two, three)])
    spread = np.sqrt(np.mean(np.square(pulls), axis=0))
    assert (spread > 0.75).all()
    assert (spread < 1.3).all()


def test_an_estimate_takes_into_account_what_its_capture_was_told() -> None:
    """1 % of the force is 8 % of mu_s by (4) at 4000 mm/min: it was told as if the force were exact."""
    seen = Tap(4000 / 6e4).capture(np.random.default_rng(1))
    exact, told = estimate(seen, PRINTED), estimate(as_recorded(seen), PRINTED)
    for of in ("by_force", "by_distance", "combined"):
        assert getattr(told, of).value == getattr(exact, of).value
        assert getattr(told, of).quality is getattr(exact, of).quality
        assert getattr(told, of).std > getattr(exact, of).std
    assert told.by_force.std > 0.08 * told.by_force.value
