"""Alarms people trust: rules that raise them, and one life cycle as a transition table."""

from impactcell.alarms.alarm_set import AlarmState, act, after_cycle, at_time, find, initial_state
from impactcell.alarms.lifecycle import Effect, Event, Occurrence, Refusal, Transition, retained, silent
from impactcell.alarms.rules import (
    AlarmSettings,
    Finding,
    RuleSettings,
    batch_shift,
    deviant_cycle,
    wear_limit,
)

__all__ = [
    "AlarmSettings",
    "AlarmState",
    "Effect",
    "Event",
    "Finding",
    "Occurrence",
    "Refusal",
    "RuleSettings",
    "Transition",
    "act",
    "after_cycle",
    "at_time",
    "batch_shift",
    "deviant_cycle",
    "find",
    "initial_state",
    "retained",
    "silent",
    "wear_limit",
]
