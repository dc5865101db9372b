"""PositioningFault: a positioning task has ended before the part was in place."""

from impactcell.alarms.rule import NO_EVIDENCE, AlarmRule, Message, RuleResult, RuleSettings
from impactcell.german.positioning_reasons import german_positioning_reason
from impactcell.records import Evidence

NAME = "PositioningFault"
"""Published name."""


def result(reason: str, evidence: Evidence = NO_EVIDENCE) -> RuleResult:
    """Say why the task has ended; an empty reason says that nothing is wrong."""
    german = german_positioning_reason(reason)
    message = Message(
        f"The part is not in place, positioning has stopped: {reason}. "
        "Clear the cause, then set the target again.",
        f"Das Teil ist nicht in Position, die Positionierung hat angehalten: {german}. "
        "Ursache beheben, danach das Ziel neu setzen.",
    )
    return RuleResult(NAME, bool(reason), message, evidence)


RULE = AlarmRule(
    name=NAME,
    node_number=5013,
    type_number=1008,
    title=Message("Positioning fault", "Positionierung gestört"),
    description=Message(
        "A positioning task has stopped short of its target.",
        "Eine Positionieraufgabe endete vor ihrem Ziel.",
    ),
    settings=RuleSettings(severity=600, told_step=0.0),
    input_node="Positioning/Remaining",
    calls_again=True,  # of the next task
)
"""The rule."""
