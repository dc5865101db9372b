"""Each effect against its law in closed form, at its null value, and on what it may act."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from impactcell.physics.effects import LIBRARY as PRODUCT
from simulator.effects import LIBRARY, UNLISTED, build
from simulator.plant import Motion, Plant, Shot, TapInput, simulate_free_slide, simulate_tap

G = 9.81
PLANT = Plant(6.5e5, 465.0, 0.2, 0.152)
STRIKE = TapInput(0.06, 18.9, stroke_m=0.0015, start_m=0.002, dwell_s=20.0, shot=3, shots=10, batch=1)
TIME = np.arange(1, 1200) * 1e-4


def null_of(identifier: str) -> dict[str, float | tuple[float, ...]]:
    """Values at which an effect vanishes, as the product's library has them; large for those without end."""
    values: dict[str, float | tuple[float, ...]] = {}
    for parameter in PRODUCT[identifier].parameters:
        null = parameter.typical if math.isnan(parameter.null) else min(parameter.null, 1e12)
        values[parameter.name] = (null,) if parameter.per_batch else null
    return values


def struck(effects: dict[str, dict[str, object]], strike: TapInput = STRIKE) -> Motion:
    return simulate_tap(replace(PLANT, effects=effects), strike)


def slid(name: str, speed: float = 0.15, shot: Shot | None = None, **parameters: float) -> Motion:
    return simulate_free_slide(replace(PLANT, effects={name: parameters}), 18.9, speed, shot)


def test_every_effect_of_the_product_and_nothing_else() -> None:
    assert {name: set(effect.defaults) for name, effect in LIBRARY.items()} == {
        name: {parameter.name for parameter in effect.parameters} for name, effect in PRODUCT.items()
    }
    assert len(UNLISTED) >= 6
    assert not set(UNLISTED) & set(PRODUCT)


@pytest.mark.parametrize("name", sorted(PRODUCT))
def test_vanishes_at_its_null_value(name: str) -> None:
    null = null_of(name)
    # The damper's first jolt b v makes elastic stick ring at any stiffness: without b the limit is rigid.
    elastic = name == "presliding_compliance"
    plant = replace(PLANT, damping_n_s_per_m=0.0) if elastic else PLANT
    nominal, motion = simulate_tap(plant, STRIKE), simulate_tap(replace(plant, effects={name: null}), STRIKE)
    tolerance = 3e-4 if elastic else 1e-9
    assert motion.sliding_distance_m == pytest.approx(nominal.sliding_distance_m, rel=tolerance)
    assert motion.peak_force_n == pytest.approx(nominal.peak_force_n, rel=tolerance)
    np.testing.assert_allclose(motion.position_m(TIME), nominal.position_m(TIME), atol=0.01 * tolerance)
    np.testing.assert_allclose(motion.force_n(TIME), nominal.force_n(TIME), atol=300.0 * max(tolerance, 1e-8))


@pytest.mark.parametrize("name", sorted([*LIBRARY, *UNLISTED]))
def test_shows_at_its_default_strength(name: str) -> None:
    defaults = dict((LIBRARY.get(name) or UNLISTED[name]).defaults)
    # Stiction shows in slow taps only, saturation in fast ones.
    velocity = 0.035 if name == "stiction_ageing" else 0.06
    strike = replace(STRIKE, mass_kg=25.2, velocity_m_s=velocity, start_m=0.0)
    nominal, motion = struck({}, strike), struck({name: defaults}, strike)
    force = np.abs(motion.force_n(TIME) - nominal.force_n(TIME)).max()
    position = np.abs(motion.position_m(TIME) - nominal.position_m(TIME)).max()
    assert force > 0.8 or position > 3e-6


@pytest.mark.parametrize(
    "name", [name for name in sorted(PRODUCT) if name.startswith(("force_s", "channel"))]
)
def test_sensors_move_nothing(name: str) -> None:
    motion = struck({name: dict(LIBRARY[name].defaults)})
    np.testing.assert_allclose(motion.position_m(TIME), struck({}).position_m(TIME), atol=1e-12)


def test_all_at_once() -> None:
    effects = {name: dict(kind.defaults) for name, kind in LIBRARY.items()}
    motion = struck(effects)
    assert np.isfinite(motion.force_n(TIME)).all()
    assert motion.displacement_m > 0.0


def test_viscous_slide() -> None:
    motion = slid("viscous_friction", viscous_coefficient_n_s_per_m=60.0)
    rate, steady = 60.0 / 18.9, 0.152 * G * 18.9 / 60.0
    stop = math.log1p(0.15 / steady) / rate
    assert motion.stop_s == pytest.approx(stop, rel=1e-10)
    assert motion.displacement_m == pytest.approx(0.15 / rate - steady * stop, rel=1e-9)


def test_quadratic_slide() -> None:
    motion = slid("quadratic_drag", drag_coefficient_n_s2_per_m2=250.0)
    expected = 18.9 / 500.0 * math.log1p(250.0 * 0.15**2 / (0.152 * 18.9 * G))
    assert motion.displacement_m == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("direction", [1, -1])
def test_tilted_slide(direction: int) -> None:
    motion = slid("surface_tilt", shot=Shot(direction=direction), tilt_rad=0.02)
    expected = 0.15**2 / (2.0 * G * (0.152 + direction * math.sin(0.02)))
    assert motion.displacement_m == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("direction", [1, -1])
def test_restored_slide(direction: int) -> None:
    start, k_r, mass = 0.01, 300.0, 18.9
    motion = slid("restoring_force", shot=Shot(direction=direction, start_m=start), stiffness_n_per_m=k_r)
    # Kinetic energy goes into friction and the spring: m v²/2 = mu m g s + k_r ((x_0 ± s)² - x_0²)/2.
    s = brentq(
        lambda s: (
            0.152 * mass * G * s
            + 0.5 * k_r * ((start + direction * s) ** 2 - start**2)
            - 0.5 * mass * 0.15**2
        ),
        0.0,
        0.05,
        xtol=1e-15,
    )
    assert motion.displacement_m == pytest.approx(s, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "parameters", "factor"),
    [
        ("position_dependent_friction", {"gradient_per_m": 20.0}, lambda x: 1.0 + 20.0 * x),
        (
            "periodic_friction",
            {"amplitude": 0.3, "period_m": 0.0013, "phase_rad": 0.7},
            lambda x: 1.0 + 0.3 * math.sin(2.0 * math.pi * x / 0.0013 + 0.7),
        ),
        (
            "friction_patch",
            {"amplitude": 0.4, "position_m": 0.005, "width_m": 0.0006},
            lambda x: 1.0 + 0.4 * math.exp(-((x - 0.005) ** 2) / (2.0 * 0.0006**2)),
        ),
    ],
)
@pytest.mark.parametrize("direction", [1, -1])
def test_friction_along_the_table(
    name: str, parameters: dict[str, float], factor: object, direction: int
) -> None:
    assert callable(factor)
    start = 0.003 if direction == 1 else 0.008
    motion = slid(name, shot=Shot(direction=direction, start_m=start), **parameters)

    def surplus(s: float) -> float:
        work = quad(lambda u: factor(start + direction * u), 0.0, s, epsabs=1e-13, limit=200)[0]
        return 0.152 * G * work - 0.5 * 0.15**2

    assert motion.displacement_m == pytest.approx(brentq(surplus, 0.0, 0.03, xtol=1e-14), rel=1e-8)


def test_hertz_force_at_known_indentation() -> None:
    motion = struck({"hertz_contact": {"exponent": 1.2}}, replace(STRIKE, velocity_m_s=0.001, stroke_m=3e-5))
    assert motion.displacement_m == 0.0
    assert motion.contact_force_n(np.array([9.0]))[0] == pytest.approx(6.5e5 * 3e-5**1.2, rel=1e-12)


def test_hunt_crossley_acts_on_departure_too() -> None:
    motion = struck({"hunt_crossley_damping": {"damping_n_s_per_m2": 6e5}})
    turn, leave = (next(e.time_s for e in motion.events if e.kind == kind) for kind in ("turn", "separation"))
    time = np.linspace(turn, leave, 20)[1:-1]
    d = motion.actuator_m(time) - motion.position_m(time)
    rate = 0.06 - motion.velocity_m_s(time)
    np.testing.assert_allclose(motion.contact_force_n(time), 6.5e5 * d + 6e5 * d * rate, rtol=1e-7)


def test_droop_follows_its_equation() -> None:
    c, tau = 2e-5, 0.003
    motion = struck({"actuator_droop": {"speed_loss_m_per_s_n": c, "time_constant_s": tau}})
    time = np.linspace(0.001, 0.006, 6)
    for t in time:
        memory = quad(
            lambda s, t=t: math.exp(-(t - s) / tau) * c / tau * motion.contact_force_n(np.array([s]))[0],
            0.0,
            t,
            points=[motion.breakaway_s],
        )[0]
        step = 1e-6
        ends = motion.actuator_m(np.array([t - step, t + step]))
        assert (ends[1] - ends[0]) / (2.0 * step) == pytest.approx(0.06 - memory, rel=1e-5)


def test_droop_without_lag_is_the_limit_of_a_short_one() -> None:
    at_once = struck({"actuator_droop": {"speed_loss_m_per_s_n": 2e-5, "time_constant_s": 0.0}})
    short = struck({"actuator_droop": {"speed_loss_m_per_s_n": 2e-5, "time_constant_s": 1e-5}})
    assert at_once.sliding_distance_m == pytest.approx(short.sliding_distance_m, rel=1e-3)


def test_ramp_travels_half_as_far_meanwhile() -> None:
    motion = struck({"actuator_ramp": {"ramp_time_s": 0.004}})
    expected = [0.06 * 0.002**2 / 0.008, 0.06 * 0.002, 0.06 * 0.002 + 0.06 * 0.002]
    np.testing.assert_allclose(motion.actuator_m(np.array([0.002, 0.004, 0.006])), expected, rtol=1e-12)


def test_adhesion_takes_its_work_from_the_slide() -> None:
    # An actuator that halts at separation leaves the whole gap to be pulled open: A l/2 of work.
    strike = TapInput(0.06, 18.9, halts_at_separation=True)
    with_pull, without = struck({"adhesion": {"force_n": 15.0, "range_m": 3e-4}}, strike), struck({}, strike)
    lost = 0.5 * 15.0 * 3e-4
    expected = without.sliding_distance_m - lost / (0.152 * 18.9 * G)
    assert with_pull.sliding_distance_m == pytest.approx(expected, rel=1e-7)
    assert with_pull.contact_force_n(np.array([with_pull.separation_s + 1e-6]))[0] == pytest.approx(
        -15.0, rel=0.01
    )


def test_presliding_breaks_away_at_its_limit() -> None:
    s0 = 3e6
    motion = struck({"presliding_compliance": {"stiffness_n_per_m": s0}})
    moved = motion.position_m(np.array([motion.breakaway_s]))[0]
    assert moved == pytest.approx(0.2 * 18.9 * G / s0, rel=1e-9)


def test_presliding_before_breakaway_is_an_oscillator() -> None:
    k, b, s0, m, v = 6.5e5, 465.0, 3e6, 18.9, 0.01
    motion = struck({"presliding_compliance": {"stiffness_n_per_m": s0}}, replace(STRIKE, velocity_m_s=v))
    # m x'' = k (v t - x) + b (v - x') - s0 x: a particular line plus a damped oscillation from rest.
    slope = k * v / (k + s0)
    offset = (b * v - b * slope) / (k + s0)
    gamma = b / (2.0 * m)
    omega = math.sqrt((k + s0) / m - gamma**2)
    time = np.linspace(0.0, 0.004, 30)
    sine = (-slope - gamma * offset) / omega
    wave = np.exp(-gamma * time) * (-offset * np.cos(omega * time) + sine * np.sin(omega * time))
    np.testing.assert_allclose(motion.position_m(time), slope * time + offset + wave, atol=1e-13)


def test_mass_error_is_another_mass() -> None:
    motion = struck({"mass_error": {"relative_error": 0.1}})
    assert motion.displacement_m == struck({}, replace(STRIKE, mass_kg=18.9 * 1.1)).displacement_m


def test_loose_mass_shares_the_momentum() -> None:
    # By the time the part stops the loose mass rings no more: contact and friction share out all momentum.
    effects = {"loose_mass": {"mass_kg": 2.0, "stiffness_n_per_m": 2e5, "damping_n_s_per_m": 60.0}}
    motion = simulate_tap(
        Plant(6.5e5, 465.0, 0.02, 0.02, effects=effects), TapInput(0.06, 10.0, halts_at_separation=True)
    )
    turns = [event.time_s for event in motion.events if event.time_s < motion.separation_s]
    impulse = 0.0
    nodes, weights = np.polynomial.legendre.leggauss(60)
    for begin, end in itertools.pairwise(sorted({0.0, *turns, motion.separation_s})):
        time = begin + 0.5 * (end - begin) * (nodes + 1.0)
        impulse += 0.5 * (end - begin) * float(weights @ motion.contact_force_n(time))
    friction = 0.02 * 10.0 * G * (motion.stop_s - motion.breakaway_s)
    assert impulse == pytest.approx(friction, rel=1e-4)
    solid = simulate_tap(Plant(6.5e5, 465.0, 0.02, 0.02), TapInput(0.06, 10.0, halts_at_separation=True))
    assert abs(motion.peak_force_n / solid.peak_force_n - 1.0) > 0.001


def test_unknown_effects_and_parameters_are_refused() -> None:
    with pytest.raises(ValueError, match="unknown effect 'wind'"):
        build({"wind": {}})
    with pytest.raises(ValueError, match="viscous_friction has no parameter 'k_v'"):
        build({"viscous_friction": {"k_v": 1.0}})
    with pytest.raises(ValueError, match="needs its parameter range_m"):
        build({"adhesion": {"force_n": 1.0}})
    with pytest.raises(ValueError, match="period_m has to be above 0"):
        build({"periodic_friction": {"amplitude": 0.1, "period_m": 0.0, "phase_rad": 0.0}})
    with pytest.raises(ValueError, match="one number a batch"):
        build({"batch_shift": {"relative_change": 0.1}})
    with pytest.raises(ValueError, match="has to be one number"):
        build({"surface_tilt": {"tilt_rad": [0.1]}})
