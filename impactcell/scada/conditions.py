"""Conditions of a cell as OPC UA shows them: nodes and events made from `Alarm` records, nothing more.

What an alarm may do next is decided in `impactcell.alarms`; here its state is only told.
"""

import hashlib
import logging
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import Any, Final

from asyncua import ua

from impactcell.alarms import RULES, is_retained
from impactcell.opcua.address_space.variable_store import GOOD, NOT_ENCODABLE, VariableStore, moment
from impactcell.opcua.binary_codec import encoding_fault
from impactcell.opcua.event_notification import BrowsePath, EventNotification
from impactcell.opcua.languages import TranslatedText
from impactcell.records import Alarm, Shelving
from impactcell.scada.alarm_events import activation_id, event_id
from impactcell.scada.cell_nodes import CellSpace

MAX_SHELVE_S: Final = 24 * 3600.0
"""Longest time a condition can be shelved: nobody remembers longer why."""

_LT: Final = ua.VariantType.LocalizedText
_SHELVING: Final[dict[Shelving, tuple[str, int]]] = {
    Shelving.UNSHELVED: ("Unshelved", ua.ObjectIds.ShelvedStateMachineType_Unshelved),
    Shelving.TIMED: ("Timed Shelved", ua.ObjectIds.ShelvedStateMachineType_TimedShelved),
    Shelving.ONE_SHOT: ("One Shot Shelved", ua.ObjectIds.ShelvedStateMachineType_OneShotShelved),
}
_STATES: Final[dict[str, tuple[Callable[[Alarm], bool], str, str]]] = {
    "ActiveState": (lambda a: a.active, "Active", "Inactive"),
    "AckedState": (lambda a: a.acknowledged, "Acknowledged", "Unacknowledged"),
    "ConfirmedState": (lambda a: a.confirmed, "Confirmed", "Unconfirmed"),
    "SuppressedState": (lambda a: a.suppressed, "Suppressed", "Unsuppressed"),
    "OutOfServiceState": (lambda a: a.out_of_service, "Out of Service", "In Service"),
}
# Part 9, 5.5.2: all else that a disabled condition says of itself is Bad_ConditionDisabled.
_TOLD_WHEN_DISABLED: Final = frozenset(
    {
        *("EventId", "EventType", "SourceNode", "SourceName", "Time", "ReceiveTime", "Message", "Severity"),
        *("ConditionClassId", "ConditionClassName", "ConditionName", "BranchId", "Retain", "EnabledState"),
        *("Comment", "ClientUserId", "MaxTimeShelved"),
    }
)
_DISABLED: Final = ua.StatusCode(ua.StatusCodes.BadConditionDisabled)
_log = logging.getLogger(__name__)


def unshelve_ms(alarm: Alarm, now_ns: int) -> float:
    """Milliseconds until a shelving ends: 0 where there is none, the longest where nothing ends it."""
    if alarm.shelving is Shelving.UNSHELVED:
        return 0.0
    if alarm.shelved_until_ns <= 0:
        return MAX_SHELVE_S * 1e3
    return max((alarm.shelved_until_ns - now_ns) / 1e6, 0.0)


class Condition:
    """One condition: its present state, its nodes, and the last event that told of it."""

    def __init__(
        self, cell: CellSpace, name: str, values: VariableStore, notifiers: frozenset[ua.NodeId]
    ) -> None:
        self.cell = cell.description.name
        self.name = name
        self.node = cell.path(name)
        self.alarm = Alarm(name)
        self._space = cell
        self._values = values
        self._notifiers = notifiers
        self._event_type = cell.alarm_type(name)
        self._event_id = event_id(self.cell, self.alarm)
        self._severity = 0
        self._last_severity = 0
        self._severity_since: datetime | None = None
        self._time: datetime | None = None
        self._began = datetime.now(UTC)
        input_path = RULES[name].input_node
        self._input = cell.path(input_path) if input_path else ua.NodeId()
        cell.compute(f"{name}/ShelvingState/UnshelveTime", self._unshelve_time)
        self._write_nodes()

    def _unshelve_time(self) -> ua.DataValue:
        now = datetime.now(UTC)
        variant = ua.Variant(unshelve_ms(self.alarm, time.time_ns()), ua.VariantType.Double)
        return ua.DataValue(variant, GOOD if self.alarm.enabled else _DISABLED, now, now)

    def update(self, alarm: Alarm) -> EventNotification | None:
        """Take a new state; the event that tells it, None where there is nothing to tell."""
        if alarm is self.alarm:  # as it is from cycle to cycle, nearly always
            return None
        before, self.alarm = self.alarm, alarm
        severity, self._severity = self._severity or alarm.severity, alarm.severity
        told = event_id(self.cell, alarm)
        if told == self._event_id:
            return None
        is_transition = (alarm.time_ns, alarm.cycle) != (before.time_ns, before.cycle)
        self._event_id, self._time = told, None if is_transition else datetime.now(UTC)
        if severity != alarm.severity:
            self._last_severity, self._severity_since = severity, _time_of(alarm, self._time)
        self._write_nodes()
        return self._event(alarm, self._time)

    def is_current_event(self, given: bytes | None) -> bool:
        """Whether an EventId is of the alarm's present activation."""
        activation = activation_id(self.cell, self.alarm)
        return given is not None and given.startswith(activation) and len(given) == len(self._event_id)

    def past_event(self, alarm: Alarm) -> EventNotification:
        """Make the event again that told of a transition."""
        return self._event(alarm, is_past=True)

    def present(self) -> EventNotification | None:
        """Make the event of the present state for a refresh; None where it is not to be shown."""
        if not is_retained(self.alarm):
            return None
        return self._event(self.alarm, self._time)

    def _event(
        self, alarm: Alarm, told: datetime | None = None, *, is_past: bool = False
    ) -> EventNotification:
        told_fields = self._fields(alarm, told, is_past=is_past)
        fields = {path: self._sendable(path, variant) for path, variant in told_fields}
        if not alarm.enabled:
            bad = ua.Variant(_DISABLED, ua.VariantType.StatusCode)
            fields = {p: v if not p or p[0] in _TOLD_WHEN_DISABLED else bad for p, v in fields.items()}
        return EventNotification(self._event_type, fields, self._notifiers)

    def _sendable(self, path: BrowsePath, value: ua.Variant) -> ua.Variant:
        """Give a field of an event, and in place of one that cannot be sent its status: the event is told."""
        if not (fault := encoding_fault(value)):
            return value
        _log.error("%s: %s/%s: %s; its events are without it", self.cell, self.name, "/".join(path), fault)
        return ua.Variant(NOT_ENCODABLE, ua.VariantType.StatusCode)

    def _write_nodes(self) -> None:
        alarm, now = self.alarm, datetime.now(UTC)
        time_of = _time_of(alarm, self._time)
        fields = dict(self._fields(alarm, self._time))
        for path, variant in fields.items():
            if not path:
                continue
            own = fields.get((*path, "SourceTimestamp"))
            source = time_of if own is None else own.Value
            status = GOOD if alarm.enabled or path[0] in _TOLD_WHEN_DISABLED else _DISABLED
            node = self._space.path("/".join((self.name, *path)))
            self._values.write(node, ua.DataValue(variant, status, source, now))

    def _fields(
        self, alarm: Alarm, told: datetime | None, *, is_past: bool = False
    ) -> Iterator[tuple[BrowsePath, ua.Variant]]:
        time_of = _time_of(alarm, told)
        last_severity, severity_since = (0, None) if is_past else (self._last_severity, self._severity_since)
        yield from _variants(
            {
                "EventId": (event_id(self.cell, alarm), ua.VariantType.ByteString),
                "EventType": (self._event_type, ua.VariantType.NodeId),
                "SourceNode": (self._space.node, ua.VariantType.NodeId),
                "SourceName": (self.cell, ua.VariantType.String),
                "Time": (time_of, ua.VariantType.DateTime),
                "ReceiveTime": (time_of, ua.VariantType.DateTime),
                "Message": (_message(alarm), _LT),
                "Severity": (alarm.severity, ua.VariantType.UInt16),
                "ConditionName": (alarm.name, ua.VariantType.String),
                "BranchId": (ua.NodeId(), ua.VariantType.NodeId),
                "Retain": (is_retained(alarm), ua.VariantType.Boolean),
                "ClientUserId": (alarm.comment_user or alarm.user, ua.VariantType.String),
                "Comment": (ua.LocalizedText(alarm.comment), _LT),
                "Quality": (GOOD, ua.VariantType.StatusCode),
                "LastSeverity": (last_severity, ua.VariantType.UInt16),
                "InputNode": (self._input, ua.VariantType.NodeId),
                "MaxTimeShelved": (MAX_SHELVE_S * 1e3, ua.VariantType.Double),
                "SuppressedOrShelved": (
                    alarm.suppressed or alarm.out_of_service or alarm.shelving is not Shelving.UNSHELVED,
                    ua.VariantType.Boolean,
                ),
            }
        )
        yield (), ua.Variant(self.node, ua.VariantType.NodeId)
        class_name = RULES[alarm.name].condition_class.value
        class_id = getattr(ua.ObjectIds, f"{class_name}Type")
        yield ("ConditionClassId",), ua.Variant(ua.NodeId(class_id), ua.VariantType.NodeId)
        yield ("ConditionClassName",), ua.Variant(ua.LocalizedText(class_name), _LT)
        for path, since in (
            (("Quality", "SourceTimestamp"), self._since(0, time_of)),
            (("LastSeverity", "SourceTimestamp"), severity_since or self._since(0, time_of)),
            (("Comment", "SourceTimestamp"), self._since(alarm.comment_ns, time_of)),
            (("ActiveState", "TransitionTime"), self._since(alarm.active_ns, time_of)),
            (("EnabledState", "TransitionTime"), self._since(alarm.enabled_ns, time_of)),
        ):
            yield path, ua.Variant(since, ua.VariantType.DateTime)
        left_ms = unshelve_ms(alarm, alarm.time_ns if is_past else time.time_ns())
        yield ("ShelvingState", "UnshelveTime"), ua.Variant(left_ms, ua.VariantType.Double)
        yield from self._states(alarm)
        yield from _evidence(alarm)

    def _since(self, time_ns: int, time_of: datetime) -> datetime:
        """Since when something is as it is told; where that is not known, since it has been shown."""
        return moment(time_ns) if time_ns else min(self._began, time_of)

    @staticmethod
    def _states(alarm: Alarm) -> Iterator[tuple[BrowsePath, ua.Variant]]:
        enabled = "Enabled" if alarm.enabled else "Disabled"
        effective = enabled
        for name, (test, true_text, false_text) in _STATES.items():
            on = test(alarm)
            yield (name,), ua.Variant(ua.LocalizedText(true_text if on else false_text), _LT)
            yield (name, "Id"), ua.Variant(on, ua.VariantType.Boolean)
            if name == "ActiveState":
                effective = true_text if on and alarm.enabled else enabled
        text, state = _SHELVING[alarm.shelving]
        if alarm.enabled and alarm.shelving is not Shelving.UNSHELVED:
            effective = text
        yield ("EnabledState",), ua.Variant(ua.LocalizedText(enabled), _LT)
        yield ("EnabledState", "Id"), ua.Variant(alarm.enabled, ua.VariantType.Boolean)
        yield ("EnabledState", "EffectiveDisplayName"), ua.Variant(ua.LocalizedText(effective), _LT)
        yield ("ShelvingState", "CurrentState"), ua.Variant(ua.LocalizedText(text), _LT)
        yield ("ShelvingState", "CurrentState", "Id"), ua.Variant(ua.NodeId(state), ua.VariantType.NodeId)


def _message(alarm: Alarm) -> ua.LocalizedText:
    title = RULES[alarm.name].title
    english = alarm.message or title.english
    return TranslatedText(english, de=alarm.message_de or (english if alarm.message else title.german))


def _time_of(alarm: Alarm, told: datetime | None) -> datetime:
    """Time of an event: of the transition, unless it tells of something since; now where it is not known."""
    return told or (moment(alarm.time_ns) if alarm.time_ns else datetime.now(UTC))


def _variants(fields: dict[str, tuple[Any, ua.VariantType]]) -> Iterator[tuple[BrowsePath, ua.Variant]]:
    for name, (value, kind) in fields.items():
        yield (name,), ua.Variant(value, kind)


def _evidence(alarm: Alarm) -> Iterator[tuple[BrowsePath, ua.Variant]]:
    evidence = alarm.evidence
    yield ("CycleNumber",), ua.Variant(alarm.cycle, ua.VariantType.UInt32)
    yield ("ChangeCycle",), ua.Variant(evidence.change_cycle, ua.VariantType.UInt32)
    for name, value in (
        ("Statistic", evidence.statistic),
        ("Threshold", evidence.threshold),
        ("Size", evidence.size),
        ("SizeStdDev", evidence.size_std),
        ("FalseAlarmCycles", evidence.false_alarm_cycles),
        ("FalseAlarmDays", evidence.false_alarm_days),
    ):
        yield (name,), ua.Variant(float(value), ua.VariantType.Double)


def refresh_event(kind: int) -> EventNotification:
    """Make the event that opens or closes a refresh."""
    now = datetime.now(UTC)
    server = ua.NodeId(ua.ObjectIds.Server)
    identity = hashlib.sha256(f"{kind} {now.isoformat()}".encode()).digest()[:16]
    fields = dict(
        _variants(
            {
                "EventId": (identity, ua.VariantType.ByteString),
                "EventType": (ua.NodeId(kind), ua.VariantType.NodeId),
                "SourceNode": (server, ua.VariantType.NodeId),
                "SourceName": ("Server", ua.VariantType.String),
                "Time": (now, ua.VariantType.DateTime),
                "ReceiveTime": (now, ua.VariantType.DateTime),
                "Message": (ua.LocalizedText("Refresh"), _LT),
                "Severity": (1, ua.VariantType.UInt16),
            }
        )
    )
    return EventNotification(ua.NodeId(kind), fields, frozenset({server}), unfiltered=True)
