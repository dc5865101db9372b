"""Intervals of shapes beside strengths: those of scipy's least squares, and where nothing tells them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import fractional_matrix_power
from scipy.optimize import least_squares
from scipy.stats import t as student

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import (
    BaseModel,
    ChosenTerm,
    FittedModel,
    NumberPrior,
    TermChoice,
)
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.fits.shape_intervals import with_shape_intervals
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.machine.regression.block_sums import blocks_of, fit_blocks
from impactcell.discrepancy.machine.regression.weak_form import Rows, build_rows
from impactcell.records import Capture, Channel, Samples
from tests.discrepancy.stick_slip import sines

pytestmark = pytest.mark.slow

MASS_KG, VISCOUS_N_S_PER_M, RIPPLE_N, PERIOD_M, PHASE_RAD = 2.0, 4.0, 0.8, 0.15, 0.4
RATE_HZ, SECONDS, RECORDS, STEPS = 250.0, 10.0, 8, 4
RIPPLE = TermChoice("periodic_force")
BASE = BaseModel(inertia=NumberPrior(MASS_KG, math.inf), terms=(TermChoice("viscous_friction"), RIPPLE))


def ripple(position: Samples) -> Samples:
    """Force of the guide, N."""
    return -RIPPLE_N * np.sin(2.0 * np.pi * position / PERIOD_M + PHASE_RAD)


def slides() -> Campaign:
    """Slides under four sines each, by the classical Runge-Kutta method."""
    drives = [sines(2.0, np.random.default_rng([41, number])) for number in range(RECORDS)]
    step = 1.0 / (RATE_HZ * STEPS)
    half_steps = np.stack([drive(0.5 * step * np.arange(2 * round(SECONDS / step) + 1)) for drive in drives])

    def rate(state: Samples, drive: Samples) -> Samples:
        position, velocity = state
        force = drive - VISCOUS_N_S_PER_M * velocity + ripple(position)
        return np.stack([velocity, force / MASS_KG])

    state, moved = np.zeros((2, RECORDS)), []
    for number in range(round(SECONDS / step)):
        if number % STEPS == 0:
            moved.append(state[0])
        begin, middle, end = half_steps[:, 2 * number : 2 * number + 3].T
        first = rate(state, begin)
        second = rate(state + 0.5 * step * first, middle)
        third = rate(state + 0.5 * step * second, middle)
        state = state + step / 6.0 * (first + 2.0 * (second + third) + rate(state + step * third, end))
    time = np.arange(len(moved)) / RATE_HZ
    rng = np.random.default_rng(43)
    shots = []
    for number, drive in enumerate(drives):
        force = drive(time) + rng.normal(0.0, 0.05, time.size)
        position = np.array(moved)[:, number] + rng.normal(0.0, 2e-5, time.size)
        channels = Channel(time, force, None), Channel(time, position, None)
        shots.append(Capture(number + 1, math.nan, math.nan, *channels))
    return Campaign(Excitation.DRIVEN, tuple(shots))


def half_by_rows(matrix: Samples, left: Samples, blocks: list[np.ndarray]) -> Samples:
    """Half intervals by CR2 and its degrees of freedom, by the hat matrix of all rows."""
    inverse = np.linalg.inv(matrix.T @ matrix)
    passed = np.eye(len(matrix)) - matrix @ inverse @ matrix.T
    parts, spreads = [], []
    for block in blocks:
        adjusted = np.real(fractional_matrix_power(passed[np.ix_(block, block)], -0.5))
        weights = inverse @ matrix[block].T @ adjusted
        parts.append(weights @ left[block])
        spreads.append(weights @ passed[block])
    variance = np.square(parts).sum(axis=0)
    half = []
    for number, size in enumerate(variance):
        each = np.array([spread[number] for spread in spreads])
        values = np.linalg.eigvalsh(each @ each.T)
        half.append(student.ppf(0.975, values.sum() ** 2 / np.sum(values**2)) * math.sqrt(size))
    return np.array(half)


@pytest.fixture(scope="module")
def fits() -> MachineFits:
    return MachineFits(uniform_records(slides(), BASE), BASE, [], None)


@pytest.fixture(scope="module")
def model(fits: MachineFits) -> FittedModel:
    """Strengths and period of least squares, intervals at the period as it was found."""
    terms = tuple(ChosenTerm(choice, fits.shapes[choice.name][0]) for choice in BASE.terms)
    return fits.fit(fits.with_best_shapes(terms), settle=True)


def test_intervals_are_those_of_nonlinear_least_squares_with_the_scatter_between_blocks(
    fits: MachineFits, model: FittedModel
) -> None:
    told = with_shape_intervals(fits, model)
    period = model.terms[1].shape
    viscous = ChosenTerm(BASE.terms[0], 0.0)

    def residuals(numbers: Samples) -> Samples:
        """Of all training rows, block by block; the last number is the logarithm of the period."""
        shape = math.exp(numbers[-1])
        rows = build_rows(fits.records, fits.base, {viscous.choice: (0.0,), RIPPLE: (shape,)}, (0.0, 0.0))
        columns = [*fits.priors, *viscous.columns, *ChosenTerm(RIPPLE, shape).columns]
        return rows.target - np.stack([rows.columns[column] for column in columns], axis=1) @ numbers[:-1]

    rows = build_rows(fits.records, fits.base, {viscous.choice: (0.0,), RIPPLE: (period,)}, (0.0, 0.0))
    training, _ = fits.blocks(rows)
    number = fits.plan.number(rows)
    inside = np.isin(number, training.number)
    found = least_squares(
        lambda numbers: residuals(numbers)[inside],
        [*model.fit.coefficients, math.log(period)],
        x_scale="jac",
        jac="3-point",
    )
    jacobian, left = found.jac, found.fun
    half = half_by_rows(jacobian, left, [number[inside] == one for one in training.number])
    low, high = told.shape_intervals[RIPPLE.name]
    assert 0.5 * (told.fit.high - told.fit.low) == pytest.approx(half[:-1], rel=0.02)
    assert 0.5 * math.log(high / low) == pytest.approx(half[-1], rel=0.02)
    assert low < PERIOD_M < high


@pytest.mark.parametrize("tells", [6, 60])
def test_intervals_hold_the_truth_where_few_blocks_tell(tells: int) -> None:
    """By the plain sandwich, and as many degrees of freedom as blocks, 74 and 94 % of them did."""
    rng, held = np.random.default_rng(5), []
    place = np.repeat(np.arange(60), 4)
    reach = np.where(place < tells, rng.exponential(1.0, 60)[place], 0.0)
    columns = {("one", 0.0, 0): np.ones(240), ("slope", 0.0, 0): reach * rng.normal(size=240)}
    matrix = np.stack([*columns.values()], axis=1)
    for _ in range(1000):
        left = np.repeat(rng.normal(size=60), 4) * reach.clip(0.1) + rng.normal(size=240)
        target = matrix @ np.array([1.0, 2.0]) + left
        rows = Rows(target, columns, np.zeros(240), np.arange(240.0), np.ones(240), np.zeros(240))
        blocks = blocks_of(rows, place, dict.fromkeys(range(60), 0))
        fit = fit_blocks(blocks, [*columns], {}, frozenset())
        held.append((fit.low[1] < 2.0) & (fit.high[1] > 2.0))
    assert 0.93 <= np.mean(held) <= 0.985


def test_a_shape_that_says_nothing_is_open(fits: MachineFits, model: FittedModel) -> None:
    """Without strength the force does not depend on the shape at all."""
    nothing = replace(model.fit, coefficients=np.zeros(len(model.fit.columns)))
    assert with_shape_intervals(fits, replace(model, fit=nothing)).shape_intervals == {
        RIPPLE.name: (0.0, math.inf)
    }


def test_an_interval_of_a_strength_that_cannot_be_negative_begins_at_nought() -> None:
    """Friction of which the records say next to nothing."""
    base = replace(BASE, terms=(*BASE.terms, TermChoice("quadratic_drag"), TermChoice("stribeck_friction")))
    fits = MachineFits(uniform_records(slides(), base), base, [], None)
    terms = tuple(ChosenTerm(choice, fits.shapes[choice.name][0]) for choice in base.terms)
    fit = fits.fit(fits.with_best_shapes(terms), settle=True)
    told = with_shape_intervals(fits, fit).fit
    for one in (fit.fit, told):
        limited = np.array([column in fits.nonnegative for column in one.columns])
        assert limited.sum() == 3
        assert np.all(one.low[limited] >= 0.0)
        assert np.any(one.low[limited] == 0.0)
        assert np.all(one.high >= one.coefficients)
    slopes = [column[0] == RIPPLE.name for column in told.columns]
    assert np.any(told.low[slopes] < 0.0)
