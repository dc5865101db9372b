"""What OPC UA shows of each condition beside its state: identifiers, description, class, input."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from impactcell.records import AlarmName


@dataclass(frozen=True, slots=True)
class ConditionDescription:
    """One condition.

    Attributes
    ----------
    number, type_number : int
        Identifiers of the condition and of its type in the NodeSet2 file.
    condition_class : str
        `Process`, `Maintenance` or `System` (Part 9, 5.9).
    input_path : str or None
        Variable that the alarm watches; None where it is no single one.
    """

    number: int
    type_number: int
    description: str
    condition_class: str = "Process"
    input_path: str | None = None


CONDITIONS: Final[Mapping[AlarmName, ConditionDescription]] = {
    AlarmName.WEAR_LIMIT: ConditionDescription(
        5008, 1003, "The filtered friction has probably passed the wear limit.", "Maintenance", "Wear/Level"
    ),
    AlarmName.BATCH_SHIFT: ConditionDescription(
        5009,
        1004,
        "The material has changed: friction has shifted from one cycle to the next.",
        input_path="Batch/Offset",
    ),
    AlarmName.DEVIANT_CYCLE: ConditionDescription(
        5010,
        1005,
        "The last cycle differs from the cycles the cell has learned.",
        input_path="Signature/TSquared",
    ),
    AlarmName.MODULE_CONNECTION: ConditionDescription(
        5011, 1006, "The module does not answer.", "System", "Module/Connected"
    ),
    AlarmName.MODEL_GAP: ConditionDescription(
        5012, 1007, "Measurements no longer fit the model.", input_path="Model/Gap"
    ),
    AlarmName.POSITIONING_FAULT: ConditionDescription(
        5013, 1008, "A positioning task has stopped short of its target.", input_path="Positioning/Remaining"
    ),
    AlarmName.JOURNAL_FAULT: ConditionDescription(5014, 1009, "Cycles cannot be stored.", "System"),
}
