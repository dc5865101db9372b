"""Wear that goes on at another rate: weighed as independent filters weigh it, believed, told, no batch."""

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

import impactcell
from impactcell.records import Quality
from impactcell.serialization import pack, unpack
from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import (
    BatchKnowledge,
    FrictionObservation,
    TrackerSettings,
    TrackerState,
    rate_changes,
    run_length_bank,
    run_length_update,
)
from impactcell.tracking.wear_batch.run_length_model import SLOPE, BankModel, Measurement

UNIT, BASE = 0.002, 0.2
SECOND = 10**9
HAZARD = 1e-9
"""So rare that no two changes come together."""
PRIOR = 0.1**2
MODEL = BankModel(HAZARD, 16.0, 0.0, 0.0, 0.0, PRIOR)


def white(seed, cycles):
    return np.random.default_rng([31, seed]).normal(size=cycles)


def bent(cycles, begin, before, after):
    """Level in standard deviations of an estimate; the rate is another from cycle `begin` on."""
    t = np.arange(cycles)
    return before * np.minimum(t, begin) + after * np.maximum(t - begin, 0)


def run_in(cycles, size, time):
    return -size * (1.0 - np.exp(-np.arange(cycles) / time))


def weighed(values, told=None):
    """The bank and the hypotheses of another rate after all values, as the tracker takes them in."""
    first = run_length_bank.initial_bank(values[0], 1.0, math.sqrt(PRIOR), 0, 1e-12)[:1]
    rows, rates, statistics = first, run_length_bank.EMPTY, []
    for cycle, value in enumerate(values[1:], 1):
        announced = -1.0 if told is None else told.get(cycle, -1.0)
        measurement = Measurement(float(value), 1.0, 1.0, 0.0, float(cycle), announced)
        bank = run_length_bank.workspace(rows)
        count, density, _ = run_length_bank.take(bank, len(rows), MODEL, measurement, np.zeros(2), 0.0)
        places = rate_changes.ROWS
        others = run_length_bank.workspace(rates, places)
        found = rate_changes.take(
            others,
            len(rates),
            run_length_bank.records(rows),
            MODEL,
            measurement,
            rate_changes.BankOutcome(0.0, density, 0.0, -rate_changes.YOUNG),
        )
        statistics.append(rate_changes.statistics(bank[:count], others[:found], MODEL, measurement, 0.0))
        rows, rates = run_length_bank.stored(bank, count), run_length_bank.stored(others, found)
    return rows, run_length_bank.records(rates), statistics


def kalman(mean, covariance):
    oracle = KalmanFilter(2, 1)
    oracle.x, oracle.P = np.array(mean, float).reshape(2, 1), np.array(covariance, float)
    oracle.F, oracle.H = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    oracle.Q, oracle.R = np.zeros((2, 2)), np.array([[1.0]])
    return oracle


def filtered(oracle, value):
    """Log density of one more value, which is taken in."""
    oracle.predict()
    oracle.update(value)
    return float(oracle.log_likelihood)


def test_one_change_of_rate_is_filterpys_filter_begun_anew_with_another_slope():
    values = bent(20, 12, 1.5, 0.1) + white(1, 20)
    _, rates, _ = weighed(values)
    steady, plain = kalman([values[0], 0.0], np.diag([1.0, PRIOR])), []
    begun = {}
    for cycle, value in enumerate(values[1:], 1):
        before = kalman(steady.x, steady.P)
        plain.append(filtered(steady, value))
        slope, variance = float(before.x[1, 0]), float(before.P[1, 1])
        if slope**2 > 9.0 * variance:
            before.predict()  # the old rate leads up to this cycle
            other = kalman([before.x[0, 0], 0.0], np.diag([before.P[0, 0], slope**2 - 9.0 * variance]))
            other.update(value)
            evidence = run_length_update.slope_evidence(slope, variance, PRIOR)
            begun[cycle] = [other, evidence + float(other.log_likelihood)]
        for first, (other, _) in begun.items():
            if first < cycle:
                begun[first][1] += filtered(other, value)
    assert len(begun) > 5
    assert rates["change_cycle"].tolist() == list(begun)
    prior = math.log(rate_changes.RATE_HAZARD * HAZARD)
    for hypothesis, (first, (other, likelihood)) in zip(rates, begun.items(), strict=True):
        unchanged = sum(plain[first - 1 :])
        assert hypothesis["log_weight"] == pytest.approx(prior + likelihood - unchanged, abs=1e-5)
        assert hypothesis["mean"][:2] == pytest.approx(other.x[:, 0], rel=1e-6)
        assert hypothesis["covariance"][:2, :2] == pytest.approx(other.P, rel=1e-6)


def test_the_statistics_weigh_another_rate_against_all_else():
    values = bent(60, 30, 1.5, 0.1) + white(2, 60)
    rows, rates, statistics = weighed(values, dict.fromkeys(range(60), 0.0))
    bank = run_length_bank.records(rows)
    evidence = [
        run_length_update.slope_evidence(h["mean"][SLOPE], h["covariance"][SLOPE, SLOPE], PRIOR) for h in bank
    ]
    weights = np.exp(bank["log_weight"] + evidence)
    batch = weights[bank["change_cycle"] > 0].sum()
    none = weights[bank["change_cycle"] == 0].sum()
    rate = np.exp(rates["log_weight"]).sum()
    last = statistics[-1]
    assert last.rate == pytest.approx(math.log(rate / (batch + none) / HAZARD / rate_changes.RATE_HAZARD))
    assert last.batch == pytest.approx(math.log(batch / (rate + none) / HAZARD))
    assert last.batch_over_rate == pytest.approx(math.log(batch / rate / HAZARD))
    assert last.rate > 20.0 > last.batch


def test_wear_that_was_never_seen_has_no_rate_that_could_change():
    _, rates, statistics = weighed(white(3, 400))
    assert len(rates) == 0
    assert statistics[-1].rate == -math.inf


def test_a_step_that_was_announced_says_nothing_of_the_rate():
    values = bent(80, 80, 1.0, 1.0) + white(4, 80)
    quiet, told = values.copy(), {60: 1.0}
    values[60:] += 30.0
    with_step, without = weighed(values, told)[1], weighed(quiet)[1]
    # one measurement is lost to the new level
    assert np.exp(with_step["log_weight"]).sum() < 3.0 * np.exp(without["log_weight"]).sum()
    ours, others = (h["mean"][h["log_weight"].argmax()][SLOPE] for h in (with_step, without))
    assert abs(ours - others) < 0.3


def test_however_long_no_more_are_kept_than_there_is_room_for():
    _, rates, _ = weighed(bent(600, 600, 0.5, 0.5) + white(5, 600))
    assert 0 < len(rates) <= rate_changes.CAPACITY
    assert np.all(np.diff(rates["change_cycle"]) > 0)


def tracked(level, knowledge, seed=0, ids=None):
    """Outcomes of the tracker on wear in standard deviations of an estimate."""
    settings, state, outcomes = TrackerSettings(batch=knowledge), wear_batch.initial_state(), []
    for cycle, value in enumerate(BASE + UNIT * (level + white(seed, len(level)))):
        batch = "A" if ids is None else ids[cycle]
        reading = FrictionObservation(cycle, value, UNIT, (cycle + 1) * SECOND, batch)
        outcomes.append(wear_batch.update(settings, state, reading))
        state = outcomes[-1].state
    return outcomes


@pytest.mark.slow
@pytest.mark.parametrize("knowledge", BatchKnowledge)
@pytest.mark.parametrize(("before", "after"), [(0.2, 0.0), (0.05, 0.01), (0.02, 0.05)])
def test_another_rate_is_found_and_told_and_no_batch_is_blamed(knowledge, before, after):
    outcomes = tracked(bent(900, 450, before, after), knowledge, seed=2)
    assert not any(outcome.shift for outcome in outcomes)
    ((cycle, note),) = [(c, n) for c, o in enumerate(outcomes) for n in o.notes]
    assert 450 < cycle < 650
    change = outcomes[-1].state.rate_change
    assert change.detected_at == cycle
    assert abs(change.cycle - 450) < 60
    assert change.before == pytest.approx(UNIT * before, rel=0.2)
    first, rate, was = change.cycle, 1000.0 * change.after, 1000.0 * change.before
    interval = f"{rate:.3g} ± {1960.0 * change.after_std:.2g}"
    assert note == f"since cycle {first} mu_s goes by {interval} in 1000 cycles, {was:.3g} before"
    assert abs(change.after - UNIT * after) < 4.0 * change.after_std
    assert outcomes[cycle].wear.quality is Quality.UNCERTAIN
    wear = outcomes[-1].wear
    assert abs(wear.rate_per_cycle - UNIT * after) < 3.0 * wear.rate_std
    truth = BASE + UNIT * bent(900, 450, before, after)[-1]
    assert abs(wear.level - truth) < 3.0 * wear.level_std
    assert wear.level_std < 0.6 * UNIT


@pytest.mark.parametrize("rate", [1e-5, -1e-4])
@pytest.mark.parametrize("std", [UNIT, None])
def test_values_without_scatter_have_one_rate(rate, std):
    """Differences of them are wear and nothing else."""
    cycles = np.arange(400)
    tracked = impactcell.track(cycles, 0.3 + rate * cycles, std)
    assert (tracked.notes, tracked.alarms) == ((), ())
    assert abs(tracked.wear.rate_per_cycle - rate) < 2.0 * tracked.wear.rate_std < 0.3 * abs(rate)


@pytest.mark.slow
@pytest.mark.parametrize("size", [5.0, 15.0])
@pytest.mark.parametrize("time", [50.0, 200.0, 600.0])
def test_a_surface_that_runs_in_is_no_other_material(size, time):
    """It was one or two changes of the batch in nearly each of these."""
    found = 0
    for seed in range(3):
        values = BASE + UNIT * (run_in(1000, size, time) + white(100 + seed, 1000))
        series = impactcell.track(np.arange(1000), values, np.full(1000, UNIT))
        found += sum(alarm.alarm == "BatchShift" for alarm in series.alarms)
    assert found == 0


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, -2.0])
def test_a_batch_in_steep_wear_is_still_a_batch(size):
    level = bent(900, 900, 0.05, 0.05)
    level[500:] += size
    outcomes = tracked(level, BatchKnowledge.UNKNOWN, seed=6)
    (cycle,) = [c for c, outcome in enumerate(outcomes) if outcome.shift]
    assert 500 <= cycle < 600
    assert outcomes[-1].state.rate_change is None
    assert abs(outcomes[-1].batch.last_shift - size * UNIT) < 3.0 * outcomes[-1].batch.last_shift_std


@pytest.mark.slow
def test_a_batch_found_before_the_rate_changed_stays_as_it_was_found():
    level = bent(1000, 700, 0.05, 0.0)
    level[400:] += 3.0
    outcomes = tracked(level, BatchKnowledge.UNKNOWN, seed=7)
    (found,) = [c for c, outcome in enumerate(outcomes) if outcome.shift]
    change, last = outcomes[-1].state.rate_change, outcomes[-1].state.change_point
    assert found < 420 < 700 < change.detected_at
    assert last == outcomes[change.detected_at - 1].state.change_point
    assert abs(outcomes[-1].wear.level - BASE - UNIT * (level[-1] - 3.0)) < 3.0 * outcomes[-1].wear.level_std


@pytest.mark.slow
def test_known_batches_keep_their_offsets_when_the_rate_changes():
    """A bank that does not know that a batch has come back knows its offset less well."""
    turns = np.arange(1000) // 60 % 2
    ids = ["AB"[turn] for turn in turns]
    level = bent(1000, 600, 0.1, 0.0)
    outcomes = tracked(level + 4.0 * turns, BatchKnowledge.KNOWN, seed=8, ids=ids)
    found = outcomes[-1].state.rate_change.detected_at
    assert 600 < found < 700
    before, after = outcomes[found - 1], outcomes[found]
    assert after.state.filter.batches == before.state.filter.batches
    assert (after.batch.offset, after.batch.offset_std) == (before.batch.offset, before.batch.offset_std)
    for outcome, cycle in ((after, found), (outcomes[-1], 999)):
        assert abs(outcome.wear.level - BASE - UNIT * level[cycle]) < 3.5 * outcome.wear.level_std
        offset = 4.0 * UNIT * turns[cycle]
        assert abs(outcome.batch.offset - offset) <= 3.0 * outcome.batch.offset_std
    assert abs(outcomes[-1].wear.rate_per_cycle) < 3.0 * outcomes[-1].wear.rate_std


def test_named_batches_that_differ_do_not_keep_a_rate_from_being_found():
    turns = np.arange(800) // 30
    steps = 4.0 * np.random.default_rng(5).normal(size=turns[-1] + 1)
    ids = [f"batch {turn}" for turn in turns]
    outcomes = tracked(bent(800, 600, 0.1, 0.0) + steps[turns], BatchKnowledge.KNOWN, seed=9, ids=ids)
    assert 600 < outcomes[-1].state.rate_change.detected_at < 700


@pytest.mark.slow
def test_a_rate_that_has_just_been_found_is_not_followed_by_another():
    """Weights that no longer added up to one made the next hypothesis e^150 too heavy after lost cycles."""
    cycles = [k if k < 450 else k + 1000 for k in range(520)]
    level = 0.05 * np.minimum(cycles, 450) + 0.2 * np.maximum(np.array(cycles) - 450, 0)
    for seed in range(4):
        settings, state, notes = TrackerSettings(batch=BatchKnowledge.UNKNOWN), wear_batch.initial_state(), []
        for cycle, value in zip(cycles, BASE + UNIT * (level + white(seed, 520)), strict=True):
            reading = FrictionObservation(cycle, value, UNIT, (cycle + 1) * SECOND)
            outcome = wear_batch.update(settings, state, reading)
            state = outcome.state
            weights = run_length_bank.records(state.bank)["log_weight"]
            assert np.exp(weights).sum() == pytest.approx(1.0, abs=1e-9)
            notes += [note for note in outcome.notes if "mu_s goes by" in note]
        assert len(notes) == 1


def test_cycles_that_are_late_lost_or_outliers_change_no_rate():
    level = bent(600, 600, 0.1, 0.1)
    values = BASE + UNIT * (level + white(9, 600))
    settings = TrackerSettings(batch=BatchKnowledge.UNKNOWN)
    state = wear_batch.initial_state()
    order = [*range(200), 205, *range(200, 205), *range(206, 300), *range(340, 600)]
    for cycle in order:
        value = values[cycle] + (30.0 * UNIT if cycle in (150, 420, 500) else 0.0)
        reading = FrictionObservation(cycle, value, UNIT, (cycle + 1) * SECOND)
        outcome = wear_batch.update(settings, state, reading)
        state = outcome.state
        assert outcome.shift is None
    assert state.rate_change is None
    assert abs(outcome.wear.rate_per_cycle - 0.1 * UNIT) < 3.0 * outcome.wear.rate_std


@pytest.mark.parametrize("late", [range(443, 449), range(451, 455)])
def test_late_cycles_of_before_the_rate_or_the_batch_changed_move_nothing(late):
    level = bent(700, 455, 0.3, 0.0)
    level[450:] += 12.0
    values = BASE + UNIT * (level + white(11, 700))
    settings = TrackerSettings(batch=BatchKnowledge.UNKNOWN)
    state, missed = wear_batch.initial_state(), set(late)
    cycles = iter(cycle for cycle in range(700) if cycle not in missed)
    while state.rate_change is None:
        cycle = next(cycles)
        reading = FrictionObservation(cycle, values[cycle], UNIT, (cycle + 1) * SECOND)
        outcome = wear_batch.update(settings, state, reading)
        state = outcome.state
    assert cycle - late[0] < settings.reorder_limit
    for earlier in late:
        reading = FrictionObservation(earlier, values[earlier], UNIT, (cycle + 1) * SECOND)
        again = wear_batch.update(settings, state, reading)
        state = again.state
        if earlier < state.rate_change.cycle:
            assert not again.used
            assert "the cycle is from before wear changed its rate, not used" in again.notes
    assert abs(again.wear.level - BASE - UNIT * (level[cycle] - 12.0)) < 3.0 * again.wear.level_std
    assert abs(again.wear.level - outcome.wear.level) < 2.0 * outcome.wear.level_std


def test_what_is_reported_while_another_rate_is_likelier_weighs_both_alike():
    outcomes = tracked(bent(700, 450, 0.05, 0.01), BatchKnowledge.UNKNOWN, seed=2)
    found = outcomes[-1].state.rate_change.detected_at
    state, prior = outcomes[found - 1].state, (0.1 * UNIT) ** 2
    assert rate_changes.has_rate_changed(state.bank, state.rates, prior)
    rows = rate_changes.mixture(state.bank, state.rates, prior)
    weights = np.exp(run_length_bank.records(rows)["log_weight"])
    rate = weights[len(state.bank) :].sum() / weights.sum()
    # by the statistic that found it with the next cycle, log odds over the prior's
    statistic = run_length_bank.threshold(TrackerSettings().false_alarm_cycles)
    hazard = rate_changes.RATE_HAZARD * TrackerSettings().hazard
    assert math.log(rate / (1.0 - rate)) == pytest.approx(statistic + math.log(hazard), abs=2.0)


@pytest.mark.parametrize("knowledge", BatchKnowledge)
def test_a_restart_just_before_goes_on_to_the_same_bits(knowledge):
    level = bent(700, 450, 0.2, 0.0)
    outcomes = tracked(level, knowledge, seed=2)
    found = outcomes[-1].state.rate_change.detected_at
    before = outcomes[found - 3].state
    assert len(before.rates) > 0
    state = unpack(TrackerState, pack(before))
    settings = TrackerSettings(batch=knowledge)
    for cycle in range(found - 2, found + 5):
        value = BASE + UNIT * (level + white(2, len(level)))[cycle]
        reading = FrictionObservation(cycle, value, UNIT, (cycle + 1) * SECOND, "A")
        state = wear_batch.update(settings, state, reading).state
        assert pack(state) == pack(outcomes[cycle].state)


def test_a_renewed_surface_forgets_the_rate():
    outcomes = tracked(bent(700, 450, 0.2, 0.0), BatchKnowledge.UNKNOWN, seed=2)
    renewed = wear_batch.reset_wear_level(outcomes[-1].state)
    assert renewed.rate_change is None
    assert len(renewed.rates) == 0
