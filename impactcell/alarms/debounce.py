"""From what a rule says to what happens to its alarm: delays counted in cycles, and re-alarm (ISA-18.2)."""

from dataclasses import dataclass

from impactcell.alarms.lifecycle import EventKind
from impactcell.alarms.rule import RuleResult, RuleSettings
from impactcell.records import Alarm


@dataclass(frozen=True, slots=True)
class DebounceCounters:
    """Cycles that are counted for one condition.

    Attributes
    ----------
    held : int
        For which the rule has held, while the condition is inactive.
    missed, called : int
        For which the rule has not held, and since the last call, while it is active.
    """

    held: int = 0
    missed: int = 0
    called: int = 0


ZERO_COUNTS = DebounceCounters()
"""Nothing is being counted."""


def debounce(
    settings: RuleSettings, alarm: Alarm, counters: DebounceCounters, result: RuleResult
) -> tuple[DebounceCounters, EventKind | None]:
    """Count cycles and say which event, if any, the result gives to its alarm."""
    if result.holds is None:
        return counters, None
    if not alarm.enabled:
        return ZERO_COUNTS, None
    if not alarm.active:
        if not result.holds:
            return ZERO_COUNTS, None
        if counters.held < settings.on_delay:
            return DebounceCounters(counters.held + 1), None
        return ZERO_COUNTS, EventKind.ACTIVATE
    missed, called = 0 if result.holds else counters.missed + 1, counters.called + 1
    if missed > settings.off_delay:
        return ZERO_COUNTS, EventKind.CLEAR
    if settings.realarm and called >= settings.realarm:
        return DebounceCounters(0, missed), EventKind.REALARM
    return DebounceCounters(0, missed, called), None
