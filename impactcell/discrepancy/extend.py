"""Which effects join the model: forward with every candidate refitted, one at a time or two, then backward.

A set of effects is accepted when nothing significant is left against the model that has it. Of all sets of
the smallest size the likeliest is taken; sets that are not significantly less likely, shot by shot, are tied
with it. When no set suffices nothing is added: forward selection on an effect outside the library would add
wrong names until it gives up.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy import name
from impactcell.discrepancy.campaign import Material
from impactcell.discrepancy.evidence import ALPHA, Evidence, Scan, examine, scan
from impactcell.discrepancy.fit import Fit, fit
from impactcell.discrepancy.problem import Problem
from impactcell.discrepancy.ties import Alternative, alternatives, by_likelihood, is_tied, total
from impactcell.errors import DiscrepancyError
from impactcell.records import Samples

REFITS = 10
STEPS = 25
RACE = 4
AHEAD = 4
POLISH = 40
FINALISTS = 2
MOST_FINALISTS = 6
STARTS = 2
SEEDS_OF_PAIRS = 4
SECONDS = 5
SMALLEST_GAIN = 15.0
MOST = 0.5
LARGE = 1.1
MATERIAL = 30.0
"""Log-likelihood that a second effect has to add; an effect that is worth less has no visible gap."""
RIVAL = 0.5

Mapper = Callable[[Callable[[Any], Any], Iterable[Any]], list[Any]]


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


def _refit(task: tuple[Problem, tuple[str, ...], list[Samples], Fit, int]) -> Fit | None:
    """Fit a set of effects from several starts of its last effect, and keep the best.

    None if the plant has no answer at any start.
    """
    problem, effects, starts, base, steps = task
    best: Fit | None = None
    for start in starts:
        made = _try(problem, effects, np.concatenate([base.at, start]), base, steps)
        if made is not None and (best is None or total(problem, made) > total(problem, best)):
            best = made
    return best


def _try(problem: Problem, effects: tuple[str, ...], at: Samples, base: Fit, steps: int) -> Fit | None:
    try:
        return fit(problem, effects, at, base.local, spread=base.spread, most_steps=steps)
    except DiscrepancyError:
        return None


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """What a search works on: all samples, fewer of them, and what may be named.

    `certain` says that the noise is stated, so that what is left above it is a gap.
    """

    problem: Problem
    coarse: Problem
    material: Material
    library: tuple[str, ...]
    seed: int
    mapper: Mapper
    certain: bool

    def look(self, model: Fit) -> Evidence:
        """All evidence against a model."""
        key = (self.seed, len(model.effects))
        return examine(self.problem, self.coarse, model, self.material, self.library, key)

    def suffices(self, evidence: Evidence) -> bool:
        """Whether nothing significant is left, and nothing large either where the noise is stated."""
        return evidence.p_value > ALPHA and self.follows(evidence.fit)

    def material_gain(self, fewer: Fit, more: Fit) -> bool:
        """Whether one more effect explains enough to be worth a name, significant or not."""
        return total(self.problem, more) - total(self.problem, fewer) > MATERIAL

    def follows(self, model: Fit) -> bool:
        """Whether a model comes near the noise, where that is stated."""
        each = model.misfit(self.problem.shots) / self.problem.sizes
        # A driven block in which stick ends at the wrong moment is far off whatever the model.
        driven = self.problem.shots.excitation is Excitation.DRIVEN
        misfit = float(np.median(each) if driven else np.average(each, weights=self.problem.sizes))
        return not (self.certain and misfit > LARGE**2)

    def polished(self, fits: Sequence[Fit]) -> list[Fit]:
        """Refit on all samples, the likeliest first."""
        if self.problem is self.coarse:
            return by_likelihood(self.problem, fits)
        tasks = [(self.problem, one.effects, [np.empty(0)], one, POLISH) for one in fits]
        return by_likelihood(self.problem, [made for made in self.mapper(_refit, tasks) if made is not None])


def _scan(task: tuple[Problem, Fit, tuple[str, ...], tuple[int, ...]]) -> Scan:
    return scan(*task)


def refits(setup: Setup, scanned: Scan, most: int) -> list[Fit]:
    """Fit the most promising candidates beside what the model has already, the likeliest first."""
    tasks = []
    gains = scanned.gains()
    for effect in sorted(gains, key=lambda one: -gains[one])[:most]:
        if gains[effect] < SMALLEST_GAIN and scanned.p_of(effect) > ALPHA:
            continue
        starts = name.starts(scanned.candidates, scanned.scores, effect, STARTS)
        if starts:
            tasks.append((setup.coarse, (*scanned.fit.effects, effect), starts, scanned.fit, RACE))
    raced = by_likelihood(setup.coarse, [made for made in setup.mapper(_refit, tasks) if made is not None])
    # A few steps tell who cannot win; the others run to the end.
    none = [np.empty(0)]
    ahead = [(setup.coarse, one.effects, none, one, STEPS) for one in raced[:AHEAD]]
    finished = [made for made in setup.mapper(_refit, ahead) if made is not None]
    return by_likelihood(setup.coarse, [*finished, *raced[AHEAD:]])


def search(setup: Setup, nominal: Fit) -> Search:
    """Look for the smallest set of effects that leaves nothing significant."""
    first = setup.look(nominal)
    if setup.suffices(first):
        return Search(first, first, nominal, (), {}, {})
    rough = refits(setup, first.scan, REFITS)
    if not rough:
        return Search(first, first, None, (), {}, {})
    singles = setup.polished(_finalists(setup, rough))
    against = setup.look(singles[0])
    if setup.suffices(against):
        return _accept_single(setup.problem, first, against, singles)
    plausible = _plausible(setup, first, against, singles[0], rough, alternatives(setup.problem, singles))
    if plausible is not None:
        return plausible
    tasks = [(setup.coarse, one, setup.library, (setup.seed, 1)) for one in rough[1:SEEDS_OF_PAIRS]]
    sources = [against.scan, *setup.mapper(_scan, tasks)]
    pairs: dict[frozenset[str], Fit] = {}
    for source in sources:
        for made in refits(setup, source, SECONDS):
            key = frozenset(made.effects)
            if key not in pairs or total(setup.coarse, made) > total(setup.coarse, pairs[key]):
                pairs[key] = made
    rough_pairs = by_likelihood(setup.coarse, pairs.values())
    if not rough_pairs:
        return Search(first, against, None, (), {}, {}, alternatives(setup.problem, singles))
    ranked = setup.polished(_finalists(setup, rough_pairs))
    everything = alternatives(setup.problem, [*ranked, *singles])
    if not setup.material_gain(singles[0], ranked[0]) and setup.follows(singles[0]):
        return _accept_single(setup.problem, first, against, singles)
    last = setup.look(ranked[0])
    if not setup.suffices(last):
        return Search(first, last, None, (), {}, {}, everything)
    return _accept_pair(setup.problem, first, last, ranked, rough, sources, everything)


def _plausible(
    setup: Setup,
    first: Evidence,
    against: Evidence,
    best: Fit,
    rough: list[Fit],
    everything: tuple[Alternative, ...],
) -> Search | None:
    """Accept the effect that explains most of a gap, if the floor itself is only a lower bound.

    What is left then may be noise that nobody stated. It also may be what separates the best effect from its
    rivals: whoever is behind by less than that is tied.
    """
    if setup.certain:
        return None
    size = setup.problem.shots.values.size
    before = float(first.fit.misfit(setup.problem.shots).sum()) - size
    after = float(best.misfit(setup.problem.shots).sum()) - size
    if after > (1.0 - MOST) * before:
        return None
    scale = setup.coarse.shots.values.size / size
    least = float(best.misfit(setup.problem.shots).sum()) * scale
    effect = best.effects[-1]
    tied = tuple(
        one.effects[-1]
        for one in rough
        if one.effects != best.effects
        and float(one.misfit(setup.coarse.shots).sum()) - least <= RIVAL * after * scale
    )
    return Search(
        first, against, best, (effect,), {effect: tied}, {effect: first.scan.p_of(effect)}, everything
    )


def _finalists(setup: Setup, rough: list[Fit]) -> list[Fit]:
    """Keep the likeliest, and those that fewer samples do not tell from it."""
    best = rough[0]
    return [
        one
        for place, one in enumerate(rough)
        if place < FINALISTS or (place < MOST_FINALISTS and is_tied(setup.coarse, best, one))
    ]


def _accept_single(problem: Problem, first: Evidence, against: Evidence, singles: list[Fit]) -> Search:
    best = singles[0]
    effect = best.effects[-1]
    tied = tuple(other.effects[-1] for other in singles[1:] if is_tied(problem, best, other))
    return Search(
        first,
        against,
        best,
        (effect,),
        {effect: tied},
        {effect: first.scan.p_of(effect)},
        alternatives(problem, singles),
    )


def _accept_pair(
    problem: Problem,
    first: Evidence,
    last: Evidence,
    ranked: list[Fit],
    rough: list[Fit],
    sources: list[Scan],
    everything: tuple[Alternative, ...],
) -> Search:
    best = ranked[0]
    order = {one.effects[-1]: place for place, one in enumerate(rough)}
    new = [effect for effect in best.effects if effect not in first.fit.effects]
    added = tuple(sorted(new, key=lambda effect: order.get(effect, len(order))))
    ties: dict[str, tuple[str, ...]] = dict.fromkeys(added, ())
    for other in ranked[1:]:
        if len(set(other.effects) & set(added)) == 1 and is_tied(problem, best, other):
            replaced = next(effect for effect in added if effect not in other.effects)
            instead = next(effect for effect in other.effects if effect not in best.effects)
            ties[replaced] = (*ties[replaced], instead)
    p_values = {added[0]: first.scan.p_of(added[0])}
    beside = [source for source in sources if source.fit.effects[-1:] == added[:1]]
    p_values[added[1]] = beside[0].p_of(added[1]) if beside else first.scan.p_of(added[1])
    return Search(first, last, best, added, ties, p_values, everything)
