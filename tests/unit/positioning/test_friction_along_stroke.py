"""Friction along the stroke: what is slid where it varies, and what noise must not teach."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.errors import PositioningError
from impactcell.physics.linear_slide import along_profile
from impactcell.positioning.friction_along_stroke import StrokeFriction, update_stroke_friction

GRID = np.linspace(0.0, 12e-3, 121)


def rho(x: float | np.ndarray) -> np.ndarray:
    return 1.0 + 0.2 * np.sin(2.0 * np.pi * np.asarray(x) / 8e-3)


def taught(signatures: int, noise: float) -> StrokeFriction:
    rng, known = np.random.default_rng(1), None
    for _ in range(signatures):
        friction = 0.15 * (rho(GRID) + noise * rng.standard_normal(GRID.size))
        known = update_stroke_friction(known, GRID, friction, np.full(GRID.size, 0.15 * max(noise, 1e-3)))
    assert known is not None
    return known


@pytest.mark.parametrize("speed", [0.05, 0.1, 0.15])
def test_slide_over_varying_friction_against_an_integrator(speed: float) -> None:
    profile = taught(6, 0.002)
    mean = float(np.mean(rho(GRID)))

    def rate(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -0.15 * 9.81 * float(rho(state[0]))]

    def rest(_: float, state: np.ndarray) -> float:
        return float(state[1])

    rest.terminal = True  # type: ignore[attr-defined]
    truth = solve_ivp(rate, (0.0, 1.0), [0.0, speed], events=rest, rtol=1e-10, atol=1e-13).y[0, -1]
    at_mean = speed**2 / (2.0 * 0.15 * mean * 9.81)
    part = np.concatenate([[10.0, 9.81], profile.warp()])
    assert along_profile(at_mean, part) == pytest.approx(truth, rel=0.01)
    assert abs(at_mean / truth - 1.0) > 0.01  # it matters


def test_even_friction_changes_nothing() -> None:
    known = update_stroke_friction(None, GRID, np.full(GRID.size, 0.2), np.full(GRID.size, 1e-3))
    assert known is not None
    part = np.concatenate([[10.0, 9.81], known.warp()])
    for distance in (1e-4, 3e-3, 11e-3, 40e-3):
        assert along_profile(distance, part) == pytest.approx(distance, rel=1e-9)


def test_noise_is_not_taken_for_structure() -> None:
    rng = np.random.default_rng(2)
    noisy = update_stroke_friction(
        None, GRID, 0.2 * (1.0 + 0.2 * rng.standard_normal(GRID.size)), np.full(GRID.size, 0.04)
    )
    assert noisy is not None
    part = np.concatenate([[10.0, 9.81], noisy.warp()])
    assert along_profile(8e-3, part) == pytest.approx(8e-3, rel=0.01)


def test_a_part_that_went_less_far_says_nothing_of_the_rest() -> None:
    friction = np.where(GRID < 6e-3, 0.15 * rho(GRID), np.nan)
    known = update_stroke_friction(taught(3, 0.002), GRID, friction, np.full(GRID.size, 1e-3))
    assert known is not None
    np.testing.assert_allclose(known.ratio[GRID > 7e-3], rho(GRID)[GRID > 7e-3] / rho(GRID).mean(), rtol=0.01)
    assert update_stroke_friction(None, GRID, np.full(GRID.size, np.nan), friction) is None


def test_refuses_arrays_that_do_not_belong_together() -> None:
    with pytest.raises(PositioningError, match="length"):
        update_stroke_friction(None, GRID, GRID[:-1], GRID)
    with pytest.raises(PositioningError, match="increase"):
        update_stroke_friction(None, GRID[::-1], GRID + 0.1, GRID + 0.1)
