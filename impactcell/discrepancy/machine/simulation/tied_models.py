"""Models with a tied term in the place of the named one: what its strength would be if it were that."""

from collections.abc import Iterator
from dataclasses import replace

from impactcell.discrepancy.machine.finding import MachineFinding
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.simulation.held_out import simulate_held_out

MAX_TIED_ERROR = 1.5
"""Times by which a held-out simulation may err more with a tied term than with the named one. Of 30 ties that
were true beside a model error it erred 0.85 to 1.18 times as much [1]."""


def with_tied_models(fits: MachineFits, finding: MachineFinding) -> MachineFinding:
    """Fit each tied term where the named one stands, at the shape that its search gave it.

    A term that is tied by what records need alone, while blocks tell it from the named one, is tied no more
    if held-out records are simulated clearly worse with it, too.
    """
    models = dict(_tied_models(fits, finding))
    largest = MAX_TIED_ERROR * finding.simulated[1].rmse
    needed = {name for step in finding.steps for name in step.needed_as_much} & models.keys()
    apart = {name for name in needed if simulate_held_out(finding, models[name]).rmse > largest}
    steps = [
        replace(step, tied_with=tuple(name for name in step.tied_with if name not in apart))
        for step in finding.steps
    ]
    kept = {name: model for name, model in models.items() if name not in apart}
    return replace(finding, steps=tuple(steps), tied_models=kept)


def _tied_models(fits: MachineFits, finding: MachineFinding) -> Iterator[tuple[str, FittedModel]]:
    tried = {trial.term.choice.name: trial.term for step in finding.steps for trial in step.trials}
    for name, rivals in finding.tied_with.items():
        for rival in rivals:
            if rival in tried:  # and no number that the base model lacks
                terms = [_in_place(term, name, tried[rival]) for term in finding.final.terms]
                yield rival, fits.fit(tuple(terms), settle=False)


def _in_place(term: ChosenTerm, name: str, rival: ChosenTerm) -> ChosenTerm:
    return rival if term.choice.name == name else term
