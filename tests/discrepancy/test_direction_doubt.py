"""Where a part turns or rests no row knows which way friction acts: that is no gap of the model."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from impactcell.discrepancy.machine import MachineFinding, NumberPrior, TermChoice, investigate_machine
from impactcell.discrepancy.machine.records import smoothing
from impactcell.discrepancy.machine.regression.direction_doubt import DirectionDoubt, floors_left, weighed
from impactcell.discrepancy.machine.regression.weak_form import KINK_SHARE, Rows
from impactcell.discrepancy.report import german_machine_sentences
from impactcell.discrepancy.report.machine_sentences import headline
from impactcell.records import Samples
from tests.discrepancy.stick_slip import (
    COULOMB_N,
    MASS_KG,
    SLIDE,
    VISCOUS_N_S_PER_M,
    levels,
    paths,
    sines,
    slides,
)

pytestmark = pytest.mark.slow

QUIET, NOISY = (0.02, 1e-5), (0.02, 1e-4)
"""Noise of force [N] and position [m]."""


def value_of(finding: MachineFinding, name: str) -> float:
    """Strength of a term in the final model."""
    return finding.final.value((name, finding_shape(finding, name), 0))


def finding_shape(finding: MachineFinding, name: str) -> float:
    return next(term.shape for term in finding.final.terms if term.choice.name == name)


@pytest.mark.slow
def test_the_slides_of_these_tests_go_as_an_integrator_with_events_says() -> None:
    """One push beyond friction that ends: sliding, then at rest for good."""
    step, drive = 1e-5, 4.0

    def rates(time: float, state: Samples) -> list[float]:
        force = drive if time < 0.3 else 0.0
        return [state[1], (force - COULOMB_N - VISCOUS_N_S_PER_M * state[1]) / MASS_KG]

    def stops(time: float, state: Samples) -> float:
        return float(state[1]) if time > 0.3 else 1.0

    stops.terminal = True  # type: ignore[attr-defined]
    pushed = solve_ivp(rates, (0.0, 0.3), (0.0, 0.0), rtol=1e-10, atol=1e-12)
    coasting = solve_ivp(rates, (0.3, 2.0), pushed.y[:, -1], rtol=1e-10, atol=1e-12, events=stops)
    drives = np.where(step * (np.arange(100_000) + 0.5) < 0.3, drive, 0.0)[:, None]
    path = paths(drives, step, 1000)[:, 0]
    assert path[-1] == pytest.approx(float(coasting.y[0, -1]), rel=1e-4)
    assert path[-1] == path[-2]


@pytest.mark.slow
@pytest.mark.parametrize("noise", [QUIET, NOISY])
def test_a_slide_that_sticks_at_its_reversals_has_no_gap(noise: tuple[float, float]) -> None:
    finding = investigate_machine(slides(lambda rng: sines(4.0, rng), noise), SLIDE)
    assert finding.verdict == "no_gap"
    assert value_of(finding, "coulomb_friction") == pytest.approx(COULOMB_N, rel=3e-3)
    assert value_of(finding, "viscous_friction") == pytest.approx(VISCOUS_N_S_PER_M, rel=3e-3)


def test_a_slide_that_rests_half_of_the_time_has_no_gap() -> None:
    """Its stops are many, and what holds it is nearly all of its friction: it was `unknown` at 7.9 floors."""
    finding = investigate_machine(slides(lambda rng: sines(1.0, rng), QUIET), SLIDE)
    assert finding.verdict == "no_gap"
    assert finding.fall.before < 1.2
    assert value_of(finding, "coulomb_friction") == pytest.approx(COULOMB_N, rel=5e-3)


@pytest.mark.slow
def test_a_drive_of_levels_has_no_gap() -> None:
    """Every level makes a kink in the speed: where noise allows it is smoothed over a few samples only."""
    finding = investigate_machine(slides(lambda rng: levels(8.0, 0.4, rng), (0.0, 1e-5)), SLIDE)
    assert finding.verdict == "no_gap"
    assert value_of(finding, "viscous_friction") == pytest.approx(VISCOUS_N_S_PER_M, rel=2e-3)


@pytest.mark.slow
def test_what_a_delay_would_explain_is_said_first() -> None:
    """A measured force jumps anywhere between two samples: half a sample early, on the mean."""
    records = slides(lambda rng: levels(8.0, 0.4, rng), (0.05, 1e-5))
    finding = investigate_machine(records, SLIDE)
    assert finding.verdict == "unknown"
    assert re.search(
        r": a force recorded [12](\.\d)? ms early would explain [89]\d % of it\.", headline(finding)
    )
    german = german_machine_sentences.headline(finding)
    assert re.search(r"[12](,\d)? ms zu früh aufgezeichnete Kraft erklärte [89]\d % davon", german)
    free = investigate_machine(records, replace(SLIDE, delay_s=NumberPrior(0.0, 5e-3)))
    assert free.verdict == "no_gap"
    assert free.final.delay_s == pytest.approx(-2e-3, rel=0.1)


@pytest.mark.slow
def test_few_samples_in_a_period_have_no_gap() -> None:
    """At 50 Hz a reversal lies anywhere within a fifteenth of a swing."""
    records = slides(lambda rng: sines(4.0, rng), QUIET, rate_hz=50.0, duration_s=24.0)
    assert investigate_machine(records, SLIDE).verdict == "no_gap"


@pytest.mark.slow
def test_what_is_hidden_beside_reversals_is_found_and_nothing_remains() -> None:
    def friction(_place: Samples, speed: Samples) -> Samples:
        return COULOMB_N + 6.0 * speed**2

    finding = investigate_machine(slides(lambda rng: sines(4.0, rng), QUIET, friction), SLIDE)
    assert finding.established == ("quadratic_drag",)
    assert finding.fall.before > 10.0
    assert finding.fall.after < finding.expected[1]
    assert value_of(finding, "quadratic_drag") == pytest.approx(6.0, rel=0.02)


@pytest.mark.slow
def test_nothing_remains_beside_a_free_delay_either() -> None:
    """Without viscous friction the delay takes over what it can of it; with it, it goes back to none."""
    knows_less = replace(SLIDE, terms=SLIDE.terms[:1], delay_s=NumberPrior(0.0, 5e-3))
    finding = investigate_machine(slides(lambda rng: sines(4.0, rng), QUIET), knows_less)
    assert finding.established == ("viscous_friction",)
    assert abs(finding.nominal.delay_s) > 4e-3
    assert abs(finding.final.delay_s) < 5e-5
    assert finding.fall.after < finding.expected[1]


@pytest.mark.slow
def test_a_stribeck_speed_is_found_between_the_points_of_its_grid() -> None:
    """Of eight campaigns like it the farthest was 9 % off; 24 % where stops counted as less uncertain."""

    def friction(_place: Samples, speed: Samples) -> Samples:
        return COULOMB_N + 0.3 * np.exp(-((speed / 0.1) ** 2))

    records = slides(lambda rng: sines(4.0, rng), QUIET, friction)
    finding = investigate_machine(records, SLIDE)
    assert finding.established == ("stribeck_friction",)
    assert finding.fall.after < finding.expected[1]
    assert finding_shape(finding, "stribeck_friction") == pytest.approx(0.1, rel=0.1)
    assert value_of(finding, "stribeck_friction") == pytest.approx(0.3, rel=0.1)
    knows = replace(SLIDE, terms=(*SLIDE.terms, TermChoice("stribeck_friction")))
    assert investigate_machine(records, knows).verdict == "no_gap"


@pytest.mark.parametrize(("rise_n", "speed"), [(1.0, 0.02), (0.75, 0.025)])
def test_a_stribeck_speed_moves_on_from_where_it_was_first_found(rise_n: float, speed: float) -> None:
    """Rows that tell it weigh little beside what the base model leaves, and more beside what it leaves."""

    def friction(_place: Samples, now: Samples) -> Samples:
        return COULOMB_N + rise_n * np.exp(-((now / speed) ** 2))

    noise, knows = (1e-3, 1e-6), replace(SLIDE, terms=(*SLIDE.terms, TermChoice("stribeck_friction")))
    records = slides(lambda rng: sines(4.0, rng), noise, friction, rate_hz=500.0, count=6, duration_s=8.0)
    for base, established in ((SLIDE, ("stribeck_friction",)), (knows, ())):
        finding = investigate_machine(records, base)
        assert finding.established == established
        assert finding.is_at_floor
        assert finding_shape(finding, "stribeck_friction") == pytest.approx(speed, rel=3e-3)
        assert value_of(finding, "stribeck_friction") == pytest.approx(rise_n, rel=5e-3)


@pytest.mark.parametrize("half", [3, 5, 14, 50])
def test_a_kink_shifts_a_smoothed_speed_by_the_share_that_is_said(half: int) -> None:
    """At a kink on a sample; over more samples the shift comes near 5/64, over fewer it is larger."""
    time = np.arange(-200.0, 201.0)
    smoothed = smoothing.smoothed_speed(np.where(time > 0.0, 0.5 * time**2, 0.0), half, 1.0)
    shift = float(np.abs(smoothed - np.maximum(time, 0.0))[60:-60].max())
    assert shift == pytest.approx(KINK_SHARE * half, rel=0.06)


@pytest.mark.parametrize("half", [5, 12])
def test_a_mean_acceleration_and_the_mean_belong_together_to_the_fourth_order(half: int) -> None:
    errors = []
    for step in (0.02, 0.01):
        weight, curvature = smoothing.test_function(half, step)
        time = step * (np.arange(weight.size) - weight.size // 2)
        wave = np.cos(12.0 * time)
        errors.append(abs(float(curvature @ wave) / (-(12.0**2) * float(weight @ wave)) - 1.0))
    assert errors[0] < 2e-5
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.05)


def rows_of(residual: Samples, doubt: Samples) -> Rows:
    """Rows without a column, of unit noise."""
    one = np.ones(residual.shape)
    return Rows(residual, {}, np.zeros(residual.size), np.arange(0.0, residual.size), one, doubt)


@given(floors=st.floats(1.5, 50.0), friction=st.floats(0.1, 100.0), seed=st.integers(0, 1000))
def test_floors_are_found_beside_any_doubt(floors: float, friction: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    doubt = np.where(rng.random(4000) < 0.5, 0.0, rng.random(4000))
    spread = np.sqrt(floors**2 + (friction * doubt) ** 2)
    residual = spread * rng.normal(size=4000)
    found = floors_left(rows_of(residual, doubt), residual, np.ones(4000, dtype=bool), friction)
    assert found == pytest.approx(floors, rel=0.15)


@given(floors=st.floats(1.0, 50.0), friction=st.floats(0.0, 100.0), seed=st.integers(0, 1000))
def test_a_row_without_doubt_weighs_one_and_any_other_less(floors: float, friction: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    doubt = np.where(rng.random(50) < 0.5, 0.0, rng.random(50))
    rows = weighed(rows_of(np.ones(50), doubt), DirectionDoubt(friction, floors))
    assert (rows.target[doubt == 0.0] == 1.0).all()
    assert (rows.target <= 1.0).all()
    assert (rows.variance == 1.0).all()
    left = floors**2 / (floors**2 + (friction * doubt) ** 2)
    assert rows.target == pytest.approx(np.sqrt(left))


def test_nothing_left_is_one_floor_and_no_row_too() -> None:
    rows = rows_of(np.zeros(10), np.zeros(10))
    assert floors_left(rows, rows.target, np.ones(10, dtype=bool), 1.0) == 1.0
    assert floors_left(rows, rows.target, np.zeros(10, dtype=bool), 1.0) == 1.0
    assert floors_left(rows, np.full(10, math.inf), np.ones(10, dtype=bool), 1.0) > 1e5
