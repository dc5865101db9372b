"""A set of shots fitted by the plant: predictions, least squares, derivatives, intervals."""

from impactcell.discrepancy.model.block_selection import decided_blocks, usable_blocks
from impactcell.discrepancy.model.constraints import Constraints, Roughness, Support
from impactcell.discrepancy.model.contact_moment import (
    ContactScatter,
    contact_note,
    contact_scatter,
)
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.model.intervals import ParameterEstimate, SharedError, estimate_parameters
from impactcell.discrepancy.model.least_squares import (
    Fit,
    fit,
    fit_from,
    promised_fall,
    refit_shot_parameters,
    simulate_open_loop,
)
from impactcell.discrepancy.model.linearisation import (
    DirectionProducts,
    LinearisedFit,
    Scores,
    concatenate_products,
    direction_products,
    linearise,
    scores,
    unmet_gradient,
)
from impactcell.discrepancy.model.parameters import (
    PLANT_PARAMETERS,
    Coordinate,
    effect_coordinates,
    parameter_name,
)
from impactcell.discrepancy.model.phase_of_samples import phase_positions, sample_phases, trajectory_of
from impactcell.discrepancy.model.problem import FitState, Problem, remove_jumps
from impactcell.discrepancy.model.profile import join_intervals, profile_parameters
from impactcell.discrepancy.model.setting_dependence import dependence_notes
from impactcell.discrepancy.model.shot_fits import gram_of_shots, normal_equations
from impactcell.discrepancy.model.shot_parameters import ShotParameters, known_std
from impactcell.discrepancy.model.split_fits import SplitFits, fit_split
from impactcell.discrepancy.model.told_settings import (
    SETTINGS,
    implausible_notes,
    setting_notes,
    setting_scatter,
    settings_on_average,
    with_open_settings,
)

__all__ = [
    "PLANT_PARAMETERS",
    "SETTINGS",
    "Constraints",
    "ContactScatter",
    "Coordinate",
    "DirectionProducts",
    "Fit",
    "FitState",
    "LinearisedFit",
    "ParameterEstimate",
    "Problem",
    "Roughness",
    "Scores",
    "SharedError",
    "ShotParameters",
    "SplitFits",
    "Support",
    "concatenate_products",
    "contact_note",
    "contact_scatter",
    "decided_blocks",
    "dependence_notes",
    "direction_products",
    "effect_coordinates",
    "estimate_parameters",
    "fit",
    "fit_from",
    "fit_nominal",
    "fit_split",
    "gram_of_shots",
    "implausible_notes",
    "join_intervals",
    "known_std",
    "linearise",
    "normal_equations",
    "parameter_name",
    "phase_positions",
    "profile_parameters",
    "promised_fall",
    "refit_shot_parameters",
    "remove_jumps",
    "sample_phases",
    "scores",
    "setting_notes",
    "setting_scatter",
    "settings_on_average",
    "simulate_open_loop",
    "trajectory_of",
    "unmet_gradient",
    "usable_blocks",
    "with_open_settings",
]
