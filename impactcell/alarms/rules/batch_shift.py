"""BatchShift: the material has changed without an announcement.

A shift is detected at one cycle: the alarm stands for a while and then clears by itself. Another shift in
that while is another change of the material: it calls again, whether or not the one before was acknowledged.
"""

from impactcell.alarms.rule import (
    AlarmRule,
    CycleInputs,
    Message,
    RuleContext,
    RuleResult,
    RuleSettings,
    german,
)
from impactcell.alarms.rules import model_gap
from impactcell.records import Evidence
from impactcell.records.uncertainty import plus_minus

NAME = "BatchShift"
"""Published name."""
GAP_RISING = 0.3
"""Share of its threshold from which the model's residual is on its way over it: then the shift may be of the
estimates only, for what the model does not know."""
HOLD_BACK = 5
"""Cycles for which such a shift waits: from that share on a residual that stays has crossed within three."""


def evaluate(inputs: CycleInputs, context: RuleContext) -> RuleResult:
    """Say whether the tracker detected a shift of the material at this cycle."""
    shift, gap = inputs.shift, inputs.gap
    if shift is None:
        return RuleResult(NAME, holds=False)
    is_gap_told = inputs.gap_exceeds and model_gap.NAME not in context.disabled
    if is_gap_told and abs(gap.change_cycle - shift.change_cycle) <= HOLD_BACK:
        # the estimates moved with what the model does not know, which ModelGap has called
        return RuleResult(NAME, holds=False)
    is_gap_rising = GAP_RISING < gap.statistic / gap.threshold <= 1.0
    return RuleResult(
        NAME,
        holds=True,
        message=_message(shift),
        evidence=shift,
        hold_back=HOLD_BACK if is_gap_rising else 0,
    )


def _message(shift: Evidence) -> Message:
    size, std, since = abs(shift.size), shift.size_std, shift.change_cycle
    stds = size / std if std > 0.0 else float("inf")
    return Message(
        f"The material has changed: since cycle {since} friction is {plus_minus(size, std, '.4f')} (95 %) "
        f"{'higher' if shift.size > 0.0 else 'lower'}, which is {stds:.0f} standard deviations. "
        "Check which batch is being fed; if the change was meant, acknowledge it.",
        f"Das Material hat gewechselt: seit Zyklus {since} ist die Reibung um {german(size, '.4f', std)} "
        f"(95 %) {'höher' if shift.size > 0.0 else 'niedriger'}, das sind {stds:.0f} "
        "Standardabweichungen. Prüfen, welche Charge läuft; war der Wechsel gewollt, quittieren.",
    )


RULE = AlarmRule(
    name=NAME,
    node_number=5009,
    type_number=1004,
    title=Message("Batch shift", "Chargenwechsel"),
    description=Message(
        "The material has changed: friction has shifted from one cycle to the next.",
        "Das Material hat gewechselt: die Reibung ist von einem Zyklus zum nächsten gesprungen.",
    ),
    settings=RuleSettings(severity=500, off_delay=50, told_step=0.0),
    input_node="Batch/Offset",
    evaluate=evaluate,
    suppressed_by_announcement=True,
    may_be_explained_by=(model_gap.NAME,),
    calls_again=True,
    is_occurrence=True,
)
"""The rule."""
