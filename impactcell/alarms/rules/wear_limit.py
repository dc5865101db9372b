"""WearLimit: friction at the reference batch has passed the limit at which the surface counts as worn.

It watches the probability that the level is above the limit, with hysteresis in probability: the level itself
goes over the limit and back many times while it crosses.
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
)
from impactcell.records import Evidence, WearState

NAME = "WearLimit"
"""Published name."""


def evaluate(inputs: CycleInputs, context: RuleContext) -> RuleResult:
    """Compare P(level > limit) with the threshold."""
    wear = inputs.wear
    if not inputs.wear_is_known:
        return RuleResult(NAME, None)
    probability = wear.probability_above_limit
    if probability <= context.threshold:
        return RuleResult(NAME, holds=False)
    above = wear.level - wear.limit
    is_rising = wear.rate_per_cycle > 0.0 < above
    since = inputs.cycle - round(above / wear.rate_per_cycle) if is_rising else inputs.cycle
    evidence = Evidence(probability, context.settings.activate_above, max(since, 0), above, wear.level_std)
    return RuleResult(NAME, holds=True, message=_message(wear, evidence), evidence=evidence)


def _message(wear: WearState, evidence: Evidence) -> Message:
    since, sure = evidence.change_cycle, 100.0 * evidence.statistic
    return Message(
        f"The surface is worn: friction is {wear.level:.4f} ± {wear.level_std:.4f}, its limit "
        f"{wear.limit:.4f} was passed at about cycle {since} ({sure:.1f} % sure). "
        "Renew the surface, then call ResetWear.",
        f"Die Oberfläche ist verschlissen: Reibung {german(wear.level, '.4f')} ± "
        f"{german(wear.level_std, '.4f')}, Grenze {german(wear.limit, '.4f')} etwa bei Zyklus {since} "
        f"überschritten ({german(sure, '.1f')} % sicher). Oberfläche erneuern, danach ResetWear aufrufen.",
    )


RULE = AlarmRule(
    name=NAME,
    node_number=5008,
    type_number=1003,
    title=Message("Wear limit", "Verschleißgrenze"),
    description="The filtered friction has probably passed the wear limit.",
    settings=RuleSettings(
        severity=700, on_delay=5, off_delay=20, activate_above=0.98, clear_below=0.5, told_step=1.0
    ),
    condition_class=ConditionClass.MAINTENANCE,
    input_node="Wear/Level",
    evaluate=evaluate,
)
"""The rule."""
