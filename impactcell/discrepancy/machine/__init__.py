"""Any machine with one coordinate: a base model without a cell, and what its records say it lacks."""

from impactcell.discrepancy.machine.base_model import BaseModel, NumberPrior, Response, TermChoice
from impactcell.discrepancy.machine.finding import FallOfGap, FittedModel, MachineFinding
from impactcell.discrepancy.machine.investigation import investigate_machine
from impactcell.discrepancy.machine.selection import ChosenTerm, SelectionStep, Trial
from impactcell.discrepancy.machine.simulation import OpenLoopError, simulate_held_out
from impactcell.discrepancy.machine.terms import CATALOGUE, Term

__all__ = [
    "CATALOGUE",
    "BaseModel",
    "ChosenTerm",
    "FallOfGap",
    "FittedModel",
    "MachineFinding",
    "NumberPrior",
    "OpenLoopError",
    "Response",
    "SelectionStep",
    "Term",
    "TermChoice",
    "Trial",
    "investigate_machine",
    "simulate_held_out",
]
