"""Terms of the catalogue with which the simulation of what was held out errs far less."""

from impactcell.discrepancy.machine.finding import MachineFinding
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.open_loop_error import BetterSimulation
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.simulation.held_out import STEPS_PER_PERIOD, simulate_held_out

MUCH_BETTER = 0.5
"""Share of the error without it that the simulation with a term may leave to be told. Our choice."""
MOST_STEPS = 50_000
"""Steps of simulations by which terms are tried, all together: of long records those that fit best [1]."""
LEAST_TRIED = 3
"""Terms that are tried however long the records are. Our choice."""
MOST_TOLD = 3
"""Terms that are told at most. Our choice."""
ALWAYS_TRIED = ("viscous_friction", "quadratic_drag")
"""Terms that are tried before those that fit best: what damps a motion, whatever the blocks show of it."""


def best_simulated(fits: MachineFits, finding: MachineFinding) -> BetterSimulation | None:
    """Give terms with which the held-out simulation errs half as much or less, the best first.

    Half of what the proposed law leaves, where there is one. None where a term is established or a number of
    the base model told, or where the simulation errs by noise alone.
    """
    if finding.established or finding.number_off or not finding.errs_beyond_noise:
        return None
    errors = errors_with_terms(fits, finding)
    rmse = finding.simulated[-1].rmse
    if finding.law is not None and finding.law.simulated is not None:
        rmse = min(rmse, finding.law.simulated[-1].rmse)
    names = sorted((name for name in errors if errors[name] <= MUCH_BETTER * rmse), key=errors.__getitem__)
    return BetterSimulation(tuple(names[:MOST_TOLD]), errors[names[0]]) if names else None


def errors_with_terms(fits: MachineFits, finding: MachineFinding) -> dict[str, float]:
    """Error [m, rad, N or N m] of the held-out simulation with each term beside the base model."""
    errors = {}
    for term in _tried(fits, finding):
        model = fits.fit((*finding.nominal.terms, term), settle=False)
        if any(model.value(column) for column in term.columns):
            errors[term.choice.name] = simulate_held_out(finding, model).rmse
    return errors


def _tried(fits: MachineFits, finding: MachineFinding) -> list[ChosenTerm]:
    """Terms of the catalogue but those by columns, as many as may be simulated: what fits best first.

    With the shapes that the search gave them; where there were too few blocks for it those that have none.
    """
    grids = fits.grids
    terms = [
        ChosenTerm(choice, grids[choice.name][0])
        for choice in fits.candidates
        if len(grids[choice.name]) == 1
    ]
    if finding.steps:
        terms = [trial.term for trial in finding.steps[0].trials]
    terms.sort(key=lambda term: term.choice.name not in ALWAYS_TRIED)
    longest_s = max(end - begin for _, begin, end in finding.held_spans)
    step_s = min(record.step_s for record in finding.records)
    steps = longest_s / min(step_s, finding.scale.period_s / STEPS_PER_PERIOD)
    most = max(int(MOST_STEPS / steps), LEAST_TRIED)
    if not finding.missing_blocks and finding.is_at_floor:  # any term may help a gravity that is a little off
        clear = {one.name for one in finding.clear_strengths}
        terms = [term for term in terms if term.choice.name in clear]
    return [term for term in terms if not term.choice.covariate][:most]
