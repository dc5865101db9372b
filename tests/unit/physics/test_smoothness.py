"""An objective over samples is smooth in the parameters while the sequence of events stays the same."""

import numpy as np
import pytest

from impactcell.physics import Ensemble, Plant, TapInput, simulate_tap

TIMES = np.arange(1, 1201) * 1e-4 + 1.3e-5
STEPS = (1e-4, 1e-5, 1e-6)


def objective(ensemble: Ensemble, target: np.ndarray, theta: np.ndarray) -> float:
    made = ensemble.traces(theta)
    miss = np.concatenate([made.force_n / 0.4, made.position_m / 1.5e-6]) - target
    return float(miss @ miss)


def problem(velocities: tuple[float, ...]) -> tuple[Ensemble, np.ndarray, np.ndarray]:
    taps = [TapInput(v, m, 1.5e-3) for v in velocities for m in (12.6, 25.2)]
    times = [TIMES] * len(taps)
    ensemble = Ensemble(taps, ["viscous_friction"], force_time_s=times, position_time_s=times)
    theta = np.array([6.5e5, 465.0, 0.2, 0.152, 85.0])
    away = ensemble.traces(theta * 1.02)
    return ensemble, np.concatenate([away.force_n / 0.4, away.position_m / 1.5e-6]), theta


@pytest.mark.parametrize("velocities", [(0.1,), (0.05, 0.08), (0.025, 0.035)])
def test_gradients_converge_down_to_steps_of_a_millionth(velocities: tuple[float, ...]) -> None:
    ensemble, target, theta = problem(velocities)
    gradients = []
    for step in STEPS:
        ends = [theta * (1.0 + sign * step * np.eye(5)[j]) for j in range(5) for sign in (1.0, -1.0)]
        values = np.array([objective(ensemble, target, end) for end in ends]).reshape(5, 2)
        gradients.append((values[:, 0] - values[:, 1]) / (2.0 * step))
    scale = np.abs(gradients[1]).max()
    assert np.abs(gradients[0] - gradients[1]).max() < 1e-5 * scale
    assert np.abs(gradients[2] - gradients[1]).max() < 1e-6 * scale


def test_gradients_are_one_sided_where_the_damper_alone_breaks_stick() -> None:
    # At b v = mu_s m g the part begins to move at once, and mu_s is seen no more.
    mass, velocity = 12.6, 0.05
    edge = 0.2 * mass * 9.81 / velocity
    ensemble = Ensemble([TapInput(velocity, mass, 1.5e-3)], position_time_s=[TIMES])

    def slope(damping: float, step: float) -> np.ndarray:
        ends = [
            ensemble.traces(np.array([6.5e5, damping, 0.2 * (1.0 + change), 0.152])).position_m
            for change in (step, -step)
        ]
        return (ends[0] - ends[1]) / (2.0 * step)

    below = [slope(edge * 0.999, step) for step in (1e-5, 1e-6)]
    above = slope(edge * 1.001, 1e-6)
    np.testing.assert_array_equal(above, 0.0)
    np.testing.assert_allclose(below[1], below[0], rtol=0.0, atol=1e-4 * np.abs(below[0]).max())
    assert np.abs(below[1]).max() > 1e-5


def test_noise_of_a_figure_along_a_parameter_is_rounding() -> None:
    tap = TapInput(0.05, 18.9, 1.5e-3)
    line = np.linspace(-1e-6, 1e-6, 41)
    plants = [Plant(6.5e5 * (1.0 + change), 465.0, 0.2, 0.152) for change in line]
    moved = np.array([simulate_tap(plant, tap).displacement_m for plant in plants])
    left = moved - np.polynomial.Polynomial.fit(line, moved, 2)(line)
    assert np.abs(left).max() < 2e-12 * moved.mean()
