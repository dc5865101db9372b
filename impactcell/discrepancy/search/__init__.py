"""Where a fitted model fails and which effect mends it: tests, candidates, selection, proof."""

from impactcell.discrepancy.search.acceptance import SelectionResult
from impactcell.discrepancy.search.context import Mapper, SearchContext
from impactcell.discrepancy.search.evidence import ALPHA, ModelEvidence
from impactcell.discrepancy.search.experiment_design import Proposal, propose_experiments
from impactcell.discrepancy.search.model_selection import select_model
from impactcell.discrepancy.search.residual_map import ALL
from impactcell.discrepancy.search.unexplained_gap import UnexplainedGap, describe_gap
from impactcell.discrepancy.search.validation import Gap, Validation, validate

__all__ = [
    "ALL",
    "ALPHA",
    "Gap",
    "Mapper",
    "ModelEvidence",
    "Proposal",
    "SearchContext",
    "SelectionResult",
    "UnexplainedGap",
    "Validation",
    "describe_gap",
    "propose_experiments",
    "select_model",
    "validate",
]
