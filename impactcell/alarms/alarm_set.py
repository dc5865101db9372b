"""All alarms of one cell: results of the rules and events go in, transitions come out."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

from impactcell.alarms.debounce import ZERO_COUNTS, DebounceCounters, debounce, has_moved, is_news
from impactcell.alarms.lifecycle import AlarmEvent, Notification, Transition, expire, transition
from impactcell.alarms.rule import CycleInputs, RuleContext, RuleResult, RuleSettings
from impactcell.alarms.rules import RULES
from impactcell.alarms.transition_tables import EventKind
from impactcell.records import Alarm, Evidence, Shelving
from impactcell.serialization import stored

T = TypeVar("T")
SECONDS_A_DAY = 86_400.0
"""Seconds."""
NAMES = tuple(RULES)
"""Published names of all conditions, in the order in which they are listed."""
_INDEX = {name: index for index, name in enumerate(NAMES)}


@dataclass(frozen=True, slots=True)
class AlarmSettings:
    """What a cell chooses of its conditions.

    Attributes
    ----------
    rules : mapping
        Settings of conditions by name; one that is missing has its rule's defaults.
    announced_cycles : int
        For how many cycles an announced batch change keeps the rules silent that it suppresses.
    """

    rules: Mapping[str, RuleSettings] = field(default_factory=dict)
    announced_cycles: int = 50

    def rule(self, name: str) -> RuleSettings:
        """Return the settings of one condition."""
        return self.rules.get(name, RULES[name].settings)


@dataclass(frozen=True, slots=True)
class AlarmSetState:
    """Alarms of a cell with their counters, in the order of `NAMES`.

    Attributes
    ----------
    suppressed_cycles : int
        Cycles for which conditions stay suppressed after an announced batch change.
    """

    alarms: tuple[Alarm, ...] = field(metadata=stored(by=NAMES))
    counters: tuple[DebounceCounters, ...] = field(metadata=stored(by=NAMES))
    suppressed_cycles: int = 0

    def alarm(self, name: str) -> Alarm:
        """One alarm by its name."""
        return self.alarms[_INDEX[name]]


def initial_state(settings: AlarmSettings) -> AlarmSetState:
    """All conditions normal."""
    rules = [(name, settings.rule(name)) for name in NAMES]
    alarms = tuple(Alarm(name, enabled=rule.enabled, severity=rule.severity) for name, rule in rules)
    return AlarmSetState(alarms, tuple(ZERO_COUNTS for _ in alarms))


def evaluate(settings: AlarmSettings, state: AlarmSetState, inputs: CycleInputs) -> list[RuleResult]:
    """Ask every rule that looks at cycles; one that holds says how rarely it was designed to be wrong.

    Where its evidence leaves that open, it is as often as the cell wants it of every rule.
    """
    disabled = frozenset(alarm.name for alarm in state.alarms if not alarm.enabled)
    results = [
        rule.evaluate(inputs, RuleContext(settings.rule(name), alarm.active, alarm.evidence, disabled))
        for name, rule, alarm in ((name, rule, state.alarm(name)) for name, rule in RULES.items())
        if rule.evaluate is not None
    ]
    if math.isnan(inputs.false_alarm_cycles):
        return results
    return [
        replace(result, evidence=_rated(result.evidence, inputs)) if result.holds else result
        for result in results
    ]


def _rated(evidence: Evidence, inputs: CycleInputs) -> Evidence:
    own = evidence.false_alarm_cycles
    cycles = inputs.false_alarm_cycles if math.isnan(own) else own
    return replace(
        evidence, false_alarm_cycles=cycles, false_alarm_days=cycles * inputs.period_s / SECONDS_A_DAY
    )


def update(
    settings: AlarmSettings,
    state: AlarmSetState,
    results: Iterable[RuleResult],
    cycle: int,
    time_ns: int,
    *,
    announced: bool = False,
) -> tuple[AlarmSetState, tuple[Transition, ...]]:
    """Move all alarms by what the rules say of one cycle.

    Its time ends no shelving: that is of the module's clock, and people shelve by ours (`expire_shelving`).

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
    state, transitions = _suppress(settings, state, cycle, time_ns, announced=announced)
    for result in _explained(state, tuple(results)):
        index = _INDEX[result.name]
        # nearly always there is nothing to do
        if result.holds or state.alarms[index].active or state.counters[index] is not ZERO_COUNTS:
            state, change = apply_rule_result(settings, state, result, cycle, time_ns)
            transitions = (*transitions, *([change] if change.notifications else []))
    return state, transitions


def _suppress(
    settings: AlarmSettings, state: AlarmSetState, cycle: int, time_ns: int, *, announced: bool
) -> tuple[AlarmSetState, tuple[Transition, ...]]:
    """Suppress rules for a while after an announced batch change, and end it."""
    remaining = settings.announced_cycles if announced else max(state.suppressed_cycles - 1, 0)
    transitions: tuple[Transition, ...] = ()
    if announced or (state.suppressed_cycles and not remaining):
        event = AlarmEvent(EventKind.SUPPRESS if announced else EventKind.UNSUPPRESS, cycle, time_ns)
        for name, rule in RULES.items():
            if rule.suppressed_by_announcement:
                state, change = apply_event(state, name, event)
                transitions = (*transitions, *([change] if change.notifications else []))
    return (
        replace(state, suppressed_cycles=remaining) if remaining != state.suppressed_cycles else state
    ), transitions


def _explained(state: AlarmSetState, results: tuple[RuleResult, ...]) -> Iterator[RuleResult]:
    """Give the results; one that another explains neither holds nor is held back any longer.

    What is disabled explains nothing: nobody hears of it, and nothing waits for it.
    """
    enabled = {alarm.name for alarm in state.alarms if alarm.enabled}
    holding = {result.name for result in results if result.holds} & enabled
    active = {alarm.name for alarm in state.alarms if alarm.active}
    for result in results:
        rule = RULES[result.name]
        causes = set(rule.explained_by) & (holding | active) | set(rule.explained_at_once_by) & holding
        if result.hold_back or state.counters[_INDEX[result.name]].held_back is not None:
            causes |= set(rule.may_be_explained_by) & (holding - active)
        others = {*rule.explained_by, *rule.explained_at_once_by, *rule.may_be_explained_by}
        if causes:
            yield RuleResult(result.name, holds=False, is_explained=True)
        elif result.hold_back and not others & enabled:
            yield replace(result, hold_back=0)
        else:
            yield result


def apply_rule_result(
    settings: AlarmSettings, state: AlarmSetState, result: RuleResult, cycle: int, time_ns: int
) -> tuple[AlarmSetState, Transition]:
    """Move one alarm by one result: of a cycle, or of what happens beside the cycles."""
    index = _INDEX[result.name]
    alarm, rule = state.alarms[index], settings.rule(result.name)
    before = state.counters[index]
    counters, kind = debounce(rule, alarm, before, result)
    if kind is EventKind.ACTIVATE and before.held_back is not None:
        result = before.held_back
    if counters is not state.counters[index]:
        state = AlarmSetState(state.alarms, _with(state.counters, index, counters), state.suppressed_cycles)
    if kind is None and alarm.active and result.holds and is_news(rule, alarm, result):
        if not RULES[result.name].calls_again:
            change = _retold(alarm, result, cycle, time_ns)
            return replace(state, alarms=_with(state.alarms, index, change.alarm)), change
        state, _ = apply_event(state, result.name, AlarmEvent(EventKind.CLEAR, cycle, time_ns))
        kind = EventKind.ACTIVATE
    if kind is None:
        return state, Transition(alarm)
    event = AlarmEvent(kind, cycle, time_ns)
    if result.holds:
        event = replace(event, message=result.message, severity=rule.severity, evidence=result.evidence)
    return apply_event(state, result.name, event)


def _retold(alarm: Alarm, result: RuleResult, cycle: int, time_ns: int) -> Transition:
    """Let an active alarm tell what has changed.

    It is an event with this cycle where something has happened anew, or where the message alone is another.
    """
    message = result.message
    renewed = replace(
        alarm,
        message=message.english or alarm.message,
        message_de=message.german or alarm.message_de,
        evidence=result.evidence,
    )
    if has_moved(alarm.evidence, result.evidence) and not RULES[result.name].is_occurrence:
        return Transition(renewed)
    return Transition(replace(renewed, cycle=cycle, time_ns=time_ns), (Notification.EVENT,))


def apply_event(state: AlarmSetState, name: str, event: AlarmEvent) -> tuple[AlarmSetState, Transition]:
    """Move one alarm by an event: a person's action, or the outside's suppression."""
    index = _INDEX[name]
    change = transition(state.alarms[index], event)
    if event.kind in (EventKind.ENABLE, EventKind.DISABLE) and change.refusal is None:
        state = replace(state, counters=_with(state.counters, index, ZERO_COUNTS))
    return replace(state, alarms=_with(state.alarms, index, change.alarm)), change


def end_surface(state: AlarmSetState, cycle: int, time_ns: int) -> AlarmSetState:
    """End what was told of a surface that has been renewed; a new one that is worn too calls anew."""
    for name, rule in RULES.items():
        if rule.ends_with_surface:
            state, _ = apply_event(state, name, AlarmEvent(EventKind.CLEAR, cycle, time_ns))
            state = replace(state, counters=_with(state.counters, _INDEX[name], ZERO_COUNTS))
    return state


def expire_shelving(
    state: AlarmSetState, cycle: int, time_ns: int
) -> tuple[AlarmSetState, tuple[Transition, ...]]:
    """End every shelving whose time is over by the clock that it was shelved by."""
    if all(alarm.shelving is Shelving.UNSHELVED for alarm in state.alarms):
        return state, ()
    changes = [expire(alarm, cycle, time_ns) for alarm in state.alarms]
    return replace(state, alarms=tuple(t.alarm for t in changes)), tuple(
        t for t in changes if t.notifications
    )


def _with(items: tuple[T, ...], index: int, item: T) -> tuple[T, ...]:
    return (*items[:index], item, *items[index + 1 :])
