"""Alarms people trust: rules that raise them, and one life cycle as a transition table."""

from impactcell.alarms.alarm_set import (
    AlarmSetState,
    apply_event,
    apply_rule_result,
    expire_shelving,
    initial_state,
    update,
)
from impactcell.alarms.lifecycle import (
    AlarmEvent,
    EventKind,
    Notification,
    Refusal,
    Transition,
    is_retained,
    is_silenced,
)
from impactcell.alarms.rules import (
    AlarmSettings,
    RuleResult,
    RuleSettings,
    batch_shift,
    deviant_cycle,
    wear_limit,
)

__all__ = [
    "AlarmEvent",
    "AlarmSetState",
    "AlarmSettings",
    "EventKind",
    "Notification",
    "Refusal",
    "RuleResult",
    "RuleSettings",
    "Transition",
    "apply_event",
    "apply_rule_result",
    "batch_shift",
    "deviant_cycle",
    "expire_shelving",
    "initial_state",
    "is_retained",
    "is_silenced",
    "update",
    "wear_limit",
]
