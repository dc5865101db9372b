"""One cycle of a cell, from what was measured to what is shown: `pipeline`, after `preprocessing`."""

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

__all__ = [
    "CellDesign",
    "CellState",
    "StepResult",
    "apply_event",
    "apply_rule_result",
    "expire_shelving",
    "initial_state",
    "migrate_state",
    "reset_wear_level",
    "start_batch",
    "step",
]
