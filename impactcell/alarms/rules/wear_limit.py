"""WearLimit: friction at the reference batch has passed the limit at which the surface counts as worn.

It watches the probability that the level is above the limit, with hysteresis in probability: the level itself
goes over the limit and back many times while it crosses. What is promised: it comes once that is 97 % sure.
"""

from impactcell.alarms.rule import (
    AlarmRule,
    ConditionClass,
    CycleInputs,
    Message,
    RuleContext,
    RuleResult,
    RuleSettings,
    german,
    percent_sure,
)
from impactcell.records import BatchState, Evidence, Quality, WearState
from impactcell.records.uncertainty import TOLD_STDS, plus_minus

NAME = "WearLimit"
"""Published name."""
DOUBT = (
    "The friction that this follows is itself uncertain: see its reason first. ",
    "Die Reibung, der dies folgt, ist selbst unsicher: zuerst deren Grund ansehen. ",
)
"""What is said before a surface is renewed for what a wrong scale or model may have made."""


def evaluate(inputs: CycleInputs, context: RuleContext) -> RuleResult:
    """Compare P(level > limit) with the threshold."""
    wear = inputs.wear
    if not inputs.wear_is_known:
        return RuleResult(NAME, None)
    probability = wear.probability_above_limit
    if probability <= context.threshold:
        return RuleResult(NAME, holds=False)
    above = wear.level - wear.limit
    # what has been told of when it was passed stays: the rate of now says nothing of that any more
    since = context.told.change_cycle if context.active else _passed(wear, inputs.cycle, above)
    evidence = Evidence(probability, context.settings.activate_above, since, above, wear.level_std)
    message = _message(wear, inputs.batch, evidence, inputs.cycle, active=context.active)
    return RuleResult(NAME, holds=True, message=message, evidence=evidence)


def told_level(wear: WearState) -> tuple[str, str]:
    """Write the level and its band in both languages, and what all cycles share where that is more."""
    common, common_in_german = "", ""
    if wear.level_common_std > wear.level_std:
        told = TOLD_STDS * wear.level_common_std
        common = f"; ± {told:.4f} more, alike in all cycles"
        common_in_german = f"; dazu ± {german(told, '.4f')}, in allen Zyklen gleich"
    return (
        f"{plus_minus(wear.level, wear.level_std, '.4f')} (95 %{common})",
        f"{german(wear.level, '.4f', wear.level_std)} (95 %{common_in_german})",
    )


def may_be_renewed(wear: WearState, batch: BatchState | None) -> bool:
    """Whether friction itself is below a limit that the level has passed.

    A fall that nobody told of is a batch to the tracker, and wear goes on from where it was.
    """
    return _friction(wear, batch) < min(wear.level, wear.limit - TOLD_STDS * wear.level_std)


def _friction(wear: WearState, batch: BatchState | None) -> float:
    return wear.level if batch is None else wear.level + batch.offset


def _renewal(wear: WearState, batch: BatchState | None) -> tuple[str, str]:
    """Say in both languages what speaks for a surface that was renewed."""
    if not may_be_renewed(wear, batch):
        return "", ""
    friction = _friction(wear, batch)
    english = f"With the present batch friction is {friction:.4f}, below the limit: if the surface has been "
    words = f"Mit der jetzigen Charge ist die Reibung {german(friction, '.4f')}, unter der Grenze: wurde die "
    return (
        english + "renewed since, reset wear only. ",
        words + "Oberfläche inzwischen erneuert, nur den Verschleiß zurücksetzen. ",
    )


def _is_rising(wear: WearState) -> bool:
    return wear.rate_per_cycle > TOLD_STDS * wear.rate_std


def _passed(wear: WearState, cycle: int, above: float) -> int:
    """Cycle at which a level that is `above` the limit now was at it; this one where no rise is seen."""
    is_past = _is_rising(wear) and above > 0.0
    return max(cycle - round(above / wear.rate_per_cycle), 0) if is_past else cycle


def _message(
    wear: WearState, batch: BatchState | None, evidence: Evidence, cycle: int, *, active: bool
) -> Message:
    since, reach = evidence.change_cycle, TOLD_STDS * wear.level_std
    sure, sure_in_german = percent_sure(evidence.statistic)
    level, level_in_german = told_level(wear)
    doubt, doubt_in_german = DOUBT if wear.quality is Quality.UNCERTAIN else ("", "")
    renewal, renewal_in_german = _renewal(wear, batch)
    if active:
        when, when_in_german = (
            f"was passed at about cycle {since} (",
            f"etwa bei Zyklus {since} überschritten (",
        )
    elif _is_rising(wear):
        first, last = (_passed(wear, cycle, evidence.size + edge) for edge in (reach, -reach))
        when = f"was passed at about cycle {since} ({first} to {last}; "
        when_in_german = f"etwa bei Zyklus {since} überschritten ({first} bis {last}; "
    else:
        when, when_in_german = "is passed (", "überschritten ("
    return Message(
        f"The surface is worn: friction is {level}, "
        f"its limit {wear.limit:.4f} {when}{sure} % sure). {doubt}{renewal}"
        "Renew the surface, then reset wear.",
        f"Die Oberfläche ist verschlissen: Reibung {level_in_german}, "
        f"Grenze {german(wear.limit, '.4f')} {when_in_german}{sure_in_german} % sicher). "
        f"{doubt_in_german}{renewal_in_german}Oberfläche erneuern, danach Verschleiß zurücksetzen.",
    )


RULE = AlarmRule(
    name=NAME,
    node_number=5008,
    type_number=1003,
    title=Message("Wear limit", "Verschleißgrenze"),
    description=Message(
        "The filtered friction has probably passed the wear limit.",
        "Die gefilterte Reibung hat wahrscheinlich die Verschleißgrenze überschritten.",
    ),
    settings=RuleSettings(
        severity=700, on_delay=5, off_delay=20, activate_above=0.97, clear_below=0.5, told_step=1.0
    ),
    condition_class=ConditionClass.MAINTENANCE,
    input_node="Wear/Level",
    evaluate=evaluate,
    ends_with_surface=True,
    is_probability=True,
)
"""The rule."""
