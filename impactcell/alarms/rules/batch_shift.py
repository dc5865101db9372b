"""BatchShift: the material has changed without an announcement.

A shift is detected at one cycle: the alarm stands for a while and then clears by itself.
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
from impactcell.records import Evidence

NAME = "BatchShift"
"""Published name."""


def evaluate(inputs: CycleInputs, _context: RuleContext) -> RuleResult:
    """Say whether the tracker detected a shift at this cycle."""
    if inputs.shift is None:
        return RuleResult(NAME, holds=False)
    return RuleResult(NAME, holds=True, message=_message(inputs.shift), evidence=inputs.shift)


def _message(shift: Evidence) -> Message:
    size, std, since = abs(shift.size), shift.size_std, shift.change_cycle
    stds = size / std if std > 0.0 else float("inf")
    return Message(
        f"The material has changed: since cycle {since} friction is {size:.4f} ± {std:.4f} "
        f"{'higher' if shift.size > 0.0 else 'lower'} ({stds:.0f} standard deviations). "
        "Check which batch is being fed; if the change was meant, acknowledge it.",
        f"Das Material hat gewechselt: seit Zyklus {since} ist die Reibung um {german(size, '.4f')} ± "
        f"{german(std, '.4f')} {'höher' if shift.size > 0.0 else 'niedriger'} ({stds:.0f} "
        "Standardabweichungen). Prüfen, welche Charge läuft; war der Wechsel gewollt, quittieren.",
    )


RULE = AlarmRule(
    name=NAME,
    node_number=5009,
    type_number=1004,
    title=Message("Batch shift", "Chargenwechsel"),
    description="The material has changed: friction has shifted from one cycle to the next.",
    settings=RuleSettings(severity=500, off_delay=50),
    input_node="Batch/Offset",
    evaluate=evaluate,
    suppressed_by_announcement=True,
)
"""The rule."""
