"""The life cycle of one alarm: a transition table after ISA-18.2 and OPC UA Part 9, and nothing else.

Five machines run beside each other in every alarm (OPC 10000-9, 5.5, 5.7, 5.8 and annex B): the first
two of these, and one for each of the three switches.

=============  ====================================================================
annunciation   active x acknowledged x confirmed, six states; see `ANNUNCIATION`
shelving       unshelved, timed, one-shot; see `SHELVING`
switches       enabled, suppressed, out of service; see `SWITCHES`
=============  ====================================================================

A confirmation is asked for after each acknowledgement. Time arrives with the event.
"""

import enum
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from impactcell.alarms.rule import Message
from impactcell.records import Alarm, Evidence, Shelving


class EventKind(enum.Enum):
    """What can happen to an alarm: by the process, by a person, by time."""

    ACTIVATE = "activate"
    CLEAR = "clear"
    REALARM = "re-alarm"
    ACKNOWLEDGE = "acknowledge"
    CONFIRM = "confirm"
    COMMENT = "comment"
    SHELVE_TIMED = "shelve for a time"
    SHELVE_ONE_SHOT = "shelve once"
    UNSHELVE = "unshelve"
    SHELVE_EXPIRED = "shelving time is over"
    ENABLE = "enable"
    DISABLE = "disable"
    SUPPRESS = "suppress"
    UNSUPPRESS = "unsuppress"
    REMOVE_FROM_SERVICE = "remove from service"
    PLACE_IN_SERVICE = "place in service"


class Annunciation(enum.Enum):
    """Reachable combinations of (active, acknowledged, confirmed)."""

    NORMAL = (False, True, True)
    UNACKNOWLEDGED = (True, False, True)
    ACKNOWLEDGED = (True, True, False)
    CONFIRMED = (True, True, True)
    CLEARED_UNACKNOWLEDGED = (False, False, True)
    CLEARED_UNCONFIRMED = (False, True, False)


class Refusal(enum.Enum):
    """Why a person's action is not carried out, by its OPC UA status code."""

    DISABLED = "BadConditionDisabled"
    ALREADY_ACKNOWLEDGED = "BadConditionBranchAlreadyAcked"
    ALREADY_CONFIRMED = "BadConditionBranchAlreadyConfirmed"
    ALREADY_ENABLED = "BadConditionAlreadyEnabled"
    ALREADY_DISABLED = "BadConditionAlreadyDisabled"
    ALREADY_SHELVED = "BadConditionAlreadyShelved"
    NOT_SHELVED = "BadConditionNotShelved"
    SHELVING_TIME = "BadShelvingTimeOutOfRange"
    INVALID_STATE = "BadInvalidState"
    ANOTHER_ACTIVATION = "BadEventIdUnknown"


class Notification(enum.Enum):
    """What the outside has to do after a transition."""

    EVENT = "send an event: something of the alarm changed"
    ANNUNCIATE = "call for attention: newly active or active again, and not kept silent"


A, E, R = Annunciation, EventKind, Refusal

ANNUNCIATION: Mapping[tuple[Annunciation, EventKind], Annunciation | Refusal] = MappingProxyType(
    {
        (A.NORMAL, E.ACTIVATE): A.UNACKNOWLEDGED,
        (A.NORMAL, E.CLEAR): A.NORMAL,
        (A.NORMAL, E.REALARM): A.NORMAL,
        (A.NORMAL, E.ACKNOWLEDGE): R.ALREADY_ACKNOWLEDGED,
        (A.NORMAL, E.CONFIRM): R.ALREADY_CONFIRMED,
        (A.UNACKNOWLEDGED, E.ACTIVATE): A.UNACKNOWLEDGED,
        (A.UNACKNOWLEDGED, E.CLEAR): A.CLEARED_UNACKNOWLEDGED,
        (A.UNACKNOWLEDGED, E.REALARM): A.UNACKNOWLEDGED,
        (A.UNACKNOWLEDGED, E.ACKNOWLEDGE): A.ACKNOWLEDGED,
        (A.UNACKNOWLEDGED, E.CONFIRM): R.ALREADY_CONFIRMED,
        (A.ACKNOWLEDGED, E.ACTIVATE): A.ACKNOWLEDGED,
        (A.ACKNOWLEDGED, E.CLEAR): A.CLEARED_UNCONFIRMED,
        (A.ACKNOWLEDGED, E.REALARM): A.UNACKNOWLEDGED,
        (A.ACKNOWLEDGED, E.ACKNOWLEDGE): R.ALREADY_ACKNOWLEDGED,
        (A.ACKNOWLEDGED, E.CONFIRM): A.CONFIRMED,
        (A.CONFIRMED, E.ACTIVATE): A.CONFIRMED,
        (A.CONFIRMED, E.CLEAR): A.NORMAL,
        (A.CONFIRMED, E.REALARM): A.UNACKNOWLEDGED,
        (A.CONFIRMED, E.ACKNOWLEDGE): R.ALREADY_ACKNOWLEDGED,
        (A.CONFIRMED, E.CONFIRM): R.ALREADY_CONFIRMED,
        (A.CLEARED_UNACKNOWLEDGED, E.ACTIVATE): A.UNACKNOWLEDGED,
        (A.CLEARED_UNACKNOWLEDGED, E.CLEAR): A.CLEARED_UNACKNOWLEDGED,
        (A.CLEARED_UNACKNOWLEDGED, E.REALARM): A.CLEARED_UNACKNOWLEDGED,
        (A.CLEARED_UNACKNOWLEDGED, E.ACKNOWLEDGE): A.CLEARED_UNCONFIRMED,
        (A.CLEARED_UNACKNOWLEDGED, E.CONFIRM): R.ALREADY_CONFIRMED,
        (A.CLEARED_UNCONFIRMED, E.ACTIVATE): A.UNACKNOWLEDGED,
        (A.CLEARED_UNCONFIRMED, E.CLEAR): A.CLEARED_UNCONFIRMED,
        (A.CLEARED_UNCONFIRMED, E.REALARM): A.CLEARED_UNCONFIRMED,
        (A.CLEARED_UNCONFIRMED, E.ACKNOWLEDGE): R.ALREADY_ACKNOWLEDGED,
        (A.CLEARED_UNCONFIRMED, E.CONFIRM): A.NORMAL,
    }
)

S = Shelving
SHELVING: Mapping[tuple[Shelving, EventKind], Shelving | Refusal] = MappingProxyType(
    {
        (S.UNSHELVED, E.SHELVE_TIMED): S.TIMED,
        (S.UNSHELVED, E.SHELVE_ONE_SHOT): S.ONE_SHOT,
        (S.UNSHELVED, E.UNSHELVE): R.NOT_SHELVED,
        (S.UNSHELVED, E.SHELVE_EXPIRED): S.UNSHELVED,
        (S.UNSHELVED, E.CLEAR): S.UNSHELVED,
        (S.TIMED, E.SHELVE_TIMED): R.ALREADY_SHELVED,
        (S.TIMED, E.SHELVE_ONE_SHOT): S.ONE_SHOT,
        (S.TIMED, E.UNSHELVE): S.UNSHELVED,
        (S.TIMED, E.SHELVE_EXPIRED): S.UNSHELVED,
        (S.TIMED, E.CLEAR): S.TIMED,
        (S.ONE_SHOT, E.SHELVE_TIMED): S.TIMED,
        (S.ONE_SHOT, E.SHELVE_ONE_SHOT): R.ALREADY_SHELVED,
        (S.ONE_SHOT, E.UNSHELVE): S.UNSHELVED,
        # a longest shelving time holds for one-shot shelving too
        (S.ONE_SHOT, E.SHELVE_EXPIRED): S.UNSHELVED,
        (S.ONE_SHOT, E.CLEAR): S.UNSHELVED,
    }
)

SWITCHES: Mapping[tuple[str, bool, EventKind], bool | Refusal] = MappingProxyType(
    {
        ("enabled", False, E.ENABLE): True,
        ("enabled", True, E.ENABLE): R.ALREADY_ENABLED,
        ("enabled", True, E.DISABLE): False,
        ("enabled", False, E.DISABLE): R.ALREADY_DISABLED,
        ("suppressed", False, E.SUPPRESS): True,
        ("suppressed", True, E.SUPPRESS): True,
        ("suppressed", False, E.UNSUPPRESS): False,
        ("suppressed", True, E.UNSUPPRESS): False,
        ("out_of_service", False, E.REMOVE_FROM_SERVICE): True,
        ("out_of_service", True, E.REMOVE_FROM_SERVICE): R.INVALID_STATE,
        ("out_of_service", True, E.PLACE_IN_SERVICE): False,
        ("out_of_service", False, E.PLACE_IN_SERVICE): R.INVALID_STATE,
    }
)

# A disabled condition is not processed: people and rules are refused or ignored, time and switches go on.
DISABLED: Mapping[EventKind, Refusal | None] = MappingProxyType(
    {
        E.ACTIVATE: None,
        E.CLEAR: None,
        E.REALARM: None,
        E.ACKNOWLEDGE: R.DISABLED,
        E.CONFIRM: R.DISABLED,
        E.COMMENT: R.DISABLED,
        E.SHELVE_TIMED: R.DISABLED,
        E.SHELVE_ONE_SHOT: R.DISABLED,
        E.UNSHELVE: R.DISABLED,
    }
)


@dataclass(frozen=True, slots=True)
class AlarmEvent:
    """An event with what comes with it.

    Attributes
    ----------
    user, comment : str
        Of a person's action. An empty comment leaves the last one standing, unless that is of somebody else.
    message, severity, evidence
        Of an activation; None leaves what is there.
    shelve_ns : int
        How long to shelve; for one-shot shelving the longest time, 0 for no end.
    activation : int or None
        The activation that a person's action answers: the alarm may have come again since it was seen.
    """

    kind: EventKind
    cycle: int = 0
    time_ns: int = 0
    user: str = ""
    comment: str = ""
    message: Message | None = None
    severity: int | None = None
    evidence: Evidence | None = None
    shelve_ns: int = 0
    activation: int | None = None


@dataclass(frozen=True, slots=True)
class Transition:
    """An alarm after an event, what is to be done, and why nothing happened if it was refused."""

    alarm: Alarm
    notifications: tuple[Notification, ...] = ()
    refusal: Refusal | None = None


def is_silenced(alarm: Alarm) -> bool:
    """Whether the alarm is kept from people: disabled, shelved, suppressed or out of service."""
    shelved = alarm.shelving is not Shelving.UNSHELVED
    return not alarm.enabled or shelved or alarm.suppressed or alarm.out_of_service


def is_retained(alarm: Alarm) -> bool:
    """Whether a client that refreshes must be shown the alarm (Retain of ConditionType)."""
    return alarm.enabled and (alarm.active or not alarm.acknowledged or not alarm.confirmed)


def annunciation(alarm: Alarm) -> Annunciation:
    """Name the combination of active, acknowledged and confirmed."""
    return Annunciation((alarm.active, alarm.acknowledged, alarm.confirmed))


def transition(alarm: Alarm, event: AlarmEvent) -> Transition:
    """Apply one event after the tables above; a refused one leaves the alarm as it was."""
    if not alarm.enabled and event.kind in DISABLED:
        return Transition(alarm, refusal=DISABLED[event.kind])
    if event.activation not in (None, alarm.activation):
        return Transition(alarm, refusal=Refusal.ANOTHER_ACTIVATION)
    if event.kind is EventKind.SHELVE_TIMED and event.shelve_ns <= 0:
        return Transition(alarm, refusal=Refusal.SHELVING_TIME)
    moved = _apply_tables(alarm, event.kind)
    if isinstance(moved, Refusal):
        return Transition(alarm, refusal=moved)
    moved = _with_end_of_shelving(moved, event)
    repeated = event.kind is EventKind.COMMENT or (event.kind is EventKind.REALARM and alarm.active)
    if moved == alarm and not repeated:
        return Transition(alarm)
    is_raised = moved.active and not moved.acknowledged and (alarm.acknowledged or not alarm.active)
    if moved.active and not alarm.active:  # what was said before was said of another activation
        moved = replace(moved, comment="", user="")
    moved = _described(moved, event)
    if is_raised:
        moved = replace(moved, activation=max(event.time_ns, alarm.activation + 1))
    calls = moved.active and not moved.acknowledged and event.kind in (EventKind.ACTIVATE, EventKind.REALARM)
    annunciated = (Notification.ANNUNCIATE,) if calls and not is_silenced(moved) else ()
    return Transition(moved, (Notification.EVENT, *annunciated))


def expire(alarm: Alarm, cycle: int, time_ns: int) -> Transition:
    """End a shelving whose time is over at `time_ns`."""
    if alarm.shelving is Shelving.UNSHELVED or not 0 < alarm.shelved_until_ns <= time_ns:
        return Transition(alarm)
    return transition(alarm, AlarmEvent(EventKind.SHELVE_EXPIRED, cycle, time_ns))


def _apply_tables(alarm: Alarm, kind: EventKind) -> Alarm | Refusal:
    moved = alarm
    for name in ("enabled", "suppressed", "out_of_service"):
        target = SWITCHES.get((name, getattr(alarm, name), kind))
        if isinstance(target, Refusal):
            return target
        if target is not None:
            moved = replace(moved, **{name: target})  # type: ignore[arg-type]
    state = ANNUNCIATION.get((annunciation(alarm), kind))
    if isinstance(state, Refusal):
        return state
    if kind is EventKind.DISABLE:
        state = Annunciation.NORMAL
    if state is not None:
        active, acknowledged, confirmed = state.value
        moved = replace(moved, active=active, acknowledged=acknowledged, confirmed=confirmed)
    shelving = SHELVING.get((alarm.shelving, kind))
    if isinstance(shelving, Refusal):
        return shelving
    return moved if shelving is None else replace(moved, shelving=shelving)


def _with_end_of_shelving(alarm: Alarm, event: AlarmEvent) -> Alarm:
    if event.kind in (EventKind.SHELVE_TIMED, EventKind.SHELVE_ONE_SHOT):
        until_ns = event.time_ns + event.shelve_ns if event.shelve_ns > 0 else 0
        return replace(alarm, shelved_until_ns=until_ns)
    return replace(alarm, shelved_until_ns=0) if alarm.shelving is Shelving.UNSHELVED else alarm


def _described(alarm: Alarm, event: AlarmEvent) -> Alarm:
    is_said = event.comment or event.user not in ("", alarm.user)
    comment, user = (event.comment, event.user) if is_said else (alarm.comment, alarm.user)
    return replace(
        alarm,
        cycle=event.cycle,
        time_ns=event.time_ns,
        message=alarm.message if event.message is None else event.message.english,
        message_de=alarm.message_de if event.message is None else event.message.german,
        severity=alarm.severity if event.severity is None else event.severity,
        evidence=alarm.evidence if event.evidence is None else event.evidence,
        comment=comment,
        user=user,
    )
