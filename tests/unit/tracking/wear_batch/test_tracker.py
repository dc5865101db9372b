"""One cycle after another: bad readings, missing and late cycles, announced batches, exact replay."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.records import Quality
from impactcell.serialization import pack, unpack
from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import (
    BatchKnowledge,
    FrictionObservation,
    TrackerSettings,
    TrackerState,
    initial_state,
)

KNOWN = TrackerSettings(wear_limit=0.25)
UNKNOWN = TrackerSettings(wear_limit=0.25, batch=BatchKnowledge.UNKNOWN)
STD = 0.002
SECOND = 1_000_000_000


def series(n, seed=0, slope=1e-6, step=0.0, at=0, batch=None):
    mu = 0.2 + STD * np.random.default_rng(seed).normal(size=n) + slope * np.arange(n)
    mu[at:] += step * STD
    return [FrictionObservation(i, float(m), STD, (i + 1) * SECOND, batch) for i, m in enumerate(mu)]


def run(config, readings, state=None):
    state, outcomes = state or initial_state(), []
    for reading in readings:
        outcomes.append(wear_batch.update(config, state, reading))
        state = outcomes[-1].state
    return outcomes


def finite(tracked):
    wear, batch = tracked.wear, tracked.batch
    figures = (wear.level, wear.level_std, wear.rate_per_cycle, wear.rate_std, batch.offset, batch.offset_std)
    return all(map(math.isfinite, figures))


def the_shift(readings, outcomes):
    """The cycle of the only shift that was reported, and its evidence."""
    found = [(r.cycle, o.shift) for r, o in zip(readings, outcomes, strict=True) if o.shift]
    assert len(found) == 1
    cycle, evidence = found[0]
    assert evidence.statistic > evidence.threshold
    return cycle, evidence


@pytest.mark.parametrize("config", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_a_shift_is_found_with_cycle_size_and_rate(config):
    readings = series(400, step=3.0, at=250)
    if config is KNOWN:
        readings = [replace(r, batch_id="A" if r.cycle < 250 else "B") for r in readings]
    outcomes = run(config, readings)
    cycle, evidence = the_shift(readings, outcomes)
    assert 250 <= cycle <= 258
    assert evidence.false_alarm_cycles == 100_000.0
    assert evidence.false_alarm_days == pytest.approx(100_000.0 / 86_400.0, rel=1e-3)
    last = outcomes[-1]
    assert abs(last.batch.last_shift_cycle - 250) <= 2
    assert abs(last.batch.last_shift - 3.0 * STD) < 3.0 * last.batch.last_shift_std
    assert abs(last.wear.rate_per_cycle - 1e-6) < 3.0 * last.wear.rate_std


@pytest.mark.parametrize("config", [KNOWN, UNKNOWN], ids=["known", "unknown"])
@pytest.mark.parametrize(
    ("bad", "why"),
    [
        ({"mu_s": math.nan}, "missing"),
        ({"mu_s": math.inf}, "infinite"),
        ({"mu_s": -math.inf}, "infinite"),
        ({"mu_s": -0.1}, "outside"),
        ({"mu_s": 1e300}, "outside"),
        ({"mu_s_std": 0.0}, "zero"),
        ({"mu_s_std": -1.0}, "standard deviation"),
        ({"mu_s_std": math.inf}, "standard deviation"),
        ({"cycle": 49}, "came again"),
    ],
)
def test_a_bad_reading_is_reported_and_the_next_is_used(config, bad, why):
    readings = series(60, batch="A")
    before = run(config, readings[:50])[-1]
    odd = wear_batch.update(config, before.state, replace(readings[50], **bad))
    assert why in odd.wear.reason
    assert odd.wear.quality is Quality.UNCERTAIN
    assert finite(odd)
    after = wear_batch.update(config, odd.state, readings[51])
    assert after.used
    assert after.wear.quality is Quality.GOOD
    assert finite(after)
    if not odd.used:
        assert odd.wear.level == before.wear.level


def test_it_says_when_no_change_would_be_reported_yet():
    outcomes = run(UNKNOWN, series(40, step=8.0, at=5))
    said = ["still being learned" in o.batch.reason for o in outcomes]
    assert said[0]
    assert all(o.batch.quality is Quality.UNCERTAIN for o, s in zip(outcomes, said, strict=True) if s)
    assert not any(o.shift for o, s in zip(outcomes, said, strict=True) if s)
    # a change in the very first cycles is found as soon as one may be
    (found,) = [o.shift for o in outcomes if o.shift]
    assert found.change_cycle == 5
    assert not said[-1]


def test_nothing_usable_at_all():
    outcomes = run(UNKNOWN, [FrictionObservation(i, math.nan, math.nan) for i in range(5)])
    assert outcomes[-1].wear.quality is Quality.BAD
    assert outcomes[-1].batch.quality is Quality.BAD
    assert "missing" in outcomes[-1].wear.reason
    assert run(UNKNOWN, series(30), outcomes[-1].state)[-1].used


@pytest.mark.parametrize("config", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_a_thousand_identical_values_are_a_stuck_sensor(config):
    readings = series(100, batch="A")
    stuck = [FrictionObservation(100 + i, readings[-1].mu_s, STD, 0, "A") for i in range(1000)]
    outcomes = run(config, [*readings, *stuck])
    assert not any(o.shift for o in outcomes)
    assert "same 1001 times" in outcomes[-1].wear.reason
    assert finite(outcomes[-1])
    good = wear_batch.update(config, outcomes[-1].state, FrictionObservation(1100, 0.2011, STD, 0, "A"))
    assert good.used
    assert good.wear.quality is Quality.GOOD
    fresh = run(config, [FrictionObservation(i, 0.2, STD, 0, "A") for i in range(1000)])
    assert finite(fresh[-1])


def test_a_batch_id_that_flips_every_cycle():
    two = [replace(r, batch_id="AB"[r.cycle % 2]) for r in series(300)]
    new = [replace(r, batch_id=f"B{r.cycle}") for r in series(300)]
    for readings in (two, new):
        outcomes = run(KNOWN, readings)
        assert finite(outcomes[-1])
        assert "too often" in outcomes[-1].wear.reason
        assert not any(o.shift for o in outcomes)
    settled = run(
        KNOWN, [FrictionObservation(300 + i, 0.2, STD, 0, "Z") for i in range(3)], outcomes[-1].state
    )
    assert settled[-1].used


def test_the_clock_may_go_back():
    readings = series(60)
    readings[40] = replace(readings[40], time_ns=readings[10].time_ns)
    outcomes = run(UNKNOWN, readings)
    assert "clock went back by 29 s" in outcomes[40].wear.reason
    assert outcomes[40].used
    assert outcomes[-1].state.clock.period_s == pytest.approx(1.0, rel=0.2)


def test_cycle_numbers_may_restart():
    readings = series(300)
    restarted = [replace(r, cycle=r.cycle - 200) if r.cycle >= 200 else r for r in readings]
    outcomes = run(UNKNOWN, restarted)
    assert "restarted at 0" in outcomes[200].wear.reason
    plain = run(UNKNOWN, readings)
    assert outcomes[-1].wear.rate_per_cycle == plain[-1].wear.rate_per_cycle


@pytest.mark.parametrize("starts_at", [249, 251, 255, 300], ids=["before", "within", "at once", "later"])
def test_a_shift_keeps_its_cycle_number_when_the_module_starts_anew(starts_at):
    """It was -50 and less, which OPC UA cannot send; and another number is another shift to who positions."""
    readings = [
        replace(r, cycle=r.cycle - starts_at + 1, session=8)
        if r.cycle >= starts_at
        else replace(r, session=7)
        for r in series(330, step=4.0, at=250)
    ]
    outcomes = run(UNKNOWN, readings)
    (told,) = [o.shift.change_cycle for o in outcomes if o.shift]
    number = 250 if starts_at > 250 else 250 - starts_at + 1
    assert abs(told - number) <= 2
    since = [o.batch.last_shift_cycle for o in outcomes[270:]]
    assert all(abs(cycle - number) <= 2 for cycle in since)
    assert len(set(since[29:])) == 1
    assert outcomes[240].batch.last_shift_cycle == 0


@pytest.mark.parametrize("config", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_missing_cycles_count_as_wear(config):
    readings = [r for r in series(800, slope=2e-5, batch="A") if r.cycle % 3 == 0]
    last = run(config, readings)[-1]
    assert abs(last.wear.rate_per_cycle - 2e-5) < 3.0 * last.wear.rate_std
    assert abs(last.wear.level - (0.2 + 2e-5 * 798)) < 3.5 * last.wear.level_std


@pytest.mark.parametrize("config", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_late_cycles_hardly_change_the_outcome(config):
    readings = series(200, batch="A")
    late = [*readings[:120], *readings[125:140], *readings[120:125], *readings[140:]]
    ours, plain = run(config, late), run(config, readings)
    assert "came 19 cycles late" in ours[135].wear.reason
    assert ours[135].used
    assert ours[-1].wear.level == pytest.approx(plain[-1].wear.level, abs=0.3 * plain[-1].wear.level_std)
    assert ours[-1].wear.rate_std == pytest.approx(plain[-1].wear.rate_std, rel=0.05)


@pytest.mark.parametrize("config", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_an_expected_change_is_silent_and_rebaselines(config):
    readings = series(300, step=5.0, at=150, batch="A")
    readings = [replace(r, batch_id="B") if r.cycle >= 150 else r for r in readings]
    readings[150] = replace(readings[150], expected_change=True)
    outcomes = run(config, readings)
    assert not any(o.shift for o in outcomes)
    assert [i for i, o in enumerate(outcomes) if o.expected] == [150]
    last = outcomes[-1]
    assert abs(last.batch.offset - 5.0 * STD) < 3.0 * last.batch.offset_std
    assert last.wear.probability_above_limit < 1e-6


def test_ids_may_come_late_and_go_away():
    readings = series(300)
    readings = [replace(r, batch_id="A") if 100 <= r.cycle < 200 else r for r in readings]
    outcomes = run(KNOWN, readings)
    assert all(o.used and finite(o) for o in outcomes)
    assert not any(o.shift for o in outcomes)


@pytest.mark.parametrize("step", [0.0, 4.0], ids=["no change", "a change"])
def test_cycles_without_an_id_still_wear(step):
    readings = series(500, slope=4e-5, step=step, at=330, batch="A")
    readings = [replace(r, batch_id=None) if 300 <= r.cycle < 380 else r for r in readings]
    outcomes = run(KNOWN, readings)
    assert sum(o.shift is not None for o in outcomes) == (step > 0.0)
    back = outcomes[380].wear
    total = outcomes[380].batch.offset + back.level
    assert abs(total - (0.2 + step * STD + 4e-5 * 380)) < 4.0 * back.level_std
    assert abs(outcomes[-1].wear.rate_per_cycle - 4e-5) < 3.0 * outcomes[-1].wear.rate_std


def test_a_known_batch_that_comes_back_is_recognised():
    readings = [replace(r, batch_id="ABA"[min(r.cycle // 200, 2)]) for r in series(600)]
    readings = [replace(r, mu_s=r.mu_s + 4.0 * STD) if r.batch_id == "B" else r for r in readings]
    last = run(KNOWN, readings)[-1]
    assert (last.batch.batch_id, last.batch.offset, last.batch.offset_std) == ("A", 0.0, 0.0)


@pytest.mark.parametrize("run_length", [1, 25])
def test_two_parts_in_turn_are_told_to_differ_once_and_a_third_is_told_too(run_length):
    names = ["AB"[(i // run_length) % 2] if i < 500 else "C" for i in range(550)]
    offsets = {"A": 0.0, "B": 3.0 * STD, "C": -5.0 * STD}
    readings = [
        replace(r, batch_id=name, mu_s=r.mu_s + offsets[name])
        for r, name in zip(series(550, seed=5), names, strict=True)
    ]
    outcomes = run(KNOWN, readings)
    found = [r.cycle for r, o in zip(readings, outcomes, strict=True) if o.shift]
    in_turn = [cycle for cycle in found if cycle < 500]
    # a pair that was nearly certain when it went may be told from either side
    assert 1 <= len(in_turn) <= 2
    assert in_turn[-1] < 100
    assert [500 <= cycle < 510 for cycle in found[len(in_turn) :]] == [True]
    last = outcomes[499]
    assert abs(last.batch.offset - offsets[names[499]]) < 4.0 * max(last.batch.offset_std, 1e-12)


@pytest.mark.parametrize("off", [6.0, 60.0, 150.0, -80.0])
@pytest.mark.parametrize("config", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_a_first_estimate_however_far_off_is_neither_batch_nor_wear(config, off):
    readings = series(200, seed=9, batch="A")
    readings[0] = replace(readings[0], mu_s=readings[0].mu_s + off * STD)
    outcomes = run(config, readings)
    assert not any(o.shift for o in outcomes)
    assert max(o.wear.probability_above_limit for o in outcomes[20:]) < 0.5
    last = outcomes[-1].wear
    assert abs(last.level - 0.2) < 4.0 * last.level_std < 4e-3


@pytest.mark.slow
def test_the_interval_of_cycles_left_is_not_that_of_wear_that_is_steady_for_ever():
    """Wear that slows down by half over the next thousand cycles, as it was seen for a thousand."""
    readings = series(1000, seed=3, slope=2e-5)
    wear = run(replace(UNKNOWN, wear_limit=0.236), readings)[-1].wear
    # 800 cycles at the rate seen; level after h cycles, the rate falling by 1e-8 a cycle: 2e-5 h - 5e-9 h^2
    excess = 0.236 - (0.2 + 2e-5 * 999)
    slowed = (2e-5 - math.sqrt(4e-10 - 2e-8 * excess)) / 1e-8
    hastened = (-2e-5 + math.sqrt(4e-10 + 2e-8 * excess)) / 1e-8
    assert wear.cycles_to_limit_low < hastened < wear.cycles_to_limit < slowed < wear.cycles_to_limit_high
    assert wear.cycles_to_limit_high < 2.0 * slowed


@pytest.mark.slow
@pytest.mark.parametrize("batch", [None, "A"], ids=["unknown", "known"])
@pytest.mark.parametrize(
    ("wear", "limit"),
    [
        (lambda k: 2e-5 * k, 0.235),
        (lambda k: -0.02 * np.expm1(-k / 300.0), 0.225),
        (lambda k: 0.03 * (k / 1500.0) ** 2, 0.225),
    ],
    ids=["steady", "runs in, and never there", "hastens"],
)
def test_the_limit_is_no_surer_at_the_horizon_than_by_the_interval_of_cycles_left(wear, limit, batch):
    """Sure by more than 97.5 % to be passed within it, and a 95 % interval that ends beyond it: not both."""
    readings = [replace(r, mu_s=r.mu_s + wear(float(r.cycle))) for r in series(1200, slope=0.0, batch=batch)]
    outcomes = run(replace(KNOWN if batch else UNKNOWN, wear_limit=limit), readings)
    sure = [o for o in outcomes if o.probability_at_horizon > 0.975]
    assert all(o.wear.cycles_to_limit_high <= o.horizon for o in sure)
    assert sure or limit == 0.225


@pytest.mark.parametrize("name", ["A", "B"], ids=["in the first batch", "in a later one"])
def test_a_change_within_a_known_batch_is_found_and_is_no_wear(name):
    readings = [replace(r, batch_id="A" if r.cycle < 200 else name) for r in series(700, slope=2e-6)]
    readings = [replace(r, mu_s=r.mu_s + 3.0 * STD) if r.cycle >= 450 else r for r in readings]
    outcomes = run(KNOWN, readings)
    cycle, _ = the_shift(readings, outcomes)
    assert 450 <= cycle <= 460
    last = outcomes[-1]
    assert abs(last.batch.last_shift_cycle - 450) <= 2
    assert abs(last.batch.offset - 3.0 * STD) < 3.0 * last.batch.offset_std + 0.5 * STD
    assert last.batch.batch_id == name
    # level and rate are those of the first batch, before and after
    assert abs(last.wear.level - (0.2 + 2e-6 * 699)) < 3.5 * last.wear.level_std
    assert abs(last.wear.rate_per_cycle - 2e-6) < 3.0 * last.wear.rate_std
    after = [FrictionObservation(700 + i, 0.2 + 2e-6 * (700 + i), STD, 0, "C") for i in range(50)]
    assert all(finite(o) and o.used for o in run(KNOWN, after[:4], last.state))


def test_wear_reset_starts_a_new_reference():
    last = run(UNKNOWN, series(200, slope=1e-5))[-1]
    fresh = wear_batch.update(
        UNKNOWN, wear_batch.reset_wear_level(last.state), FrictionObservation(200, 0.15, STD, 300 * SECOND)
    )
    assert fresh.wear.level == pytest.approx(0.15)
    assert fresh.state.noise.factor == last.state.noise.factor or fresh.used


@pytest.mark.slow
def test_how_friction_walks_stays_learned_over_a_reset_of_wear():
    """It was taken for steady until the walk was found anew, and each of its turns for a batch."""
    rng = np.random.default_rng(3)
    level = 0.2 + np.cumsum(0.6 * STD * rng.standard_normal(700))
    mu = level + STD * rng.standard_normal(700)
    readings = [FrictionObservation(i, float(m), STD, (i + 1) * SECOND) for i, m in enumerate(mu)]
    learned = run(UNKNOWN, readings[:450])[-1].state
    walks = learned.level_variance, learned.slope_variance
    assert max(walks) > 0.0
    outcomes = run(UNKNOWN, readings[450:650], wear_batch.reset_wear_level(learned))
    assert [(o.state.level_variance, o.state.slope_variance) for o in outcomes[:60]] == [walks] * 60
    assert not any(o.shift for o in outcomes)
    off = [(o.wear.level - level[450 + i]) / o.wear.level_std for i, o in enumerate(outcomes)]
    assert np.sqrt(np.mean(np.square(off))) < 1.5
    # one that is steady is commissioned as ever
    steady = run(UNKNOWN, series(300))[-1].state
    fresh = run(UNKNOWN, series(1), wear_batch.reset_wear_level(steady))[-1].state
    assert fresh.commissioning is not None


@pytest.mark.parametrize("declared", [math.nan, STD, STD / 30.0], ids=["none", "right", "far too small"])
def test_the_scale_of_the_noise_is_learned(declared):
    readings = [replace(r, mu_s_std=declared) for r in series(600, seed=3)]
    outcomes = run(UNKNOWN, readings)
    assert not any(o.shift for o in outcomes)
    state = outcomes[-1].state
    assert state.noise.factor * state.noise.usual_std**2 == pytest.approx(STD**2, rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("config", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_a_restored_state_replays_to_the_same_bits(config):
    readings = series(700, step=3.0, at=350, batch="A")
    straight = run(config, readings)
    state = initial_state()
    for reading in readings:
        data = pack(state)
        state = wear_batch.update(config, unpack(TrackerState, data), reading).state
    assert pack(state) == pack(straight[-1].state)


def test_the_input_state_is_not_written_to():
    before = run(UNKNOWN, series(120))[-1].state
    data = pack(before)
    run(UNKNOWN, [FrictionObservation(120 + i, 0.25, STD) for i in range(20)], before)
    assert pack(before) == data


readings_of_any_kind = st.builds(
    FrictionObservation,
    cycle=st.integers(0, 60),
    mu_s=st.one_of(st.floats(), st.floats(0.1, 0.3)),
    mu_s_std=st.one_of(st.floats(), st.floats(1e-4, 1e-2)),
    time_ns=st.integers(0, 2**62),
    batch_id=st.sampled_from([None, "A", "B", ""]),
    expected_change=st.booleans(),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(readings_of_any_kind, max_size=25), st.sampled_from([KNOWN, UNKNOWN]))
def test_no_readings_whatever_break_the_state(readings, config):
    state = initial_state()
    for reading in readings:
        tracked = wear_batch.update(config, state, reading)
        state = tracked.state
        assert np.isfinite(state.bank[:, 1:]).all()
        assert tracked.wear.quality is Quality.BAD or finite(tracked)
        assert tracked.used or tracked.wear.reason
    assert pack(unpack(TrackerState, pack(state))) == pack(state)


@pytest.mark.slow
def test_a_change_among_the_first_cycles_leaves_the_level_that_of_the_cycles_before_it():
    """Friction at the first batch is what it was drawn with, whether five cycles of it came or hundreds."""
    lasts = [run(UNKNOWN, series(120, seed=seed, slope=0.0, step=4.0, at=5))[-1] for seed in range(10)]
    off = np.array([(last.wear.level - 0.2) / last.wear.level_std for last in lasts])
    assert np.sqrt(np.mean(off**2)) < 1.8
    for last in lasts:
        assert abs(last.batch.offset - 4.0 * STD) < 3.5 * last.batch.offset_std


def test_what_all_estimates_share_stands_beside_the_level_and_moves_nothing_else():
    plain = series(60, step=8.0, at=40)
    shared = [replace(reading, common_std=0.003 + 0.002 * (reading.cycle % 2)) for reading in plain]
    without, outcomes = run(UNKNOWN, plain), run(UNKNOWN, shared)
    mean = math.sqrt(0.5 * (0.003**2 + 0.005**2))
    assert math.isnan(without[-1].wear.level_common_std)
    assert outcomes[39].wear.level_common_std == pytest.approx(mean)
    for one, other in zip(outcomes, without, strict=True):
        assert replace(one.wear, level_common_std=0.0) == replace(other.wear, level_common_std=0.0)
    late = [replace(one, cycle=one.cycle + 60, common_std=0.1) for one in series(20, step=8.0)]
    after = run(UNKNOWN, late, outcomes[-1].state)[-1].wear
    assert any(one.shift for one in outcomes), (
        "another batch tells of its offset, not of the reference's level"
    )
    assert after.level_common_std == pytest.approx(mean, rel=0.05)


def test_what_estimates_share_is_learned_anew_with_the_level_and_kept_over_unusable_cycles():
    shared = [replace(reading, common_std=0.003) for reading in series(30)]
    state = run(KNOWN, shared)[-1].state
    unusable = wear_batch.update(KNOWN, state, FrictionObservation(30, math.nan, math.nan, 31 * SECOND))
    assert unusable.wear.level_common_std == pytest.approx(0.003)
    untold = wear_batch.update(KNOWN, state, replace(shared[0], cycle=30, common_std=math.nan))
    assert untold.wear.level_common_std == pytest.approx(0.003)
    fresh = wear_batch.reset_wear_level(state)
    renewed = wear_batch.update(KNOWN, fresh, replace(shared[0], cycle=31, common_std=0.001))
    assert renewed.wear.level_common_std == pytest.approx(0.001)


@pytest.mark.slow
@pytest.mark.parametrize("config", [KNOWN, UNKNOWN], ids=["known", "unknown"])
def test_one_wrong_cycle_number_bends_neither_level_nor_rate(config):
    """All is as if that cycle had not been measured."""
    readings = series(700, slope=2e-5, batch="A")
    wrong = replace(readings[150], cycle=10_150)
    lost = run(config, [*readings[:150], replace(readings[150], mu_s=math.nan), *readings[151:]])
    outcomes = run(config, [*readings[:150], wrong, *readings[151:]])
    for outcome, expected in zip(outcomes[151:], lost[151:], strict=True):
        assert repr((outcome.wear, outcome.batch, outcome.shift)) == repr(
            (expected.wear, expected.batch, expected.shift)
        )
    assert [n for o in outcomes for n in o.notes] == ["cycle number 10150 after 149 is in doubt, not used"]
    assert outcomes[150].wear.quality is Quality.UNCERTAIN


def test_cycles_that_were_lost_before_the_first_that_is_followed_again_have_passed():
    """An outage that is longer than all before it, and the wear in it."""
    rate = 2e-6
    readings = series(600, slope=rate)
    later = [replace(r, cycle=r.cycle + 5_000, mu_s=r.mu_s + 5_000 * rate) for r in readings[200:]]
    outcomes = run(UNKNOWN, [*readings[:200], *later])
    wear = outcomes[-1].wear
    assert outcomes[-1].state.clock.last == 5_599
    assert abs(wear.rate_per_cycle - rate) < 3.0 * wear.rate_std < rate
    assert [o.used for o in outcomes].count(False) == 1


def test_a_change_that_is_said_with_a_number_in_doubt_is_expected_with_the_next():
    readings = series(300, step=20.0, at=150)
    readings[150] = replace(readings[150], cycle=10_150, expected_change=True)
    outcomes = run(UNKNOWN, readings)
    assert not any(o.shift for o in outcomes)
    assert outcomes[151].expected


def test_a_restart_between_a_number_in_doubt_and_the_next_goes_on_to_the_same_bits():
    readings = series(300, slope=2e-5)
    readings[150] = replace(readings[150], cycle=10_150)
    outcomes = run(UNKNOWN, readings)
    state = unpack(TrackerState, pack(outcomes[150].state))
    assert pack(run(UNKNOWN, readings[151:], state)[-1].state) == pack(outcomes[-1].state)
