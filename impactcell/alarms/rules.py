"""Which conditions should be active after a cycle, and why: hysteresis, delays in cycles, re-alarm."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from impactcell.alarms.lifecycle import AlarmEvent, EventKind
from impactcell.records import Alarm, AlarmName, Evidence, Quality, WearState


@dataclass(frozen=True, slots=True)
class RuleSettings:
    """Of one condition.

    Attributes
    ----------
    severity : int
        1-1000, as in OPC UA.
    on_delay, off_delay : int
        Cycles for which the rule must hold, and not hold, before the alarm activates and clears.
    realarm : int
        Cycles after which an alarm that is still active calls again; 0 for never.
    enabled : bool
        Whether the condition starts enabled.
    """

    severity: int = 500
    on_delay: int = 0
    off_delay: int = 0
    realarm: int = 0
    enabled: bool = True


DEFAULT_RULES: Mapping[AlarmName, RuleSettings] = MappingProxyType(
    {
        AlarmName.WEAR_LIMIT: RuleSettings(severity=700, on_delay=5, off_delay=20),
        # a shift is one cycle's result: the alarm stands for a while and then clears by itself
        AlarmName.BATCH_SHIFT: RuleSettings(severity=500, off_delay=50),
        AlarmName.DEVIANT_CYCLE: RuleSettings(severity=400, off_delay=1),
        AlarmName.MODULE_CONNECTION: RuleSettings(severity=800),
        AlarmName.MODEL_GAP: RuleSettings(severity=300, off_delay=20),
        AlarmName.POSITIONING_FAULT: RuleSettings(severity=600),
        AlarmName.JOURNAL_FAULT: RuleSettings(severity=900),
    }
)


@dataclass(frozen=True, slots=True)
class AlarmSettings:
    """Of all conditions of a cell.

    Attributes
    ----------
    rules : mapping
        Settings of each condition; a name that is missing has its default.
    wear_on, wear_off : float
        P(level > limit) at which WearLimit comes on and goes off.
    announced_cycles : int
        For how many cycles an announced batch change keeps BatchShift suppressed.
    """

    rules: Mapping[AlarmName, RuleSettings] = field(default_factory=lambda: DEFAULT_RULES)
    wear_on: float = 0.98
    wear_off: float = 0.5
    announced_cycles: int = 50

    def rule(self, name: AlarmName) -> RuleSettings:
        """Return the settings of one condition."""
        return self.rules.get(name, DEFAULT_RULES[name])


NO_EVIDENCE = Evidence()


@dataclass(frozen=True, slots=True)
class RuleResult:
    """What a rule says of one condition now; `holds` None where it cannot tell, and all stays as it is."""

    name: AlarmName
    holds: bool | None
    message: str = ""
    evidence: Evidence = NO_EVIDENCE


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


def wear_limit(settings: AlarmSettings, wear: WearState, cycle: int, *, active: bool) -> RuleResult:
    """Wear on the probability that the level is above the limit, with hysteresis in probability."""
    probability = wear.probability_above_limit
    threshold = settings.wear_off if active else settings.wear_on
    if wear.quality is Quality.BAD or probability != probability:
        return RuleResult(AlarmName.WEAR_LIMIT, None)
    if probability <= threshold:
        return RuleResult(AlarmName.WEAR_LIMIT, holds=False)
    above = wear.level - wear.limit
    since = cycle - round(above / wear.rate_per_cycle) if wear.rate_per_cycle > 0.0 < above else cycle
    evidence = Evidence(probability, settings.wear_on, max(since, 0), above, wear.level_std)
    message = (
        f"mu_s {wear.level:.4f} ± {wear.level_std:.4f}, limit {wear.limit:.4f}, P(above) {probability:.3f}"
    )
    return RuleResult(AlarmName.WEAR_LIMIT, holds=True, message=message, evidence=evidence)


def batch_shift(shift: Evidence | None) -> RuleResult:
    """Find a batch shift in what the tracker says."""
    if shift is None:
        return RuleResult(AlarmName.BATCH_SHIFT, holds=False)
    message = f"mu_s shifted by {shift.size:+.4f} ± {shift.size_std:.4f} from cycle {shift.change_cycle}"
    return RuleResult(AlarmName.BATCH_SHIFT, holds=True, message=message, evidence=shift)


def deviant_cycle(deviation: Evidence | None, at_m: float, *, judged: bool) -> RuleResult:
    """Find a deviant cycle in what the signature says; `judged` False while its reference is learned."""
    if not judged:
        return RuleResult(AlarmName.DEVIANT_CYCLE, None)
    if deviation is None:
        return RuleResult(AlarmName.DEVIANT_CYCLE, holds=False)
    message = f"friction {deviation.size:+.4f} ± {deviation.size_std:.4f} off at {at_m * 1e3:.2f} mm"
    if not math.isfinite(deviation.size_std + at_m):
        message = "the stroke as a whole is unlike the others; no single place stands out"
    return RuleResult(AlarmName.DEVIANT_CYCLE, holds=True, message=message, evidence=deviation)


def debounce(
    rule: RuleSettings, alarm: Alarm, delay: DebounceCounters, result: RuleResult
) -> tuple[DebounceCounters, EventKind | None]:
    """Count cycles and say which event, if any, the result gives to its alarm."""
    if result.holds is None:
        return delay, None
    if not alarm.enabled:
        return ZERO_COUNTS, None
    if not alarm.active:
        if not result.holds:
            return ZERO_COUNTS, None
        if delay.held < rule.on_delay:
            return DebounceCounters(delay.held + 1), None
        return ZERO_COUNTS, EventKind.ACTIVATE
    missed, called = 0 if result.holds else delay.missed + 1, delay.called + 1
    if missed > rule.off_delay:
        return ZERO_COUNTS, EventKind.CLEAR
    if rule.realarm and called >= rule.realarm:
        return DebounceCounters(0, missed), EventKind.REALARM
    return DebounceCounters(0, missed, called), None


def alarm_event(kind: EventKind, result: RuleResult, severity: int, cycle: int, time_ns: int) -> AlarmEvent:
    """Make the event that carries a result's message and evidence, where it has any."""
    if not result.holds:
        return AlarmEvent(kind, cycle, time_ns)
    return AlarmEvent(
        kind, cycle, time_ns, message=result.message, severity=severity, evidence=result.evidence
    )
