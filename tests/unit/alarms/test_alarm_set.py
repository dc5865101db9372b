"""Rules and the set of alarms: hysteresis, delays in cycles, re-alarm, announced batches, shelving."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell import alarms
from impactcell.alarms import AlarmEvent, AlarmSettings, CycleInputs, EventKind, RuleResult, RuleSettings
from impactcell.alarms.rules import module_connection, positioning_fault
from impactcell.records import (
    BatchState,
    Evidence,
    Quality,
    Shelving,
    Signature,
    TapPredictions,
    WearState,
)
from impactcell.serialization import pack, unpack

WEAR = "WearLimit"
BATCH = "BatchShift"
WARNING = "WearWarning"
SECOND = 1_000_000_000


def wear(probability, quality=Quality.GOOD):
    return WearState(0.21, 0.001, 1e-5, 1e-6, 0.205, probability, 0.0, 0.0, 0.0, quality)


SETTINGS = AlarmSettings()
NORMAL = alarms.initial_state(SETTINGS)
ACTIVE = replace(NORMAL, alarms=tuple(replace(alarm, active=True) for alarm in NORMAL.alarms))


def judge(settings, state, inputs, name):
    """What one rule says of a cycle."""
    return next(result for result in alarms.evaluate(settings, state, inputs) if result.name == name)


def shift(evidence):
    return judge(SETTINGS, NORMAL, CycleInputs(0, wear(0.0), shift=evidence), BATCH)


def run(settings, state, name, holds, start=0):
    """Feed one finding a cycle; give back the events as (cycle, active, announced)."""
    events = []
    for i, held in enumerate(holds, start=start):
        state, moved = alarms.update(settings, state, [RuleResult(name, held)], i, i * SECOND)
        events.extend((i, t.alarm.active, alarms.Notification.ANNUNCIATE in t.notifications) for t in moved)
    return state, events


def test_wear_has_hysteresis_in_probability():
    settings = AlarmSettings(rules={WEAR: RuleSettings(activate_above=0.9, clear_below=0.5)})
    state = alarms.initial_state(settings)
    active = []
    for i, p in enumerate([0.5, 0.89, 0.91, 0.6, 0.51, 0.49, 0.89, 0.95]):
        found = judge(settings, state, CycleInputs(i, wear(p)), WEAR)
        state, _ = alarms.update(settings, state, [found], i, 0)
        active.append(state.alarm(WEAR).active)
    assert active == [False, False, True, True, True, False, False, True]


def rising(left, probability):
    """Wear that will be at its limit in so many cycles, and the inputs of a rule that looks ahead."""
    state = WearState(0.2, 0.001, 1e-5, 1e-6, 0.21, 0.001, left, 0.6 * left, 1.5 * left, Quality.GOOD)
    return CycleInputs(100, state, probability_at_horizon=probability, horizon=2000.0)


def test_a_warning_comes_ahead_of_the_limit_and_says_what_is_left():
    found = judge(SETTINGS, NORMAL, rising(1000.0, 0.91), WARNING)
    assert found.holds
    assert (found.evidence.statistic, found.evidence.threshold) == (0.91, 0.9)
    assert found.evidence.change_cycle == 0
    assert found.evidence.size == 0.2 - 0.21
    for said in (found.message.english, found.message.german):
        for number in ("1000 (600", "1500; 95 %", "2000", "91 %"):
            assert number in said
    assert "0.2100" in found.message.english
    assert "0,2100" in found.message.german
    endless = rising(1000.0, 0.91)
    endless = replace(endless, wear=replace(endless.wear, cycles_to_limit_high=math.inf))
    assert "(600 or more; 95 %)" in judge(SETTINGS, NORMAL, endless, WARNING).message.english
    assert judge(SETTINGS, NORMAL, rising(1000.0, 0.89), WARNING).holds is False
    assert judge(SETTINGS, ACTIVE, rising(1000.0, 0.51), WARNING).holds is True
    assert judge(SETTINGS, ACTIVE, rising(1000.0, 0.49), WARNING).holds is False
    assert judge(SETTINGS, NORMAL, rising(1000.0, math.nan), WARNING).holds is None


def test_the_alarm_of_the_limit_takes_the_place_of_the_warning():
    state, events = run(SETTINGS, NORMAL, WARNING, [True] * 6)
    assert [active for _, active, _ in events] == [True]
    worn = RuleResult(WEAR, holds=True)
    seen = []
    for cycle in range(6, 40):
        state, _ = alarms.update(SETTINGS, state, [worn, RuleResult(WARNING, holds=True)], cycle, 0)
        seen.append((state.alarm(WEAR).active, state.alarm(WARNING).active))
    assert (False, True) in seen
    assert seen[-1] == (True, False)


def test_wear_says_when_the_limit_was_crossed():
    found = judge(SETTINGS, NORMAL, CycleInputs(1000, wear(0.99)), WEAR)
    assert found.evidence.size == 0.21 - 0.205
    assert found.evidence.size_std == 0.001
    assert found.evidence.change_cycle == 500


@pytest.mark.parametrize(
    ("probability", "english", "german"),
    [
        (0.974, "97 % sure", "97 % sicher"),
        (0.9949, "99.5 % sure", "99,5 % sicher"),
        (0.9996, "over 99.9 % sure", "über 99,9 % sicher"),
        (1.0, "over 99.9 % sure", "über 99,9 % sicher"),
    ],
)
def test_a_message_is_never_sure_of_all(probability: float, english: str, german: str):
    message = judge(SETTINGS, NORMAL, CycleInputs(1000, wear(probability)), WEAR).message
    assert f"; {english})" in message.english
    assert f"; {german})" in message.german
    assert judge(SETTINGS, NORMAL, rising(1000.0, 1.0), WARNING).message.english.count("100 %") == 0


def test_no_surface_is_to_be_renewed_for_uncertain_friction_alone():
    for quality, is_doubted in ((Quality.GOOD, False), (Quality.UNCERTAIN, True)):
        message = judge(SETTINGS, NORMAL, CycleInputs(1000, wear(0.99, quality)), WEAR).message
        assert ("itself uncertain: see its reason first. Renew" in message.english) == is_doubted
        assert ("selbst unsicher: zuerst deren Grund ansehen. Oberfläche" in message.german) == is_doubted


@pytest.mark.parametrize(
    ("offset", "is_told"), [(-0.02, True), (-0.0071, True), (-0.0069, False), (0.0, False), (0.01, False)]
)
def test_a_worn_surface_with_friction_below_the_limit_may_have_been_renewed(offset, is_told):
    """The level is 0.21 ± 0.002 (95 %), the limit 0.205: friction below 0.203 is surely below it."""
    batch = BatchState("", offset, 0.001, offset, 0.001, 900, Quality.GOOD)
    message = judge(SETTINGS, NORMAL, CycleInputs(1000, wear(0.99), batch), WEAR).message
    assert (
        f"friction is {0.21 + offset:.4f}, below the limit: if the surface has" in message.english
    ) == is_told
    assert ("inzwischen erneuert, nur den Verschleiß zurücksetzen" in message.german) == is_told


def test_an_unknown_wear_leaves_the_alarm_alone():
    for unknown in (wear(math.nan), wear(0.99, Quality.BAD)):
        assert judge(SETTINGS, ACTIVE, CycleInputs(1, unknown), WEAR).holds is None


def test_delays_are_counted_in_cycles():
    settings = AlarmSettings(rules={WEAR: RuleSettings(on_delay=2, off_delay=1)})
    state = alarms.initial_state(settings)
    holds = [True, True, False, True, True, True, False, True, False, False]
    _, events = run(settings, state, WEAR, holds)
    assert events == [(5, True, True), (9, False, False)]


def test_an_unknown_finding_neither_counts_nor_clears():
    settings = AlarmSettings(rules={WEAR: RuleSettings(on_delay=1)})
    _, events = run(settings, alarms.initial_state(settings), WEAR, [True, None, None, True, None, False])
    assert events == [(3, True, True), (5, False, False)]


def test_realarm_after_so_many_cycles():
    settings = AlarmSettings(rules={WEAR: RuleSettings(realarm=3)})
    state = alarms.initial_state(settings)
    state, events = run(settings, state, WEAR, [True] * 8)
    assert events == [(0, True, True), (3, True, True), (6, True, True)]
    state, _ = alarms.apply_event(state, WEAR, AlarmEvent(EventKind.ACKNOWLEDGE))
    assert state.alarm(WEAR).acknowledged
    state, _ = run(settings, state, WEAR, [True] * 3, start=8)
    assert not state.alarm(WEAR).acknowledged


def test_a_call_again_while_the_rule_rests_keeps_what_was_said():
    settings = AlarmSettings(rules={BATCH: RuleSettings(off_delay=9, realarm=2)})
    state = alarms.initial_state(settings)
    evidence = Evidence(12.0, 11.0, 4, 0.01, 0.002)
    state, _ = alarms.update(settings, state, [shift(evidence)], 5, 0)
    said, called = state.alarm(BATCH).message, []
    for i in range(6, 10):
        state, moved = alarms.update(settings, state, [shift(None)], i, 0)
        called.extend(i for _ in moved)
    assert called == [7, 9]
    assert (state.alarm(BATCH).message, state.alarm(BATCH).evidence) == (said, evidence)


def test_a_shift_stands_for_a_while_and_clears_by_itself():
    settings = AlarmSettings(rules={BATCH: RuleSettings(off_delay=3)})
    state = alarms.initial_state(settings)
    evidence = Evidence(12.0, 11.0, 4, 0.01, 0.002)
    state, moved = alarms.update(settings, state, [shift(evidence)], 5, 0)
    assert moved[0].alarm.evidence == evidence
    assert (
        "since cycle 4 friction is 0.0100 ± 0.0040 (95 %) higher, which is 5 standard deviations"
        in moved[0].alarm.message
    )
    assert (
        "seit Zyklus 4 ist die Reibung um 0,0100 ± 0,0040 (95 %) höher, das sind 5 Standardabweichungen"
        in moved[0].alarm.message_de
    )
    cleared = []
    for i in range(6, 12):
        state, moved = alarms.update(settings, state, [shift(None)], i, 0)
        cleared.extend(i for t in moved if not t.alarm.active)
    assert cleared == [9]
    assert not state.alarm(BATCH).acknowledged


def test_every_message_tells_two_standard_deviations():
    friction = np.full(2, 0.2)
    odd_signature = Signature(friction, friction, friction, 9.0, 9.0, 0.001, Quality.GOOD)
    worn, at = wear(0.99), CycleInputs(2000, wear(0.99))
    soon = replace(at, probability_at_horizon=0.95, horizon=5000.0)
    odd = replace(at, deviation=Evidence(6.0, 5.0, 7, 0.01, 0.002), judged=True, signature=odd_signature)
    for name, inputs, told in (
        (WEAR, at, "0.2100 ± 0.0020 (95 %)"),
        (WARNING, soon, "0.2100 ± 0.0020 (95 %)"),
        (DEVIANT, odd, "0.0100 ± 0.0040 (95 %) higher"),
    ):
        message = judge(SETTINGS, NORMAL, inputs, name).message
        assert told in message.english
        assert told.replace(".", ",").removesuffix(" higher") in message.german
    # 0.005 above a limit at 1e-5 a cycle: 500 cycles ago, 200 to either side
    assert worn.level - worn.limit == pytest.approx(0.005)
    assert "at about cycle 1500 (1300 to 1700;" in judge(SETTINGS, NORMAL, at, WEAR).message.english


def test_a_message_of_wear_tells_what_all_cycles_share_where_that_is_more():
    at = CycleInputs(2000, wear(0.99), probability_at_horizon=0.95, horizon=5000.0)
    for name in (WEAR, WARNING):
        shared = replace(at, wear=replace(at.wear, level_common_std=0.004))
        message = judge(SETTINGS, NORMAL, shared, name).message
        assert "0.2100 ± 0.0020 (95 %; ± 0.0080 more, alike in all cycles)" in message.english
        assert "0,2100 ± 0,0020 (95 %; dazu ± 0,0080, in allen Zyklen gleich)" in message.german
        less = replace(at, wear=replace(at.wear, level_common_std=0.0005))
        assert judge(SETTINGS, NORMAL, less, name) == judge(SETTINGS, NORMAL, at, name)


def test_when_the_limit_was_passed_is_not_told_anew_by_the_rate_of_now():
    """A surface that has run in does not rise any more: by that it was never at its limit."""
    worn = wear(0.99)
    state, _ = run(SETTINGS, NORMAL, WEAR, [])
    for cycle in range(2000, 2010):
        results = alarms.evaluate(SETTINGS, state, CycleInputs(cycle, worn))
        state, _ = alarms.update(SETTINGS, state, results, cycle, 0)
    told = state.alarm(WEAR)
    assert told.active
    assert "was passed at about cycle 1505 (1305 to 1705;" in told.message
    for rate in (0.0, -1e-6, 5e-7):
        flat = replace(worn, level=worn.level + 0.01, rate_per_cycle=rate, rate_std=3e-7)
        results = alarms.evaluate(SETTINGS, state, CycleInputs(3000, flat))
        later = alarms.update(SETTINGS, state, results, 3000, 0)[0].alarm(WEAR)
        assert (
            "friction is 0.2200 ± 0.0020 (95 %), its limit 0.2050 was passed at about cycle 1505 ("
            in later.message
        )
        assert "Grenze 0,2050 etwa bei Zyklus 1505 überschritten (" in later.message_de
        assert later.evidence.change_cycle == 1505
        fresh = judge(SETTINGS, NORMAL, CycleInputs(3000, flat), WEAR)
        assert "its limit 0.2050 is passed (" in fresh.message.english
        assert "Grenze 0,2050 überschritten (" in fresh.message.german
        assert fresh.evidence.change_cycle == 3000


def test_an_announced_batch_keeps_the_batch_alarm_silent():
    settings = AlarmSettings(announced_cycles=3)
    state = alarms.initial_state(settings)
    state, moved = alarms.update(settings, state, [], 1, 0, announced=True)
    assert state.alarm(BATCH).suppressed
    assert len(moved) == 1
    state, moved = alarms.update(settings, state, [shift(Evidence())], 2, 0)
    assert state.alarm(BATCH).active
    assert all(alarms.Notification.ANNUNCIATE not in t.notifications for t in moved)
    for i in (3, 4):
        state, _ = alarms.update(settings, state, [shift(None)], i, 0)
    assert not state.alarm(BATCH).suppressed


def test_shelving_ends_by_the_clock_it_was_shelved_by_and_not_by_that_of_the_cycles():
    """A module whose clock was two hours ahead ended a shelving of one hour with its next cycle."""
    settings = AlarmSettings(rules={WEAR: RuleSettings()})
    state = alarms.initial_state(settings)
    shelve = AlarmEvent(EventKind.SHELVE_TIMED, 0, 0, user="ann", shelve_ns=3600 * SECOND)
    state, done = alarms.apply_event(state, WEAR, shelve)
    assert done.refusal is None
    told = []
    for cycle, held in enumerate([False, True, True], 1):
        result = RuleResult(WEAR, held)
        state, moved = alarms.update(settings, state, [result], cycle, (7200 + cycle) * SECOND)
        told += [(cycle, t.alarm.active, alarms.Notification.ANNUNCIATE in t.notifications) for t in moved]
    assert told == [(2, True, False)]
    assert state.alarm(WEAR).shelving is Shelving.TIMED
    assert alarms.expire_shelving(state, 3, 3599 * SECOND) == (state, ())
    state, (over,) = alarms.expire_shelving(state, 3, 3600 * SECOND)
    assert over.alarm.shelving is Shelving.UNSHELVED
    again, moved = alarms.expire_shelving(state, 6, 9999 * SECOND)
    assert again == state
    assert moved == ()


def test_a_condition_beside_the_cycles():
    settings = AlarmSettings(rules={WEAR: RuleSettings()})
    state = alarms.initial_state(settings)
    lost = module_connection.result("connection refused", connected=False)
    state, done = alarms.apply_rule_result(settings, state, lost, 0, 5)
    assert done.alarm.active
    assert "connection refused" in done.alarm.message
    assert "connection refused" in done.alarm.message_de
    state, done = alarms.apply_rule_result(
        settings, state, module_connection.result("", connected=True), 0, 6
    )
    assert not done.alarm.active
    assert not done.alarm.acknowledged


def test_a_disabled_condition_is_not_evaluated_and_comes_back():
    settings = AlarmSettings(rules={WEAR: RuleSettings()})
    state = alarms.initial_state(settings)
    state, _ = run(settings, state, WEAR, [True])
    state, _ = alarms.apply_event(state, WEAR, AlarmEvent(EventKind.DISABLE))
    state, events = run(settings, state, WEAR, [True, True])
    assert events == []
    state, _ = alarms.apply_event(state, WEAR, AlarmEvent(EventKind.ENABLE))
    _, events = run(settings, state, WEAR, [True])
    assert events == [(0, True, True)]


def test_the_state_is_restored_bit_for_bit():
    settings = AlarmSettings(rules={WEAR: RuleSettings()})
    state, _ = run(settings, alarms.initial_state(settings), WEAR, [True, True, False])
    state, _ = alarms.apply_event(state, WEAR, AlarmEvent(EventKind.SHELVE_ONE_SHOT, comment="ä"))
    data = pack(state)
    assert pack(unpack(alarms.AlarmSetState, data)) == data


DEVIANT, GAP = "DeviantCycle", "ModelGap"
LINK, TASK = "ModuleConnection", "PositioningFault"


def feed(state, *results, cycle):
    return alarms.update(SETTINGS, state, results, cycle, cycle * SECOND)


def test_a_result_that_is_held_back_activates_with_what_it_said():
    held = RuleResult(DEVIANT, holds=True, evidence=Evidence(9.0, 5.0, 1), hold_back=3)
    state, moved = feed(NORMAL, held, cycle=1)
    assert moved == ()
    state = unpack(alarms.AlarmSetState, pack(state))
    for cycle in (2, 3):
        state, moved = feed(state, RuleResult(DEVIANT, holds=False), cycle=cycle)
        assert moved == ()
    # nor does it matter whether the rule can tell by then
    state, (raised,) = feed(state, RuleResult(DEVIANT, None), cycle=4)
    assert (raised.alarm.active, raised.alarm.evidence.change_cycle, raised.alarm.cycle) == (True, 1, 4)


def test_what_another_rule_explains_is_given_up():
    held = RuleResult(DEVIANT, holds=True, hold_back=3)
    state, _ = feed(NORMAL, held, cycle=1)
    state, moved = feed(state, RuleResult(BATCH, holds=True), RuleResult(DEVIANT, holds=True), cycle=2)
    assert [t.alarm.name for t in moved] == [BATCH]
    for cycle in range(3, 9):
        state, moved = feed(state, RuleResult(BATCH, holds=False), RuleResult(DEVIANT, None), cycle=cycle)
        assert moved == ()


def test_deviant_cycles_do_not_call_while_the_model_does_not_fit():
    state, _ = feed(NORMAL, RuleResult(GAP, holds=True), cycle=1)
    state, moved = feed(state, RuleResult(DEVIANT, holds=True), RuleResult(GAP, holds=True), cycle=2)
    assert moved == ()
    state, moved = feed(state, RuleResult(BATCH, holds=True), RuleResult(GAP, holds=True), cycle=3)
    assert [t.alarm.name for t in moved] == [BATCH], "a batch is another cause"


def test_a_shift_waits_for_a_residual_that_rises_and_goes_with_it():
    inputs = CycleInputs(
        7, wear(0.0), shift=Evidence(12.0, 11.0, 6, 0.01, 0.002), gap=Evidence(3.3, 6.6, 6), gap_exceeds=False
    )
    result = judge(SETTINGS, NORMAL, inputs, BATCH)
    assert result.hold_back == 5
    state, moved = feed(NORMAL, result, cycle=7)
    state, moved = feed(state, RuleResult(GAP, holds=True), RuleResult(BATCH, holds=False), cycle=8)
    assert [t.alarm.name for t in moved] == [GAP]
    for quiet in (0.0, 1.9, 6.7):
        calm = replace(inputs, gap=Evidence(quiet, 6.6, 6))
        assert judge(SETTINGS, NORMAL, calm, BATCH).hold_back == 0
    # the residual crossed before the shift was detected: its cause is the same if they began together
    for since, holds in ((6, False), (1, False), (0, True), (11, False), (12, True)):
        late = replace(inputs, gap=Evidence(9.0, 6.6, since), gap_exceeds=True)
        assert judge(SETTINGS, NORMAL, late, BATCH).holds is holds


def test_a_deviation_waits_only_where_the_level_is_off_as_well():
    for innovation, hold_back in ((1.9, 0), (2.1, 5), (-2.1, 5), (math.nan, 0)):
        inputs = CycleInputs(3, wear(0.0), deviation=Evidence(6.0, 5.0), judged=True, innovation=innovation)
        assert judge(SETTINGS, NORMAL, inputs, DEVIANT).hold_back == hold_back
    assert judge(SETTINGS, NORMAL, replace(inputs, deviation=None), DEVIANT).holds is False
    assert judge(SETTINGS, NORMAL, replace(inputs, judged=False), DEVIANT).holds is None


def test_an_active_alarm_is_told_anew_only_when_its_size_has_changed_by_the_agreed_step():
    """WearLimit sent an event every cycle: 24 in 24."""
    state, told = NORMAL, []
    for cycle in range(1, 40):
        size = 0.001 + 1e-4 * cycle
        result = RuleResult(WEAR, holds=True, evidence=Evidence(0.99, 0.98, 3, size, 0.00095))
        state, _ = feed(state, result, cycle=cycle)
        evidence = state.alarm(WEAR).evidence
        if state.alarm(WEAR).active and (not told or evidence.size != told[-1]):
            told.append(evidence.size)
    assert told == [0.001 + 1e-4 * cycle for cycle in (6, 16, 26, 36)]


def test_evidence_without_a_size_is_told_once():
    """A rule by the how-to sent an event every cycle."""
    state, told = NORMAL, set()
    for cycle in range(1, 40):
        result = RuleResult(WEAR, holds=True, evidence=Evidence(0.9 + 0.001 * cycle, 0.9))
        state, _ = feed(state, result, cycle=cycle)
        told |= {state.alarm(WEAR).evidence.statistic} if state.alarm(WEAR).active else set()
    assert told == {0.9 + 0.001 * 6}


@pytest.mark.parametrize(
    "name", ["BatchShift", "DeviantCycle", "JournalFault", "ModuleConnection", "PositioningFault"]
)
def test_what_happens_anew_is_told_anew(name):
    assert alarms.RULES[name].settings.told_step == 0.0


def test_a_rule_may_say_its_own_rate_of_false_alarms():
    """What a rule said of it was overwritten with what the cell wants of every rule."""
    inputs = CycleInputs(7, wear(0.99), false_alarm_cycles=1e5, period_s=8.64)
    assert judge(SETTINGS, NORMAL, inputs, WEAR).evidence.false_alarm_cycles == 1e5
    own = Evidence(6.0, 5.0, 7, 0.01, 0.002, false_alarm_cycles=2e4)
    result = judge(SETTINGS, NORMAL, replace(inputs, shift=own), BATCH)
    assert result.evidence == replace(own, false_alarm_days=2.0)


def test_every_batch_shift_is_told_while_the_last_one_still_stands():
    state, _ = feed(
        NORMAL, RuleResult(BATCH, holds=True, evidence=Evidence(12.0, 11.0, 1, 0.01, 0.1)), cycle=1
    )
    state, _ = feed(
        state, RuleResult(BATCH, holds=True, evidence=Evidence(12.0, 11.0, 5, 0.01, 0.1)), cycle=6
    )
    assert state.alarm(BATCH).evidence.change_cycle == 5


def predictions(lacking, depends_on="velocity"):
    evidence = Evidence(statistic=12.0, threshold=9.2, size=-0.07, size_std=0.01)
    return TapPredictions(taps=31, lacking=lacking, depends_on=depends_on, evidence=evidence)


def test_taps_that_the_model_does_not_foretell_raise_the_model_gap():
    said = judge(SETTINGS, NORMAL, CycleInputs(40, wear(0.0), predictions=predictions(lacking=True)), GAP)
    assert said.holds
    assert said.evidence.change_cycle == 10
    assert (said.evidence.statistic, said.evidence.threshold) == (12.0, 9.2)
    assert "over 31 taps since cycle 10" in said.message.english
    assert "depends on their velocity and comes to -7.0 %" in said.message.english
    assert "von ihrer Geschwindigkeit ab und beträgt -7,0 %" in said.message.german
    fine = judge(SETTINGS, NORMAL, CycleInputs(40, wear(0.0), predictions=predictions(lacking=False)), GAP)
    assert not fine.holds


def test_every_cause_that_the_planner_may_name_has_its_words():
    from impactcell.alarms.rules.model_gap import DEPENDS_ON
    from impactcell.positioning import displacement_discrepancy

    assert set(DEPENDS_ON) == {*displacement_discrepancy.DEPENDS_ON, ""}


def test_a_residual_that_exceeds_speaks_before_the_taps():
    gap = Evidence(statistic=5.0, threshold=4.0, size=1.5, change_cycle=7)
    inputs = CycleInputs(40, wear(0.0), gap=gap, gap_exceeds=True, predictions=predictions(lacking=True))
    assert judge(SETTINGS, NORMAL, inputs, GAP).evidence.change_cycle == 7


def beside(state, result, time_ns):
    return alarms.apply_rule_result(SETTINGS, state, result, 0, time_ns)


def acknowledged(state, name, activation=None):
    event = AlarmEvent(EventKind.ACKNOWLEDGE, 0, 50, user="ann", comment="seen", activation=activation)
    return alarms.apply_event(state, name, event)


def test_another_reason_of_a_lost_link_is_told_and_leaves_its_acknowledgement():
    """It said "no connection, check the cable" for as long as it stood, whatever answered meanwhile."""
    lost = module_connection.result("press-1: 10.0.0.9:502 device 1: connection lost", connected=False)
    other = module_connection.result("press-1: 10.0.0.9:502 device 1: not connected", connected=False)
    state, _ = beside(NORMAL, lost, 5)
    state, _ = acknowledged(state, LINK)
    before = state.alarm(LINK)
    for state_now in (state, unpack(alarms.AlarmSetState, pack(state))):  # restored: its nan is another one
        same, done = beside(state_now, lost, 6)
        assert (same.alarm(LINK).time_ns, done.notifications) == (50, ())
    state, done = beside(state, other, 7)
    assert done.notifications == (alarms.Notification.EVENT,)
    assert done.alarm is state.alarm(LINK)
    assert done.alarm == replace(
        before, message=other.message.english, message_de=other.message.german, time_ns=7
    )
    assert "nicht verbunden" in done.alarm.message_de
    assert beside(state, other, 8)[1].notifications == ()


def test_the_fault_of_another_task_calls_again_and_is_not_acknowledged_unseen():
    """A second target was refused, and its alarm stood acknowledged, with the reason of the first."""
    first, second = (
        positioning_fault.result(f"press-1: {why}")
        for why in (
            "target 500.000 mm is beyond the travel of 0 to 40 mm",
            "the mass of the part is not known",
        )
    )
    state, raised = beside(NORMAL, first, 5)
    state, _ = acknowledged(state, TASK)
    for state_now in (state, unpack(alarms.AlarmSetState, pack(state))):
        same, done = beside(state_now, first, 60)
        assert same.alarm(TASK).acknowledged, "the same refusal calls again"
        assert done.notifications == ()
    state, again = beside(state, second, 61)
    assert again.notifications == (alarms.Notification.EVENT, alarms.Notification.ANNUNCIATE)
    assert again.alarm is state.alarm(TASK)
    assert (again.alarm.active, again.alarm.acknowledged) == (True, False)
    assert "mass of the part" in again.alarm.message
    state, third = beside(state, first, 62)
    assert raised.alarm.activation < again.alarm.activation < third.alarm.activation
    assert acknowledged(state, TASK, again.alarm.activation)[1].refusal is alarms.Refusal.ANOTHER_ACTIVATION
    assert acknowledged(state, TASK, third.alarm.activation)[1].refusal is None


def test_a_fault_with_figures_calls_again_where_they_are_others():
    figures = Evidence(4.0, 3.29, 0, 0.001, 0.0002)
    state, _ = beside(NORMAL, positioning_fault.result("press-1: tap 3 moved nothing", figures), 5)
    state, _ = acknowledged(state, TASK)
    state, done = beside(state, positioning_fault.result("press-1: tap 3 moved nothing"), 60)
    assert (done.alarm.acknowledged, done.alarm.evidence) == (False, Evidence())


def test_a_shelved_alarm_tells_the_fault_of_another_task_without_a_call():
    state, _ = beside(NORMAL, positioning_fault.result("press-1: tap 3 moved nothing"), 5)
    shelve = AlarmEvent(EventKind.SHELVE_TIMED, 0, 6, user="ann", shelve_ns=3600 * SECOND)
    state, _ = alarms.apply_event(state, TASK, shelve)
    state, done = beside(state, positioning_fault.result("press-1: tap 4 moved nothing"), 7)
    assert done.notifications == (alarms.Notification.EVENT,)
    assert state.alarm(TASK).shelving is Shelving.TIMED
