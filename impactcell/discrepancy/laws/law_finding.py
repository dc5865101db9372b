"""A law that was found where something remained, or why none is proposed."""

from dataclasses import dataclass, replace

from impactcell.discrepancy.laws.fitted_function import FittedFunction
from impactcell.discrepancy.laws.free_term import FreeTerm
from impactcell.discrepancy.laws.law import Law
from impactcell.discrepancy.laws.refit import FittedLaw
from impactcell.discrepancy.model import Fit, ParameterEstimate, Problem, estimate_parameters, linearise
from impactcell.discrepancy.search import GapChange


@dataclass(frozen=True, slots=True, eq=False)
class LawFinding:
    """What was found where something remained.

    Attributes
    ----------
    term : FreeTerm
        Free-form term at the place that predicts best.
    function : FittedFunction
        Of two covariates at the median of the second.
    slices : tuple of (float, FittedFunction)
        The same at several values of the second covariate; empty where there is one alone.
    law : FittedLaw or None
        Functional form that does as well; None where only the spline does.
    equivalents : tuple of FittedLaw
        Other forms that the data cannot tell from it.
    rival_places : tuple of str
        Effects of other places at which a term predicts as well.
    change : GapChange
        Of the held-out gap, without and with it: the law where there is one, else the spline.
    model : Problem
        Training shots with that term in the model.
    training, held_out : Fit
        The same, fitted.
    refused : str
        Why nothing is proposed; empty where something is.
    """

    term: FreeTerm
    function: FittedFunction
    slices: tuple[tuple[float, FittedFunction], ...]
    law: FittedLaw | None
    equivalents: tuple[FittedLaw, ...]
    rival_places: tuple[str, ...]
    change: GapChange
    model: Problem
    training: Fit
    held_out: Fit
    refused: str

    @property
    def proposed(self) -> Law | None:
        """The law with the numbers that all training shots gave; None where there is none to propose."""
        if self.law is None or self.refused:
            return None
        values = {
            item.parameter: item.value(float(self.training.theta[place]))
            for place, item in enumerate(self.training.coordinates)
            if item.effect == self.law.law.identifier
        }
        law = self.law.law
        return replace(law, parameters=tuple(item.starting_at(values[item.name]) for item in law.parameters))

    @property
    def estimates(self) -> tuple[ParameterEstimate, ...]:
        """Parameters of the law that is proposed, with their intervals."""
        law = self.proposed
        if law is None:
            return ()
        found = estimate_parameters(self.training, linearise(self.model, self.training))
        return tuple(one for one in found if one.effect == law.identifier)
