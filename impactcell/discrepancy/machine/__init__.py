"""Any machine with one coordinate: a base model without a cell, and what its records say it lacks."""

from impactcell.discrepancy.machine.base_model import BaseModel, Prior, Response, TermChoice
from impactcell.discrepancy.machine.finding import FallOfGap, MachineFinding, Model
from impactcell.discrepancy.machine.investigation import investigate_machine
from impactcell.discrepancy.machine.selection import ChosenTerm, SelectionStep, Trial
from impactcell.discrepancy.machine.simulation import SimulationError, simulate_held_out
from impactcell.discrepancy.machine.terms import CATALOGUE, Term

__all__ = [
    "CATALOGUE",
    "BaseModel",
    "ChosenTerm",
    "FallOfGap",
    "MachineFinding",
    "Model",
    "Prior",
    "Response",
    "SelectionStep",
    "SimulationError",
    "Term",
    "TermChoice",
    "Trial",
    "investigate_machine",
    "simulate_held_out",
]
