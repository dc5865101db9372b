"""Where a fitted model fails and which effect mends it: tests, candidates, selection, proof."""

from impactcell.discrepancy.search.acceptance import (
    Outdone,
    SelectionResult,
    exchanged,
    fitted_with,
    reject,
    tied_models,
)
from impactcell.discrepancy.search.between_shots import (
    chance_by_exchange,
    chance_of_narrowing,
    chance_of_order,
    exchange_rng,
    factor_patterns,
    trace_rivals,
)
from impactcell.discrepancy.search.candidate_fits import (
    fit_all_samples,
    fit_between_shots,
    is_at_bound,
    refine,
    screen,
    without_each_effect,
)
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
from impactcell.discrepancy.search.confirmation import NestedModels
from impactcell.discrepancy.search.context import Mapper, SearchContext
from impactcell.discrepancy.search.evidence import ALPHA, CandidateScan, ModelEvidence, scan_candidates
from impactcell.discrepancy.search.experiment_design import UNLIMITED, Proposal, propose_experiments
from impactcell.discrepancy.search.gap import Gap, Part
from impactcell.discrepancy.search.gap_measure import (
    MAX_EXPECTED_GAP,
    MAX_P_VALUE,
    MIN_CLOSED_SHARE,
    MIN_OPEN_GAP,
    GapChange,
    GapMeasure,
)
from impactcell.discrepancy.search.held_out import HeldOutOutcome, OpenedShots
from impactcell.discrepancy.search.indistinguishability import CandidateFit, compare_fits, widest_rival
from impactcell.discrepancy.search.model_error import (
    ModelError,
    estimate_beside_error,
    estimate_model_error,
    shared_error,
)
from impactcell.discrepancy.search.model_selection import nested_models, only_test, select_model
from impactcell.discrepancy.search.open_loop import Simulation, SimulationError, simulate_held_out
from impactcell.discrepancy.search.policy import POLICY
from impactcell.discrepancy.search.residual_map import ALL
from impactcell.discrepancy.search.unexplained_gap import UnexplainedGap, describe_gap
from impactcell.discrepancy.search.validation import Validation

__all__ = [
    "ALL",
    "ALPHA",
    "MAX_EXPECTED_GAP",
    "MAX_P_VALUE",
    "MIN_CLOSED_SHARE",
    "MIN_OPEN_GAP",
    "NAMED",
    "NO_GAP",
    "POLICY",
    "TIED",
    "UNKNOWN",
    "UNLIMITED",
    "UNTESTED",
    "CandidateFit",
    "CandidateScan",
    "Conclusion",
    "Gap",
    "GapChange",
    "GapMeasure",
    "HeldOutOutcome",
    "Mapper",
    "ModelError",
    "ModelEvidence",
    "NestedModels",
    "OpenedShots",
    "Outdone",
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
    "chance_by_exchange",
    "chance_of_narrowing",
    "chance_of_order",
    "compare_fits",
    "conclude",
    "describe_gap",
    "estimate_beside_error",
    "estimate_model_error",
    "exchange_rng",
    "exchanged",
    "factor_patterns",
    "fit_all_samples",
    "fit_between_shots",
    "fitted_with",
    "is_at_bound",
    "missing_shots",
    "nested_models",
    "only_test",
    "propose_experiments",
    "refine",
    "reject",
    "scan_candidates",
    "screen",
    "select_model",
    "shared_error",
    "simulate_held_out",
    "tied_models",
    "trace_rivals",
    "widest_rival",
    "without_each_effect",
]
