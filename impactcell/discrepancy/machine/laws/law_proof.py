"""How the held-out gap falls with a law by a functional form, fitted as a base model that has it is."""

from dataclasses import replace

from impactcell.discrepancy.machine.evidence import FallOfGap
from impactcell.discrepancy.machine.finding import MachineFinding
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.fits.proof import fall_of_gap
from impactcell.discrepancy.machine.open_loop_error import OpenLoopError
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.simulation.held_out import simulate_held_out
from impactcell.discrepancy.machine.terms.base_model import TermChoice

WEIGHINGS = 2
"""Rounds of weights by what a model with the law leaves, and of a model by these weights [1]."""


def proved_form(
    fits: MachineFits, model: FittedModel, form: TermChoice, seed: int
) -> tuple[FittedModel, FallOfGap]:
    """Model with a form beside its terms, and the fall of the held-out gap from the one to the other.

    As of a term that is named, the rows have weights by what is left with the form, and a free delay and
    torque of gravity are found anew: without it they took over what it explains.
    """
    terms = (*model.terms, ChosenTerm(form, 0.0))
    base = replace(fits.base, terms=tuple(term.choice for term in terms))
    own = fits.without_candidates(base, fits.records)
    own.gravity, own.priors, own.delay_s, own.doubt = fits.gravity, fits.priors, fits.delay_s, fits.doubt
    own.shapes = {name: fits.shapes.get(name, shapes) for name, shapes in own.shapes.items()}
    for _ in range(WEIGHINGS):
        own.weigh(own.fit(terms, settle=False))
    _, held_out = own.blocks()
    without = own.fit(model.terms, settle=False)
    with_it = own.fit(terms, settle=True)
    _, settled = own.blocks()
    # What a stretch has of its own in a simulation goes by the base model, without and with the form alike.
    return replace(with_it, base=fits.base), fall_of_gap(held_out, without, with_it, seed, settled)


def simulated_without(finding: MachineFinding, model: FittedModel) -> OpenLoopError:
    """Error of the held-out simulation without a law that was found beside a model.

    What else is fitted beside the law may not make its simulation look near: of that model and the final one
    the nearer counts.
    """
    without = [simulate_held_out(finding, model)]
    if model.base is not finding.base:
        without.append(finding.simulated[-1])
    return min(without, key=lambda error: error.rmse)
