"""Many taps at once give what each gives alone, and derivatives that are the closed form's."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from impactcell.errors import PhysicsError
from impactcell.physics import Ensemble, Plant, TapInput, simulate_driven, simulate_free_slide, simulate_tap

EFFECTS = {
    "viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0},
    "surface_tilt": {"tilt_rad": 0.002},
    "batch_shift": {"relative_change": [0.05, -0.03]},
    "channel_skew": {"delay_s": 2.3e-4},
}
PLANT = Plant(6.5e5, 465.0, 0.2, 0.152, effects=EFFECTS)
TAPS = [
    TapInput(v, 18.9, 1.5e-3, direction=d, batch=b)
    for v, b in ((0.03, 0), (0.06, 1), (0.1, 2))
    for d in (1, -1)
]
TIMES = [np.arange(1, 900 + 50 * i) * 1e-4 for i in range(len(TAPS))]


def test_an_ensemble_is_its_taps() -> None:
    ensemble = Ensemble(
        TAPS,
        tuple(EFFECTS),
        force_time_s=TIMES,
        position_time_s=[t[::3] for t in TIMES],
        actuator_time_s=TIMES,
        velocity_time_s=TIMES,
    )
    theta = ensemble.parameters(PLANT)
    traces = ensemble.traces(theta)
    motions = [simulate_tap(PLANT, tap) for tap in TAPS]
    alone = [motion.sample(time) for motion, time in zip(motions, TIMES, strict=True)]
    np.testing.assert_allclose(
        traces.force_n, np.concatenate([s.force_n for s in alone]), rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(
        traces.position_m, np.concatenate([s.position_m[::3] for s in alone]), atol=1e-12
    )
    np.testing.assert_allclose(traces.actuator_m, np.concatenate([s.actuator_m for s in alone]), atol=1e-14)
    np.testing.assert_allclose(
        traces.velocity_m_s, np.concatenate([s.velocity_m_s for s in alone]), atol=1e-10
    )
    figures = ensemble.outputs(theta)
    np.testing.assert_array_equal(figures.peak_force_n, [motion.peak_force_n for motion in motions])
    np.testing.assert_array_equal(figures.displacement_m, [motion.displacement_m for motion in motions])
    np.testing.assert_array_equal(
        figures.sliding_distance_m, [motion.sliding_distance_m for motion in motions]
    )
    np.testing.assert_array_equal(figures.stop_s, [motion.stop_s for motion in motions])
    assert figures.at_rest.all()


def test_a_part_that_is_held_between_two_slips_is_not_at_rest() -> None:
    """The first is pushed on, the second stalls its actuator, the third is as yet below its breakaway."""
    plant = Plant(6.5e5, 465.0, 0.2, 0.152)
    pushed = Ensemble([TapInput(0.01, 100.0, halts_at_separation=True)])
    held_on = pushed.outputs(pushed.parameters(plant), horizon_s=10.0)
    assert not held_on.at_rest.any()
    droop = {"actuator_droop": {"speed_loss_m_per_s_n": 8e-5, "time_constant_s": 2e-3}}
    stalling = Ensemble([TapInput(0.0025, 28.5, 1e-3)], tuple(droop))
    values = stalling.parameters(replace(plant, effects=droop))
    assert stalling.outputs(values, horizon_s=10.0).at_rest.all()
    assert not stalling.outputs(values, horizon_s=0.01).at_rest.any()


def test_contact_of_each_tap_may_be_at_another_time() -> None:
    """It is the same as other times of its samples."""
    onsets = np.linspace(-8e-5, 9e-5, len(TAPS))
    channels = {"force_time_s": TIMES, "position_time_s": [t[::3] for t in TIMES], "actuator_time_s": TIMES}
    by_onset = Ensemble(TAPS, tuple(EFFECTS), **channels, by_tap=True)
    moved = {
        name: [t - onset for t, onset in zip(times, onsets, strict=True)] for name, times in channels.items()
    }
    by_times = Ensemble(TAPS, tuple(EFFECTS), **moved, by_tap=True)
    theta = by_onset.parameters(PLANT)
    samples = by_onset.samples(theta, onset_s=onsets)
    np.testing.assert_array_equal(samples, by_times.samples(theta))
    assert np.abs(samples - by_onset.samples(theta)).max() > 1.0


def test_names_say_what_a_vector_holds() -> None:
    ensemble = Ensemble(TAPS, tuple(EFFECTS))
    assert ensemble.names == (
        "stiffness_n_per_m",
        "damping_n_s_per_m",
        "mu_s",
        "mu_k",
        "viscous_friction.viscous_coefficient_n_s_per_m",
        "surface_tilt.tilt_rad",
        "batch_shift.relative_change[1]",
        "batch_shift.relative_change[2]",
        "channel_skew.delay_s",
    )
    np.testing.assert_array_equal(
        ensemble.parameters(PLANT), [6.5e5, 465.0, 0.2, 0.152, 85.0, 0.002, 0.05, -0.03, 2.3e-4]
    )


def test_factors_masses_and_vectors_may_differ_from_tap_to_tap() -> None:
    ensemble = Ensemble(TAPS)
    theta = np.tile([6.5e5, 465.0, 0.2, 0.152], (len(TAPS), 1))
    theta[:, 0] *= np.linspace(0.9, 1.1, len(TAPS))
    factor = np.linspace(0.95, 1.05, len(TAPS))
    mass = np.linspace(10.0, 30.0, len(TAPS))
    figures = ensemble.outputs(theta, factor, mass_kg=mass)
    for i, tap in enumerate(TAPS):
        plant = Plant(theta[i, 0], 465.0, 0.2 * factor[i], 0.152 * factor[i])
        alone = simulate_tap(plant, TapInput(tap.velocity_m_s, mass[i], 1.5e-3))
        assert figures.displacement_m[i] == pytest.approx(alone.displacement_m, rel=1e-12)


def test_derivatives_of_a_slide_are_the_closed_form() -> None:
    taps = [TapInput(1.0, 18.9), TapInput(1.0, 12.6, direction=-1)]
    speed = np.array([0.1, 0.07])
    times = [np.linspace(0.0, 0.04, 20)] * 2
    ensemble = Ensemble(taps, position_time_s=times, initial_speed_m_s=speed)
    made = ensemble.sensitivities(
        np.array([6.5e5, 465.0, 0.2, 0.152]), ["mu_k", "mu_s", "friction_factor", "initial_speed_m_s"]
    ).position_m.reshape(4, 2, 20)
    sign = np.array([1.0, -1.0])[:, None]
    np.testing.assert_allclose(made[0], sign * -0.5 * 9.81 * times[0] ** 2, atol=1e-9)
    np.testing.assert_array_equal(made[1], 0.0)
    np.testing.assert_allclose(made[2], 0.152 * made[0], atol=1e-9)
    np.testing.assert_allclose(made[3], sign * times[0], atol=1e-9)


def test_a_derivative_at_the_end_of_a_range_is_one_sided() -> None:
    ensemble = Ensemble(TAPS, ["quadratic_drag"], position_time_s=TIMES)
    theta = np.array([6.5e5, 465.0, 0.2, 0.152, 0.0])
    made = ensemble.sensitivities(theta, ["quadratic_drag.drag_coefficient_n_s2_per_m2"]).position_m[0]
    far = np.array([6.5e5, 465.0, 0.2, 0.152, 0.01])
    coarse = (ensemble.traces(far).position_m - ensemble.traces(theta).position_m) / 0.01
    np.testing.assert_allclose(made, coarse, rtol=1e-2, atol=1e-9)


def test_an_ensemble_travels_to_another_process_by_name() -> None:
    ensemble = Ensemble(TAPS, tuple(EFFECTS), force_time_s=TIMES)
    theta = ensemble.parameters(PLANT)
    travelled = pickle.loads(pickle.dumps(ensemble))
    np.testing.assert_array_equal(travelled.traces(theta).force_n, ensemble.traces(theta).force_n)


def test_driven_parts_in_an_ensemble() -> None:
    time = np.arange(0.0, 0.4, 1e-3)
    force = 60.0 * np.sin(2.0 * np.pi * 5.0 * time)
    samples = np.linspace(0.0, 0.39, 77)
    plant = Plant(6.5e5, 465.0, 0.2, 0.152)
    ensemble = Ensemble(
        [TapInput(1.0, 20.0), TapInput(1.0, 25.0)], position_time_s=[samples] * 2, drives=[(time, force)] * 2
    )
    traces = ensemble.traces(ensemble.parameters(plant))
    for i, mass in enumerate((20.0, 25.0)):
        alone = simulate_driven(plant, TapInput(1.0, mass), time, force, samples)
        np.testing.assert_array_equal(traces.position_m.reshape(2, -1)[i], alone.position_m)
    assert np.ptp(traces.position_m) > 1e-3


def test_a_driven_part_slides_by_the_closed_form() -> None:
    # A ramp of force breaks stick at mu_s m g; from then on m x'' = ramp - mu_k m g.
    m, rate = 20.0, 200.0
    plant = Plant(6.5e5, 465.0, 0.2, 0.15)
    samples = np.linspace(0.0, 0.5, 40)
    moved = simulate_driven(
        plant, TapInput(1.0, m), np.array([0.0, 0.5]), np.array([0.0, 0.5 * rate]), samples
    ).position_m
    since = np.maximum(samples - 0.2 * m * 9.81 / rate, 0.0)
    exact = (0.05 * 9.81) * since**2 / 2.0 + rate / m * since**3 / 6.0
    np.testing.assert_allclose(moved, exact, atol=1e-11)


def test_the_force_sensor_s_laws_are_undone_before_a_measured_force_drives() -> None:
    time = np.arange(0.0, 0.4, 1e-3)
    force = 60.0 * np.sin(2.0 * np.pi * 5.0 * time)
    samples = np.linspace(0.0, 0.35, 50)
    sensor = {"force_sensor_gain": {"relative_error": 0.1}, "force_sensor_offset": {"offset_n": 3.0}}
    shown = Plant(6.5e5, 465.0, 0.2, 0.152, effects=sensor)
    there = simulate_driven(shown, TapInput(1.0, 20.0), time, 1.1 * force + 3.0, samples).position_m
    plain = simulate_driven(
        Plant(6.5e5, 465.0, 0.2, 0.152), TapInput(1.0, 20.0), time, force, samples
    ).position_m
    np.testing.assert_allclose(there, plain, atol=1e-12)


def test_bad_questions_are_refused() -> None:
    with pytest.raises(PhysicsError, match="must ascend"):
        Ensemble(TAPS[:1], force_time_s=[np.array([1.0, 0.5])])
    with pytest.raises(PhysicsError, match="must ascend"):
        Ensemble(TAPS[:1], force_time_s=[np.array([np.nan])])
    with pytest.raises(PhysicsError, match="named twice"):
        Ensemble(TAPS, ["surface_tilt", "surface_tilt"])
    with pytest.raises(PhysicsError, match="made without surface_tilt"):
        Ensemble(TAPS).parameters(Plant(6.5e5, 465.0, 0.2, 0.15, effects={"surface_tilt": {}}))
    with pytest.raises(PhysicsError, match="drive 0"):
        Ensemble(TAPS[:1], drives=[(np.array([0.0, 0.0]), np.array([1.0, 1.0]))])


def test_a_slide_in_an_ensemble() -> None:
    ensemble = Ensemble([TapInput(1.0, 18.9)], position_time_s=[TIMES[0]], initial_speed_m_s=np.array([0.1]))
    theta = np.array([6.5e5, 465.0, 0.2, 0.152])
    alone = simulate_free_slide(Plant(*theta), TapInput(1.0, 18.9), 0.1).sample(TIMES[0])
    np.testing.assert_allclose(ensemble.traces(theta).position_m, alone.position_m, atol=1e-14)
