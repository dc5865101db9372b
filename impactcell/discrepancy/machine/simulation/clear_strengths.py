"""Strengths clear of 0 where the gap is at its floor: what the noise hides is there all the same.

A gap counts what all rows leave, a strength only what is left along its column: of a slow decay in a noisy
film the gap shows nothing, and its strength may be known to a third.
"""

from dataclasses import replace

import numpy as np

from impactcell.discrepancy.machine.evidence import ClearStrength
from impactcell.discrepancy.machine.finding import MachineFinding
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.regression.block_sums import Blocks, fit_blocks
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.simulation.held_out import simulate_held_out
from impactcell.german.findings import enumerated
from impactcell.physics.effect_names import in_words

BY_CHANCE = 0.01
"""Probability that any term of the catalogue is clear of 0 where nothing is missing (Bonferroni) [1]."""
MOST_TOLD = 3
"""Terms that are told at most. Our choice."""
INTERVALS_WITHOUT = (
    "The intervals of what is named are those without it: with it, values may lie beyond them."
)
"""What is said where another term is clear of 0 beside what is named."""
SIMULATES_BETTER = 0.9
"""Share of the base model's error that the simulation with such a term may leave: of many rows a strength is
clear of 0 by what rows are off at reversals, and no motion goes by that. Our choice."""


def with_clear_strengths(fits: MachineFits, finding: MachineFinding) -> MachineFinding:
    """Tell terms whose strength is clear of 0 beside what is established, where the gap shows nothing."""
    if finding.missing_blocks or not finding.is_at_floor or not finding.steps:
        return finding
    most = SIMULATES_BETTER * finding.simulated[-1].rmse
    simulated = [
        (_simulated(fits, finding, term), strength)
        for term, strength in _clear_strengths(fits, finding)[:MOST_TOLD]
    ]
    clear = sorted(
        ((rmse, strength) for rmse, strength in simulated if rmse < most), key=lambda pair: pair[0]
    )
    if not clear:
        return finding
    rmse, first = clear[0]
    names = enumerated([in_words(one.name) for _, one in clear], "or")
    named = enumerated([*map(in_words, finding.established)], "and") if finding.established else ""
    note = (
        f"{names}: the gap is at its floor, yet{f' beside {named}' if named else ''} over all blocks the "
        f"strength of {in_words(first.name)} would be {first.value:.3g} ({first.low:.3g} to "
        f"{first.high:.3g}, SI), clear of 0 and not by chance, and simulated open loop, held-out records are "
        f"{rmse:.3g} {finding.base.unit} off with it, {finding.simulated[-1].rmse:.3g} without. In the "
        f"equation of motion noise hides it, and it is not named: put {first.name} in the base model and "
        "compare; longer records, a finer or faster sensor, or a larger motion would show it."
    )
    notes = [*finding.notes, note]
    if finding.established:
        notes.append(INTERVALS_WITHOUT)
    told = tuple(strength for _, strength in clear)
    return replace(finding, clear_strengths=told, notes=tuple(notes))


def _simulated(fits: MachineFits, finding: MachineFinding, term: ChosenTerm) -> float:
    """Error of the held-out simulation with a term beside the final model."""
    model = fits.fit((*finding.final.terms, term), settle=False)
    return simulate_held_out(finding, model).rmse


def _clear_strengths(
    fits: MachineFits, finding: MachineFinding
) -> tuple[tuple[ChosenTerm, ClearStrength], ...]:
    """Terms, each beside the final model, in the order of how far they are clear of 0."""
    training, held_out = fits.blocks()
    blocks = training.beside(held_out)
    named = {term.choice.name for term in finding.final.terms}
    terms = [trial.term for trial in finding.steps[-1].trials if trial.term.choice.name not in named]
    tests = sum(len(fits.shapes[term.choice.name]) * len(term.columns) for term in terms)
    columns = fits.columns(finding.final.terms)
    found = []
    for term in terms:
        strength = _clearest(fits, blocks, (columns, term), 1.0 - BY_CHANCE / tests)
        if strength is not None:
            found.append((term, strength))
    return tuple(sorted(found, key=lambda pair: -abs(pair[1].value) / (pair[1].high - pair[1].low)))


def _clearest(
    fits: MachineFits, blocks: Blocks, model: tuple[list[Column], ChosenTerm], level: float
) -> ClearStrength | None:
    """Strength of a term that is clear of 0 at such a level, with its 95 % interval; None if none is."""
    columns, term = model
    every = [*columns, *term.columns]
    own = slice(len(columns), None)
    wide = fit_blocks(blocks, every, fits.priors, fits.nonnegative, level)
    clear = (wide.low[own] > 0.0) | (wide.high[own] < 0.0)
    if not clear.any():
        return None
    fit = fit_blocks(blocks, every, fits.priors, fits.nonnegative)
    values, low, high = fit.coefficients[own], fit.low[own], fit.high[own]
    over = np.where(clear, np.abs(values) / (high - low), 0.0)
    place = int(np.argmax(over))
    return ClearStrength(term.choice.name, float(values[place]), float(low[place]), float(high[place]))
