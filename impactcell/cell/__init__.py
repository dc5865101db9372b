"""One cycle of a cell, from what was measured to what is shown: `pipeline`, after `preprocessing`."""

from impactcell.cell.model_change import in_place_of
from impactcell.cell.pipeline import (
    CellDesign,
    CellState,
    StepResult,
    apply_event,
    apply_rule_result,
    expire_shelving,
    initial_state,
    migrate_state,
    reset_wear_level,
    start_batch,
    step,
)
from impactcell.cell.preprocessing import fill_defaults

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
