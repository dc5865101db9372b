"""Every transition of the life cycle, against OPC 10000-9 written down a second time, and random walks."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.alarms.lifecycle import (
    ANNUNCIATION,
    DISABLED,
    SHELVING,
    SWITCHES,
    Annunciation,
    Effect,
    Event,
    Occurrence,
    Refusal,
    annunciation,
    expire,
    retained,
    silent,
    transition,
)
from impactcell.records import Alarm, AlarmName, Evidence, Shelving

MINUTE = 60_000_000_000


def alarm(state=Annunciation.NORMAL, **changes):
    active, acknowledged, confirmed = state.value
    return Alarm(
        AlarmName.WEAR_LIMIT, active=active, acknowledged=acknowledged, confirmed=confirmed, **changes
    )


# OPC 10000-9 annex B.1.2, table B.1: one current state, confirmation required; (active, acked, confirmed)
ANNEX_B = [
    (Event.ACTIVATE, (True, False, True)),
    (Event.ACKNOWLEDGE, (True, True, False)),
    (Event.CLEAR, (False, True, False)),
    (Event.CONFIRM, (False, True, True)),
    (Event.ACTIVATE, (True, False, True)),
    (Event.CLEAR, (False, False, True)),
    (Event.ACKNOWLEDGE, (False, True, False)),
    (Event.CONFIRM, (False, True, True)),
]


def test_the_example_of_annex_b():
    now = alarm()
    for number, (event, expected) in enumerate(ANNEX_B):
        done = transition(now, Occurrence(event, cycle=number, time_ns=number))
        now = done.alarm
        assert (now.active, now.acknowledged, now.confirmed) == expected
        assert done.refusal is None
        assert (Effect.ANNOUNCE in done.effects) == (event is Event.ACTIVATE)
        assert Effect.NOTIFY in done.effects
        assert (now.cycle, now.time_ns) == (number, number)


def expected_annunciation(state, event):
    """The same rules in words: part 9, 5.7.2 and 5.8.2."""
    active, acknowledged, confirmed = state.value
    if event is Event.ACKNOWLEDGE:
        return Refusal.ALREADY_ACKNOWLEDGED if acknowledged else (active, True, False)
    if event is Event.CONFIRM:
        return Refusal.ALREADY_CONFIRMED if confirmed else (active, acknowledged, True)
    if event is Event.CLEAR:
        return (False, acknowledged, confirmed)
    if event is Event.ACTIVATE and not active:
        return (True, False, True)
    if event is Event.REALARM and active:
        return (True, False, True)
    return (active, acknowledged, confirmed)


@pytest.mark.parametrize(("state", "event"), list(ANNUNCIATION), ids=str)
def test_every_annunciation_transition(state, event):
    expected = expected_annunciation(state, event)
    done = transition(alarm(state), Occurrence(event))
    if isinstance(expected, Refusal):
        assert done.refusal is expected
        assert done.alarm == alarm(state)
        assert done.effects == ()
    else:
        assert done.refusal is None
        assert annunciation(done.alarm).value == expected


def test_the_annunciation_table_is_complete():
    events = {Event.ACTIVATE, Event.CLEAR, Event.REALARM, Event.ACKNOWLEDGE, Event.CONFIRM}
    assert set(ANNUNCIATION) == {(s, e) for s in Annunciation for e in events}


# part 9, 5.8.17: ShelvedStateMachineType, its transitions and the Bad_ results of its methods
SHELVED = {
    (Shelving.UNSHELVED, Event.SHELVE_TIMED): Shelving.TIMED,
    (Shelving.UNSHELVED, Event.SHELVE_ONE_SHOT): Shelving.ONE_SHOT,
    (Shelving.UNSHELVED, Event.UNSHELVE): Refusal.NOT_SHELVED,
    (Shelving.UNSHELVED, Event.SHELVE_EXPIRED): Shelving.UNSHELVED,
    (Shelving.UNSHELVED, Event.CLEAR): Shelving.UNSHELVED,
    (Shelving.TIMED, Event.SHELVE_TIMED): Refusal.ALREADY_SHELVED,
    (Shelving.TIMED, Event.SHELVE_ONE_SHOT): Shelving.ONE_SHOT,
    (Shelving.TIMED, Event.UNSHELVE): Shelving.UNSHELVED,
    (Shelving.TIMED, Event.SHELVE_EXPIRED): Shelving.UNSHELVED,
    (Shelving.TIMED, Event.CLEAR): Shelving.TIMED,
    (Shelving.ONE_SHOT, Event.SHELVE_TIMED): Shelving.TIMED,
    (Shelving.ONE_SHOT, Event.SHELVE_ONE_SHOT): Refusal.ALREADY_SHELVED,
    (Shelving.ONE_SHOT, Event.UNSHELVE): Shelving.UNSHELVED,
    (Shelving.ONE_SHOT, Event.SHELVE_EXPIRED): Shelving.UNSHELVED,
    (Shelving.ONE_SHOT, Event.CLEAR): Shelving.UNSHELVED,
}


@pytest.mark.parametrize(("state", "event"), list(SHELVING), ids=str)
def test_every_shelving_transition(state, event):
    expected = SHELVED[state, event]
    until = 0 if state is Shelving.UNSHELVED else MINUTE
    before = alarm(Annunciation.UNACKNOWLEDGED, shelving=state, shelved_until_ns=until)
    done = transition(before, Occurrence(event, time_ns=5, shelve_ns=MINUTE))
    if isinstance(expected, Refusal):
        assert done.refusal is expected
        assert done.alarm == before
        return
    assert done.alarm.shelving is expected
    if event in (Event.SHELVE_TIMED, Event.SHELVE_ONE_SHOT):
        assert done.alarm.shelved_until_ns == MINUTE + 5
    elif expected is Shelving.UNSHELVED:
        assert done.alarm.shelved_until_ns == 0


def test_the_shelving_table_is_complete():
    assert set(SHELVING) == set(SHELVED)


@pytest.mark.parametrize(("name", "value", "event"), list(SWITCHES), ids=str)
def test_every_switch_transition(name, value, event):
    on = {Event.ENABLE: True, Event.SUPPRESS: True, Event.REMOVE_FROM_SERVICE: True}.get(event, False)
    before = alarm(**{name: value})
    done = transition(before, Occurrence(event))
    if on == value and event not in (Event.SUPPRESS, Event.UNSUPPRESS):
        refusals = {Event.ENABLE: Refusal.ALREADY_ENABLED, Event.DISABLE: Refusal.ALREADY_DISABLED}
        assert done.refusal is refusals.get(event, Refusal.INVALID_STATE)
        assert done.alarm == before
    else:
        assert done.refusal is None
        assert getattr(done.alarm, name) is on
        assert bool(done.effects) == (on != value)


@pytest.mark.parametrize(("event", "refusal"), list(DISABLED.items()), ids=str)
def test_a_disabled_alarm_stays_as_it_is(event, refusal):
    before = alarm(enabled=False)
    done = transition(before, Occurrence(event, shelve_ns=MINUTE))
    assert done.alarm == before
    assert done.refusal is refusal
    assert done.effects == ()


@pytest.mark.parametrize("state", list(Annunciation))
def test_disabling_leaves_nothing_pending(state):
    done = transition(alarm(state), Occurrence(Event.DISABLE, user="eng"))
    assert annunciation(done.alarm) is Annunciation.NORMAL
    assert not retained(done.alarm)
    again = transition(done.alarm, Occurrence(Event.ENABLE)).alarm
    assert again.enabled
    assert transition(again, Occurrence(Event.ACTIVATE)).effects == (Effect.NOTIFY, Effect.ANNOUNCE)


@pytest.mark.parametrize(
    "change",
    [
        {"suppressed": True},
        {"out_of_service": True},
        {"shelving": Shelving.TIMED, "shelved_until_ns": MINUTE},
        {"shelving": Shelving.ONE_SHOT},
    ],
    ids=str,
)
def test_a_silenced_alarm_follows_the_process_without_calling(change):
    done = transition(alarm(**change), Occurrence(Event.ACTIVATE))
    assert done.alarm.active
    assert done.effects == (Effect.NOTIFY,)
    assert silent(done.alarm)


def test_shelving_needs_a_time_and_ends_with_it():
    assert transition(alarm(), Occurrence(Event.SHELVE_TIMED)).refusal is Refusal.SHELVING_TIME
    shelved = transition(alarm(), Occurrence(Event.SHELVE_TIMED, time_ns=10, shelve_ns=MINUTE)).alarm
    assert expire(shelved, 3, MINUTE + 9).alarm == shelved
    done = expire(shelved, 3, MINUTE + 10)
    assert done.alarm.shelving is Shelving.UNSHELVED
    assert done.effects == (Effect.NOTIFY,)
    forever = transition(alarm(), Occurrence(Event.SHELVE_ONE_SHOT, time_ns=10)).alarm
    assert expire(forever, 3, 2**62).alarm == forever


def test_comment_and_description_travel_with_the_event():
    evidence = Evidence(12.0, 11.5, 7, 0.01, 0.001, 1e5, 1.2)
    raised = transition(
        alarm(), Occurrence(Event.ACTIVATE, 7, 8, message="worn", severity=900, evidence=evidence)
    ).alarm
    assert (raised.message, raised.severity, raised.evidence) == ("worn", 900, evidence)
    done = transition(raised, Occurrence(Event.COMMENT, 9, 10, user="ann", comment="seen"))
    assert (done.alarm.comment, done.alarm.user, done.alarm.message) == ("seen", "ann", "worn")
    assert done.effects == (Effect.NOTIFY,)
    acknowledged = transition(done.alarm, Occurrence(Event.ACKNOWLEDGE, 11, 12, user="bob")).alarm
    assert (acknowledged.comment, acknowledged.user) == ("seen", "bob")


def test_realarm_calls_again():
    for state in (Annunciation.UNACKNOWLEDGED, Annunciation.ACKNOWLEDGED, Annunciation.CONFIRMED):
        done = transition(alarm(state), Occurrence(Event.REALARM))
        assert done.effects == (Effect.NOTIFY, Effect.ANNOUNCE)
    for state in (Annunciation.NORMAL, Annunciation.CLEARED_UNACKNOWLEDGED, Annunciation.CLEARED_UNCONFIRMED):
        done = transition(alarm(state), Occurrence(Event.REALARM))
        assert done.alarm == alarm(state)
        assert done.effects == ()


events = st.builds(
    Occurrence,
    st.sampled_from(Event),
    cycle=st.integers(0, 100),
    time_ns=st.integers(0, 10**12),
    comment=st.sampled_from(["", "note"]),
    shelve_ns=st.sampled_from([0, -5, MINUTE]),
)


@settings(max_examples=300, deadline=None)
@given(st.lists(events, max_size=60))
def test_no_sequence_of_events_leaves_the_life_cycle(sequence):
    now = alarm()
    for occurrence in sequence:
        done = transition(now, occurrence)
        Annunciation((done.alarm.active, done.alarm.acknowledged, done.alarm.confirmed))
        if done.refusal is not None:
            assert done.alarm == now
            assert done.effects == ()
        if done.alarm != now:
            assert Effect.NOTIFY in done.effects
        if not done.alarm.enabled:
            assert annunciation(done.alarm) is Annunciation.NORMAL
        if done.alarm.shelving is Shelving.UNSHELVED:
            assert done.alarm.shelved_until_ns == 0
        if done.alarm.shelving is Shelving.TIMED:
            assert done.alarm.shelved_until_ns > 0
        if Effect.ANNOUNCE in done.effects:
            assert done.alarm.active
            assert not done.alarm.acknowledged
            assert not silent(done.alarm)
        now = done.alarm
