"""Which effects join the model: forward with every candidate refitted, one at a time or two, then backward.

A set of effects is accepted when nothing significant is left against the model that has it. Of all sets of the
smallest size the likeliest is taken; sets that are not significantly less likely, shot by shot, are tied
with it. When no set suffices nothing is added: forward selection on an effect outside the library would add
wrong names until it gives up.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from impactcell.discrepancy import name
from impactcell.discrepancy.campaign import Material
from impactcell.discrepancy.evidence import ALPHA, Evidence, examine
from impactcell.discrepancy.fit import Fit, Problem, fit
from impactcell.errors import DiscrepancyError
from impactcell.records import Samples

REFITS = 10
STARTS = 3
SEEDS_OF_PAIRS = 4
SECONDS = 6
TIED = 2.2
SMALLEST_GAIN = 15.0

Mapper = Callable[[Callable[[Any], Any], Iterable[Any]], list[Any]]


@dataclass(frozen=True, slots=True, eq=False)
class Alternative:
    """A set of effects that was fitted, and how much less likely it is than the best of its size."""

    fit: Fit
    log_likelihood: float
    behind: float
    behind_std: float

    @property
    def effects(self) -> tuple[str, ...]:
        """Its effects."""
        return self.fit.effects


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """Outcome of the search.

    Attributes
    ----------
    steps : tuple of Evidence
        Against the nominal model, then against each model that was accepted or tried last.
    accepted : Fit or None
        None where nothing suffices.
    added : tuple of str
        Effects in the order they were added.
    ties : dict of str to tuple of str
    p_values : dict of str to float
    alternatives : tuple of Alternative
        Everything that was fitted, the likeliest first.
    """

    nominal: Evidence
    final: Evidence
    accepted: Fit | None
    added: tuple[str, ...]
    ties: dict[str, tuple[str, ...]]
    p_values: dict[str, float]
    alternatives: tuple[Alternative, ...] = field(default=())


def _refit(task: tuple[Problem, tuple[str, ...], list[Samples], Fit]) -> Fit | None:
    """Fit a set of effects from several starts of its last effect; None if the plant has no answer."""
    problem, effects, starts, base = task
    best: Fit | None = None
    for start in starts:
        try:
            made = fit(problem, effects, np.concatenate([base.at, start]), base.local, spread=base.spread)
        except DiscrepancyError:
            continue
        if (
            best is None
            or made.log_likelihood(problem.shots).sum() > best.log_likelihood(problem.shots).sum()
        ):
            best = made
    return best


def _examine(problem: Problem, material: Material, library: Sequence[str], seed: int, model: Fit) -> Evidence:
    return examine(problem, model, material, library, (seed, len(model.effects)))


def refits(problem: Problem, evidence: Evidence, most: int, mapper: Mapper) -> list[Fit]:
    """Fit the most promising candidates beside what the model has already."""
    tasks = []
    gains = evidence.gains()
    for effect in sorted(gains, key=lambda one: -gains[one])[:most]:
        if gains[effect] < SMALLEST_GAIN and evidence.p_of(effect) > ALPHA:
            continue
        number = evidence.candidates.names.index(effect)
        shapes = len(evidence.candidates.probes[int(np.argmax(evidence.candidates.group == number))].at) > 1
        best = name.best_probes(
            evidence.candidates, evidence.candidate_scores, number, STARTS if shapes else 1
        )
        if best:
            starts = [start for _, start in best]
            tasks.append((problem, (*evidence.fit.effects, effect), starts, evidence.fit))
    return [made for made in mapper(_refit, tasks) if made is not None]


def behind(problem: Problem, best: Fit, other: Fit) -> tuple[float, float]:
    """By how much `other` is less likely than `best`, and the standard deviation of that over shots."""
    difference = best.log_likelihood(problem.shots) - other.log_likelihood(problem.shots)
    return float(difference.sum()), float(difference.std() * np.sqrt(len(difference)))


def is_tied(problem: Problem, best: Fit, other: Fit) -> bool:
    """Whether the shots do not tell two models apart (Vuong's test, the shot as the unit)."""
    gap, std = behind(problem, best, other)
    return gap <= TIED * std or gap < 2.0


def search(
    problem: Problem,
    nominal: Fit,
    material: Material,
    library: Sequence[str],
    seed: int,
    mapper: Mapper,
) -> Search:
    """Look for the smallest set of effects that leaves nothing significant."""
    look = partial(_examine, problem, material, library, seed)
    first = look(nominal)
    if first.p_value > ALPHA:
        return Search(first, first, nominal, (), {}, {})
    singles = _ranked(problem, refits(problem, first, REFITS, mapper))
    if not singles:
        return Search(first, first, None, (), {}, {})
    against = look(singles[0])
    if against.p_value > ALPHA:
        return _accept_single(problem, first, against, singles)
    sources: list[Evidence] = [against, *mapper(look, singles[1:SEEDS_OF_PAIRS])]
    pairs: dict[frozenset[str], Fit] = {}
    for evidence in sources:
        for made in refits(problem, evidence, SECONDS, mapper):
            key = frozenset(made.effects)
            if key not in pairs or _total(problem, made) > _total(problem, pairs[key]):
                pairs[key] = made
    ranked = _ranked(problem, pairs.values())
    everything = _alternatives(problem, [*ranked, *singles])
    if not ranked:
        return Search(first, against, None, (), {}, {}, everything)
    best = ranked[0]
    last = look(best)
    if last.p_value <= ALPHA:
        return Search(first, last, None, (), {}, {}, everything)
    return _accept_pair(problem, first, last, best, ranked, singles, sources, everything)


def _total(problem: Problem, made: Fit) -> float:
    return float(made.log_likelihood(problem.shots).sum())


def _ranked(problem: Problem, fits: Iterable[Fit]) -> list[Fit]:
    return sorted(fits, key=lambda made: (-_total(problem, made), made.effects))


def _alternatives(problem: Problem, fits: Sequence[Fit]) -> tuple[Alternative, ...]:
    made = []
    best = max(fits, key=lambda one: _total(problem, one)) if fits else None
    for one in fits:
        if best is not None:
            gap, std = behind(problem, best, one)
            made.append(Alternative(one, _total(problem, one), gap, std))
    return tuple(sorted(made, key=lambda one: -one.log_likelihood))


def _accept_single(problem: Problem, first: Evidence, against: Evidence, singles: list[Fit]) -> Search:
    best = singles[0]
    effect = best.effects[0]
    tied = tuple(other.effects[0] for other in singles[1:] if is_tied(problem, best, other))
    return Search(
        first,
        against,
        best,
        (effect,),
        {effect: tied},
        {effect: first.p_of(effect)},
        _alternatives(problem, singles),
    )


def _accept_pair(
    problem: Problem,
    first: Evidence,
    last: Evidence,
    best: Fit,
    ranked: list[Fit],
    singles: list[Fit],
    sources: list[Evidence],
    everything: tuple[Alternative, ...],
) -> Search:
    order = {one.effects[0]: place for place, one in enumerate(singles)}
    added = tuple(sorted(best.effects, key=lambda effect: order.get(effect, len(order))))
    ties: dict[str, tuple[str, ...]] = {effect: () for effect in added}
    for other in ranked[1:]:
        shared = set(other.effects) & set(added)
        if len(shared) == 1 and is_tied(problem, best, other):
            replaced = next(effect for effect in added if effect not in shared)
            instead = next(effect for effect in other.effects if effect not in shared)
            ties[replaced] = (*ties[replaced], instead)
    p_values = {added[0]: first.p_of(added[0])}
    with_first = [source for source in sources if source.fit.effects == added[:1]]
    p_values[added[1]] = with_first[0].p_of(added[1]) if with_first else first.p_of(added[1])
    return Search(first, last, best, added, ties, p_values, everything)
