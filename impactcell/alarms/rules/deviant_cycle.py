"""DeviantCycle: friction along the slide of one cycle is unlike that of the others.

Deviant cycles come in runs, of the same cause: who was called for the first is not called for each, as by a
chattering alarm (ISA-18.2, IEC 62682). Each is an event of its own, which names the part to be set aside.
"""

import math

from impactcell.alarms.rule import (
    AlarmRule,
    CycleInputs,
    Message,
    RuleContext,
    RuleResult,
    RuleSettings,
    german,
)
from impactcell.alarms.rules import batch_shift, model_gap
from impactcell.records import Evidence
from impactcell.records.uncertainty import plus_minus

NAME = "DeviantCycle"
"""Published name."""
LEVEL_INNOVATION = 2.0
"""Standard deviations of mu_s from its prediction beyond which the cycle's level of friction is off as well:
then it may be the first of another batch."""
HOLD_BACK = 5
"""Cycles for which such a cycle waits: a step that makes cycles deviant is found to be a batch in them."""


def evaluate(inputs: CycleInputs, _context: RuleContext) -> RuleResult:
    """Say whether the signature deviates; nothing while its reference is being learned."""
    if not inputs.judged:
        return RuleResult(NAME, None)
    if inputs.deviation is None:
        return RuleResult(NAME, holds=False)
    at_m = inputs.signature.deviates_at_m if inputs.signature is not None else math.nan
    message = _message(inputs.cycle, inputs.deviation, at_m, inputs.pushed_m)
    is_level = abs(inputs.innovation) > LEVEL_INNOVATION
    hold_back = HOLD_BACK if is_level else 0
    return RuleResult(NAME, holds=True, message=message, evidence=inputs.deviation, hold_back=hold_back)


def _message(cycle: int, deviation: Evidence, at_m: float, pushed_m: float) -> Message:
    is_higher = deviation.size > 0.0
    size, std = abs(deviation.size), deviation.size_std
    if not math.isfinite(deviation.size_std + at_m):
        return Message(
            f"Cycle {cycle} is unlike the others over the whole slide; no single place stands out. "
            "Set the part aside and look at it and at the surface.",
            f"Zyklus {cycle} weicht über den ganzen Gleitweg von den anderen ab; keine einzelne Stelle "
            "fällt auf. Teil beiseitelegen, Teil und Oberfläche ansehen.",
        )
    place, place_in_german = _place(at_m, pushed_m)
    return Message(
        f"Cycle {cycle} is unlike the others: {place} friction is "
        f"{plus_minus(size, std, '.4f')} (95 %) {'higher' if is_higher else 'lower'}. "
        "Set the part aside and look at it and at the surface there.",
        f"Zyklus {cycle} weicht von den anderen ab: {place_in_german} ist die Reibung "
        f"um {german(size, '.4f', std)} (95 %) {'höher' if is_higher else 'niedriger'}. "
        "Teil beiseitelegen, Teil und Oberfläche an dieser Stelle ansehen.",
    )


def _place(at_m: float, pushed_m: float) -> tuple[str, str]:
    """Say in both languages where that was, by distance slid and from where the part lay, if it is known."""
    english, words = (
        f"{1e3 * at_m:.2f} mm after contact ended",
        f"{german(1e3 * at_m, '.2f')} mm nach Ende des Kontakts",
    )
    if not math.isfinite(pushed_m):
        return english, words
    way_mm = 1e3 * (pushed_m + at_m)
    return (
        f"{english} ({way_mm:.2f} mm from where the part lay)",
        f"{words} ({german(way_mm, '.2f')} mm von dort, wo das Teil lag)",
    )


RULE = AlarmRule(
    name=NAME,
    node_number=5010,
    type_number=1005,
    title=Message("Deviant cycle", "Abweichender Zyklus"),
    description=Message(
        "The last cycle differs from the cycles the cell has learned.",
        "Der letzte Zyklus weicht von den gelernten ab.",
    ),
    settings=RuleSettings(severity=400, off_delay=1, told_step=0.0),
    input_node="Signature/TSquared",
    evaluate=evaluate,
    explained_by=(model_gap.NAME,),
    # the signature begins anew with a shift: what deviates from there on is not of the batch
    explained_at_once_by=(batch_shift.NAME,),
    is_occurrence=True,
)
"""The rule."""
