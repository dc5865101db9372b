"""Cost to go against cases with a known answer, and against simulated play."""

import math

import numpy as np
import pytest

from impactcell.positioning.dynamic_programming import (
    Goal,
    ValueFunction,
    expected_cost,
    interpolate_value,
    solve_value_function,
)
from impactcell.positioning.quadrature import COARSE_Z as Z
from impactcell.positioning.quadrature import quadrature


def table_of(displacements: np.ndarray, spread: float) -> np.ndarray:
    """One velocity, displacement growing with stroke, normal about it with relative deviation `spread`."""
    return (displacements[None, :, None] * (1.0 - spread * Z[None, None, :])).astype(float)


def cost_at(value: object, r: float) -> float:
    return interpolate_value(value.step_m, value.cost, value.cost.size, r)  # type: ignore[attr-defined]


def test_probabilities_between_nodes_add_up() -> None:
    mass = quadrature(Z).probability
    assert mass.sum() == pytest.approx(1.0)
    assert mass[3] == pytest.approx(0.5 * math.erf(0.85 / math.sqrt(2.0)), rel=1e-9)


def test_without_scatter_the_number_of_taps_is_a_quotient_rounded_up() -> None:
    value = solve_value_function(
        table_of(np.linspace(1e-6, 1e-3, 400), 1e-9), quadrature(Z), Goal(10e-6, 100.0)
    )
    for distance, taps in ((0.5e-3, 1), (0.95e-3, 1), (1.4e-3, 2), (1.85e-3, 2), (2.5e-3, 3), (4.5e-3, 5)):
        assert cost_at(value, distance) == pytest.approx(taps, abs=1e-6)
    assert value.overshoot.max() < 1e-9


def test_cost_of_scatter_against_simulated_play() -> None:
    # the policy that aims at r - c in one family of taps; its play must cost no less than the optimum
    spread, tolerance, penalty, furthest = 0.05, 50e-6, 100.0, 2e-3
    value = solve_value_function(
        table_of(np.geomspace(2e-5, furthest, 500), spread), quadrature(Z), Goal(tolerance, penalty)
    )
    rng = np.random.default_rng(1)
    best = math.inf
    for margin in (1.5, 2.0, 2.5, 3.0):
        costs = []
        for _ in range(3000):
            r, cost = 5e-3, 0.0
            while r > tolerance:
                aim = min((r + tolerance) / (1.0 + margin * spread), furthest)
                r -= aim * (1.0 + spread * rng.standard_normal())
                cost += 1.0
            costs.append(cost + (penalty if r < -tolerance else 0.0))
        best = min(best, float(np.mean(costs)))
    assert cost_at(value, 5e-3) <= best * 1.02
    assert cost_at(value, 5e-3) >= 3.0  # two taps reach 4 mm


def test_overshoot_of_one_tap_is_the_tail_of_its_distribution() -> None:
    moved = 1e-3 * (1.0 - 0.1 * Z)
    cost, overshoot = np.zeros(200), np.zeros(200)
    for remaining in (0.95e-3, 1.0e-3, 1.13e-3):
        _, risk = expected_cost(
            remaining,
            moved,
            quadrature(Z),
            Goal(20e-6, 10.0),
            ValueFunction(10e-6, cost, overshoot),
            200,
            math.inf,
        )
        tail = 0.5 * math.erfc((remaining + 20e-6 - 1e-3) / 1e-4 / math.sqrt(2.0))
        assert risk == pytest.approx(tail, rel=1e-6)


def test_a_bound_that_is_passed_is_infinite() -> None:
    moved = np.full(Z.size, 1e-3)
    cost = np.full(1000, 5.0)
    answer = expected_cost(
        3e-3, moved, quadrature(Z), Goal(20e-6, 10.0), ValueFunction(10e-6, cost, np.zeros(1000)), 1000, 2.0
    )
    assert answer == (math.inf, 1.0)


def test_more_caution_overshoots_less_and_costs_more_taps() -> None:
    table = table_of(np.geomspace(2e-5, 5e-3, 300), 0.05)
    bold, careful = (
        solve_value_function(table, quadrature(Z), Goal(50e-6, penalty)) for penalty in (10.0, 3000.0)
    )
    assert careful.overshoot.mean() < 0.1 * bold.overshoot.mean()
    count = slice(200, None)
    taps = [(v.cost - p * v.overshoot)[count].mean() for v, p in ((bold, 10.0), (careful, 3000.0))]
    assert taps[1] > taps[0]
