"""Every transition of the life cycle, against OPC 10000-9 written down a second time, and random walks."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.alarms import Message
from impactcell.alarms.lifecycle import (
    AlarmEvent,
    Notification,
    annunciation,
    expire,
    is_retained,
    is_silenced,
    transition,
)
from impactcell.alarms.transition_tables import (
    ANNUNCIATION,
    DISABLED,
    SHELVING,
    SWITCHES,
    Annunciation,
    EventKind,
    Refusal,
)
from impactcell.records import Alarm, Evidence, Shelving

MINUTE = 60_000_000_000


def alarm(state=Annunciation.NORMAL, **changes):
    active, acknowledged, confirmed = state.value
    return Alarm("WearLimit", active=active, acknowledged=acknowledged, confirmed=confirmed, **changes)


# OPC 10000-9 annex B.1.2, table B.1: one current state, confirmation required; (active, acked, confirmed)
ANNEX_B = [
    (EventKind.ACTIVATE, (True, False, True)),
    (EventKind.ACKNOWLEDGE, (True, True, False)),
    (EventKind.CLEAR, (False, True, False)),
    (EventKind.CONFIRM, (False, True, True)),
    (EventKind.ACTIVATE, (True, False, True)),
    (EventKind.CLEAR, (False, False, True)),
    (EventKind.ACKNOWLEDGE, (False, True, False)),
    (EventKind.CONFIRM, (False, True, True)),
]


def test_the_example_of_annex_b():
    now = alarm()
    for number, (event, expected) in enumerate(ANNEX_B):
        done = transition(now, AlarmEvent(event, cycle=number, time_ns=number))
        now = done.alarm
        assert (now.active, now.acknowledged, now.confirmed) == expected
        assert done.refusal is None
        assert (Notification.ANNUNCIATE in done.notifications) == (event is EventKind.ACTIVATE)
        assert Notification.EVENT in done.notifications
        assert (now.cycle, now.time_ns) == (number, number)


def expected_annunciation(state, event):
    """The same rules in words: part 9, 5.7.2 and 5.8.2."""
    active, acknowledged, confirmed = state.value
    if event is EventKind.ACKNOWLEDGE:
        return Refusal.ALREADY_ACKNOWLEDGED if acknowledged else (active, True, False)
    if event is EventKind.CONFIRM:
        return Refusal.ALREADY_CONFIRMED if confirmed else (active, acknowledged, True)
    if event is EventKind.CLEAR:
        return (False, acknowledged, confirmed)
    if event is EventKind.ACTIVATE and not active:
        return (True, False, True)
    if event is EventKind.REALARM and active:
        return (True, False, True)
    return (active, acknowledged, confirmed)


@pytest.mark.parametrize(("state", "event"), list(ANNUNCIATION), ids=str)
def test_every_annunciation_transition(state, event):
    expected = expected_annunciation(state, event)
    done = transition(alarm(state), AlarmEvent(event))
    if isinstance(expected, Refusal):
        assert done.refusal is expected
        assert done.alarm == alarm(state)
        assert done.notifications == ()
    else:
        assert done.refusal is None
        assert annunciation(done.alarm).value == expected


def test_the_annunciation_table_is_complete():
    events = {
        EventKind.ACTIVATE,
        EventKind.CLEAR,
        EventKind.REALARM,
        EventKind.ACKNOWLEDGE,
        EventKind.CONFIRM,
    }
    assert set(ANNUNCIATION) == {(s, e) for s in Annunciation for e in events}


# part 9, 5.8.17: ShelvedStateMachineType, its transitions and the Bad_ results of its methods
SHELVED = {
    (Shelving.UNSHELVED, EventKind.SHELVE_TIMED): Shelving.TIMED,
    (Shelving.UNSHELVED, EventKind.SHELVE_ONE_SHOT): Shelving.ONE_SHOT,
    (Shelving.UNSHELVED, EventKind.UNSHELVE): Refusal.NOT_SHELVED,
    (Shelving.UNSHELVED, EventKind.SHELVE_EXPIRED): Shelving.UNSHELVED,
    (Shelving.UNSHELVED, EventKind.CLEAR): Shelving.UNSHELVED,
    (Shelving.TIMED, EventKind.SHELVE_TIMED): Refusal.ALREADY_SHELVED,
    (Shelving.TIMED, EventKind.SHELVE_ONE_SHOT): Shelving.ONE_SHOT,
    (Shelving.TIMED, EventKind.UNSHELVE): Shelving.UNSHELVED,
    (Shelving.TIMED, EventKind.SHELVE_EXPIRED): Shelving.UNSHELVED,
    (Shelving.TIMED, EventKind.CLEAR): Shelving.TIMED,
    (Shelving.ONE_SHOT, EventKind.SHELVE_TIMED): Shelving.TIMED,
    (Shelving.ONE_SHOT, EventKind.SHELVE_ONE_SHOT): Refusal.ALREADY_SHELVED,
    (Shelving.ONE_SHOT, EventKind.UNSHELVE): Shelving.UNSHELVED,
    (Shelving.ONE_SHOT, EventKind.SHELVE_EXPIRED): Shelving.UNSHELVED,
    (Shelving.ONE_SHOT, EventKind.CLEAR): Shelving.UNSHELVED,
}


@pytest.mark.parametrize(("state", "event"), list(SHELVING), ids=str)
def test_every_shelving_transition(state, event):
    expected = SHELVED[state, event]
    until = 0 if state is Shelving.UNSHELVED else MINUTE
    before = alarm(Annunciation.UNACKNOWLEDGED, shelving=state, shelved_until_ns=until)
    done = transition(before, AlarmEvent(event, time_ns=5, shelve_ns=MINUTE))
    if isinstance(expected, Refusal):
        assert done.refusal is expected
        assert done.alarm == before
        return
    assert done.alarm.shelving is expected
    if event in (EventKind.SHELVE_TIMED, EventKind.SHELVE_ONE_SHOT):
        assert done.alarm.shelved_until_ns == MINUTE + 5
    elif expected is Shelving.UNSHELVED:
        assert done.alarm.shelved_until_ns == 0


def test_the_shelving_table_is_complete():
    assert set(SHELVING) == set(SHELVED)


@pytest.mark.parametrize(("name", "value", "event"), list(SWITCHES), ids=str)
def test_every_switch_transition(name, value, event):
    on = {EventKind.ENABLE: True, EventKind.SUPPRESS: True, EventKind.REMOVE_FROM_SERVICE: True}.get(
        event, False
    )
    before = alarm(**{name: value})
    done = transition(before, AlarmEvent(event))
    if on == value and event not in (EventKind.SUPPRESS, EventKind.UNSUPPRESS):
        refusals = {EventKind.ENABLE: Refusal.ALREADY_ENABLED, EventKind.DISABLE: Refusal.ALREADY_DISABLED}
        assert done.refusal is refusals.get(event, Refusal.INVALID_STATE)
        assert done.alarm == before
    else:
        assert done.refusal is None
        assert getattr(done.alarm, name) is on
        assert bool(done.notifications) == (on != value)


@pytest.mark.parametrize(("event", "refusal"), list(DISABLED.items()), ids=str)
def test_a_disabled_alarm_stays_as_it_is(event, refusal):
    before = alarm(enabled=False)
    done = transition(before, AlarmEvent(event, shelve_ns=MINUTE))
    assert done.alarm == before
    assert done.refusal is refusal
    assert done.notifications == ()


@pytest.mark.parametrize("state", list(Annunciation))
def test_disabling_leaves_nothing_pending(state):
    done = transition(alarm(state), AlarmEvent(EventKind.DISABLE, user="eng"))
    assert annunciation(done.alarm) is Annunciation.NORMAL
    assert not is_retained(done.alarm)
    again = transition(done.alarm, AlarmEvent(EventKind.ENABLE)).alarm
    assert again.enabled
    assert transition(again, AlarmEvent(EventKind.ACTIVATE)).notifications == (
        Notification.EVENT,
        Notification.ANNUNCIATE,
    )


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
    done = transition(alarm(**change), AlarmEvent(EventKind.ACTIVATE))
    assert done.alarm.active
    assert done.notifications == (Notification.EVENT,)
    assert is_silenced(done.alarm)


def test_shelving_needs_a_time_and_ends_with_it():
    assert transition(alarm(), AlarmEvent(EventKind.SHELVE_TIMED)).refusal is Refusal.SHELVING_TIME
    shelved = transition(alarm(), AlarmEvent(EventKind.SHELVE_TIMED, time_ns=10, shelve_ns=MINUTE)).alarm
    assert expire(shelved, 3, MINUTE + 9).alarm == shelved
    done = expire(shelved, 3, MINUTE + 10)
    assert done.alarm.shelving is Shelving.UNSHELVED
    assert done.notifications == (Notification.EVENT,)
    forever = transition(alarm(), AlarmEvent(EventKind.SHELVE_ONE_SHOT, time_ns=10)).alarm
    assert expire(forever, 3, 2**62).alarm == forever


def test_comment_and_description_travel_with_the_event():
    evidence = Evidence(12.0, 11.5, 7, 0.01, 0.001, 1e5, 1.2)
    raised = transition(
        alarm(),
        AlarmEvent(
            EventKind.ACTIVATE, 7, 8, message=Message("worn", "verschlissen"), severity=900, evidence=evidence
        ),
    ).alarm
    assert (raised.message, raised.severity, raised.evidence) == ("worn", 900, evidence)
    done = transition(raised, AlarmEvent(EventKind.COMMENT, 9, 10, user="ann", comment="seen"))
    assert (done.alarm.comment, done.alarm.user, done.alarm.message) == ("seen", "ann", "worn")
    assert done.notifications == (Notification.EVENT,)


@pytest.mark.parametrize(
    ("kind", "user", "acted"),
    [
        (EventKind.ACKNOWLEDGE, "ann", "ann"),
        (EventKind.ACKNOWLEDGE, "bob", "bob"),
        (EventKind.SHELVE_TIMED, "bob", "bob"),
        (EventKind.CLEAR, "", "ann"),
    ],
)
def test_nobody_is_told_to_have_said_what_somebody_else_said(kind: EventKind, user: str, acted: str):
    """OPC UA Part 9, 5.7.3: without a comment the one that stands does, and it is its author's (5.5.2)."""
    raised = alarm(Annunciation.UNACKNOWLEDGED)
    noted = transition(raised, AlarmEvent(EventKind.COMMENT, 9, 10, user="ann", comment="seen")).alarm
    done = transition(noted, AlarmEvent(kind, 11, 12, user=user, shelve_ns=MINUTE)).alarm
    assert (done.comment, done.comment_user, done.user) == ("seen", "ann", acted)
    other = AlarmEvent(EventKind.COMMENT, 13, 14, user="bob", comment="gone")
    done = transition(done, other).alarm
    assert (done.comment, done.comment_user, done.user) == ("gone", "bob", "bob")


def test_what_was_said_of_an_activation_does_not_stand_on_the_next():
    """OPC UA Part 9, 5.5.2: a comment is of a certain state of the condition."""
    raised = alarm(Annunciation.UNACKNOWLEDGED)
    noted = transition(raised, AlarmEvent(EventKind.COMMENT, 9, 10, user="ann", comment="seen")).alarm
    reminded = transition(noted, AlarmEvent(EventKind.REALARM, 10, 11)).alarm
    assert (reminded.comment, reminded.user) == ("seen", "ann")
    gone = transition(noted, AlarmEvent(EventKind.CLEAR, 11, 12)).alarm
    assert (gone.comment, gone.user) == ("seen", "ann")
    again = transition(gone, AlarmEvent(EventKind.ACTIVATE, 13, 14)).alarm
    assert (again.comment, again.comment_user, again.user) == ("", "", "")


def test_realarm_calls_again():
    for state in (Annunciation.UNACKNOWLEDGED, Annunciation.ACKNOWLEDGED, Annunciation.CONFIRMED):
        done = transition(alarm(state), AlarmEvent(EventKind.REALARM))
        assert done.notifications == (Notification.EVENT, Notification.ANNUNCIATE)
    for state in (Annunciation.NORMAL, Annunciation.CLEARED_UNACKNOWLEDGED, Annunciation.CLEARED_UNCONFIRMED):
        done = transition(alarm(state), AlarmEvent(EventKind.REALARM))
        assert done.alarm == alarm(state)
        assert done.notifications == ()


events = st.builds(
    AlarmEvent,
    st.sampled_from(EventKind),
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
            assert done.notifications == ()
        if done.alarm != now:
            assert Notification.EVENT in done.notifications
        if not done.alarm.enabled:
            assert annunciation(done.alarm) is Annunciation.NORMAL
        if done.alarm.shelving is Shelving.UNSHELVED:
            assert done.alarm.shelved_until_ns == 0
        if done.alarm.shelving is Shelving.TIMED:
            assert done.alarm.shelved_until_ns > 0
        if Notification.ANNUNCIATE in done.notifications:
            assert done.alarm.active
            assert not done.alarm.acknowledged
            assert not is_silenced(done.alarm)
        now = done.alarm


def test_each_state_knows_since_when_it_is():
    """OPC 10000-9: TransitionTime is when the present state was entered, whatever has happened since."""
    now = alarm()

    def since(kind: EventKind, time_ns: int, **changes: object) -> tuple[int, int, int]:
        nonlocal now
        done = transition(now, AlarmEvent(kind, 0, time_ns, **changes))
        assert done.refusal is None
        now = done.alarm
        return now.active_ns, now.enabled_ns, now.comment_ns

    assert since(EventKind.SUPPRESS, 1) == (0, 0, 0)
    assert since(EventKind.UNSUPPRESS, 2) == (0, 0, 0)
    assert since(EventKind.ACTIVATE, 3) == (3, 0, 0)
    assert since(EventKind.COMMENT, 4, user="ann", comment="seen") == (3, 0, 4)
    assert since(EventKind.ACKNOWLEDGE, 5, user="ann") == (3, 0, 4)
    assert since(EventKind.REALARM, 6) == (3, 0, 4)
    assert since(EventKind.SHELVE_TIMED, 7, user="ann", shelve_ns=MINUTE) == (3, 0, 4)
    assert since(EventKind.ACKNOWLEDGE, 8, user="ann", comment="seen") == (3, 0, 8)
    assert since(EventKind.CLEAR, 9) == (9, 0, 8)
    assert since(EventKind.CONFIRM, 10, user="ann") == (9, 0, 8)
    assert since(EventKind.DISABLE, 11, user="eve", comment="rig") == (9, 11, 11)
    assert since(EventKind.ENABLE, 12, user="eve") == (9, 12, 11)
    assert since(EventKind.ACTIVATE, 13) == (13, 12, 13), "its comment is another: none"
    assert since(EventKind.DISABLE, 14) == (14, 14, 13), "what is disabled is not active"
