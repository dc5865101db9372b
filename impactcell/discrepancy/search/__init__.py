"""Where a fitted model fails and which effect mends it: tests, candidates, selection, proof."""

from impactcell.discrepancy.search.acceptance import SelectionResult, exchanged
from impactcell.discrepancy.search.between_shots import chance_of_narrowing
from impactcell.discrepancy.search.conclusion import (
    NAMED,
    NO_GAP,
    TIED,
    UNKNOWN,
    UNTESTED,
    Conclusion,
    Place,
    Remaining,
    conclude,
    missing_shots,
)
from impactcell.discrepancy.search.context import Mapper, SearchContext
from impactcell.discrepancy.search.evidence import ALPHA, ModelEvidence
from impactcell.discrepancy.search.experiment_design import Proposal, propose_experiments
from impactcell.discrepancy.search.held_out import HeldOutOutcome, OpenedShots
from impactcell.discrepancy.search.model_error import ModelError, estimate_model_error, shared_error
from impactcell.discrepancy.search.model_selection import nested_models, only_test, select_model
from impactcell.discrepancy.search.open_loop import Simulation, SimulationError, simulate_held_out
from impactcell.discrepancy.search.residual_map import ALL
from impactcell.discrepancy.search.unexplained_gap import UnexplainedGap, describe_gap
from impactcell.discrepancy.search.validation import (
    MAX_P_VALUE,
    Gap,
    GapChange,
    GapMeasure,
    Part,
    Validation,
)

__all__ = [
    "ALL",
    "ALPHA",
    "MAX_P_VALUE",
    "NAMED",
    "NO_GAP",
    "TIED",
    "UNKNOWN",
    "UNTESTED",
    "Conclusion",
    "Gap",
    "GapChange",
    "GapMeasure",
    "HeldOutOutcome",
    "Mapper",
    "ModelError",
    "ModelEvidence",
    "OpenedShots",
    "Part",
    "Place",
    "Proposal",
    "Remaining",
    "SearchContext",
    "SelectionResult",
    "Simulation",
    "SimulationError",
    "UnexplainedGap",
    "Validation",
    "chance_of_narrowing",
    "conclude",
    "describe_gap",
    "estimate_model_error",
    "exchanged",
    "missing_shots",
    "nested_models",
    "only_test",
    "propose_experiments",
    "select_model",
    "shared_error",
    "simulate_held_out",
]
