"""The life cycle of one alarm: `impactcell.alarms.transition_tables` applied, and nothing else.

Time arrives with the event.
"""

import enum
from dataclasses import dataclass, replace

from impactcell.alarms.rule import Message
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


class Notification(enum.Enum):
    """What the outside has to do after a transition."""

    EVENT = "send an event: something of the alarm changed"
    ANNUNCIATE = "call for attention: newly active or active again, and not kept silent"


@dataclass(frozen=True, slots=True)
class AlarmEvent:
    """An event with what comes with it.

    Attributes
    ----------
    user, comment : str
        Of a person's action. An empty comment leaves the last one standing, as its author's.
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
        moved = replace(moved, comment="", comment_user="", user="")
    moved = _dated(alarm, _described(moved, event), event)
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


def _dated(before: Alarm, after: Alarm, event: AlarmEvent) -> Alarm:
    is_comment = bool(event.comment) or after.comment != before.comment
    return replace(
        after,
        active_ns=event.time_ns if after.active != before.active else before.active_ns,
        enabled_ns=event.time_ns if after.enabled != before.enabled else before.enabled_ns,
        comment_ns=event.time_ns if is_comment else before.comment_ns,
    )


def _described(alarm: Alarm, event: AlarmEvent) -> Alarm:
    return replace(
        alarm,
        cycle=event.cycle,
        time_ns=event.time_ns,
        message=alarm.message if event.message is None else event.message.english,
        message_de=alarm.message_de if event.message is None else event.message.german,
        severity=alarm.severity if event.severity is None else event.severity,
        evidence=alarm.evidence if event.evidence is None else event.evidence,
        comment=event.comment or alarm.comment,
        comment_user=event.user if event.comment else alarm.comment_user,
        user=event.user or alarm.user,
    )
