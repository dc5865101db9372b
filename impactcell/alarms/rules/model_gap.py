"""ModelGap: the model no longer explains the captures of this cell, or how far its taps move parts."""

from dataclasses import replace

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
from impactcell.records import Evidence, TapPredictions

NAME = "ModelGap"
"""Published name."""


DEPENDS_ON = {
    "velocity": ("their velocity", "ihrer Geschwindigkeit"),
    "mass": ("the mass of the part", "der Masse des Teils"),
    "position": ("the position of the part", "der Lage des Teils"),
    "contact": ("the contact", "dem Kontakt"),
    "direction": ("their direction", "ihrer Richtung"),
    "slide": ("the slide", "dem Gleitweg"),
    "": ("nothing that is known of them", "nichts, was von ihnen bekannt ist"),
}
"""What the displacement that is missed depends on, in words."""


def evaluate(inputs: CycleInputs, context: RuleContext) -> RuleResult:
    """Say whether the residual has left its usual level, or taps miss; nothing while that is learned.

    What taps have raised they also end: a cell may have no residual at all.
    """
    predictions = inputs.predictions
    if predictions is not None and predictions.lacking and not inputs.gap_exceeds:
        since = max(inputs.cycle - predictions.taps + 1, 1)
        evidence = replace(predictions.evidence, change_cycle=since)
        return RuleResult(NAME, holds=True, message=_message_of_taps(predictions, since), evidence=evidence)
    is_told_by_taps = context.active and context.told.threshold != inputs.gap.threshold
    if predictions is not None and is_told_by_taps and inputs.gap_exceeds is None:
        return RuleResult(NAME, holds=False)
    message = _message(inputs.gap) if inputs.gap_exceeds else NO_MESSAGE
    return RuleResult(NAME, inputs.gap_exceeds, message, inputs.gap)


def _message_of_taps(predictions: TapPredictions, since: int) -> Message:
    english, german_words = DEPENDS_ON[predictions.depends_on]
    percent = 100.0 * predictions.evidence.size
    return Message(
        f"The model does not say how far taps move a part: over {predictions.taps} taps since cycle {since} "
        f"what it misses depends on {english} and comes to {percent:+.1f} %. Taps are planned with it, and "
        "more cautiously; have the taps looked at with `impactcell discrepancy --journal DB --cell "
        "CELL.yaml`.",
        f"Das Modell sagt nicht, wie weit Stöße ein Teil bewegen: über {predictions.taps} Stöße seit "
        f"Zyklus {since} hängt das Fehlende von {german_words} ab und beträgt {german(percent, '+.1f')} %. "
        "Stöße werden damit und vorsichtiger geplant; sie mit `impactcell discrepancy --journal DB --cell "
        "CELL.yaml` untersuchen lassen.",
    )


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
    description=Message("Measurements no longer fit the model.", "Messungen passen nicht mehr zum Modell."),
    settings=RuleSettings(severity=300, off_delay=20, told_step=1.0),
    input_node="Model/Gap",
    evaluate=evaluate,
)
"""The rule."""
