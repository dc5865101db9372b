"""Models with a tied term in the place of the named one: what its strength would be if it were that."""

from collections.abc import Iterator
from dataclasses import replace

from impactcell.discrepancy.machine.finding import FittedModel, MachineFinding
from impactcell.discrepancy.machine.machine_fits import MachineFits
from impactcell.discrepancy.machine.trials import ChosenTerm


def with_tied_models(fits: MachineFits, finding: MachineFinding) -> MachineFinding:
    """Fit each tied term where the named one stands, at the shape that its search gave it."""
    return replace(finding, tied_models=dict(_tied_models(fits, finding)))


def _tied_models(fits: MachineFits, finding: MachineFinding) -> Iterator[tuple[str, FittedModel]]:
    tried = {trial.term.choice.name: trial.term for step in finding.steps for trial in step.trials}
    for name, rivals in finding.tied_with.items():
        for rival in rivals:
            if rival in tried:  # and no number that the base model lacks
                terms = [_in_place(term, name, tried[rival]) for term in finding.final.terms]
                yield rival, fits.fit(tuple(terms), settle=False)


def _in_place(term: ChosenTerm, name: str, rival: ChosenTerm) -> ChosenTerm:
    return rival if term.choice.name == name else term
