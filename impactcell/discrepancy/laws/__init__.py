"""A law that nobody had listed: a free-form term where something remains, then the laws that it may be."""

from impactcell.discrepancy.laws.condense import RankedForm, rank_forms
from impactcell.discrepancy.laws.finding import find_law
from impactcell.discrepancy.laws.fitted_function import BAND, DRAWN, FittedFunction
from impactcell.discrepancy.laws.free_rivals import hold_against_free_forms
from impactcell.discrepancy.laws.free_term import FreeTerm, fit_free_terms
from impactcell.discrepancy.laws.grammar import ATOMS, Atom, Shaped
from impactcell.discrepancy.laws.grammar import name as form_name
from impactcell.discrepancy.laws.law import Law, shape_names
from impactcell.discrepancy.laws.law_finding import LawFinding
from impactcell.discrepancy.laws.refit import FittedLaw
from impactcell.discrepancy.laws.remainder import estimate_effects
from impactcell.discrepancy.laws.tangent import Tangent

__all__ = [
    "ATOMS",
    "BAND",
    "DRAWN",
    "Atom",
    "FittedFunction",
    "FittedLaw",
    "FreeTerm",
    "Law",
    "LawFinding",
    "RankedForm",
    "Shaped",
    "Tangent",
    "estimate_effects",
    "find_law",
    "fit_free_terms",
    "form_name",
    "hold_against_free_forms",
    "rank_forms",
    "shape_names",
]
