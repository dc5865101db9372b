"""Sets of effects with one more in them: beside the best smaller ones, and in the place of each of the best.

A set is fitted on few samples first; the likeliest run to the end on all samples, and those that have
converged are ranked out of shot.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from impactcell.discrepancy.model import Fit
from impactcell.discrepancy.search.acceptance import SelectionResult
from impactcell.discrepancy.search.candidate_fits import (
    finalists,
    fit_all_samples,
    prefer_interior,
    refine,
    screen,
    without_each_effect,
)
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.convergence import converge
from impactcell.discrepancy.search.evidence import CandidateScan, ModelEvidence, scan_candidates
from impactcell.discrepancy.search.indistinguishability import (
    Alternative,
    CandidateFit,
    compare_fits,
    rank_out_of_shot,
    sort_by_likelihood,
    total_log_likelihood,
)
from impactcell.discrepancy.search.policy import POLICY


@dataclass(frozen=True, slots=True, eq=False)
class SearchState:
    """What the stages so far have found; each stage reads it and returns the next.

    Attributes
    ----------
    tested : dict of int to ModelEvidence
        Against the nominal model, 0, and the best with so many effects more, where that was tested.
    rough : dict of int to list of Fit
        Models with so many effects more, on few samples, the likeliest first.
    sets : dict of int to list of CandidateFit
        The same on all samples, the likeliest out of shot first.
    scans : list of CandidateScan
        Further effects beside models that have some.
    unconverged : list of Fit
        Trials that came to rest short of their optimum: they neither win nor lose.
    result : SelectionResult or None
        Ends the search.
    """

    tested: dict[int, ModelEvidence]
    rough: dict[int, list[Fit]] = field(default_factory=dict)
    sets: dict[int, list[CandidateFit]] = field(default_factory=dict)
    scans: list[CandidateScan] = field(default_factory=list)
    unconverged: list[Fit] = field(default_factory=list)
    result: SelectionResult | None = None

    @property
    def nominal(self) -> Fit:
        """The model without any effect more."""
        return self.tested[0].fit

    @property
    def latest(self) -> ModelEvidence:
        """Evidence against the largest model that was tested."""
        return self.tested[max(self.tested)]

    def best(self, size: int) -> Fit:
        """Return the likeliest model with so many effects more."""
        return self.sets[size][0].fit

    def fits(self, size: int) -> list[Fit]:
        """Return all models with so many effects more, fitted to all samples."""
        return [candidate.fit for candidate in self.sets.get(size, [])]

    def smaller(self, size: int) -> list[Fit]:
        """Return all models with fewer effects."""
        return [self.nominal, *(fit for fewer in range(1, size) for fit in self.fits(fewer))]

    @property
    def alternatives(self) -> tuple[Alternative, ...]:
        """Everything that was fitted to all samples, the likeliest first."""
        return compare_fits([one for size in sorted(self.sets, reverse=True) for one in self.sets[size]])


def fit_one_more(context: SearchContext, state: SearchState, size: int) -> SearchState:
    """Fit sets of a size: every promising effect beside the best smaller sets.

    The likeliest of these on all samples need not have been so on few.
    """
    if size == 1:
        return _fit_beside(context, state, [state.nominal], size, POLICY.max_screened)
    best = state.best(size - 1)
    others = [model for model in state.rough[size - 1] if set(model.effects) != set(best.effects)]
    bases = [best, *others[: POLICY.max_first_effects - 1]]
    return _fit_beside(context, state, bases, size, POLICY.max_second_effects)


def exchange_each(context: SearchContext, state: SearchState, size: int) -> SearchState:
    """Look for another effect in the place of each of the best set, until none is likelier.

    What is left without one of them is told from where the set stands.
    """
    state, reduced = refit_smaller(context, state, size)
    for _ in range(size):
        best = state.best(size)
        state = _fit_beside(context, state, reduced, size, POLICY.max_second_effects)
        if set(state.best(size).effects) == set(best.effects):
            break
        state, reduced = refit_smaller(context, state, size)
    return state


def refit_smaller(context: SearchContext, state: SearchState, size: int) -> tuple[SearchState, list[Fit]]:
    """Fit the best set without each of its effects, from where it stands; what is likelier so is kept.

    Returns
    -------
    state : SearchState
    reduced : list of Fit
    """
    reduced = fit_all_samples(context, without_each_effect(state.nominal, state.best(size)))
    converged, _ = converge(context, reduced, state.smaller(size - 1))
    return merge(context, state, size - 1, converged), converged


def _fit_beside(
    context: SearchContext, state: SearchState, bases: Sequence[Fit], size: int, most: int
) -> SearchState:
    """Fit one effect more beside each of some models: screened on few samples, finalists on all."""
    scans = _scans(context, state, bases)
    screened = [fitted for scan in scans for fitted in screen(context, scan, most)]
    before = state.rough.get(size, [])
    new = [fitted for fitted in _likeliest(context, [*before, *screened]) if fitted not in before]
    refined = refine(context, new)
    rough = _likeliest(context, [*before, *refined])
    last = fit_all_samples(
        context, [one for one in finalists(context, rough, state.nominal.effects) if one not in before]
    )
    converged, stuck = converge(context, [*last, *_known(context, state, size)], state.smaller(size))
    return replace(
        merge(context, state, size, converged),
        rough=state.rough | {size: rough},
        scans=[*state.scans, *(scan for scan in scans if scan not in state.scans)],
        unconverged=[*state.unconverged, *stuck],
    )


def _known(context: SearchContext, state: SearchState, size: int) -> list[Fit]:
    """List fits of an earlier search with so many effects more, of sets that this one has not fitted yet."""
    fitted = {frozenset(one.effects) for one in state.fits(size)}
    effects = len(state.nominal.effects) + size
    return [
        one for one in context.known if len(one.effects) == effects and frozenset(one.effects) not in fitted
    ]


def _scans(context: SearchContext, state: SearchState, bases: Sequence[Fit]) -> list[CandidateScan]:
    """Scan what may come beside each model; what has been scanned is not scanned again."""
    if not bases:
        return []
    known = [*state.scans, *(evidence.candidate_scan for evidence in state.tested.values())]
    by_set = {frozenset(scan.fit.effects): scan for scan in known}
    missing = [base for base in bases if frozenset(base.effects) not in by_set]
    more = len(bases[0].effects) - len(state.nominal.effects)
    scan = partial(scan_candidates, context.coarse, library=context.library, seed=(context.seed, more))
    by_set |= {frozenset(one.fit.effects): one for one in context.mapper(scan, missing)}
    return [by_set[frozenset(base.effects)] for base in bases]


def _likeliest(context: SearchContext, fits: Sequence[Fit]) -> list[Fit]:
    """Keep the likeliest fit of each set on few samples, the likeliest first."""
    by_set: dict[frozenset[str], Fit] = {}
    for fitted in sort_by_likelihood(context.coarse, fits):
        by_set.setdefault(frozenset(fitted.effects), fitted)
    return [*by_set.values()]


def merge(context: SearchContext, state: SearchState, size: int, fits: Sequence[Fit]) -> SearchState:
    """Rank further fits among those of a size; of the same set one must be likelier by more than a trifle."""
    by_set = {frozenset(one.fit.effects): one for one in state.sets.get(size, [])}
    for one in rank_out_of_shot(context.problem, fits):
        known = by_set.get(frozenset(one.fit.effects))
        if known is None or _gain(context, known.fit, one.fit) > POLICY.min_refit_gain:
            by_set[frozenset(one.fit.effects)] = one
    ranked = sorted(by_set.values(), key=lambda one: (-float(one.each.sum()), one.fit.effects))
    return replace(state, sets=state.sets | {size: prefer_interior(context.problem, state.nominal, ranked)})


def _gain(context: SearchContext, before: Fit, after: Fit) -> float:
    return total_log_likelihood(context.problem, after) - total_log_likelihood(context.problem, before)
