"""A fitted model of a machine: its terms, its coefficients, and what was held."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from impactcell.discrepancy.machine.regression.block_sums import LinearFit
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.terms.base_model import BaseModel


@dataclass(frozen=True, slots=True, eq=False)
class FittedModel:
    """A fitted model of a machine.

    Attributes
    ----------
    base : BaseModel
        With what its data cannot tell held.
    terms : tuple of ChosenTerm
        Those of the base model first.
    fit : LinearFit
    delay_s : float
    gravity : float
        G.
    shape_intervals : mapping
        95 % interval of the shape of each term that has one, by the term's name; empty as long as shapes
        are being compared.
    """

    base: BaseModel
    terms: tuple[ChosenTerm, ...]
    fit: LinearFit
    delay_s: float
    gravity: float
    shape_intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def value(self, column: Column) -> float:
        """Coefficient of a column; 0 where the model does not have it."""
        if column not in self.fit.columns:
            return 0.0
        return float(self.fit.coefficients[self.fit.columns.index(column)])

    def term(self, name: str) -> ChosenTerm:
        """One of its terms."""
        return next(term for term in self.terms if term.choice.name == name)

    def nuisance(self, name: str) -> float:
        """Coefficient of a nuisance."""
        return self.value((name, 0.0, 0))
