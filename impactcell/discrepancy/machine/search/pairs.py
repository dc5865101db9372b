"""Two terms neither of which is taken alone: of the other it leaves too much.

Of an axis without any friction in its base model neither Coulomb nor viscous friction comes near a free
function of speed, and both together do.
"""

from collections.abc import Sequence
from dataclasses import replace

from impactcell.discrepancy.machine.regression.trials import ChosenTerm, TermSearch
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.search.selection import MIN_SECOND_GAP, SelectionStep, select_one
from impactcell.discrepancy.machine.terms.base_model import TermChoice
from impactcell.discrepancy.search import MAX_EXPECTED_GAP

MOST_FIRST = 3
"""Terms beside each of which another is looked for: those that close most. Our choice."""
MOST_LEFT_BY_PAIR = 0.05
"""Gap of a pair over that of either of its terms up to which it is tried. Rows are weighed by the base model
here, which leaves all that the pair explains: its gap is asked again by weights of its own. Our choice."""


def select_pair(
    search: TermSearch, columns: Sequence[Column], step: SelectionStep
) -> tuple[SelectionStep, SelectionStep] | None:
    """Look for two terms that explain together what none does alone; None where there are none.

    Each is what a step finds beside the other. Neither may have a shape: two that bend follow much that the
    catalogue lacks. What they leave by weights of their own is the caller's to ask.

    Parameters
    ----------
    search : TermSearch
    columns : sequence of Column
        Of the base model.
    step : SelectionStep
        That took no term beside it.
    """
    straight = [trial for trial in step.trials if _is_straight(search, trial.term.choice)]
    if len(straight) < 2 or search.gap(columns) < MIN_SECOND_GAP:
        return None
    before = search.losses(columns)
    for first in straight[:MOST_FIRST]:
        second = _beside(search, columns, first.term)
        if second.accepted is None or not _is_straight(search, second.accepted.term.choice):
            continue
        again = _beside(search, columns, second.accepted.term)
        if again.accepted is not None and again.accepted.term == first.term:
            trial = search.trial(first.term, columns, before)
            taken = replace(step, accepted=trial, tied_with=again.tied_with, reason="")
            return replace(taken, pair=second.accepted.term), second
    return None


def _is_straight(search: TermSearch, choice: TermChoice) -> bool:
    return len(search.shapes[choice.name]) == 1


def _beside(search: TermSearch, columns: Sequence[Column], term: ChosenTerm) -> SelectionStep:
    """Step beside a term; it takes only what leaves next to nothing of a gap of its own."""
    own = [*columns, *term.columns]
    step = select_one(search, own, [choice for choice in search.candidates if choice != term.choice])
    if step.accepted is None:
        return step
    alone, left = search.gap(own), search.gap([*own, *step.accepted.term.columns])
    if alone >= MIN_SECOND_GAP and left <= max(MOST_LEFT_BY_PAIR * alone, MAX_EXPECTED_GAP):
        return step
    return replace(step, accepted=None, tied_with=())
