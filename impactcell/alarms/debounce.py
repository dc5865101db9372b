"""From what a rule says to what happens to its alarm: delays counted in cycles, and re-alarm (ISA-18.2)."""

import math
from dataclasses import astuple, dataclass, replace

from impactcell.alarms.rule import RuleResult, RuleSettings
from impactcell.alarms.transition_tables import EventKind
from impactcell.records import Alarm, Evidence


@dataclass(frozen=True, slots=True)
class DebounceCounters:
    """Cycles that are counted for one condition.

    Attributes
    ----------
    held : int
        For which the rule has held, while the condition is inactive.
    missed, called : int
        For which the rule has not held, and since the last call, while it is active.
    held_back : RuleResult or None
        What waits for another rule to explain it, for as many cycles as have passed of its `hold_back`.
    waited : int
        How many have.
    """

    held: int = 0
    missed: int = 0
    called: int = 0
    held_back: RuleResult | None = None
    waited: int = 0


ZERO_COUNTS = DebounceCounters()
"""Nothing is being counted."""


def debounce(
    settings: RuleSettings, alarm: Alarm, counters: DebounceCounters, result: RuleResult
) -> tuple[DebounceCounters, EventKind | None]:
    """Count cycles and say which event, if any, the result gives to its alarm.

    An alarm that has been held back activates with what was held back: `counters.held_back` of the call.
    """
    if not alarm.enabled:
        return (counters, None) if result.holds is None else (ZERO_COUNTS, None)
    if counters.held_back is not None and not alarm.active and not result.is_explained:
        if counters.waited < counters.held_back.hold_back:
            return replace(counters, waited=counters.waited + 1), None
        return ZERO_COUNTS, EventKind.ACTIVATE
    if result.holds is None:
        return counters, None
    if not alarm.active:
        if not result.holds:
            return ZERO_COUNTS, None
        if counters.held < settings.on_delay:
            return DebounceCounters(counters.held + 1), None
        if result.hold_back:
            return DebounceCounters(counters.held, held_back=result, waited=1), None
        return ZERO_COUNTS, EventKind.ACTIVATE
    missed, called = 0 if result.holds else counters.missed + 1, counters.called + 1
    if missed > settings.off_delay:
        return ZERO_COUNTS, EventKind.CLEAR
    if settings.realarm and called >= settings.realarm:
        return DebounceCounters(0, missed), EventKind.REALARM
    return DebounceCounters(0, missed, called), None


def is_news(settings: RuleSettings, told: Alarm, now: RuleResult) -> bool:
    """Whether what a rule says has changed by the agreed step since its alarm told it.

    Where every change is told, another message is one too, though no figure has moved.
    """
    if has_moved(told.evidence, now.evidence):
        step = settings.told_step * now.evidence.size_std
        return settings.told_step == 0.0 or abs(now.evidence.size - told.evidence.size) >= step
    return settings.told_step == 0.0 and now.message.english not in ("", told.message)


def has_moved(before: Evidence, after: Evidence) -> bool:
    """Whether any figure differs; two that are not there do not, though one is from a journal."""
    pairs = zip(astuple(before), astuple(after), strict=True)
    return any(a != b and not (math.isnan(a) and math.isnan(b)) for a, b in pairs)
