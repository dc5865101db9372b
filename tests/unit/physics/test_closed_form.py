"""Displacements against the simulator's own plant, closed form and adaptive, and against the physics."""

import math

import numpy as np
import pytest

from impactcell.physics import Plant, TapInput, simulate_tap
from impactcell.physics.closed_form import displacement_of, displacements
from impactcell.physics.linear_slide import narrowed
from impactcell.positioning.safety_limits import allowed_strokes, largest_force
from simulator.plant import Plant as TruePlant
from simulator.plant import TapInput as TrueStrike
from simulator.plant import simulate_tap as true_tap
from simulator.plant_nominal import nominal_taps


def drawn(count: int, seed: int) -> np.ndarray:
    """Columns k, b, mu_s, mu_k, k_v, mass, velocity, stroke over far more than the range of a cell."""
    rng = np.random.default_rng(seed)

    def spread(low: float, high: float) -> np.ndarray:
        return np.exp(rng.uniform(math.log(low), math.log(high), count))

    mu_s = spread(0.08, 0.4)
    return np.column_stack(
        [
            spread(4e5, 1.1e6), spread(100.0, 900.0), mu_s, mu_s * rng.uniform(0.6, 1.0, count),
            rng.choice([0.0, 0.5, 10.0, 85.0], count), spread(3.0, 60.0), spread(0.004, 0.15),
            spread(1e-5, 3e-3),
        ]
    )  # fmt: skip


def of(row: np.ndarray, stroke: float | None = None) -> float:
    plant, (mass, velocity, end) = row[:5], row[5:]
    strokes, part = np.array([end if stroke is None else stroke]), np.array([mass, 9.81])
    moved = displacement_of(velocity, strokes, plant[None], np.ones(1), part)
    return float(moved[0])


def test_agrees_with_the_simulators_closed_form() -> None:
    rows = drawn(4000, 1)
    k, b, mu_s, mu_k, viscous, mass, velocity, stroke = rows.T
    truth = nominal_taps(k, b, mu_s, mu_k, mass, velocity, stroke, viscous).displacement_m
    mine = np.array([of(row) for row in rows])
    np.testing.assert_allclose(mine, truth, rtol=1e-9, atol=1e-12)


def test_a_part_whose_static_friction_is_its_kinetic_one_is_pushed_like_any_other() -> None:
    """It breaks away without any acceleration: rounding took a fifth of these for parts that stop at once."""
    rows = drawn(1000, 5)
    rows[:, 3] = rows[:, 2]
    k, b, mu_s, mu_k, viscous, mass, velocity, stroke = rows.T
    truth = nominal_taps(k, b, mu_s, mu_k, mass, velocity, stroke, viscous).displacement_m
    mine = np.array([of(row) for row in rows])
    np.testing.assert_allclose(mine, truth, rtol=1e-9, atol=1e-12)


def test_agrees_with_the_simulators_integrator() -> None:
    rows = drawn(40, 2)
    rows = rows[rows[:, 6] > 0.02][:12]
    for row in rows:
        plant = TruePlant(
            row[0], row[1], row[2], row[3],
            effects={"viscous_friction": {"viscous_coefficient_n_s_per_m": float(row[4])}},
        )  # fmt: skip
        truth = true_tap(plant, TrueStrike(row[6], row[5], row[7])).displacement_m
        assert of(row) == pytest.approx(truth, rel=1e-6, abs=1e-9)


def test_agrees_with_the_physics() -> None:
    for row in drawn(25, 3):
        plant = Plant(
            row[0], row[1], row[2], row[3],
            effects={"viscous_friction": {"viscous_coefficient_n_s_per_m": float(row[4])}},
        )  # fmt: skip
        truth = simulate_tap(plant, TapInput(row[6], row[5], stroke_m=row[7])).displacement_m
        assert of(row) == pytest.approx(truth, rel=1e-6, abs=1e-9)


def test_one_course_answers_for_every_stroke() -> None:
    strokes = np.linspace(1e-5, 1.5e-3, 200)
    for row in drawn(30, 4):
        together = np.empty(strokes.size)
        displacements(row[6], strokes, row[:5], np.array([row[5], 9.81]), together)
        alone = np.array([of(row, stroke) for stroke in strokes])
        np.testing.assert_array_equal(together, alone)


@pytest.mark.parametrize("value", [0.0, 1e-300, -1e-300])
def test_newton_stays_where_it_has_arrived(value: float) -> None:
    new, _, _ = narrowed(0.3, value, -1.0, 0.0, 1.0)
    assert new == 0.3


def test_newton_outside_its_bracket_halves_it() -> None:
    assert narrowed(0.25, 5.0, -1.0, 0.0, 1.0) == (0.625, 0.25, 1.0)
    assert narrowed(0.5, -5.0, -1.0, 0.0, 1.0) == (0.25, 0.0, 0.5)


def test_without_a_stroke_the_actuator_halts_at_separation() -> None:
    rows = drawn(300, 5)
    rows[:, 6] = np.maximum(rows[:, 6], 0.06)  # fast enough to lose contact in the first stroke
    k, b, mu_s, mu_k, viscous, mass, velocity, _ = rows.T
    truth = nominal_taps(k, b, mu_s, mu_k, mass, velocity, np.inf, viscous, halts_at_separation=True)
    mine = np.array([of(row, math.inf) for row in rows])
    np.testing.assert_allclose(mine, truth.displacement_m, rtol=1e-9)


def test_gentlest_taps_without_a_stroke_move_a_part_this_far() -> None:
    """0.06 mm for 5 kg at friction 0.12, 0.93 mm for 40 kg at 0.3, without a stroke."""
    for mass, mu_s, smallest in ((5.0, 0.12, 0.06e-3), (40.0, 0.3, 0.93e-3)):
        velocities = np.linspace(0.003, 0.04, 1000)
        row = np.array([6.5e5, 465.0, mu_s, 0.76 * mu_s, 0.0, mass, 0.0, 0.0])
        moved = []
        for velocity in velocities:
            row[6] = velocity
            moved.append(of(row, math.inf))
        true_strikes = np.array(moved)
        assert np.nanmin(true_strikes[np.isfinite(true_strikes)]) == pytest.approx(smallest, rel=0.2)


def test_contact_force_stays_below_its_bound() -> None:
    rows = drawn(4000, 6)
    k, b, mu_s, mu_k, viscous, mass, velocity, stroke = rows.T
    peak = nominal_taps(k, b, mu_s, mu_k, mass, velocity, stroke, viscous).peak_force_n
    bound = np.array([largest_force(row[6], row[7], row[:5], row[5], 9.81) for row in rows])
    assert (peak <= bound * (1.0 + 1e-12)).all()
    assert np.median(peak / bound) > 0.8


def test_allowed_strokes_keep_the_force() -> None:
    plant = np.array([6.5e5, 465.0, 0.2, 0.152, 0.0])
    velocities = np.linspace(0.005, 0.1, 30)
    strokes = allowed_strokes(velocities, 150.0, plant, 20.0, 9.81)
    assert np.isinf(strokes[0])
    assert np.isfinite(strokes[-1])
    for velocity, stroke in zip(velocities, strokes, strict=True):
        if stroke > 0.0:
            assert largest_force(velocity, stroke, plant, 20.0, 9.81) <= 150.0 * (1.0 + 1e-12)


def test_viscous_friction_fades_out_smoothly() -> None:
    rows = drawn(2000, 7)
    without = rows.copy()
    rows[:, 4], without[:, 4] = 1e-7, 0.0
    np.testing.assert_allclose([of(row) for row in rows], [of(row) for row in without], rtol=1e-6, atol=1e-12)


def test_nothing_moves_below_breakaway() -> None:
    row = np.array([6.5e5, 465.0, 0.3, 0.228, 0.0, 40.0, 0.01, 1e-4])
    assert of(row) == 0.0  # 65 N against 118 N
