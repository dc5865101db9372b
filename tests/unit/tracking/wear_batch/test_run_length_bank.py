"""The compiled bank against exhaustive enumeration, filterpy and its own limits."""

import itertools
import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from impactcell.numerics import scatter_correlation
from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import (
    BatchKnowledge,
    FrictionObservation,
    TrackerSettings,
    initial_state,
    run_length_bank,
    run_length_model,
    state_reports,
)
from impactcell.tracking.wear_batch.run_length_model import BankModel, Measurement


def run(values, model, announced=None, variance=1.0, slope_std=0.1, accepted=0.0):
    first = run_length_bank.initial_bank(values[0], variance, slope_std, 0, model.outlier_probability)
    bank = run_length_bank.workspace(first)
    count, densities, statistics = len(first), [], []
    outliers = np.zeros(2)
    for t, value in enumerate(values[1:], start=1):
        told = 0.0 if announced is None else announced[t]
        measurement = Measurement(float(value), variance, 1.0, 0.0, float(t), float(told))
        count, density, statistic, _ = run_length_bank.update(
            bank, count, model, measurement, outliers, accepted
        )
        densities.append(density)
        statistics.append(statistic)
    return run_length_bank.stored(bank, count), np.array(densities), np.array(statistics)


def exact_posterior(values, hazard, step_std, slope_std):
    """Every set of change cycles and kinds of step, each a linear Gaussian model solved in one piece."""
    n = len(values)
    weights, means, lasts = [], [], []
    for kinds in itertools.product([None, *run_length_model.STEPS], repeat=n - 1):
        at = [(t, kind) for t, kind in enumerate(kinds, start=1) if kind]
        # unknowns: level at cycle 0 (known from the first value), slope, one shift a change
        design = np.zeros((n, 2 + len(at)))
        design[:, 0], design[:, 1] = 1.0, np.arange(n)
        for k, (t, _) in enumerate(at):
            design[t:, 2 + k] = 1.0
        expected = np.array([0.0, 0.0, *[step_std * mean for _, (mean, _, _) in at]])
        prior = np.diag([1.0, slope_std**2, *[(step_std * std) ** 2 for _, (_, std, _) in at]])
        later = design[1:]
        residual = values[1:] - values[0] - later @ expected
        cov = later @ prior @ later.T + np.eye(n - 1)
        inverse = np.linalg.inv(cov)
        weight = -0.5 * (residual @ inverse @ residual + np.linalg.slogdet(2.0 * math.pi * cov)[1])
        weight += len(at) * math.log(hazard) + (n - 1 - len(at)) * math.log1p(-hazard)
        weight += sum(math.log(share) for _, (_, _, share) in at)
        gain = prior @ later.T @ inverse
        weights.append(weight)
        means.append((gain @ residual)[1])
        lasts.append(at[-1][0] if at else 0)
    w = np.exp(np.array(weights) - max(weights))
    w /= w.sum()
    last = np.bincount(lasts, weights=w, minlength=n)
    total = max(weights) + math.log(np.exp(np.array(weights) - max(weights)).sum())
    return last, float(w @ means), total


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.0, 1.5, 4.0])
def test_last_change_and_slope_against_enumeration(shift):
    rng = np.random.default_rng(3)
    values = 0.03 * np.arange(6) + rng.normal(size=6)
    values[3:] += shift
    hazard, step_std, slope_std = 0.02, 3.0, 0.1
    model = BankModel(hazard, step_std**2, 0.0, 0.0, 1e-12, slope_std**2)
    table, densities, _ = run(values, model, slope_std=slope_std)
    last, slope, total = exact_posterior(values, hazard, step_std, slope_std)
    ours = np.zeros(6)
    for hypothesis in run_length_bank.workspace(table)[: len(table)]:
        ours[int(hypothesis["change_cycle"])] += math.exp(hypothesis["log_weight"])
    # histories before the last change are merged by moments: near, not equal
    assert ours == pytest.approx(last, abs=0.01)
    assert run_length_bank.moments(table)[0][1] == pytest.approx(slope, abs=4e-3)
    assert densities.sum() == pytest.approx(total, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.0, 1.5, 4.0])
def test_the_statistic_against_enumeration_over_every_scale_of_the_wear(shift):
    rng = np.random.default_rng(8)
    values = 0.2 * np.arange(6) + rng.normal(size=6)
    values[3:] += shift
    hazard, step_std, slope_std = 0.02, 3.0, 2.0
    model = BankModel(hazard, step_std**2, 0.0, 0.0, 1e-12, slope_std**2)
    _, _, statistics = run(values, model, slope_std=slope_std)
    changed, unchanged = [], []
    for scale in run_length_model.SLOPES:
        last, _, total = exact_posterior(values, hazard, step_std, scale * slope_std)
        changed.append(math.exp(total) * last[1:].sum())
        unchanged.append(math.exp(total) * last[0])
    exact = math.log(sum(changed) / sum(unchanged) / hazard)
    # one normal prior for the slope, as wide as the widest, would give another
    assert abs(math.log(changed[0] / unchanged[0] / hazard) - exact) > 0.05
    assert statistics[-1] == pytest.approx(exact, abs=0.01)


def test_one_hypothesis_is_filterpys_kalman_filter():
    rng = np.random.default_rng(1)
    values = 0.2 + 0.002 * rng.normal(size=300) + 1e-5 * np.arange(300)
    variance, level_q, slope_q = 4e-6, 1e-9, 1e-13
    model = BankModel(1e-3, 1e-4, level_q, slope_q, 0.0, 1e-8)
    bank = run_length_bank.workspace(run_length_bank.initial_bank(values[0], variance, 1e-4, 0, 0.01)[:1])
    bank[0]["log_weight"] = 0.0
    oracle = KalmanFilter(2, 1)
    oracle.x = np.array([[values[0]], [0.0]])
    oracle.P = np.diag([variance, 1e-8])
    oracle.F = np.array([[1.0, 1.0], [0.0, 1.0]])
    oracle.H = np.array([[1.0, 0.0]])
    oracle.Q = np.array([[level_q + slope_q / 3.0, slope_q / 2.0], [slope_q / 2.0, slope_q]])
    oracle.R *= variance
    for t, value in enumerate(values[1:], start=1):
        measurement = Measurement(float(value), variance, 1.0, 0.0, float(t), -1.0)
        count, density, *_ = run_length_bank.update(bank, 1, model, measurement, np.zeros(2), 0.0)
        oracle.predict()
        oracle.update(value)
        assert count == 1
        assert density == pytest.approx(oracle.log_likelihood, abs=1e-6)
    mean, covariance = run_length_bank.moments(run_length_bank.stored(bank, 1))
    assert mean[:2] == pytest.approx(oracle.x[:, 0], rel=1e-9)
    assert covariance[:2, :2] == pytest.approx(oracle.P, rel=1e-9)


def test_what_is_said_of_wear_and_of_a_change_is_of_the_whole_mixture():
    rng = np.random.default_rng(8)
    rows = np.zeros((30, run_length_bank.WIDTH))
    rows[:, 0], rows[:, 1] = rng.normal(size=30), np.repeat(np.arange(10.0), 3)
    rows[:, 2:6] = rng.normal(size=(30, 4))
    roots = rng.normal(size=(30, 4, 4))
    rows[:, 6:] = (roots @ roots.transpose(0, 2, 1)).reshape(30, 16)
    mean, covariance = run_length_bank.moments(rows)
    said = run_length_bank.wear_moments(rows)
    assert said[:3] == pytest.approx(mean[:3])
    assert said[3:] == pytest.approx(covariance[np.triu_indices(3)])
    for after, until, included in ((2.0, 6.0, slice(9, 21)), (-1.0, 9.0, slice(30))):
        cycle, size, std = run_length_bank.locate_change_point(rows, after, until)
        share = np.exp(rows[included, 0])
        share /= share.sum()
        shift = float(share @ rows[included, 5])
        assert cycle == rows[included, 1][share.argmax()]
        assert size == pytest.approx(shift)
        assert std**2 == pytest.approx(float(share @ (rows[included, 21] + (rows[included, 5] - shift) ** 2)))
    # of none it is not that of others
    assert np.isnan(run_length_bank.locate_change_point(rows, 20.0, 30.0)[1:]).all()


def test_a_late_reading_gives_the_same_state_as_in_time():
    rng = np.random.default_rng(2)
    values = rng.normal(size=60)
    model = BankModel(1e-3, 16.0, 0.0, 0.0, 1e-12, 0.01)

    def take(order):
        bank = run_length_bank.workspace(run_length_bank.initial_bank(values[0], 1.0, 0.1, 0, 0.01)[:1])
        count, newest, outliers = 1, 0, np.zeros(2)
        for t in order:
            passed, lag = float(max(t - newest, 0)), float(max(newest - t, 0))
            measurement = Measurement(float(values[t]), 1.0, passed, lag, float(t), -1.0)
            count, *_ = run_length_bank.update(bank, count, model, measurement, outliers, 0.0)
            newest = max(newest, t)
        return run_length_bank.moments(run_length_bank.stored(bank, count))

    in_time = take(range(1, 60))
    shuffled = take([*range(1, 20), 25, 20, 22, 21, 24, 23, *range(26, 60)])
    assert shuffled[0] == pytest.approx(in_time[0], abs=1e-9)
    assert shuffled[1] == pytest.approx(in_time[1], rel=1e-7, abs=1e-12)


def test_an_announced_change_leaves_one_history_and_knows_its_size():
    rng = np.random.default_rng(4)
    values = rng.normal(size=400)
    values[200:] += 2.0
    told = np.where(np.arange(400) == 200, 1.0, -1.0)
    table, _, _ = run(values, BankModel(1e-3, 16.0, 0.0, 0.0, 0.003, 0.01), announced=told)
    assert set(run_length_bank.workspace(table)[: len(table)]["change_cycle"].tolist()) == {200}
    cycle, size, std = run_length_bank.locate_change_point(table, 199, 200)
    assert cycle == 200
    # two lines of 200 points with a common slope, known level and slope to within their data
    assert std == pytest.approx(0.2, rel=0.1)
    assert abs(size - 2.0) < 3.0 * std


def test_the_bank_stays_small_and_normalised_over_a_long_run():
    rng = np.random.default_rng(5)
    values = rng.normal(size=3000)
    values[::97] += 12.0
    table, _, statistics = run(values, BankModel(3e-3, 16.0, 0.0, 0.0, 0.003, 0.01))
    assert len(table) <= run_length_bank.CAPACITY
    bank = run_length_bank.workspace(table)[: len(table)]
    assert np.exp(bank["log_weight"]).sum() == pytest.approx(1.0, abs=1e-9)
    assert np.all(np.diff(bank["change_cycle"]) >= 0)
    assert np.isfinite(table).all()
    # outliers alone, however regular, are no batch change
    assert statistics[20:].max() < run_length_bank.threshold(1e5)


def test_a_threshold_for_each_rate():
    assert run_length_bank.threshold(1e6) - run_length_bank.threshold(1e5) == pytest.approx(math.log(10.0))


@pytest.mark.parametrize("share", [0.0, 0.03])
def test_how_many_outliers_there_are_is_learned(share):
    rng = np.random.default_rng(6)
    values = rng.normal(size=3000)
    odd = rng.random(3000) < share
    values[odd] += 10.0 * rng.normal(size=int(odd.sum()))
    prior = 0.005
    bank = run_length_bank.workspace(run_length_bank.initial_bank(values[0], 1.0, 0.1, 0, prior))
    count, outliers, model = 2, np.zeros(2), BankModel(3e-3, 16.0, 0.0, 0.0, prior, 0.01)
    for t, value in enumerate(values[1:], start=1):
        measurement = Measurement(float(value), 1.0, 1.0, 0.0, float(t), 0.0)
        count, *_ = run_length_bank.update(bank, count, model, measurement, outliers, 0.0)
    learned = run_length_bank.outlier_probability(prior, *outliers)
    # a quarter of the outliers are too small to be told from good values
    assert 0.6 * share <= learned <= 1.2 * share + 0.2 * prior


@pytest.mark.slow
def test_the_tracker_gives_the_alarms_of_its_bank_alone():
    rng = np.random.default_rng(12)
    z = rng.normal(size=1600) + 3.3e-4 * np.arange(1600)
    z[500:] += 2.0
    z[1100:] -= 1.0
    z[::150] += 9.0
    config, std = TrackerSettings(batch=BatchKnowledge.UNKNOWN), 0.002
    state, ours, variances = initial_state(), [], []
    for i, value in enumerate(z.tolist()):
        done = wear_batch.update(config, state, FrictionObservation(i, 0.2 + std * value, std))
        state = done.state
        variances.append(scatter_correlation.variance_over_differences(state.noise.variogram.correlation))
        if done.shift is not None:
            ours.append((i, done.shift.change_cycle, done.shift.size / std))
    # the bank, told what the tracker has to learn: the scale of the noise, and how white it takes it to be
    model = BankModel(
        config.hazard, config.step_std**2, 0.0, 0.0, config.outlier_probability, config.slope_std**2
    )
    first = run_length_bank.initial_bank(z[0], 1.0, config.slope_std, 0, config.outlier_probability)
    bank, outliers = run_length_bank.workspace(first), np.zeros(2)
    count, accepted, its = len(first), 0.0, []
    for t in range(1, len(z)):
        measurement = Measurement(float(z[t]), variances[t], 1.0, 0.0, float(t), 0.0)
        count, _, statistic, _ = run_length_bank.update(bank, count, model, measurement, outliers, accepted)
        if statistic > run_length_bank.threshold(config.false_alarm_cycles):
            before, accepted = accepted, float(t)
            change, size, _ = run_length_bank.locate_change_point(
                run_length_bank.stored(bank, count), before, accepted
            )
            its.append((t, change, size))
    assert len(its) == 2
    assert len(ours) == len(its)
    for mine, other in zip(ours, its, strict=True):
        assert abs(mine[0] - other[0]) <= 2
        assert abs(mine[1] - other[1]) <= 3
        assert mine[2] == pytest.approx(other[2], abs=0.15)


def test_a_series_is_its_measurements_one_after_another():
    rng = np.random.default_rng(7)
    series = np.column_stack(
        [
            rng.normal(size=40), rng.uniform(0.5, 2.0, 40), np.ones(40), np.zeros(40), np.arange(40.0),
            np.where(np.arange(40) == 25, 1.0, 0.0),
        ]
    )  # fmt: skip
    model, banks = BankModel(1e-3, 16.0, 0.0, 0.0, 0.003, 0.01), []
    for _ in range(2):
        first = run_length_bank.initial_bank(series[0, 0], series[0, 1], 0.1, 0, 0.003)
        banks.append((run_length_bank.workspace(first), np.zeros(2)))
    (one, outliers_one), (other, outliers_other) = banks
    count, total = 2, 0.0
    for row in series[1:]:
        count, density, *_ = run_length_bank.update(one, count, model, Measurement(*row), outliers_one, 0.0)
        total += density
    assert run_length_bank.update_series(other, 2, model, series, outliers_other, 0.0) == (count, total)
    assert run_length_bank.stored(other, count).tolist() == run_length_bank.stored(one, count).tolist()


def test_level_of_the_first_batch_is_total_less_offset_in_mean_and_covariance():
    rng = np.random.default_rng(9)
    rows, roots = np.zeros((5, run_length_bank.WIDTH)), rng.normal(size=(5, 4, 4))
    rows[:, 0], rows[:, 2:6] = np.log(rng.dirichlet(np.ones(5))), rng.normal(size=(5, 4))
    rows[:, 6:] = (roots @ roots.transpose(0, 2, 1)).reshape(5, 16)
    moments, offset, offset_std = state_reports._bank_moments(rows)
    share, means = np.exp(rows[:, 0]), rows[:, 2:6]
    apart = means - share @ means
    covariance = np.einsum("i,iab->ab", share, roots @ roots.transpose(0, 2, 1))
    covariance += np.einsum("i,ia,ib->ab", share, apart, apart)
    combined = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    of_level_and_slope = combined @ covariance @ combined.T
    assert moments[:2] == pytest.approx(combined @ (share @ means))
    assert moments[2:] == pytest.approx(of_level_and_slope[np.triu_indices(2)])
    assert (offset, offset_std**2) == pytest.approx(((share @ means)[2], covariance[2, 2]))
