"""What effects do to a free part, against the laws themselves and against motion."""

import numpy as np
import pytest

from impactcell.physics import Plant, TapInput, free_motion, simulate_free_slide
from impactcell.physics.effect import LawKind
from impactcell.physics.effects import LIBRARY
from impactcell.records import Capture

NOMINAL = (6.5e5, 465.0, 0.2, 0.15)


@pytest.mark.parametrize("k_v", [0.0, 0.1, 85.0, 85.1])
def test_viscous_friction_is_its_own_resistance(k_v: float) -> None:
    plant = Plant(*NOMINAL, effects={"viscous_friction": {"viscous_coefficient_n_s_per_m": k_v}})
    assert free_motion.linear_resistance(plant) == k_v


def test_drag_resists_as_at_the_chord() -> None:
    effects = {"quadratic_drag": {"drag_coefficient_n_s2_per_m2": 40.0}, "surface_tilt": {"tilt_rad": 0.01}}
    assert free_motion.linear_resistance(Plant(*NOMINAL, effects=effects)) == pytest.approx(40.0 / 16.0)


def test_no_effect_resists_nothing() -> None:
    assert free_motion.linear_resistance(Plant(*NOMINAL)) == 0.0


@pytest.mark.parametrize("direction", [1, -1])
def test_acceleration_is_that_of_the_motion(direction: int) -> None:
    effects = {
        "viscous_friction": {"viscous_coefficient_n_s_per_m": 60.0},
        "surface_tilt": {"tilt_rad": 0.01},
        "stribeck_friction": {"friction_increase": 0.02, "stribeck_velocity_m_s": 0.05},
    }
    plant, tap = Plant(*NOMINAL, effects=effects), TapInput(0.05, 20.0, direction=direction)
    time = np.linspace(0.001, 0.03, 30)
    speed = direction * simulate_free_slide(plant, tap, 0.12).sample(time).velocity_m_s
    measured = np.gradient(speed, time, edge_order=2)[1:-1]
    own = free_motion.acceleration(plant, tap, speed)[1:-1]
    np.testing.assert_allclose(measured, own - 0.15 * plant.gravity_m_s2, rtol=2e-4)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("identifier", [name for name in LIBRARY if free_motion.acts_on_speed(name)])
def test_acceleration_is_the_law_in_python_to_the_bit(identifier: str, direction: int) -> None:
    effect = LIBRARY[identifier]
    given = {parameter.name: parameter.typical for parameter in effect.parameters}
    plant = Plant(*NOMINAL, effects={identifier: given})
    tap = TapInput(1.0, 19.3, direction=direction, start_m=0.0123)
    speed = np.linspace(0.0, 0.2, 50)
    flat, expected, g = list(given.values()), np.zeros(50), plant.gravity_m_s2
    if (body := effect.laws.get(LawKind.BODY)) is not None:
        expected += [direction * body(0.0123, direction * v, 19.3, g, flat) / 19.3 for v in speed.tolist()]
    if (kinetic := effect.laws.get(LawKind.KINETIC)) is not None:
        expected -= [g * kinetic(v, 0.0, 0.0, 0.0, flat) for v in speed.tolist()]
    np.testing.assert_array_equal(free_motion.acceleration(plant, tap, speed), expected)


@pytest.mark.parametrize("identifier", list(LIBRARY))
def test_what_depends_on_mass_moves_a_heavy_part_less(identifier: str) -> None:
    given = {parameter.name: parameter.typical for parameter in LIBRARY[identifier].parameters}
    plant = Plant(*NOMINAL, effects={identifier: given})
    depends = free_motion.depends_on_mass(identifier)
    if not free_motion.acts_on_speed(identifier):
        assert not depends
        return
    taps = [TapInput(1.0, mass_kg, start_m=0.0123) for mass_kg in (5.0, 40.0)]
    light, heavy = (free_motion.acceleration(plant, tap, np.array([0.2]))[0] for tap in taps)
    assert (abs(light) > 2.0 * abs(heavy)) == depends


def test_an_unknown_mass_leaves_the_tilt_and_no_force() -> None:
    tilt, viscous = {"tilt_rad": 0.01}, {"viscous_coefficient_n_s_per_m": 60.0}
    both = Plant(*NOMINAL, effects={"surface_tilt": tilt, "viscous_friction": viscous})
    one, speed = Plant(*NOMINAL, effects={"surface_tilt": tilt}), np.linspace(0.0, 0.2, 5)
    unknown = Capture(1, 0.05, float("nan"), None, None)
    given = free_motion.model_acceleration(both, unknown)
    assert given is not None
    expected = free_motion.acceleration(one, TapInput(0.05, 7.0), speed)
    np.testing.assert_allclose(given(speed), expected, rtol=1e-14)
    assert (
        free_motion.model_acceleration(Plant(*NOMINAL, effects={"viscous_friction": viscous}), unknown)
        is None
    )
