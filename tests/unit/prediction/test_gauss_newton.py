"""The loop of the fits: against scipy, also where full steps do harm, and where there is no minimum."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares, lsq_linear

from impactcell.errors import PhysicsError
from impactcell.prediction.gauss_newton import RAISED_DAMPING, Step, StopRule, fit, step_within

STOP = StopRule(max_steps=200, length=1e-6, cost=1e-12, refused_cost=1e-10)
Array = NDArray[np.float64]


@dataclass
class Place:
    theta: Array
    residual: Array
    cost: float


@dataclass
class Valley:
    """Rosenbrock's valley with a slope that does not vanish at its minimum; no residuals left of `wall`."""

    wall: float = -np.inf
    dampings: list[float] = field(default_factory=list)

    def residual(self, theta: Array) -> Array:
        return np.array([10.0 * (theta[1] - theta[0] ** 2), 1.0 - theta[0], 0.5 * theta[1]])

    def linearise(self, theta: Array) -> Place:
        if theta[0] < self.wall:
            raise PhysicsError("behind the wall")
        residual = self.residual(theta)
        return Place(theta, residual, 0.5 * float(residual @ residual))

    def step(self, start: Place, damping: float) -> Step:
        self.dampings.append(damping)
        J = np.array([[-20.0 * start.theta[0], 10.0], [-1.0, 0.0], [0.0, 0.5]])
        curvature = J.T @ J
        raised = curvature + damping * np.diag(np.diag(curvature))
        step = -np.linalg.solve(raised, J.T @ start.residual)
        return Step(start.theta + step, float(step @ curvature @ step), np.linalg.inv(curvature))

    def noise(self, at: Place) -> float:
        assert at.cost >= 0.0
        return 1.0


@pytest.mark.parametrize(
    ("start", "does_harm"), [((-1.2, 1.0), True), ((2.0, -3.0), False), ((-0.5, 4.0), False)]
)
def test_the_minimum_is_scipys_though_full_steps_may_do_harm(
    start: tuple[float, float], does_harm: bool
) -> None:
    problem = Valley()
    minimum, _, converged = fit(problem, np.array(start), STOP)
    expected = least_squares(problem.residual, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert converged
    assert (max(problem.dampings) > 0.0) is does_harm
    assert minimum.theta == pytest.approx(expected.x, abs=1e-5)
    assert minimum.cost == pytest.approx(expected.cost, abs=1e-10)


def test_a_step_into_what_the_model_does_not_know_is_refused() -> None:
    problem = Valley(wall=-1.3)
    minimum, _, converged = fit(problem, np.array([-1.2, 6.0]), STOP)
    expected = least_squares(problem.residual, (1.0, 1.0))
    assert converged
    assert minimum.theta == pytest.approx(expected.x, abs=1e-5)
    with pytest.raises(PhysicsError, match="behind the wall"):
        fit(problem, np.array([-1.4, 0.0]), STOP)


def test_rest_counts_where_steps_are_damped_little_or_more_damped_ones_were_refused_for_little() -> None:
    """With the least damping that is raised, no more than noise to gain is the end."""

    class Plain:
        """A first step that is refused, one that gains nothing, and all others that gain much."""

        def __init__(self) -> None:
            self.dampings = list[float]()

        def linearise(self, theta: Array) -> Place:
            costs = {0.0: 1.0, 1.0: 2.0, 2.0: 1.0}
            return Place(theta, theta, costs.get(float(theta[0]), 0.0))

        def step(self, start: Place, damping: float) -> Step:
            assert start.cost >= 0.0
            self.dampings.append(damping)
            return Step(np.array([float(len(self.dampings))]), 1.0, np.eye(1))

        def noise(self, at: Place) -> float:
            assert at.cost >= 0.0
            return 1.0

    problem = Plain()
    minimum, _, converged = fit(problem, np.zeros(1), STOP)
    assert converged
    assert (minimum.theta[0], problem.dampings) == (2.0, [0.0, RAISED_DAMPING])


def test_steps_that_come_to_an_end_first_are_not_called_a_minimum() -> None:
    few = StopRule(max_steps=3, length=1e-6, cost=1e-12, refused_cost=1e-10)
    _, _, converged = fit(Valley(), np.array([-1.2, 1.0]), few)
    assert not converged


@dataclass
class Kink:
    """A slope down to a wall that its derivative does not see, as that of a tap is taken into one side."""

    steepness: float

    def linearise(self, theta: Array) -> Place:
        residual = np.array([(theta[0] + 0.04) / 0.3, self.steepness * min(theta[0], 0.0)])
        return Place(theta, residual, 0.5 * float(residual @ residual))

    def step(self, start: Place, damping: float) -> Step:
        step = -0.3 * start.residual[0] / (1.0 + damping)
        return Step(start.theta + step, (step / 0.3) ** 2, np.array([[0.3**2]]))

    def noise(self, at: Place) -> float:
        assert at.cost >= 0.0
        return 1.0


@pytest.mark.parametrize("steepness", [100.0, 250.0, 300.0, 1000.0])
def test_a_minimum_at_a_kink_is_one_though_steps_across_it_do_harm(steepness: float) -> None:
    stop = StopRule(max_steps=40, length=0.02, cost=0.05, refused_cost=0.1)
    minimum, _, converged = fit(Kink(steepness), np.array([0.1]), stop)
    assert converged
    assert minimum.cost == pytest.approx(0.5 * (0.04 / 0.3) ** 2, abs=stop.cost)


@given(seed=st.integers(0, 10_000), size=st.integers(1, 9), width=st.floats(0.05, 20.0))
def test_a_step_within_bounds_is_where_nothing_is_beyond_them_the_whole_one(
    seed: int, size: int, width: float
) -> None:
    """Else it keeps them, and comes nearer to the minimum within them than the whole step that is cut off."""
    draw = np.random.default_rng(seed)
    root = draw.standard_normal((size + 3, size)) * 10.0 ** draw.uniform(-2.0, 2.0, size)
    curvature, gradient = root.T @ root, root.T @ draw.standard_normal(size + 3)
    covariance = np.linalg.inv(curvature)
    whole, stds = -covariance @ gradient, np.sqrt(np.diag(covariance))
    low, high = -width * stds * draw.uniform(0.0, 1.0, size), width * stds * draw.uniform(0.0, 1.0, size)

    def cost(step: Array) -> float:
        return 0.5 * float(step @ curvature @ step) + float(gradient @ step)

    step = step_within(whole, covariance, low, high)
    cut_off = np.clip(whole, low, high)
    assert np.all((low <= step) & (step <= high))
    if np.array_equal(cut_off, whole):
        np.testing.assert_allclose(step, whole, rtol=1e-9)
    factor = np.linalg.cholesky(curvature).T
    best = lsq_linear(factor, -np.linalg.solve(factor.T, gradient), (low - 1e-12 * stds, high + 1e-12 * stds))
    assert cost(step) >= best.cost - 0.5 * float(gradient @ covariance @ gradient) - 1e-6 * abs(cost(whole))
    held = (step <= low) | (step >= high)
    free = ~held
    if free.any() and held.sum() == 1:  # the others' conditional minimum, by solving for them alone
        pull = gradient[free] + curvature[np.ix_(free, held)] @ step[held]
        alone = -np.linalg.solve(curvature[np.ix_(free, free)], pull)
        np.testing.assert_allclose(step[free], alone, rtol=1e-5, atol=1e-6 * float(stds.max()))


def test_steps_within_bounds_come_to_an_end_where_cut_off_ones_creep() -> None:
    """Two numbers that nearly make up for each other, the one of short steps: 40 of them for 4."""
    rows = np.array([[1.0, 0.99], [0.0, 0.01]]) * 100.0
    curvature, target = rows.T @ rows, np.array([5.0, -5.0])
    longest = np.array([0.5, 20.0])

    def descend(how: str) -> tuple[float, int]:
        theta, steps = np.zeros(2), 0
        while abs(rows @ (theta - target)).max() > 1e-6 and steps < 60:
            whole = target - theta
            if how == "cut off":
                step = np.clip(whole, -longest, longest)
            else:
                step = step_within(whole, np.linalg.inv(curvature), -longest, longest)
            trial = theta + step
            if how == "cut off" and np.sum((rows @ (trial - target)) ** 2) > np.sum(
                (rows @ (theta - target)) ** 2
            ):
                trial = theta + 0.1 * step  # as damping shortens what does harm
            theta, steps = trial, steps + 1
        return float(abs(rows @ (theta - target)).max()), steps

    assert descend("within")[1] <= 10
    assert descend("cut off")[1] > 20
