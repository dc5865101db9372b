"""Any machine with one coordinate: a base model without a cell, and what its records say it lacks."""

from impactcell.discrepancy.machine.evidence import FallOfGap
from impactcell.discrepancy.machine.finding import MachineFinding, MachineLaw
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.investigation import investigate_machine
from impactcell.discrepancy.machine.measured_motion import motions
from impactcell.discrepancy.machine.open_loop_error import OpenLoopError
from impactcell.discrepancy.machine.records.held_out_stretch import drifts
from impactcell.discrepancy.machine.regression.trials import ChosenTerm, Trial
from impactcell.discrepancy.machine.regression.weak_form import ECCENTRICITY, shape_grid
from impactcell.discrepancy.machine.search.needs import MIN_NEED
from impactcell.discrepancy.machine.search.selection import SelectionStep
from impactcell.discrepancy.machine.simulation.held_out import simulate_held_out
from impactcell.discrepancy.machine.terms.base_model import (
    BaseModel,
    LawForm,
    NumberPrior,
    Response,
    TermChoice,
)
from impactcell.discrepancy.machine.terms.catalogue import CATALOGUE, Term
from impactcell.discrepancy.machine.terms.law_terms import LAW_PLACES, law_place, term_of
from impactcell.discrepancy.machine.terms.rival_forms import COVARIATES, FREE_FORMS, VALUES

__all__ = [
    "CATALOGUE",
    "COVARIATES",
    "ECCENTRICITY",
    "FREE_FORMS",
    "LAW_PLACES",
    "MIN_NEED",
    "VALUES",
    "BaseModel",
    "ChosenTerm",
    "FallOfGap",
    "FittedModel",
    "LawForm",
    "MachineFinding",
    "MachineLaw",
    "NumberPrior",
    "OpenLoopError",
    "Response",
    "SelectionStep",
    "Term",
    "TermChoice",
    "Trial",
    "drifts",
    "investigate_machine",
    "law_place",
    "motions",
    "shape_grid",
    "simulate_held_out",
    "term_of",
]
