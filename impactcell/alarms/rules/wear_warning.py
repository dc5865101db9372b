"""WearWarning: the surface will be worn soon; there is time to plan its renewal.

It watches the probability that the level will be above the limit a number of cycles from now, the horizon,
with hysteresis in probability. What is promised: when it comes, the limit is passed within the horizon with
at least the probability that is asked for, as far as wear keeps its rate (see `WearState`). Once the limit
itself is passed `WearLimit` takes its place.
"""

import math

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
from impactcell.alarms.rules import wear_limit
from impactcell.records import Evidence, WearState
from impactcell.records.uncertainty import told_cycles

NAME = "WearWarning"
"""Published name."""


def evaluate(inputs: CycleInputs, context: RuleContext) -> RuleResult:
    """Compare P(level > limit) at the horizon with the threshold."""
    probability = inputs.probability_at_horizon
    if not inputs.wear_is_known or math.isnan(probability):
        return RuleResult(NAME, None)
    if probability <= context.threshold:
        return RuleResult(NAME, holds=False)
    wear, threshold = inputs.wear, context.settings.activate_above
    evidence = Evidence(probability, threshold, size=wear.level - wear.limit, size_std=wear.level_std)
    return RuleResult(
        NAME, holds=True, message=_message(wear, probability, inputs.horizon), evidence=evidence
    )


def _message(wear: WearState, probability: float, horizon: float) -> Message:
    rate = 1000.0 * wear.rate_per_cycle
    sure, sure_in_german = percent_sure(probability)
    level, level_in_german = wear_limit.told_level(wear)
    english, german_words = (_cycles(wear, words) for words in (("to", "or more"), ("bis", "oder mehr")))
    return Message(
        f"The surface will be worn soon: friction is {level} and rises by {rate:.4f} per 1000 cycles; "
        f"about {english} cycles are left to its limit {wear.limit:.4f}. It is {sure} % sure to be passed "
        f"within {horizon:.0f} cycles. Plan to renew the surface.",
        f"Die Oberfläche ist bald verschlissen: Reibung {level_in_german}, sie steigt "
        f"um {german(rate, '.4f')} je 1000 Zyklen; bis zur Grenze {german(wear.limit, '.4f')} bleiben etwa "
        f"{german_words} Zyklen. Zu {sure_in_german} % wird sie innerhalb von {horizon:.0f} Zyklen "
        "überschritten. Erneuern der Oberfläche einplanen.",
    )


def _cycles(wear: WearState, words: tuple[str, str]) -> str:
    """Write cycles left and their 95 % interval with words for "to" and "or more"."""
    left, low, high = wear.cycles_to_limit, wear.cycles_to_limit_low, wear.cycles_to_limit_high
    end = f"{words[0]} {told_cycles(high)}" if math.isfinite(high) else words[1]
    return f"{told_cycles(left)} ({told_cycles(low)} {end}; 95 %)"


RULE = AlarmRule(
    name=NAME,
    node_number=5017,
    type_number=1010,
    title=Message("Wear warning", "Verschleißwarnung"),
    description=Message(
        "The filtered friction will probably pass the wear limit soon.",
        "Die gefilterte Reibung überschreitet wahrscheinlich bald die Verschleißgrenze.",
    ),
    settings=RuleSettings(
        severity=350, on_delay=5, off_delay=20, activate_above=0.9, clear_below=0.5, told_step=1.0
    ),
    condition_class=ConditionClass.MAINTENANCE,
    input_node="Wear/CyclesToLimit",
    evaluate=evaluate,
    ends_with_surface=True,
    explained_by=(wear_limit.NAME,),
    is_probability=True,
)
"""The rule."""
