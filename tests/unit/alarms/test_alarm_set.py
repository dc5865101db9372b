"""Rules and the set of alarms: hysteresis, delays in cycles, re-alarm, announced batches, shelving."""

import math
from dataclasses import replace

from impactcell import alarms
from impactcell.alarms import AlarmEvent, AlarmSettings, CycleInputs, EventKind, RuleResult, RuleSettings
from impactcell.alarms.rules import module_connection
from impactcell.records import Evidence, Quality, Shelving, WearState
from impactcell.serialization import pack, unpack

WEAR = "WearLimit"
BATCH = "BatchShift"
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


def test_wear_says_when_the_limit_was_crossed():
    found = judge(SETTINGS, NORMAL, CycleInputs(1000, wear(0.99)), WEAR)
    assert found.evidence.size == 0.21 - 0.205
    assert found.evidence.size_std == 0.001
    assert found.evidence.change_cycle == 500


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
    assert "since cycle 4 friction is 0.0100 ± 0.0020 higher" in moved[0].alarm.message
    assert "seit Zyklus 4 ist die Reibung um 0,0100 ± 0,0020 höher" in moved[0].alarm.message_de
    cleared = []
    for i in range(6, 12):
        state, moved = alarms.update(settings, state, [shift(None)], i, 0)
        cleared.extend(i for t in moved if not t.alarm.active)
    assert cleared == [9]
    assert not state.alarm(BATCH).acknowledged


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


def test_shelving_ends_with_time_as_the_cycles_bring_it():
    settings = AlarmSettings(rules={WEAR: RuleSettings()})
    state = alarms.initial_state(settings)
    shelve = AlarmEvent(EventKind.SHELVE_TIMED, 0, 0, user="ann", shelve_ns=5 * SECOND)
    state, done = alarms.apply_event(state, WEAR, shelve)
    assert done.refusal is None
    state, events = run(settings, state, WEAR, [False, True, True, True, True, True])
    assert events == [(1, True, False), (5, True, False)]
    assert state.alarm(WEAR).shelving is Shelving.UNSHELVED
    again, moved = alarms.expire_shelving(state, 6, 99 * SECOND)
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
