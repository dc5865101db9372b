"""One cycle of a cell, from what was measured to what is shown: `pipeline`, after `preprocessing`."""

from impactcell.cell.pipeline import (
    CellDesign,
    CellState,
    Stepped,
    act,
    adapted,
    find,
    initial_state,
    pass_time,
    renew_surface,
    start_batch,
    step,
)

__all__ = [
    "CellDesign",
    "CellState",
    "Stepped",
    "act",
    "adapted",
    "find",
    "initial_state",
    "pass_time",
    "renew_surface",
    "start_batch",
    "step",
]
