"""Alarms people trust: rules that raise them, one file each, and one life cycle as a transition table."""

from impactcell.alarms.alarm_set import (
    NAMES,
    AlarmSetState,
    AlarmSettings,
    apply_event,
    apply_rule_result,
    end_surface,
    evaluate,
    expire_shelving,
    initial_state,
    update,
)
from impactcell.alarms.lifecycle import (
    AlarmEvent,
    Notification,
    Transition,
    is_retained,
    is_silenced,
)
from impactcell.alarms.rule import (
    AlarmRule,
    ConditionClass,
    CycleInputs,
    Message,
    RuleContext,
    RuleResult,
    RuleSettings,
)
from impactcell.alarms.rules import RULES
from impactcell.alarms.transition_tables import EventKind, Refusal

__all__ = [
    "NAMES",
    "RULES",
    "AlarmEvent",
    "AlarmRule",
    "AlarmSetState",
    "AlarmSettings",
    "ConditionClass",
    "CycleInputs",
    "EventKind",
    "Message",
    "Notification",
    "Refusal",
    "RuleContext",
    "RuleResult",
    "RuleSettings",
    "Transition",
    "apply_event",
    "apply_rule_result",
    "end_surface",
    "evaluate",
    "expire_shelving",
    "initial_state",
    "is_retained",
    "is_silenced",
    "update",
]
