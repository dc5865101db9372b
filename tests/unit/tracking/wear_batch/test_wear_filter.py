"""The filter of known batches against least squares in one piece, and what it says of the limit."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from impactcell.tracking.wear_batch import wear_filter, wear_report
from impactcell.tracking.wear_batch.wear_report import WearMoments


def run(values, batches, variance=1.0, slope_std=1.0, step_variance=1e6):
    state = wear_filter.initial_state(values[0], variance, slope_std, batches[0])
    for value, batch in zip(values[1:], batches[1:], strict=True):
        state = wear_filter.predict(state, 1, 0.0, 0.0)
        if batch != state.current:
            state = wear_filter.switch_batch(state, batch, step_variance)
        state, _ = wear_filter.update(state, value, variance, math.inf)
    return state


def least_squares(values, batches, slope_std):
    """Level at the last cycle, slope, an offset a batch; the slope's prior as one more equation."""
    names = list(dict.fromkeys(batches))
    n = len(values)
    design = np.zeros((n + 1, 1 + len(names)))
    design[:n, 0], design[:n, 1] = 1.0, np.arange(n) - (n - 1.0)
    for k, name in enumerate(names[1:]):
        design[:n, 2 + k] = [b == name for b in batches]
    design[n, 1] = 1.0 / slope_std
    target = np.append(values, 0.0)
    covariance = np.linalg.inv(design.T @ design)
    return covariance @ design.T @ target, covariance, names


def test_equals_least_squares_with_batches_that_come_back():
    rng = np.random.default_rng(0)
    batches = ["A"] * 40 + ["B"] * 30 + ["A"] * 20 + ["C"] * 25 + ["B"] * 15
    values = 0.02 * np.arange(130) + rng.normal(size=130)
    state = run(values, batches, slope_std=0.5)
    expected, covariance, _ = least_squares(values, batches, 0.5)
    assert state.batches == ("A", "C", "B")
    order = [0, 1, 3, 2]
    assert state.mean == pytest.approx(expected[order], rel=1e-3, abs=1e-3)
    assert state.covariance == pytest.approx(covariance[np.ix_(order, order)], rel=1e-3, abs=1e-5)
    size, std = wear_filter.contrast(state, "B", "C")
    difference = np.array([0.0, 0.0, 1.0, -1.0])
    assert size == pytest.approx(difference @ expected, abs=2e-3)
    assert std == pytest.approx(math.sqrt(difference @ covariance @ difference), rel=1e-3)


def test_an_outlier_is_clipped():
    state = run(np.zeros(50), ["A"] * 50, slope_std=0.01)
    std = math.sqrt(1.0 + state.covariance[0, 0])
    edge, _ = wear_filter.update(state, 2.5 * std, 1.0, 2.5)
    odd, error = wear_filter.update(state, 4.5 * std, 1.0, 2.5)
    assert odd.mean == pytest.approx(edge.mean, rel=1e-9)
    assert odd.covariance[0, 0] > edge.covariance[0, 0]
    assert error.value == pytest.approx(4.5 * std, abs=1e-6)
    far, _ = wear_filter.update(state, 100.0, 1.0, 2.5)
    assert abs(far.mean[0]) < 0.2 * abs(edge.mean[0])


def test_old_batches_are_forgotten_and_all_stays_finite():
    batches = [f"B{i}" for i in range(60)]
    state = run(np.random.default_rng(1).normal(size=60), batches, step_variance=9.0)
    assert len(state.batches) == wear_filter.KEPT_BATCHES + 1
    assert len(state.mean) == len(state.batches) + 1
    assert np.isfinite(state.covariance).all()
    assert np.linalg.eigvalsh(state.covariance)[0] > 0.0


def test_a_late_measurement_at_its_own_place():
    values = np.random.default_rng(2).normal(size=30)
    in_time = run(values, ["A"] * 30)
    late = run(np.delete(values, 20), ["A"] * 29)
    # the same cycles, the twenty-first taken in at the end
    state = wear_filter.initial_state(values[0], 1.0, 1.0, "A")
    for t in range(1, 30):
        state = wear_filter.predict(state, 1, 0.0, 0.0)
        if t != 20:
            state, _ = wear_filter.update(state, values[t], 1.0, math.inf)
    state, _ = wear_filter.update(state, values[20], 1.0, math.inf, lag=9)
    assert state.mean == pytest.approx(in_time.mean, abs=1e-9)
    assert state.covariance == pytest.approx(in_time.covariance, abs=1e-9)
    assert late.mean[0] != pytest.approx(in_time.mean[0], abs=1e-6)


def test_cycles_to_limit_and_its_interval():
    published = wear_report.forecast(WearMoments(0.2, 1e-5, 1e-8, 0.0, 1e-14), (0.0, 0.0), 0.21)
    assert published.cycles_to_limit == pytest.approx(1000.0)
    for cycles, share in (
        (published.cycles_to_limit_low, 0.025),
        (published.cycles_to_limit_high, 0.975),
    ):
        std = math.sqrt(1e-8 + cycles**2 * 1e-14)
        assert norm.sf(0.21, 0.2 + 1e-5 * cycles, std) == pytest.approx(share, rel=1e-6)
    assert published.probability_above_limit == pytest.approx(norm.sf(100.0))


def test_a_rate_may_change_over_as_many_cycles_as_it_was_followed():
    """By a quarter of itself: a walk of the slope; its integral has a third of its variance by the cube."""
    moments, followed = WearMoments(0.2, 1e-5, 1e-8, 0.0, 1e-16), 1600.0
    walks = wear_report.walks_ahead(moments, (2e-12, 3e-18), followed)
    assert math.sqrt((walks[1] - 3e-18) * followed) == pytest.approx(0.25 * moments.slope)
    published = wear_report.forecast(moments, walks, 0.202)
    assert published.cycles_to_limit == pytest.approx(200.0)
    for cycles, share in (
        (published.cycles_to_limit_low, 0.025),
        (published.cycles_to_limit_high, 0.975),
    ):
        variance = 1e-8 + cycles**2 * 1e-16 + 2e-12 * cycles
        variance += ((0.25e-5) ** 2 / followed + 3e-18) * cycles**3 / 3.0
        assert norm.sf(0.202, 0.2 + 1e-5 * cycles, math.sqrt(variance)) == pytest.approx(share, rel=1e-6)


def test_a_limit_that_is_not_reached():
    falling = wear_report.forecast(WearMoments(0.2, -1e-5, 1e-8, 0.0, 1e-16), (0.0, 0.0), 0.21)
    assert falling.cycles_to_limit == math.inf
    assert falling.cycles_to_limit_high == math.inf
    worn = wear_report.forecast(WearMoments(0.3, 1e-5, 1e-8, 0.0, 1e-16), (0.0, 0.0), 0.21)
    assert (worn.cycles_to_limit, worn.cycles_to_limit_high) == (0.0, 0.0)
    none = wear_report.forecast(WearMoments(0.3, 1e-5, 1e-8, 0.0, 1e-16), (0.0, 0.0), math.inf)
    assert none.probability_above_limit == 0.0


@pytest.mark.parametrize(
    ("slope", "slope_std", "correlation"),
    [(0.0, 5e-6, -0.6), (1e-5, 5e-6, 0.5), (4e-5, 5e-6, -0.6), (2e-6, 4e-7, 0.8), (0.0, 1.9e-4, 0.0)],
)
def test_the_probability_of_being_above_the_limit_later(slope, slope_std, correlation):
    """Against integration over the slope: its likelihood, a prior of four scales, the level given it."""
    level_std, prior_std, excess, cycles, walk = 5e-4, 2e-4, -0.01, 2000.0, 1e-12
    covariance = correlation * level_std * slope_std
    moments = WearMoments(0.2 + excess, slope, level_std**2, covariance, slope_std**2)
    ahead = wear_report.extrapolation(moments, (walk, 0.0), 0.2)
    scales = prior_std * np.array([1.0, 0.3, 0.03, 0.003])

    def density(x):
        prior = np.mean([norm.pdf(x, 0.0, scale) for scale in scales], axis=0)
        return norm.pdf(x, slope, slope_std) / norm.pdf(x, 0.0, prior_std) * prior

    def above(x):
        mean = excess + covariance / slope_std**2 * (x - slope) + x * cycles
        return norm.sf(0.0, mean, math.sqrt(level_std**2 * (1.0 - correlation**2) + walk * cycles))

    fine = np.concatenate([s * np.linspace(-12.0, 12.0, 4001) for s in (*scales, slope_std)])
    x = np.unique(np.concatenate([fine, fine + slope]))
    expected = np.trapezoid(density(x) * above(x), x) / np.trapezoid(density(x), x)
    assert wear_report.probability_after(ahead, cycles, prior_std**2) == pytest.approx(expected, abs=1e-5)
