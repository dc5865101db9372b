"""A tap simulated and estimated through the public API."""

import math
from pathlib import Path

import numpy as np
import pytest

import impactcell
from impactcell.errors import CaptureError, NotConvergedError, PhysicsError, PredictionError, SettingsError
from impactcell.features import white_noise_std
from impactcell.physics import Plant
from impactcell.records import Quality
from simulator import plant as simulated

PLANT = {"stiffness_n_per_m": 6.5e5, "damping_n_s_per_m": 465.0, "mu_s": 0.21, "mu_k": 0.16}


@pytest.mark.parametrize("stroke_m", [1.5e-3, 4e-4])
def test_it_agrees_with_the_simulators_own_integrator(stroke_m: float) -> None:
    tap = impactcell.simulate_tap(0.05, 12.6, stroke_m, plant=PLANT)
    truth = simulated.simulate_tap(
        simulated.Plant(**PLANT, effects={}),
        simulated.TapInput(velocity_m_s=0.05, mass_kg=12.6, stroke_m=stroke_m),
    )
    assert tap.peak_force_n == pytest.approx(truth.peak_force_n, rel=1e-6)
    assert tap.sliding_distance_m == pytest.approx(truth.sliding_distance_m, rel=1e-6)


def test_the_traces_are_those_of_the_figures() -> None:
    tap = impactcell.simulate_tap(0.075, 18.9)
    assert tap.force_n.max() == pytest.approx(tap.peak_force_n, rel=1e-3)
    assert tap.position_m[-1] == pytest.approx(tap.displacement_m, rel=1e-9)
    assert tap.time_s[-1] >= tap.stop_s > tap.separation_s > tap.breakaway_s >= 0.0
    # momentum: what the contact gave is what friction took
    sliding = (tap.time_s > tap.separation_s + 1e-3) & (tap.time_s < tap.stop_s - 1e-3)
    friction = np.gradient(tap.velocity_m_s, tap.time_s)[sliding]
    assert np.median(friction) == pytest.approx(-0.76 * 0.2 * 9.81, rel=1e-6)


def test_times_may_be_given_in_any_order() -> None:
    tap = impactcell.simulate_tap(0.075, 18.9, time_s=[0.02, 0.0, 0.01])
    ordered = impactcell.simulate_tap(0.075, 18.9, time_s=[0.0, 0.01, 0.02])
    assert tap.position_m.tolist() == ordered.position_m[[2, 0, 1]].tolist()


def test_a_plant_is_given_whole_or_in_part() -> None:
    whole = impactcell.simulate_tap(0.05, 18.9, plant=Plant(6.5e5, 465.0, 0.25, 0.19))
    part = impactcell.simulate_tap(0.05, 18.9, plant={"mu_s": 0.25})
    assert whole.sliding_distance_m == pytest.approx(part.sliding_distance_m, rel=1e-12)
    viscous = {"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0}}
    slowed = impactcell.simulate_tap(0.05, 18.9, plant={"mu_s": 0.25, "effects": viscous})
    assert slowed.sliding_distance_m < part.sliding_distance_m


def test_a_part_that_is_held_has_no_slide() -> None:
    tap = impactcell.simulate_tap(0.01, 18.9, 1e-6)
    assert math.isnan(tap.sliding_distance_m)
    assert math.isnan(tap.breakaway_s)
    assert tap.displacement_m == 0.0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"friction": 0.2}, "no field 'friction'"),
        ({"mu_s": -0.2}, "mu_s must be 0 or more"),
        ({"effects": {"gravity_waves": {}}}, "gravity_waves"),
    ],
)
def test_a_plant_that_cannot_be_is_refused(given: dict[str, object], message: str) -> None:
    with pytest.raises(PhysicsError, match=message):
        impactcell.simulate_tap(0.05, 18.9, plant=given)


def test_friction_is_found_from_noisy_arrays() -> None:
    rng = np.random.default_rng(5)
    tap = impactcell.simulate_tap(0.033, 18.9, plant=PLANT)
    force = tap.force_n + rng.normal(0.0, 0.4, tap.force_n.shape)
    position = tap.position_m + rng.normal(0.0, 1.5e-6, tap.position_m.shape)
    friction = impactcell.estimate(tap.time_s, force, position, 0.033, 18.9)
    assert friction.mu_k.value == pytest.approx(0.16, abs=3.0 * friction.mu_k.std)
    assert friction.mu_s.value == pytest.approx(0.21, abs=3.0 * friction.mu_s.std)
    assert friction.mu_k.std < 1e-3
    # Over the noise that the traces show, which is 11 % low here, of some 200 samples of either channel.
    assert friction.gap == pytest.approx(0.4 / white_noise_std(force), rel=0.05)


def test_a_models_predictors_are_used(pytestconfig: pytest.Config) -> None:
    model = pytestconfig.rootpath / "config" / "models" / "prototype.yaml"
    tap = impactcell.simulate_tap(0.075, 18.9, 1.5e-3)
    friction = impactcell.estimate(tap.time_s, tap.force_n, tap.position_m, 0.075, 18.9, 1.5e-3, model=model)
    assert friction.by_force.quality < Quality.BAD
    assert friction.by_distance.quality < Quality.BAD


def test_arrays_in_which_no_tap_is_seen_say_so() -> None:
    nothing = np.zeros(500)
    with pytest.raises(PredictionError, match=r"^the tap cannot be used: the position is constant at 0$"):
        impactcell.estimate(np.arange(500) * 1e-4, nothing, nothing, 0.05, 18.9)


@pytest.mark.parametrize(
    ("velocity_m_s", "mass_kg", "message"),
    [
        (2400.0, 18.9, "velocity_m_s = 2400: no actuator .* 10 m/s; if that was meant in mm/min, give 0.04"),
        (40.0, 18.9, "if that was meant in mm/s, give 0.04"),
        (math.inf, 18.9, "check its unit"),
        (0.0, 18.9, "velocity_m_s = 0: give the actuator's speed in m/s, above 0"),
        (-0.04, 18.9, "velocity_m_s = -0.04: give the actuator's speed"),
        (math.nan, 18.9, "velocity_m_s = nan: give the actuator's speed"),
        (0.04, 0.0, "mass_kg = 0: give the mass of the part in kg"),
        (0.04, math.nan, "mass_kg = nan: give the mass of the part in kg"),
    ],
)
def test_a_velocity_or_mass_that_cannot_be_is_refused(
    velocity_m_s: float, mass_kg: float, message: str, pytestconfig: pytest.Config
) -> None:
    tap = impactcell.simulate_tap(0.04, 18.9, plant=PLANT)
    traces = tap.time_s, tap.force_n, tap.position_m
    with pytest.raises(CaptureError, match=message):
        impactcell.estimate(*traces, velocity_m_s, mass_kg)
    if abs(velocity_m_s) > 1.0:
        model = pytestconfig.rootpath / "config" / "models" / "prototype.yaml"
        with pytest.raises(CaptureError, match=message):
            impactcell.estimate(*traces, velocity_m_s, mass_kg, model=model)


@pytest.mark.parametrize(
    ("per_second", "per_metre", "velocity_m_s"), [(1.0, 1.0, 4.0), (1e3, 1.0, 0.04), (1.0, 1e3, 0.04)]
)
def test_units_that_make_a_tap_hopeless_are_to_be_looked_at(
    per_second: float, per_metre: float, velocity_m_s: float
) -> None:
    """It was told that a stiffness must be positive, of which nobody had said anything."""
    tap = impactcell.simulate_tap(0.04, 18.9, plant=PLANT)
    traces = per_second * tap.time_s, tap.force_n, per_metre * tap.position_m
    with pytest.raises(PredictionError, match=r"^the tap cannot be used: the force does not rise .* check"):
        impactcell.estimate(*traces, velocity_m_s, 18.9)


def test_a_force_in_other_units_is_to_be_looked_at() -> None:
    tap = impactcell.simulate_tap(0.04, 18.9, plant=PLANT)
    with pytest.raises(
        PredictionError, match=r"^the tap cannot be used: .*; check .* the units of the traces$"
    ):
        impactcell.estimate(tap.time_s, 1e-3 * tap.force_n, tap.position_m, 0.04, 18.9)


@pytest.mark.parametrize(
    ("turned", "message"),
    [
        ("force", r"^force_n pulls with \d+\.?\d* N, where a contact only pushes: give -force_n$"),
        ("position", r"^position_m falls by 2\.\d+ mm, and is positive along the tap: give -position_m$"),
        ("time", r"^the force begins at 30\.\d* ms, and t = 0 is first contact: give time_s - 0\.03\b"),
    ],
)
@pytest.mark.parametrize("with_model", [False, True])
def test_signs_and_a_start_that_are_not_those_of_a_tap_are_refused(
    turned: str, message: str, with_model: bool, pytestconfig: pytest.Config
) -> None:
    """They were told as a slide that is too short, as no contact, as an actuator that pushes without end."""
    draw = np.random.default_rng(4)
    tap = impactcell.simulate_tap(0.04, 18.9, plant=PLANT, time_s=np.arange(-300, 1500) * 1e-4)
    time_s, force, position = tap.time_s, tap.force_n.copy(), tap.position_m.copy()
    force[time_s <= 0.0], position[time_s <= 0.0] = 0.0, 0.0
    force = force + draw.normal(0.0, 0.4, len(force))
    position = position + draw.normal(0.0, 1.5e-6, len(position))
    model = pytestconfig.rootpath / "config" / "models" / "prototype.yaml" if with_model else None
    impactcell.estimate(time_s, force, position, 0.04, 18.9, model=model)
    match turned:
        case "force":
            force = -force
        case "position":
            position = 0.3 - position
        case "time":
            time_s = time_s + 0.03
    with pytest.raises(CaptureError, match=message):
        impactcell.estimate(time_s, force, position, 0.04, 18.9, model=model)


def test_a_mass_that_no_plant_explains_is_told_without_the_words_of_a_campaign() -> None:
    tap = impactcell.simulate_tap(0.04, 18.9, plant=PLANT)
    with pytest.raises(NotConvergedError, match=r"^no k, b and mu_k/mu_s explain the tap; .* mass"):
        impactcell.estimate(tap.time_s, tap.force_n, tap.position_m, 0.04, 189.0)
    with pytest.raises(
        PredictionError, match=r"cannot be used: .* pushed it without end; check velocity, mass, stroke and"
    ):
        impactcell.estimate(tap.time_s, tap.force_n, tap.position_m, 0.04, 18900.0)


def test_what_cannot_be_used_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="of one length"):
        impactcell.estimate([0.0, 1e-4], [0.0], [0.0, 0.0], 0.05, 18.9)
    some = [0.0, 1e-4, 2e-4]
    with pytest.raises(SettingsError):
        impactcell.estimate(some, some, some, 0.05, 18.9, model=tmp_path / "none.yaml")
