"""One tap against closed forms of its linear phases."""

import math

import numpy as np
import pytest

from impactcell.errors import NoBreakawayError, NoSeparationError, NoStopError, PhysicsError
from impactcell.physics import Ensemble, Plant, TapEventKind, TapInput, simulate_free_slide, simulate_tap

K, B, MU_S, MU_K, G = 6.5e5, 465.0, 0.2, 0.152, 9.81
NOMINAL = Plant(K, B, MU_S, MU_K)


def undamped(velocity: float, mass: float) -> tuple[float, float, float]:
    """Peak force, separation time and speed of a part that breaks away at mu_s m g, b = 0."""
    omega = math.sqrt(K / mass)
    breakaway = MU_S * mass * G / (K * velocity)
    excess = (MU_S - MU_K) * mass * G
    # F(t) - mu_k m g = excess cos(omega t) + K v / omega sin(omega t), t from breakaway
    amplitude = math.hypot(excess, K * velocity / omega)
    phase = math.atan2(K * velocity / omega, excess)
    peak = MU_K * mass * G + amplitude
    left = (phase + math.acos(-MU_K * mass * G / amplitude)) / omega
    speed = velocity + omega / K * amplitude * math.sin(omega * left - phase)
    return peak, breakaway + left, speed


@pytest.mark.parametrize("velocity", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("mass", [5.0, 18.9, 40.0])
def test_an_undamped_tap_is_the_closed_form(velocity: float, mass: float) -> None:
    motion = simulate_tap(Plant(K, 0.0, MU_S, MU_K), TapInput(velocity, mass, halts_at_separation=True))
    peak, separation, speed = undamped(velocity, mass)
    assert motion.peak_force_n == pytest.approx(peak, rel=3e-9)
    assert motion.breakaway_s == pytest.approx(MU_S * mass * G / (K * velocity), rel=1e-12)
    assert motion.separation_s == pytest.approx(separation, rel=1e-10)
    assert motion.sliding_distance_m == pytest.approx(speed**2 / (2.0 * MU_K * G), rel=1e-9)
    assert motion.stop_s == pytest.approx(separation + speed / (MU_K * G), rel=1e-9)


def test_preload_is_the_damper_s_first_force_and_then_the_spring() -> None:
    motion = simulate_tap(NOMINAL, TapInput(0.01, 18.9, 1.5e-3))
    time = np.array([0.0, 1e-3, 2e-3])
    assert motion.breakaway_s == pytest.approx((MU_S * 18.9 * G - B * 0.01) / (K * 0.01), rel=1e-12)
    np.testing.assert_allclose(motion.sample(time).force_n, B * 0.01 + K * 0.01 * time, rtol=1e-12)
    np.testing.assert_array_equal(motion.sample(time).position_m, 0.0)


def test_a_part_whose_friction_the_damper_exceeds_moves_at_once() -> None:
    motion = simulate_tap(NOMINAL, TapInput(0.1, 18.9, 1.5e-3))
    assert B * 0.1 > MU_S * 18.9 * G
    assert motion.breakaway_s == 0.0
    assert motion.events[0].kind is TapEventKind.BREAKAWAY


@pytest.mark.parametrize("speed", [0.01, 0.2])
def test_a_viscous_slide_is_the_closed_form(speed: float) -> None:
    k_v, m = 85.0, 12.6
    plant = Plant(K, B, MU_S, MU_K, effects={"viscous_friction": {"viscous_coefficient_n_s_per_m": k_v}})
    motion = simulate_free_slide(plant, TapInput(1.0, m), speed)
    dry = MU_K * m * G
    stop = m / k_v * math.log1p(k_v * speed / dry)
    assert motion.stop_s == pytest.approx(stop, rel=1e-10)
    assert motion.displacement_m == pytest.approx(m / k_v * speed - dry / k_v * stop, rel=1e-9)
    time = np.linspace(0.0, stop, 50)
    velocity = (speed + dry / k_v) * np.exp(-k_v / m * time) - dry / k_v
    np.testing.assert_allclose(motion.sample(time).velocity_m_s, velocity, rtol=0.0, atol=1e-10)


def test_a_drag_slide_is_the_closed_form() -> None:
    c, m, speed = 50.0, 18.9, 0.2
    plant = Plant(K, B, MU_S, MU_K, effects={"quadratic_drag": {"drag_coefficient_n_s2_per_m2": c}})
    distance = m / (2.0 * c) * math.log1p(c * speed**2 / (MU_K * m * G))
    assert simulate_free_slide(plant, TapInput(1.0, m), speed).displacement_m == pytest.approx(
        distance, rel=1e-10
    )


def test_a_slide_uphill_and_downhill_is_the_closed_form() -> None:
    plant = Plant(K, B, MU_S, MU_K, effects={"surface_tilt": {"tilt_rad": 0.01}})
    for direction in (1, -1):
        deceleration = G * (MU_K + direction * math.sin(0.01))
        moved = simulate_free_slide(plant, TapInput(1.0, 18.9, direction=direction), 0.1)
        assert moved.displacement_m == pytest.approx(0.1**2 / (2.0 * deceleration), rel=1e-10)


def test_a_spring_lets_the_part_slide_back_until_friction_holds_it() -> None:
    # Half oscillations about +-mu m g / k_r, each shorter by twice that.
    spring, m, speed = 5000.0, 10.0, 0.5
    mu = 0.1
    plant = Plant(K, B, mu, mu, effects={"restoring_force": {"stiffness_n_per_m": spring}})
    motion = simulate_free_slide(plant, TapInput(1.0, m), speed)
    shift = mu * m * G / spring
    extreme = math.hypot(shift, speed / math.sqrt(spring / m)) - shift
    while extreme > shift:
        extreme, last = extreme - 2.0 * shift, extreme
    stops = [event for event in motion.events if event.kind is TapEventKind.STOP]
    assert len(stops) > 2
    sign = -1.0 if len(stops) % 2 == 0 else 1.0
    del last
    assert motion.displacement_m == pytest.approx(sign * extreme, rel=1e-8)


def test_the_actuator_halts_when_its_stroke_is_used_up() -> None:
    motion = simulate_tap(NOMINAL, TapInput(0.1, 18.9, 1.5e-3))
    halt = next(event for event in motion.events if event.kind is TapEventKind.HALT)
    assert halt.time_s == pytest.approx(0.015, rel=1e-12)
    np.testing.assert_allclose(motion.sample([0.005, 0.015, 1.0]).actuator_m, [5e-4, 1.5e-3, 1.5e-3])


def test_a_slow_part_is_caught_and_pushed_again() -> None:
    motion = simulate_tap(NOMINAL, TapInput(1000.0 / 60000.0, 18.9, 1.5e-3))
    kinds = [event.kind for event in motion.events]
    assert kinds.count(TapEventKind.SEPARATION) > 1
    assert TapEventKind.CONTACT in kinds
    times = [event.time_s for event in motion.events]
    assert times == sorted(times)
    assert motion.separation_s == max(e.time_s for e in motion.events if e.kind is TapEventKind.SEPARATION)


def test_a_push_that_ends_in_contact_has_no_sliding_distance() -> None:
    motion = simulate_tap(NOMINAL, TapInput(0.005, 18.9, 1.5e-3))
    assert motion.displacement_m > 1e-3
    with pytest.raises(NoSeparationError, match="never left"):
        _ = motion.sliding_distance_m


def test_a_tap_too_short_to_break_friction_moves_nothing() -> None:
    motion = simulate_tap(NOMINAL, TapInput(0.005, 18.9, 1e-5))
    assert motion.displacement_m == 0.0
    assert motion.stop_s == 0.0
    assert motion.peak_force_n == pytest.approx(K * 1e-5 + B * 0.005, rel=1e-9)
    with pytest.raises(NoBreakawayError, match="static friction held"):
        _ = motion.breakaway_s


def test_directions_mirror_each_other() -> None:
    time = np.linspace(-0.001, 0.2, 300)
    there = simulate_tap(NOMINAL, TapInput(0.06, 18.9, 1.5e-3, start_m=0.3)).sample(time)
    back = simulate_tap(NOMINAL, TapInput(0.06, 18.9, 1.5e-3, direction=-1)).sample(time)
    np.testing.assert_array_equal(there.force_n, back.force_n)
    np.testing.assert_array_equal(there.position_m, -back.position_m)
    np.testing.assert_array_equal(there.actuator_m, -back.actuator_m)
    np.testing.assert_array_equal(there.velocity_m_s, -back.velocity_m_s)


def test_samples_may_be_asked_for_in_any_order() -> None:
    motion = simulate_tap(NOMINAL, TapInput(0.06, 18.9, 1.5e-3))
    time = np.linspace(-0.001, 0.2, 300)
    shuffled = np.random.default_rng(1).permutation(300)
    np.testing.assert_array_equal(
        motion.sample(time[shuffled]).force_n, motion.sample(time).force_n[shuffled]
    )


def test_before_first_contact_all_is_at_rest_and_after_the_stop_again() -> None:
    motion = simulate_tap(NOMINAL, TapInput(0.06, 18.9, 1.5e-3))
    early, late = motion.sample([-1.0, 10.0]), motion.sample([motion.stop_s, 10.0])
    assert early.force_n[0] == 0.0
    assert early.position_m[0] == 0.0
    assert late.position_m[0] == pytest.approx(late.position_m[1], rel=1e-13)
    assert late.position_m[1] == pytest.approx(motion.displacement_m, rel=1e-14)


def test_the_peak_is_the_maximum_of_the_force() -> None:
    motion = simulate_tap(NOMINAL, TapInput(0.06, 18.9, 1.5e-3))
    dense = motion.sample(np.linspace(0.0, 0.03, 200_001)).force_n.max()
    assert motion.peak_force_n == pytest.approx(dense, rel=1e-8)
    assert motion.peak_force_n >= dense * (1.0 - 1e-12)


def test_a_push_without_end_is_refused() -> None:
    with pytest.raises(NoStopError, match="pushed it without end"):
        simulate_tap(NOMINAL, TapInput(0.05, 18.9))


@pytest.mark.parametrize(("velocity_m_s", "mass_kg"), [(0.01, 100.0), (0.0005, 18.9), (0.04, 18900.0)])
def test_stick_and_slip_without_end_is_no_rest(velocity_m_s: float, mass_kg: float) -> None:
    """After ten minutes the part is held for a moment, 6 m from where it lay, under an actuator that runs."""
    with pytest.raises(NoStopError, match="pushed it without end"):
        simulate_tap(NOMINAL, TapInput(velocity_m_s, mass_kg, halts_at_separation=True))


def test_a_part_on_a_slope_too_steep_never_stops() -> None:
    steep = Plant(K, B, 0.05, 0.04, effects={"surface_tilt": {"tilt_rad": -0.06}})
    with pytest.raises(NoStopError, match=r"still moving .* Less tilt, or more friction"):
        simulate_tap(steep, TapInput(0.05, 18.9, 1e-3))


def test_a_part_with_hardly_any_friction_is_not_blamed_on_a_tilt() -> None:
    slippery = Plant(K, B, 1e-6, 1e-6)
    with pytest.raises(NoStopError, match=r"still moving .* A lower velocity, or more friction"):
        simulate_tap(slippery, TapInput(0.05, 18.9, 1e-3))


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        (["viscous_friction"], "plant: effects is to be a mapping"),
        (None, "plant: effects is to be a mapping .* not None"),
        ({"viscous_friction": None}, "plant: viscous_friction is to have its parameters by name"),
        ({"viscous_friction": 85.0}, "plant: viscous_friction is to have its parameters by name"),
    ],
)
def test_effects_that_are_none_are_refused_by_name(effects: object, message: str) -> None:
    with pytest.raises(PhysicsError, match=message):
        Plant(K, B, MU_S, MU_K, effects=effects)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", ["85", None, [85.0, 90.0], np.array([85.0])])
def test_a_parameter_of_an_effect_is_one_number(value: object) -> None:
    plant = Plant(K, B, MU_S, MU_K, effects={"viscous_friction": {"viscous_coefficient_n_s_per_m": value}})  # type: ignore[dict-item]
    with pytest.raises(PhysicsError, match=r"^viscous_friction: viscous_coefficient_n_s_per_m is to be one"):
        simulate_tap(plant, TapInput(0.05, 18.9, 1e-3))


def test_a_value_a_batch_may_be_an_array() -> None:
    tap = TapInput(0.05, 18.9, 1e-3, batch=2)
    of_row, of_array = (
        simulate_tap(Plant(K, B, MU_S, MU_K, effects={"batch_shift": {"relative_change": values}}), tap)
        for values in ((0.05, -0.1), np.array([0.05, -0.1]))
    )
    assert of_row.displacement_m == of_array.displacement_m


@pytest.mark.slow
def test_a_part_that_runs_away_over_waves_is_given_up_and_no_sample_is_taken_for_a_rest() -> None:
    # In the time allowed it would cross some 1e8 waves.
    waves = {"amplitude": 1e-3, "period_m": 1e-4, "phase_rad": 0.0}
    plant = Plant(K, B, 0.05, 0.04, effects={"surface_tilt": {"tilt_rad": -0.06}, "periodic_friction": waves})
    tap = TapInput(0.05, 18.9, 1e-3)
    with pytest.raises(NoStopError, match="ran away"):
        simulate_tap(plant, tap)
    ensemble = Ensemble([tap], tuple(plant.effects), position_time_s=[np.array([0.5, 0.75, 1.0, 590.0])])
    *soon, late = ensemble.traces(ensemble.parameters(plant)).position_m
    # The contact over, the acceleration is constant; over thousands of waves friction is its mean.
    acceleration = G * (math.sin(0.06) - 0.04)
    assert np.diff(soon, 2)[0] == pytest.approx(acceleration * 0.25**2, rel=1e-4)
    assert math.isnan(late)


def test_stick_slip_without_end_is_given_up_and_no_sample_is_taken_for_a_rest() -> None:
    # Pushed on without a stroke it sticks and slips some hundred times a second, for ever.
    ensemble = Ensemble([TapInput(0.001, 0.9)], (), position_time_s=[np.array([1.0, 2.0, 590.0])])
    first, second, late = ensemble.traces(ensemble.parameters(Plant(1.6e6, 20.0, 0.3, 0.2))).position_m
    assert second - first == pytest.approx(0.001, rel=0.01)
    assert math.isnan(late)


@pytest.mark.parametrize(
    ("plant", "message"),
    [
        ({"stiffness_n_per_m": 0.0}, "stiffness_n_per_m must be positive"),
        ({"mu_s": -0.1}, "mu_s must be 0 or more"),
        ({"damping_n_s_per_m": math.nan}, "damping_n_s_per_m must be 0 or more"),
    ],
)
def test_an_impossible_plant_is_refused(plant: dict[str, float], message: str) -> None:
    whole = {"stiffness_n_per_m": K, "damping_n_s_per_m": B, "mu_s": MU_S, "mu_k": MU_K, **plant}
    with pytest.raises(PhysicsError, match=message):
        Plant(**whole)


@pytest.mark.parametrize(
    ("tap", "message"),
    [
        ({"velocity_m_s": 0.0}, "velocity_m_s must be positive"),
        ({"mass_kg": math.nan}, "mass_kg must be positive"),
        ({"stroke_m": -1.0}, "stroke_m must be positive"),
        ({"direction": 0}, "direction must be 1 or -1"),
        ({"start_m": math.nan}, "start_m must be a number"),
    ],
)
def test_an_impossible_tap_is_refused(tap: dict[str, float], message: str) -> None:
    whole = {"velocity_m_s": 0.05, "mass_kg": 18.9, **tap}
    with pytest.raises(PhysicsError, match=message):
        TapInput(**whole)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"gremlins": {}}, "no effect is called 'gremlins'"),
        ({"surface_tilt": {"slope": 1.0}}, "has no parameter slope; it has tilt_rad"),
        ({"surface_tilt": {"tilt_rad": 3.0}}, "tilt_rad is 3.0, outside -0.1 to 0.1 rad"),
        ({"surface_tilt": {"tilt_rad": math.nan}}, "tilt_rad is nan"),
    ],
)
def test_an_impossible_effect_is_refused(effects: dict[str, dict[str, float]], message: str) -> None:
    with pytest.raises(PhysicsError, match=message):
        simulate_tap(Plant(K, B, MU_S, MU_K, effects=effects), TapInput(0.05, 18.9, 1e-3))


def test_a_long_stick_slip_keeps_its_last_events_in_its_figures() -> None:
    motion = simulate_tap(Plant(1.6e6, 20.0, 0.3, 0.2), TapInput(0.001, 0.9, 1.5e-2))
    assert len(motion.events) == 4096
    assert motion.stop_s > motion.events[-1].time_s
    assert motion.displacement_m > 1.49e-2
    assert motion.breakaway_s == motion.events[0].time_s


def test_an_actuator_that_stalls_against_the_part_leaves_it_at_rest() -> None:
    droop = {"speed_loss_m_per_s_n": 8e-5, "time_constant_s": 2e-3}
    held = simulate_tap(
        Plant(K, B, 0.19, 0.18, effects={"actuator_droop": droop}), TapInput(0.004, 28.5, 1e-3)
    )
    assert held.displacement_m == 0.0
    assert held.sample([100.0]).force_n[0] == pytest.approx(0.004 / 8e-5, rel=1e-9)
