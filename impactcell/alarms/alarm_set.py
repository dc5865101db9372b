"""All alarms of one cell: results of the rules and events go in, transitions come out."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TypeVar

from impactcell.alarms.lifecycle import AlarmEvent, EventKind, Transition, expire, transition
from impactcell.alarms.rules import (
    ZERO_COUNTS,
    AlarmSettings,
    DebounceCounters,
    RuleResult,
    alarm_event,
    debounce,
)
from impactcell.records import Alarm, AlarmName, Shelving
from impactcell.serialization import stored

T = TypeVar("T")
_INDEX = {name: index for index, name in enumerate(AlarmName)}


@dataclass(frozen=True, slots=True)
class AlarmSetState:
    """Alarms of a cell with their delays, in the order of `AlarmName`.

    Attributes
    ----------
    announced : int
        Cycles for which BatchShift stays suppressed.
    """

    alarms: tuple[Alarm, ...] = field(metadata=stored(by=AlarmName))
    delays: tuple[DebounceCounters, ...] = field(metadata=stored(by=AlarmName))
    announced: int = 0

    def alarm(self, name: AlarmName) -> Alarm:
        """One alarm by its name."""
        return self.alarms[_INDEX[name]]


def initial_state(settings: AlarmSettings) -> AlarmSetState:
    """All conditions normal."""
    rules = [(name, settings.rule(name)) for name in AlarmName]
    alarms = tuple(Alarm(name, enabled=rule.enabled, severity=rule.severity) for name, rule in rules)
    return AlarmSetState(alarms, tuple(ZERO_COUNTS for _ in alarms))


def update(
    settings: AlarmSettings,
    state: AlarmSetState,
    results: Iterable[RuleResult],
    cycle: int,
    time_ns: int,
    *,
    announced: bool = False,
) -> tuple[AlarmSetState, tuple[Transition, ...]]:
    """Move all alarms by what the rules found in one cycle, and by its time.

    Parameters
    ----------
    announced : bool
        The PLC announced a batch change with this cycle.

    Returns
    -------
    state : AlarmSetState
    transitions : tuple of Transition
        Those that have notifications.
    """
    state, changes = expire_shelving(state, cycle, time_ns)
    remaining = settings.announced_cycles if announced else max(state.announced - 1, 0)
    if announced or (state.announced and not remaining):
        kind = EventKind.SUPPRESS if announced else EventKind.UNSUPPRESS
        state, change = apply_event(state, AlarmName.BATCH_SHIFT, AlarmEvent(kind, cycle, time_ns))
        changes = (*changes, *([change] if change.notifications else []))
    if remaining != state.announced:
        state = replace(state, announced=remaining)
    for result in results:
        index = _INDEX[result.name]
        # nearly always there is nothing to do
        if result.holds or state.alarms[index].active or state.delays[index] is not ZERO_COUNTS:
            state, change = apply_rule_result(settings, state, result, cycle, time_ns)
            changes = (*changes, *([change] if change.notifications else []))
    return state, changes


def apply_rule_result(
    settings: AlarmSettings, state: AlarmSetState, result: RuleResult, cycle: int, time_ns: int
) -> tuple[AlarmSetState, Transition]:
    """Move one alarm by one result: of a cycle, or of what happens beside the cycles."""
    index = _INDEX[result.name]
    alarm, rule = state.alarms[index], settings.rule(result.name)
    delay, kind = debounce(rule, alarm, state.delays[index], result)
    if delay is not state.delays[index]:
        state = AlarmSetState(state.alarms, _with(state.delays, index, delay), state.announced)
    if kind is None:
        if alarm.active and result.holds and result.evidence != alarm.evidence:
            renewed = replace(alarm, message=result.message or alarm.message, evidence=result.evidence)
            state = replace(state, alarms=_with(state.alarms, index, renewed))
        return state, Transition(state.alarms[index])
    return apply_event(state, result.name, alarm_event(kind, result, rule.severity, cycle, time_ns))


def apply_event(state: AlarmSetState, name: AlarmName, event: AlarmEvent) -> tuple[AlarmSetState, Transition]:
    """Move one alarm by an event: a person's action, or the outside's suppression."""
    index = _INDEX[name]
    change = transition(state.alarms[index], event)
    if event.kind in (EventKind.ENABLE, EventKind.DISABLE) and change.refusal is None:
        state = replace(state, delays=_with(state.delays, index, ZERO_COUNTS))
    return replace(state, alarms=_with(state.alarms, index, change.alarm)), change


def expire_shelving(
    state: AlarmSetState, cycle: int, time_ns: int
) -> tuple[AlarmSetState, tuple[Transition, ...]]:
    """End every shelving whose time is over."""
    if all(alarm.shelving is Shelving.UNSHELVED for alarm in state.alarms):
        return state, ()
    changes = [expire(alarm, cycle, time_ns) for alarm in state.alarms]
    return replace(state, alarms=tuple(t.alarm for t in changes)), tuple(
        t for t in changes if t.notifications
    )


def _with(items: tuple[T, ...], index: int, item: T) -> tuple[T, ...]:
    return (*items[:index], item, *items[index + 1 :])
