"""Terms that the records cannot tell from the best one."""

from collections.abc import Sequence

from impactcell.discrepancy.machine.regression.trials import TermSearch, Trial, mean_over_error
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.search.needs import MIN_NEED, TIED_NEED, needs_of_terms
from impactcell.discrepancy.search import MAX_EXPECTED_GAP
from impactcell.records import Samples

TIE_Z = 2.2
"""Difference of two terms over its standard error up to which they are tied [1]."""
MIN_TIED_SHARE = 0.8
"""Share of the best term's gain below which another one is not tied whatever the scatter [1]."""
EQUAL_SHARE = 0.97
"""Share of the best term's gain from which on another one is tied whatever the scatter [1]."""
TOLD_GAP = 2.0
"""Noise floors from which on a term that leaves as much is no equal of one that leaves nothing [1]."""
MIN_SHARE_OF_NEEDED = 0.5
"""Share of what a term closes, that another one has to close to take its place or to be tied with it [1]."""


def tied_terms(search: TermSearch, before: Samples, best: Trial, others: Sequence[Trial]) -> tuple[str, ...]:
    """Names of the terms that are tied with the best one.

    Where the best one takes the gap to its floor, none is that leaves one, however small a share it is.
    """
    alike = [trial for trial in others if is_tied(best, trial)]
    if search.gap_of(before - best.gains) <= MAX_EXPECTED_GAP:
        alike = [trial for trial in alike if search.gap_of(before - trial.gains) <= TOLD_GAP]
    return tuple(trial.term.choice.name for trial in alike)


def still_tied(
    search: TermSearch, columns: Sequence[Column], best: Trial, names: Sequence[str]
) -> tuple[str, ...]:
    """Names of those tied with the best term that still are, by the blocks of another search."""
    before = search.losses(columns)
    choices = [choice for choice in search.candidates if choice.name in names]
    now = search.best_shape(best.term.choice, columns, before)
    return tied_terms(search, before, now, [search.best_shape(one, columns, before) for one in choices])


def needed_as_much(search: TermSearch, columns: Sequence[Column], best: Trial) -> tuple[str, ...]:
    """Names of the terms that records need as much as the best one, beside a smooth force.

    What blocks lose with each hangs on what remains: beside a model error two terms that a smooth force turns
    into one another are told apart by it falsely. Where the best one leaves but the noise, they tell.
    """
    if search.smooth_force is None or search.gap([*columns, *best.term.columns]) <= 1.0:
        return ()
    before = search.losses(columns)
    needs = needs_of_terms(search.smooth_force.beside(columns), search.candidates, search.shapes)
    choice = best.term.choice
    now = search.best_shape(choice, columns, before)
    least = max(needs[choice.name][0] - TIED_NEED, MIN_NEED)
    wanted = [one for one in search.candidates if one != choice and needs[one.name][0] > least]
    rivals = [search.best_shape(one, columns, before) for one in wanted]
    return tuple(
        rival.term.choice.name
        for rival in rivals
        if rival.gain >= MIN_SHARE_OF_NEEDED * now.gain and not rival.at_end
    )


def is_tied(best: Trial, rival: Trial) -> bool:
    """Whether the blocks cannot tell a term that does worse from the best one."""
    if rival.gain < MIN_TIED_SHARE * best.gain or rival.at_end:
        return False
    apart = mean_over_error(best.gains - rival.gains), mean_over_error(best.shares - rival.shares)
    return rival.gain >= EQUAL_SHARE * best.gain or max(apart) < TIE_Z
