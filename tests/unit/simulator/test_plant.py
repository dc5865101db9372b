"""The simulator's plant against closed forms, balances and the source paper: the truth of other tests."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import brentq

from simulator.plant import (
    NeverAtRestError,
    Plant,
    Shot,
    TapInput,
    simulate_driven,
    simulate_free_slide,
    simulate_tap,
)
from simulator.plant_nominal import nominal_taps

MM_PER_MIN = 1e-3 / 60.0
G = 9.81
PLANT = Plant(6.5e5, 465.0, 0.2, 0.152)
VISCOUS = {"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0}}


def propagate(matrix: np.ndarray, forcing: np.ndarray, state: np.ndarray, time: float) -> np.ndarray:
    """Solution of z' = A z + c by one matrix exponential."""
    size = len(state)
    augmented = np.zeros((size + 1, size + 1))
    augmented[:size, :size], augmented[:size, size] = matrix, forcing
    return (expm(augmented * time) @ np.append(state, 1.0))[:size]


def test_a_tap_against_matrix_exponentials() -> None:
    k, b, mass, mu_s, mu_k, kv, v = 6.5e5, 465.0, 18.9, 0.2, 0.152, 85.0, 3000 * MM_PER_MIN
    motion = simulate_tap(
        Plant(k, b, mu_s, mu_k, effects=VISCOUS), TapInput(v, mass, halts_at_separation=True)
    )
    breakaway = (mu_s * mass * G - b * v) / (k * v)
    forcing = np.array([v, mu_k * G + kv / mass * v])

    def contact(time: float, state: np.ndarray, damping: float) -> np.ndarray:
        # States: indentation and its rate; the part's velocity is v minus the latter.
        matrix = np.array([[0.0, 1.0], [-k / mass, -(damping + kv) / mass]])
        return propagate(matrix, np.array([0.0, forcing[1]]), state, time)

    start = np.array([v * breakaway, v])
    turn = brentq(lambda t: contact(t, start, b)[1], 1e-3, 0.012, xtol=1e-15)
    deepest = contact(turn, start, b)
    leave = brentq(lambda t: contact(t, deepest, 0.0)[0], 1e-3, 0.015, xtol=1e-15)
    speed = v - contact(leave, deepest, 0.0)[1]
    rate = kv / mass
    steady = mu_k * G / rate
    stop = math.log(1.0 + speed / steady) / rate
    distance = speed / rate - steady * stop
    grid = np.linspace(0.0, turn, 401)
    forces = [k * z[0] + b * max(z[1], 0.0) for z in (contact(t, start, b) for t in grid)]
    assert [event.kind for event in motion.events] == ["breakaway", "turn", "separation", "stop"]
    assert motion.breakaway_s == pytest.approx(breakaway, rel=1e-10)
    assert motion.separation_s == pytest.approx(breakaway + turn + leave, rel=1e-9)
    assert motion.stop_s == pytest.approx(breakaway + turn + leave + stop, rel=1e-9)
    assert motion.sliding_distance_m == pytest.approx(distance, rel=1e-8)
    assert motion.peak_force_n == pytest.approx(max(forces), rel=5e-6)


def test_reproduces_the_printed_equations() -> None:
    force_errors, distance_errors = [], []
    for mu_s in (0.15, 0.2, 0.25):
        for v in (3000.0, 4500.0, 6000.0):
            plant = Plant(6.5e5, 465.0, mu_s, 0.76 * mu_s, effects=VISCOUS)
            motion = simulate_tap(plant, TapInput(v * MM_PER_MIN, 18.9, halts_at_separation=True))
            force = 146.2 * mu_s + 0.0529 * v
            distance = 0.00041 * v**1.8997 + 0.07379 * v**1.6428 * (0.3415 - mu_s) ** 2
            force_errors.append(abs(motion.peak_force_n / force - 1.0))
            distance_errors.append(abs(motion.sliding_distance_m * 1e6 / distance - 1.0))
    assert max(force_errors) < 0.006
    assert np.mean(force_errors) < 0.0025
    assert max(distance_errors) < 0.015
    assert np.mean(distance_errors) < 0.008


@pytest.mark.parametrize("velocity", [500.0, 1000.0, 4000.0])
def test_energy_balance(velocity: float) -> None:
    mass, k = 18.9, 6.5e5
    motion = simulate_tap(PLANT, TapInput(velocity * MM_PER_MIN, mass, stroke_m=0.0015))
    edges = sorted({0.0, motion.end_s, *(event.time_s for event in motion.events)})
    work = heat = 0.0
    for begin, end in itertools.pairwise(edges):
        # Gauss-Legendre inside each phase: the integrands jump at its ends.
        nodes, weights = np.polynomial.legendre.leggauss(40)
        time = begin + 0.5 * (end - begin) * (nodes + 1.0)
        weight = 0.5 * (end - begin) * weights
        force, part = motion.contact_force_n(time), motion.velocity_m_s(time)
        step = (end - begin) * 1e-4
        feed = (motion.actuator_m(time + step) - motion.actuator_m(time - step)) / (2.0 * step)
        indentation = np.maximum(motion.actuator_m(time) - motion.position_m(time), 0.0)
        damper = force - k * indentation
        work += float(weight @ (force * feed))
        heat += float(weight @ (0.152 * mass * G * np.abs(part) + damper * (feed - part)))
    left = max(float(motion.actuator_m(np.array([9.0]))[0] - motion.displacement_m), 0.0)
    assert work == pytest.approx(heat + 0.5 * k * left**2, rel=1e-5)


def test_event_order_when_the_part_is_caught_and_pushed_again() -> None:
    motion = simulate_tap(PLANT, TapInput(1000 * MM_PER_MIN, 18.9, stroke_m=0.0015))
    kinds = [event.kind for event in motion.events]
    assert kinds == [
        *("breakaway", "turn", "separation", "contact", "turn"),
        *("separation", "contact", "turn", "halt", "separation", "stop"),
    ]
    times = [event.time_s for event in motion.events]
    assert times == sorted(times)
    assert motion.displacement_m > 0.0015
    assert motion.sliding_distance_m < motion.displacement_m


def test_stroke_ends_inside_the_contact() -> None:
    long = simulate_tap(PLANT, TapInput(6000 * MM_PER_MIN, 25.2, stroke_m=0.01)).sliding_distance_m
    short = simulate_tap(PLANT, TapInput(6000 * MM_PER_MIN, 25.2, stroke_m=0.0015)).sliding_distance_m
    assert 1.0 - short / long == pytest.approx(0.14, abs=0.02)


def test_breakaway_at_once_when_the_damper_alone_exceeds_static_friction() -> None:
    assert simulate_tap(PLANT, TapInput(5000 * MM_PER_MIN, 18.9, stroke_m=0.0015)).breakaway_s == 0.0
    assert simulate_tap(PLANT, TapInput(4500 * MM_PER_MIN, 18.9, stroke_m=0.0015)).breakaway_s > 0.0


def test_a_tap_too_short_moves_nothing() -> None:
    motion = simulate_tap(PLANT, TapInput(0.005, 18.9, stroke_m=2e-5))
    assert motion.displacement_m == 0.0
    assert math.isnan(motion.sliding_distance_m)
    assert motion.peak_force_n == pytest.approx(6.5e5 * 2e-5 + 465.0 * 0.005)
    # The halted actuator keeps pressing with its spring alone.
    assert motion.contact_force_n(np.array([1.0]))[0] == pytest.approx(13.0)


def test_the_other_direction_is_the_mirror_image() -> None:
    time = np.linspace(-0.001, 0.12, 300)
    forth = simulate_tap(PLANT, TapInput(0.06, 18.9, stroke_m=0.0015))
    back = simulate_tap(PLANT, TapInput(0.06, 18.9, stroke_m=0.0015, direction=-1))
    np.testing.assert_array_equal(forth.position_m(time), -back.position_m(time))
    np.testing.assert_array_equal(forth.actuator_m(time), -back.actuator_m(time))
    np.testing.assert_array_equal(forth.force_n(time), back.force_n(time))
    assert forth.displacement_m == back.displacement_m > 0.0


def test_samples_before_and_after() -> None:
    motion = simulate_tap(PLANT, TapInput(0.06, 18.9, stroke_m=0.0015))
    time = np.array([-1.0, 0.0, 1e-9, 50.0])
    np.testing.assert_allclose(motion.force_n(time), [0.0, 27.9, 27.9, 0.0], atol=1e-3)
    np.testing.assert_allclose(motion.position_m(time), [0.0, 0.0, 0.0, motion.displacement_m], atol=1e-12)
    np.testing.assert_allclose(motion.actuator_m(time), [0.0, 0.0, 6e-11, 0.0015], atol=1e-15)


def test_an_actuator_that_never_halts_is_refused() -> None:
    with pytest.raises(ValueError, match="halt at separation"):
        simulate_tap(PLANT, TapInput(0.06, 18.9))


@pytest.mark.slow
def test_a_slide_that_cannot_end_is_reported() -> None:
    downhill = Plant(6.5e5, 465.0, 0.02, 0.01, effects={"surface_tilt": {"tilt_rad": -0.2}})
    with pytest.raises(NeverAtRestError, match="still slides"):
        simulate_free_slide(downhill, 5.0, 0.1)


def test_free_slide_is_a_parabola() -> None:
    motion = simulate_free_slide(PLANT, 5.0, 0.2, Shot(direction=-1))
    stop = 0.2 / (0.152 * G)
    time = np.linspace(0.0, stop, 50)
    assert motion.stop_s == pytest.approx(stop, rel=1e-12)
    np.testing.assert_allclose(motion.position_m(time), -(0.2 * time - 0.5 * 0.152 * G * time**2), atol=1e-12)


def test_driven_part_sticks_then_accelerates() -> None:
    mass, ramp = 5.0, 100.0
    motion = simulate_driven(PLANT, mass, lambda t: -ramp * t, 0.4)
    breakaway = 0.2 * mass * G / ramp
    time = np.linspace(breakaway, 0.4, 50)
    late = time - breakaway
    expected = (0.2 - 0.152) * G * late**2 / 2.0 + ramp / mass * late**3 / 6.0
    assert motion.breakaway_s == pytest.approx(breakaway, rel=1e-10)
    np.testing.assert_allclose(motion.position_m(time), -expected, atol=1e-11)
    np.testing.assert_array_equal(motion.position_m(np.array([0.5 * breakaway])), [0.0])


def test_driven_part_reverses() -> None:
    motion = simulate_driven(PLANT, 5.0, lambda t: 30.0 * math.cos(2.0 * math.pi * t), 2.0)
    kinds = [event.kind for event in motion.events]
    assert kinds.count("stop") >= 3
    assert kinds.count("breakaway") >= 3
    velocity = motion.velocity_m_s(np.linspace(0.0, 2.0, 400))
    assert velocity.min() < -0.1
    assert velocity.max() > 0.1


def test_a_drive_that_peaks_briefly_breaks_a_resting_part_away() -> None:
    mass, peak = 5.0, 1.3

    def force(t: float) -> float:
        return 0.2 * mass * G * peak * math.exp(-(((t - 0.9) / 0.02) ** 2))

    motion = simulate_driven(PLANT, mass, force, 1.5)
    breakaway = 0.9 - 0.02 * math.sqrt(math.log(peak))
    assert motion.breakaway_s == pytest.approx(breakaway, rel=1e-8)
    assert motion.events[-1].kind == "stop"


@settings(max_examples=40, deadline=None)
@given(
    stiffness=st.floats(4e5, 9e5),
    damping=st.floats(100.0, 900.0),
    mu_s=st.floats(0.1, 0.3),
    ratio=st.floats(0.6, 1.0),
    mass=st.floats(5.0, 40.0),
    velocity=st.floats(0.005, 0.12),
    stroke=st.floats(1e-4, 2e-3),
    viscous=st.sampled_from([0.0, 85.0, 300.0]),
)
def test_closed_form_and_integrator_agree(
    stiffness: float,
    damping: float,
    mu_s: float,
    ratio: float,
    mass: float,
    velocity: float,
    stroke: float,
    viscous: float,
) -> None:
    effects = {"viscous_friction": {"viscous_coefficient_n_s_per_m": viscous}} if viscous else {}
    plant = Plant(stiffness, damping, mu_s, mu_s * ratio, effects=effects)
    motion = simulate_tap(plant, TapInput(velocity, mass, stroke))
    fast = nominal_taps(stiffness, damping, mu_s, mu_s * ratio, mass, velocity, stroke, viscous)
    assert fast.displacement_m[0] == pytest.approx(motion.displacement_m, rel=1e-8, abs=1e-11)
    assert fast.peak_force_n[0] == pytest.approx(motion.peak_force_n, rel=1e-8)
    if not math.isnan(motion.sliding_distance_m):
        # A contact that only just opens may be one to the one and none to the other.
        assert fast.sliding_distance_m[0] == pytest.approx(motion.sliding_distance_m, rel=1e-6, abs=2e-9)


def test_closed_form_refuses_what_it_cannot_do() -> None:
    good = (6.5e5, 465.0, 0.2, 0.152, 18.9, 0.05, 0.0015)
    assert nominal_taps(*good).displacement_m.shape == (1,)
    with pytest.raises(ValueError, match="overdamped"):
        nominal_taps(6.5e5, 1e4, *good[2:])
    with pytest.raises(ValueError, match="mass has to be positive"):
        nominal_taps(*good[:4], [1.0, 0.0], *good[5:])
    with pytest.raises(ValueError, match="halt at separation"):
        nominal_taps(*good[:6], math.inf)
    free = nominal_taps(*good[:6], math.inf, halts_at_separation=True)
    strike = TapInput(0.05, 18.9, halts_at_separation=True)
    assert free.sliding_distance_m[0] == pytest.approx(
        simulate_tap(PLANT, strike).sliding_distance_m, rel=1e-8
    )


def test_stribeck_slide_against_quadrature() -> None:
    effects = {"stribeck_friction": {"friction_increase": 0.03, "stribeck_velocity_m_s": 0.04}}
    motion = simulate_free_slide(Plant(6.5e5, 465.0, 0.2, 0.152, effects=effects), 5.0, 0.2)

    def friction(v: float) -> float:
        return (0.152 + 0.03 * math.exp(-((v / 0.04) ** 2))) * G

    distance = quad(lambda v: v / friction(v), 0.0, 0.2, epsabs=1e-14)[0]
    assert motion.displacement_m == pytest.approx(distance, rel=1e-8)
    assert motion.stop_s == pytest.approx(quad(lambda v: 1.0 / friction(v), 0.0, 0.2)[0], rel=1e-9)
