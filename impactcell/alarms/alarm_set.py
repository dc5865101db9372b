"""All alarms of one cell: findings and actions go in, moved alarms come out."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeVar

from impactcell.alarms.lifecycle import Event, Occurrence, Transition, expire, transition
from impactcell.alarms.rules import RESTED, AlarmSettings, Delay, Finding, delayed, occurrence
from impactcell.records import Alarm, AlarmName, Shelving

T = TypeVar("T")
_PLACES = {name: place for place, name in enumerate(AlarmName)}


@dataclass(frozen=True, slots=True)
class AlarmState:
    """Alarms of a cell with their delays, in the order of `AlarmName`.

    Attributes
    ----------
    announced : int
        Cycles for which BatchShift stays suppressed.
    """

    alarms: tuple[Alarm, ...]
    delays: tuple[Delay, ...]
    announced: int = 0

    def alarm(self, name: AlarmName) -> Alarm:
        """One alarm by its name."""
        return self.alarms[_PLACES[name]]


def initial_state(settings: AlarmSettings) -> AlarmState:
    """All conditions normal."""
    rules = [(name, settings.rule(name)) for name in AlarmName]
    alarms = tuple(Alarm(name, enabled=rule.enabled, severity=rule.severity) for name, rule in rules)
    return AlarmState(alarms, tuple(RESTED for _ in alarms))


def after_cycle(
    settings: AlarmSettings,
    state: AlarmState,
    findings: Iterable[Finding],
    cycle: int,
    time_ns: int,
    *,
    announced: bool = False,
) -> tuple[AlarmState, tuple[Transition, ...]]:
    """Move all alarms by what the rules found in one cycle, and by its time.

    Parameters
    ----------
    announced : bool
        The PLC announced a batch change with this cycle.

    Returns
    -------
    state : AlarmState
    transitions : tuple of Transition
        Those that have effects.
    """
    state, moved = at_time(state, cycle, time_ns)
    left = settings.announced_cycles if announced else max(state.announced - 1, 0)
    if announced or (state.announced and not left):
        event = Event.SUPPRESS if announced else Event.UNSUPPRESS
        state, done = act(state, AlarmName.BATCH_SHIFT, Occurrence(event, cycle, time_ns))
        moved = (*moved, *([done] if done.effects else []))
    if left != state.announced:
        state = replace(state, announced=left)
    for finding in findings:
        place = _PLACES[finding.name]
        # nearly always there is nothing to do
        if finding.holds or state.alarms[place].active or state.delays[place] is not RESTED:
            state, done = find(settings, state, finding, cycle, time_ns)
            moved = (*moved, *([done] if done.effects else []))
    return state, moved


def find(
    settings: AlarmSettings, state: AlarmState, finding: Finding, cycle: int, time_ns: int
) -> tuple[AlarmState, Transition]:
    """Move one alarm by one finding: of a cycle, or of what happens beside the cycles."""
    place = _PLACES[finding.name]
    alarm, rule = state.alarms[place], settings.rule(finding.name)
    delay, event = delayed(rule, alarm, state.delays[place], finding)
    if delay is not state.delays[place]:
        state = AlarmState(state.alarms, _with(state.delays, place, delay), state.announced)
    if event is None:
        if alarm.active and finding.holds and finding.evidence != alarm.evidence:
            newer = replace(alarm, message=finding.message or alarm.message, evidence=finding.evidence)
            state = replace(state, alarms=_with(state.alarms, place, newer))
        return state, Transition(state.alarms[place])
    return act(state, finding.name, occurrence(event, finding, rule.severity, cycle, time_ns))


def act(state: AlarmState, name: AlarmName, happened: Occurrence) -> tuple[AlarmState, Transition]:
    """Move one alarm by an event: a person's action, or the outside's suppression."""
    place = _PLACES[name]
    done = transition(state.alarms[place], happened)
    if happened.event in (Event.ENABLE, Event.DISABLE) and done.refusal is None:
        state = replace(state, delays=_with(state.delays, place, RESTED))
    return replace(state, alarms=_with(state.alarms, place, done.alarm)), done


def at_time(state: AlarmState, cycle: int, time_ns: int) -> tuple[AlarmState, tuple[Transition, ...]]:
    """End every shelving whose time is over."""
    if all(alarm.shelving is Shelving.UNSHELVED for alarm in state.alarms):
        return state, ()
    done = [expire(alarm, cycle, time_ns) for alarm in state.alarms]
    return replace(state, alarms=tuple(t.alarm for t in done)), tuple(t for t in done if t.effects)


def _with(items: tuple[T, ...], place: int, item: T) -> tuple[T, ...]:
    return (*items[:place], item, *items[place + 1 :])
