"""One cycle of a cell: `pipeline`, after `preprocessing`; `state` is what it keeps."""

from impactcell.cell.model_change import in_place_of
from impactcell.cell.pipeline import (
    StepResult,
    apply_event,
    apply_rule_result,
    expire_shelving,
    reset_wear_level,
    start_batch,
    step,
)
from impactcell.cell.preprocessing import fill_defaults
from impactcell.cell.state import CellDesign, CellState, initial_state, migrate_state

__all__ = [
    "CellDesign",
    "CellState",
    "StepResult",
    "apply_event",
    "apply_rule_result",
    "expire_shelving",
    "fill_defaults",
    "in_place_of",
    "initial_state",
    "migrate_state",
    "reset_wear_level",
    "start_batch",
    "step",
]
