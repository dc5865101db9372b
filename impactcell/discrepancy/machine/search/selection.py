"""Which term is missing: forward selection by blocks that a model was not fitted to.

A term is taken if it closes more than half of what any model of the catalogue can close, if its gain holds
from block to block, and if it does about as well as a free form in the same place; and only where records
need it beside a smooth force of position and speed. At most two are taken.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

from impactcell.discrepancy.machine.regression.trials import ChosenTerm, TermSearch, Trial, mean_over_error
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.search.needs import (
    MIN_NEED,
    TIED_NEED,
    needs_of_free_forms,
    needs_of_terms,
)
from impactcell.discrepancy.machine.search.ties import MIN_SHARE_OF_NEEDED, is_tied, tied_terms
from impactcell.discrepancy.machine.terms.base_model import TermChoice
from impactcell.discrepancy.machine.terms.rival_forms import FREE_FORMS, PLACES
from impactcell.discrepancy.search import MAX_EXPECTED_GAP
from impactcell.records import Samples

MIN_GAIN_Z = 3.0
"""Mean gain of a block over its standard error that a term needs: one of fourteen passes by chance about once
in fifty runs [1]."""
MIN_SHARE = 0.2
"""Share of the squared gap above the floor that a term has to close [1]."""
MIN_SHARE_OF_ALL = 0.5
"""Share of what all terms together close that a term has to close: beside a model error it stands out [1]."""
MIN_SHARE_OF_FREE = 0.8
"""Share of what a free form in the same place closes, and of how much records need it, that a named term has
to have [1]."""
MAX_TERMS = 2
"""Terms that one run takes, the second only if nothing is left then: any other is likelier to be a patch on
what the catalogue lacks [1]."""
MIN_SECOND_GAP = 2.0
"""Gap in noise floors beside the first term from which on a second one is named [1]."""
SMOOTH_FORCE = "a smooth force of position and speed explains these records as well as any named term"
"""Why the best term is not taken where nothing needs it."""
FREE_FORM = "a free form in the same place does much better than any named term"
"""Why the best term is not taken where something else acts in its place."""
FREE_FORM_ELSEWHERE = "a free form in another place does much better than any named term"
"""Why the term that records need most is not taken where they need a function elsewhere more."""
NOT_IN_EVERY_BLOCK = "no term does better in block after block that it was not fitted to"
"""Why the best term is not taken where its gain scatters too much from block to block."""
END_OF_RANGE = "the shape of the best term came to the end of its range"
"""Why it is not taken where another value of its shape, beyond those that are tried, may do better."""


@dataclass(frozen=True, slots=True, eq=False)
class SelectionStep:
    """What one step of the selection saw.

    Attributes
    ----------
    trials : tuple of Trial
        By gain, the largest first.
    free_gains : mapping
        Gain of each free form.
    gain_of_all : float
        Of all terms together.
    excess : float
        Squared residual above the sensors' noise, before the step.
    accepted : Trial or None
    tied_with : tuple of str
    reason : str
        Why nothing was accepted; empty where something was.
    beside : str
        Term beside which alone the accepted one shows; empty where it shows by itself.
    needs : mapping
        By term and by free form, how much likelier records are with it than with a smooth force alone
        (logarithm).
    needed_as_much : tuple of str
        Those that are tied by what records need alone: blocks tell them from the accepted one.
    pair : ChosenTerm or None
        Term of the next step, beside which this one was looked for.
    """

    trials: tuple[Trial, ...]
    free_gains: Mapping[str, float]
    gain_of_all: float
    excess: float
    accepted: Trial | None
    tied_with: tuple[str, ...]
    reason: str
    beside: str = ""
    needs: Mapping[str, float] = field(default_factory=dict)
    needed_as_much: tuple[str, ...] = ()
    pair: ChosenTerm | None = None

    @property
    def note(self) -> str:
        """Say beside which term the accepted one shows; empty where it shows by itself."""
        if self.accepted is None or not self.beside:
            return ""
        name, beside = self.accepted.term.choice.name, self.beside
        return f"{name} shows only beside {beside}, which hides it on these records; {beside} is not named."


def select_terms(search: TermSearch, columns: Sequence[Column]) -> list[SelectionStep]:
    """Add terms one by one to the base model's columns; the last says why no more are taken."""
    steps: list[SelectionStep] = []
    columns = list(columns)
    remaining = list(search.candidates)
    while remaining:
        step = select_one(search, columns, remaining)
        if steps and step.accepted is not None and not _is_second(search, columns, step.accepted):
            refused = "beside a remainder one term is named at most"
            step = replace(step, accepted=None, tied_with=(), reason=refused)
        steps.append(step)
        if step.accepted is None or len(steps) == MAX_TERMS:
            return steps
        columns += step.accepted.term.columns
        remaining.remove(step.accepted.term.choice)
    return steps


def _is_second(search: TermSearch, columns: Sequence[Column], trial: Trial) -> bool:
    """Whether a second term takes a gap of its own to the floor, and is no patch on a small remainder."""
    is_closed = search.gap([*columns, *trial.term.columns]) <= MAX_EXPECTED_GAP
    return is_closed and search.gap(columns) >= MIN_SECOND_GAP


def select_one(
    search: TermSearch, columns: Sequence[Column], candidates: Sequence[TermChoice]
) -> SelectionStep:
    """Look for the one term that is missing beside a model."""
    columns = list(columns)
    before = search.losses(columns)
    excess = max(float(before.sum() - search.blocks.noise.sum()), 0.0)
    trials = sorted(
        (search.best_shape(choice, columns, before) for choice in candidates), key=lambda one: -one.gain
    )
    free_gains = {form: float((before - search.free_losses(columns, form)).sum()) for form in FREE_FORMS}
    every = [column for trial in trials if trial.gain > 0.0 for column in trial.term.columns]
    gain_of_all = float((before - search.losses([*columns, *every])).sum())
    best = trials[0]
    reason = _refusal(best, free_gains, max(gain_of_all, best.gain), excess)
    step = SelectionStep(tuple(trials), free_gains, gain_of_all, excess, None, (), reason)
    of_terms, of_free = {}, {}
    if search.smooth_force is not None:
        need = search.smooth_force.beside(columns)
        of_terms, of_free = needs_of_terms(need, candidates, search.shapes), needs_of_free_forms(need)
        step = replace(step, needs={name: most for name, (most, _) in of_terms.items()} | of_free)
    if reason == NOT_IN_EVERY_BLOCK and best.gain > 0.0 and not best.at_end:
        least = max(MIN_SHARE * excess, MIN_SHARE_OF_ALL * gain_of_all)
        shown = _beside_another(search, (columns, before), trials, least)
        if shown is not None and _is_needed(search, [*columns, *shown[1].columns], shown[0].term):
            return replace(step, accepted=shown[0], beside=shown[1].choice.name, reason="")
    if not reason:
        step = replace(step, accepted=best, tied_with=tied_terms(search, before, best, trials[1:]))
    if search.smooth_force is None:
        return step
    most = max(of_terms, key=lambda name: of_terms[name][0])
    choice = next(choice for choice in candidates if choice.name == most)
    trial = search.trial(ChosenTerm(choice, of_terms[most][1]), columns, before)
    return _beside_smooth_force(step, trial, of_free)


def _beside_smooth_force(step: SelectionStep, term: Trial, free: Mapping[str, float]) -> SelectionStep:
    """Take the term that the records need most beside a smooth force, if they need any."""
    choice = term.term.choice
    most, need = choice.name, step.needs[choice.name]
    if step.accepted is not None:
        accepted = step.accepted.term.choice
        own = step.needs[accepted.name]
        closes_less = term.gain < MIN_SHARE_OF_NEEDED * step.accepted.gain
        if not _not_needed(own, free, accepted) and (need - own < MIN_NEED or closes_less):
            return step
    reason = _not_needed(need, free, choice) or _needed_elsewhere(need, free)
    if reason:
        return replace(step, accepted=None, tied_with=(), reason=step.reason or reason)
    others = [trial for trial in step.trials if trial.term.choice.name != most]
    term = next((one for one in step.trials if one.term.choice.name == most and one.at_end), term)
    if term.at_end and not step.reason:
        step = replace(step, trials=(term, *others), reason=END_OF_RANGE)
    if term.at_end or term.gain <= 0.0:
        return replace(step, accepted=None, tied_with=(), reason=step.reason or SMOOTH_FORCE)
    tied = [
        trial.term.choice.name for trial in others if need - step.needs[trial.term.choice.name] < TIED_NEED
    ]
    return replace(step, accepted=term, tied_with=tuple(tied), reason="")


def _is_needed(search: TermSearch, columns: Sequence[Column], term: ChosenTerm) -> bool:
    """Whether records need a term beside a model and a smooth force, and no free form much more."""
    if search.smooth_force is None:
        return True
    need = search.smooth_force.beside(columns)
    own, free = need(term.columns, 1.0), needs_of_free_forms(need)
    return not (_not_needed(own, free, term.choice) or _needed_elsewhere(own, free))


def _not_needed(need: float, needs_of_free: Mapping[str, float], choice: TermChoice) -> str:
    """Say why a term is not named that records need so much; empty if it may be."""
    if need < MIN_NEED:
        return SMOOTH_FORCE
    in_its_place = needs_of_free.get(PLACES.get(choice.identifier, ""), -math.inf)
    return "" if _is_about(need, in_its_place) else FREE_FORM


def _needed_elsewhere(need: float, needs_of_free: Mapping[str, float]) -> str:
    """Say that records need a function in any place more; empty if they do not."""
    return "" if _is_about(need, max(needs_of_free.values())) else FREE_FORM_ELSEWHERE


def _is_about(need: float, free: float) -> bool:
    """Whether a term does about as well as a free form: of many records any law is a little off."""
    return need >= min(free - MIN_NEED, MIN_SHARE_OF_FREE * free)


def _beside_another(
    search: TermSearch, model: tuple[list[Column], Samples], trials: Sequence[Trial], least: float
) -> tuple[Trial, ChosenTerm] | None:
    """Best term as it shows beside another one, and that one; None where it does not.

    Where each of two shows only beside the other (speed falls where pressure rises), no step of one finds
    either. Both have to hold from block to block, together and each beside the other, the pair has to close
    `least` more than the other alone, and no two terms without the best may do about as well.
    """
    columns, before = model
    best, others = trials[0], trials[1:]
    shown: list[tuple[Trial, Trial]] = []
    for other in others:
        pair = search.best_shape(other.term.choice, [*columns, *best.term.columns], before)
        alone = before - search.losses([*columns, *pair.term.columns])
        own = pair.gains - alone
        holds = all(
            mean_over_error(gains) >= MIN_GAIN_Z for gains in (pair.gains, own, pair.gains - best.gains)
        )
        if holds and not pair.at_end and pair.gain - max(float(alone.sum()), 0.0) >= least:
            shown.append((pair, replace(best, gains=own, shares=search.shares(own, before))))
    if not shown:
        return None
    most = max((pair for pair, _ in shown), key=lambda pair: pair.gain)
    about = [item for item in shown if item[0] is most or is_tied(most, item[0])]
    pair, own_trial = max(about, key=lambda item: mean_over_error(item[0].gains))
    for one, two in combinations(others, 2):
        together = before - search.losses([*columns, *one.term.columns, *two.term.columns])
        if is_tied(pair, replace(pair, gains=together, shares=search.shares(together, before))):
            return None
    return own_trial, pair.term


def _refusal(best: Trial, free_gains: Mapping[str, float], gain_of_all: float, excess: float) -> str:
    """Say why a term is not taken; empty if it is."""
    if best.gain <= 0.0 or best.z < MIN_GAIN_Z:
        return NOT_IN_EVERY_BLOCK
    if best.gain < MIN_SHARE * excess:
        return "no term closes a fifth of the gap"
    if best.gain < MIN_SHARE_OF_ALL * gain_of_all:
        return "no term stands out from what all of them close together"
    if best.at_end:
        return END_OF_RANGE
    free = free_gains.get(PLACES.get(best.term.choice.identifier, ""), -math.inf)
    if best.gain < MIN_SHARE_OF_FREE * free:
        return FREE_FORM
    return ""
