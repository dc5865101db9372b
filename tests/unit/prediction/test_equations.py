"""Equations (4), (5), (6): the printed numbers, the reference plant, and their limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.errors import NegativeRootError, PredictionError
from impactcell.features import MeasuredFeature
from impactcell.physics import Plant, TapInput
from impactcell.prediction import PROVISIONAL, Model, Prior, calibrate, printed_predictor
from impactcell.prediction.calibration import Regime, fit_predictor, regimes, velocity_spans
from impactcell.prediction.equations import (
    beyond_calibration,
    by_distance,
    by_force,
    combined,
    force_weight,
    out_of_range,
)
from impactcell.prediction.estimate import estimate
from impactcell.prediction.mass_interpolation import interpolate_mass, sliding_distance
from impactcell.records import Capture, Quality, Summary
from impactcell.web.texts.reasons import german_reason
from tests.taps import VISCOUS, Tap

PLANT = Plant(6.5e5, 465.0, 0.2, 0.152, effects=VISCOUS)
PRIOR = Prior(6500.0, 9.3, 0.0228)
PRINTED = Model("printed", PLANT, PRIOR, (printed_predictor(),))
FRICTIONS = np.linspace(0.15, 0.25, 9)


def test_the_printed_equations_are_the_printed_numbers() -> None:
    v, peak, slide = 4000.0, 250.0, 3500.0  # mm/min, N, µm
    mixed = interpolate_mass(PRINTED, 18.9, v / 6e4)
    force = by_force(PRINTED, mixed, v / 6e4, MeasuredFeature(peak, 0.1))
    assert force.value == pytest.approx((peak - 0.0529 * v) / 146.2, rel=1e-12)
    from_distance = by_distance(PRINTED, mixed, v / 6e4, MeasuredFeature(slide * 1e-6, 1e-6))
    root = math.sqrt((slide - 0.00041 * v**1.8997) / (0.07379 * v**1.6428))
    assert from_distance.value == pytest.approx(0.3415 - root, rel=1e-9)


def test_equation_6_weighs_by_gradients_and_spans() -> None:
    v = 4500 / 6e4
    mixed = interpolate_mass(PRINTED, 18.9, v)

    def slide(mu: float) -> float:
        return 0.07379 * 4500**1.6428 * (0.3415 - mu) ** 2 + 0.00041 * 4500**1.8997

    slope_d = 2 * 0.07379 * 4500**1.6428 * (0.3415 - 0.2)
    span_ratio = 146.2 * 0.1 / (slide(0.15) - slide(0.25))
    assert force_weight(mixed, 0.2, v) == pytest.approx(146.2 / (146.2 + slope_d * span_ratio), rel=1e-6)
    peak = MeasuredFeature(146.2 * 0.19 + 0.0529 * 4500, 0.1)
    length = MeasuredFeature(slide(0.21) * 1e-6, 1e-6)
    one, two = by_force(PRINTED, mixed, v, peak), by_distance(PRINTED, mixed, v, length)
    both = combined(PRINTED, mixed, v, (one, peak), (two, length))
    weight = force_weight(mixed, 0.2, v)
    assert both.value == pytest.approx(weight * 0.19 + (1 - weight) * 0.21, rel=1e-6)


@pytest.mark.parametrize("v", [2000.0, 3000.0, 4500.0, 6000.0])
@pytest.mark.parametrize("mu", [0.15, 0.165, 0.18, 0.22, 0.24, 0.25])
def test_equation_6_away_from_equal_weights_is_its_closed_form(mu: float, v: float) -> None:
    """Printed: w_F = 1 / (1 + 2 (0.3415 - mu) / (2 0.3415 - 0.15 - 0.25)), one half at 0.2 only."""
    mixed = interpolate_mass(PRINTED, 18.9, v / 6e4)
    weight = 1.0 / (1.0 + 2.0 * (0.3415 - mu) / (2.0 * 0.3415 - 0.15 - 0.25))
    assert abs(weight - 0.5) > 0.025
    assert force_weight(mixed, mu, v / 6e4) == pytest.approx(weight, rel=1e-9)
    by_peak, by_length = mu + 0.004, mu - 0.004
    peak = MeasuredFeature(146.2 * by_peak + 0.0529 * v, 0.1)
    micrometres = 0.07379 * v**1.6428 * (0.3415 - by_length) ** 2 + 0.00041 * v**1.8997
    length = MeasuredFeature(1e-6 * micrometres, 1e-6)
    one = by_force(PRINTED, mixed, v / 6e4, peak)
    two = by_distance(PRINTED, mixed, v / 6e4, length)
    both = combined(PRINTED, mixed, v / 6e4, (one, peak), (two, length))
    assert both.value == pytest.approx(weight * by_peak + (1.0 - weight) * by_length, rel=1e-9)


@pytest.mark.parametrize(("mu", "held_at"), [(0.12, 0.15), (0.29, 0.25)])
def test_the_weights_of_equation_6_stay_as_at_the_end_of_the_calibrated_range(
    mu: float, held_at: float
) -> None:
    mixed = interpolate_mass(PRINTED, 18.9, 0.075)
    weight = 1.0 / (1.0 + 2.0 * (0.3415 - held_at) / (2.0 * 0.3415 - 0.15 - 0.25))
    assert force_weight(mixed, mu, 0.075) == pytest.approx(weight, rel=1e-9)


def test_the_printed_coefficients_come_back_out_of_the_reference_plant() -> None:
    tap = TapInput(0.1, 18.9, halts_at_separation=True)
    found = fit_predictor(PLANT, tap, np.linspace(0.05, 0.1, 9), FRICTIONS)
    given = printed_predictor()
    mu, v = np.meshgrid(FRICTIONS, np.linspace(0.05, 0.1, 9))
    force = (found.force.friction_n * mu + found.force.velocity_n_s_per_m * v) / (
        given.force.friction_n * mu + given.force.velocity_n_s_per_m * v
    )
    slide = sliding_distance(found.distance, mu, v) / sliding_distance(given.distance, mu, v)
    assert np.abs(force - 1.0).max() < 0.006
    assert np.abs(slide - 1.0).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("stroke_m", [math.inf, 1.5e-3])
def test_calibrated_equations_invert_the_simulators_taps(stroke_m: float) -> None:
    tap = TapInput(0.1, 18.9, stroke_m, halts_at_separation=math.isinf(stroke_m))
    velocities = np.linspace(0.05, 0.1, 9)
    predictors = calibrate(PLANT, tap, [13.5, 16.0, 18.9, 22.5], velocities, FRICTIONS)
    model = Model("calibrated", PLANT, PRIOR, predictors, stroke_m)
    for mass, most in ((18.9, 0.02), (15.0, 0.025), (21.0, 0.025)):  # the last two are interpolated
        for velocity in (0.055, 0.07, 0.095):
            for mu in (0.16, 0.2, 0.24):
                motion = Tap(velocity, mu, mass_kg=mass, stroke_m=stroke_m).motion()
                mixed = interpolate_mass(model, mass, velocity)
                force = by_force(model, mixed, velocity, MeasuredFeature(motion.peak_force_n, 0.0))
                slide = by_distance(model, mixed, velocity, MeasuredFeature(motion.sliding_distance_m, 0.0))
                assert force.value == pytest.approx(mu, rel=most)
                assert slide.value == pytest.approx(mu, rel=2 * most)
                assert force.std > 0.0
                assert slide.std > 0.0


@pytest.mark.slow
def test_the_standard_deviations_follow_what_is_not_known() -> None:
    tap = TapInput(0.1, 18.9, halts_at_separation=True)
    model = Model("m", PLANT, PRIOR, calibrate(PLANT, tap, [18.9], np.linspace(0.05, 0.1, 9), FRICTIONS))
    mixed = interpolate_mass(model, 18.9, 0.08)
    rng = np.random.default_rng(1)
    pulls = []
    for _ in range(60):
        tap_made = Tap(
            rng.uniform(0.055, 0.095), rng.uniform(0.16, 0.24), 0.76 * (1 + 0.03 * rng.normal()),
            stiffness=6.5e5 * (1 + 0.01 * rng.normal()), damping=465 * (1 + 0.02 * rng.normal()),
        )  # fmt: skip
        motion = tap_made.motion()
        peak, slide = (
            MeasuredFeature(motion.peak_force_n, 0.05),
            MeasuredFeature(motion.sliding_distance_m, 1e-6),
        )
        one = by_force(model, mixed, tap_made.velocity_m_s, peak)
        two = by_distance(model, mixed, tap_made.velocity_m_s, slide)
        three = combined(model, mixed, tap_made.velocity_m_s, (one, peak), (two, slide))
        pulls.append([(given.value - tap_made.mu_s) / given.std for given in (one, two, three)])
    spread = np.std(pulls, axis=0)
    assert (spread > 0.6).all()
    assert (spread < 1.5).all()


def test_a_negative_root_and_a_frictionless_part_are_named() -> None:
    mixed = interpolate_mass(PRINTED, 18.9, 0.08)
    with pytest.raises(NegativeRootError, match=r"no|below .* the shortest"):
        by_distance(PRINTED, mixed, 0.08, MeasuredFeature(1e-4, 1e-6))
    with pytest.raises(PredictionError, match="without friction"):
        by_distance(PRINTED, mixed, 0.08, MeasuredFeature(1.0, 1e-6))
    with pytest.raises(PredictionError, match="without friction"):
        by_force(PRINTED, mixed, 0.08, MeasuredFeature(10.0, 0.1))


def test_a_provisional_model_blames_itself_not_the_part() -> None:
    """It was mass and velocity that were to be checked, in tap after tap of a cell that was set up right."""
    guessed = replace(PRINTED, provenance={PROVISIONAL: "nothing measured"})
    mixed = interpolate_mass(PRINTED, 18.9, 0.08)
    for model, way_out in ((PRINTED, "check mass"), (guessed, "run `impactcell model fit` after 30 taps")):
        for by, feature in ((by_force, 10.0), (by_distance, 1.0), (by_distance, 1e-4)):
            with pytest.raises(PredictionError, match=way_out) as fault:
                by(model, mixed, 0.08, MeasuredFeature(feature, 1e-6))
            assert german_reason(way_out_of := str(fault.value).rsplit("; ", 1)[1]) != way_out_of


@pytest.mark.parametrize(
    ("mass", "velocity", "mu", "stroke", "reason"),
    [
        (18.9, 0.02, 0.2, math.inf, "velocity 1200 mm/min is outside the calibrated 3000-6000 mm/min"),
        (18.9, 0.08, 0.3, math.inf, "mu_s 0.3 is outside the calibrated 0.15-0.25"),
        (40.0, 0.08, 0.2, math.inf, "mass 40 kg is outside the calibrated 18.9-18.9 kg"),
        (18.9, 0.08, 0.2, 1e-3, "stroke 1 mm is not the without limit of the calibration"),
        (18.9, 0.08, 0.2, math.inf, ""),
    ],
)
def test_a_tap_outside_the_calibration_is_told_why(
    mass: float, velocity: float, mu: float, stroke: float, reason: str
) -> None:
    assert out_of_range(PRINTED, interpolate_mass(PRINTED, mass, velocity), velocity, mu, stroke) == reason
    if "stroke" not in reason:
        capture = replace(Tap().capture(), mass_kg=mass, velocity_m_s=velocity)
        assert bool(beyond_calibration(PRINTED, capture, mu)) == bool(reason)


def test_a_value_outside_the_calibrated_friction_is_uncertain() -> None:
    mixed = interpolate_mass(PRINTED, 18.9, 0.08)
    found = by_force(PRINTED, mixed, 0.08, MeasuredFeature(146.2 * 0.28 + 0.0529 * 4800, 0.1))
    assert found.quality is Quality.UNCERTAIN
    assert "outside the calibrated" in found.reason


@pytest.mark.parametrize(("mass", "velocity"), [(math.nan, 0.08), (0.0, 0.08), (18.9, math.nan)])
def test_an_unknown_mass_or_velocity_is_named(mass: float, velocity: float) -> None:
    with pytest.raises(PredictionError, match="is not known"):
        interpolate_mass(PRINTED, mass, velocity)


def test_a_model_without_predictors_says_how_to_get_them() -> None:
    with pytest.raises(PredictionError, match="impactcell calibrate"):
        interpolate_mass(replace(PRINTED, predictors=()), 18.9, 0.08)


def test_regimes_are_those_of_the_simulators_taps() -> None:
    velocities = np.linspace(2000, 6000, 9) / 6e4
    tap = TapInput(0.1, 25.2, 1.5e-3)
    found = regimes(PLANT, tap, velocities, FRICTIONS[[0, 4, 8]])
    for velocity, regime in zip(velocities.tolist(), found, strict=True):
        motion = Tap(velocity, mass_kg=25.2, stroke_m=1.5e-3).motion()
        halted = 1.5e-3 / velocity < motion.separation_s
        assert regime in (Regime.EITHER, Regime.HALTED if halted else Regime.CLEAN)
    ranges = velocity_spans(found, velocities)
    assert ranges[0][0] == velocities[0]
    assert ranges[-1][1] == velocities[-1]


def test_calibration_is_deterministic_and_tells_its_progress() -> None:
    tap = TapInput(0.1, 18.9, 1.5e-3)
    seen: list[tuple[int, int]] = []
    velocities = np.linspace(0.05, 0.1, 5)
    first = calibrate(
        PLANT, tap, [12.6, 18.9], velocities, FRICTIONS, lambda done, of: seen.append((done, of))
    )
    assert first == calibrate(PLANT, tap, [12.6, 18.9], velocities, FRICTIONS)
    assert seen == [(0, 2), (1, 2), (2, 2)]


def test_a_part_that_never_slides_free_cannot_be_calibrated() -> None:
    with pytest.raises(PredictionError, match="slides free"):
        calibrate(PLANT, TapInput(0.1, 18.9, 1e-5), [18.9], np.linspace(0.01, 0.02, 5), FRICTIONS)


def _by_figures(model: Model, tap: Tap, cycle: int, rng: np.random.Generator) -> Capture:
    """What a module without samples says of a tap."""
    moved = tap.motion()
    peak, slid = moved.peak_force_n + rng.normal(0.0, 0.5), moved.sliding_distance_m + rng.normal(0.0, 5e-6)
    figures = Summary(peak, slid, 0.5, 5e-6)
    return Capture(cycle, tap.velocity_m_s, tap.mass_kg, None, None, stroke_m=tap.stroke_m, summary=figures)


@pytest.mark.slow
def test_figures_of_a_module_that_contradict_each_other_are_uncertain() -> None:
    """A mass, a velocity or a scale that is wrong by 5 % bends mu_s by 6 to 30 %, and nothing else shows."""
    stroke_m = 1.5e-3
    tap = TapInput(0.1, 18.9, stroke_m)
    masses = (18.9 * np.geomspace(0.8, 1.25, 5)).tolist()
    model = Model(
        "m", PLANT, PRIOR, calibrate(PLANT, tap, masses, np.linspace(0.05, 0.1, 9), FRICTIONS), stroke_m
    )
    rng = np.random.default_rng(5)
    wrong = {"mass_kg": 1.05, "velocity_m_s": 1.05}
    for cycle in range(1, 41):
        ratio = 0.76 + 0.01 * rng.normal()
        made = Tap(rng.uniform(0.08, 0.095), 0.2 * (1 + 0.02 * rng.normal()), ratio, stroke_m=stroke_m)
        right = _by_figures(model, made, cycle, rng)
        found = estimate(right, model).mu_s
        assert (found.quality, found.reason) == (Quality.GOOD, "")
        assert found.value == pytest.approx(made.mu_s, abs=4.0 * found.std)
        figures = right.summary
        assert figures is not None
        captures = [replace(right, **{name: getattr(right, name) * factor}) for name, factor in wrong.items()]
        captures.append(replace(right, summary=replace(figures, peak_force_n=0.95 * figures.peak_force_n)))
        for capture in captures:
            told = estimate(capture, model).combined
            assert told.quality is not Quality.GOOD
            assert "peak force" in told.reason
    assert "die Spitzenkraft sagt" in german_reason(estimate(captures[0], model).mu_s.reason)
