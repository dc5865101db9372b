"""ModelGap: the model no longer explains the captures of this cell."""

from impactcell.alarms.rule import (
    NO_MESSAGE,
    AlarmRule,
    CycleInputs,
    Message,
    RuleContext,
    RuleResult,
    RuleSettings,
    german,
)
from impactcell.records import Evidence

NAME = "ModelGap"
"""Published name."""


def evaluate(inputs: CycleInputs, _context: RuleContext) -> RuleResult:
    """Say whether the residual has left its usual level; nothing while that is being learned."""
    message = _message(inputs.gap) if inputs.gap_exceeds else NO_MESSAGE
    return RuleResult(NAME, inputs.gap_exceeds, message, inputs.gap)


def _message(gap: Evidence) -> Message:
    size, since = gap.size, gap.change_cycle
    return Message(
        f"The model no longer explains the captures: since cycle {since} the residual is {size:+.2f} noise "
        "floors off its usual level. Estimates are less certain; have the captures looked at with "
        "`impactcell discrepancy`.",
        f"Das Modell erklärt die Messungen nicht mehr: seit Zyklus {since} liegt der Rest um "
        f"{german(size, '+.2f')} Rauschpegel neben dem üblichen. Schätzwerte sind weniger sicher; Messungen "
        "mit `impactcell discrepancy` untersuchen lassen.",
    )


RULE = AlarmRule(
    name=NAME,
    node_number=5012,
    type_number=1007,
    title=Message("Model gap", "Modelllücke"),
    description="Measurements no longer fit the model.",
    settings=RuleSettings(severity=300, off_delay=20, told_step=1.0),
    input_node="Model/Gap",
    evaluate=evaluate,
)
"""The rule."""
