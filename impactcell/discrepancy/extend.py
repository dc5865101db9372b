"""Which effects join the model: forward with every candidate refitted, one at a time or two, then backward.

A set of effects is accepted when nothing significant is left against the model that has it. Of all sets of
the smallest size the likeliest is taken; sets that are not significantly less likely, shot by shot, are tied
with it. When no set suffices nothing is added: forward selection on an effect outside the library would add
wrong names until it gives up.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy import name
from impactcell.discrepancy.campaign import Material
from impactcell.discrepancy.evidence import ALPHA, Evidence, Scan, examine, scan
from impactcell.discrepancy.fit import Fit, fit
from impactcell.discrepancy.problem import Problem
from impactcell.discrepancy.ties import (
    Alternative,
    Contender,
    alternatives,
    by_likelihood,
    is_tied,
    ranked,
    total,
)
from impactcell.errors import DiscrepancyError
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY
from impactcell.records import Samples

REFITS = 10
STEPS = 25
FIRST = 2
RACE = 5
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
NARROWER = 0.85
"""Or by which factor it has to lower the spread of the friction factors, if it acts between shots."""
BETTER = 2.0
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
    first = min(steps, FIRST) if len(starts) > 1 else steps
    tried = [_try(problem, effects, np.concatenate([base.at, start]), base, first) for start in starts]
    ranked = by_likelihood(problem, [made for made in tried if made is not None])
    if not ranked or first == steps:
        return ranked[0] if ranked else None
    return _try(problem, effects, ranked[0].at, ranked[0], steps - first) or ranked[0]


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

    def closes(self, evidence: Evidence) -> bool:
        """Whether what is left beside an effect is not significant, or too little to be worth a name."""
        return self.suffices(evidence) or (self.follows(evidence.fit) and not self.worth(evidence))

    def worth(self, evidence: Evidence) -> bool:
        """Whether some candidate or some cell of the map promises enough to be worth a name."""
        gains = evidence.scan.gains()
        promised = [gain for effect, gain in gains.items() if LIBRARY[effect].kind is not Kind.BETWEEN_SHOTS]
        between = [gain for effect, gain in gains.items() if LIBRARY[effect].kind is Kind.BETWEEN_SHOTS]
        chart, gain = evidence.map, evidence.map_scores.gain
        promised += gain[chart.channel >= 0].tolist()
        between += gain[chart.channel < 0].tolist()
        share = max(between, default=0.0) / self.problem.count
        return max(promised, default=0.0) > 2.0 * MATERIAL or share > 1.0 - NARROWER**2

    def material_gain(self, fewer: Fit, more: Fit) -> bool:
        """Whether one more effect explains enough to be worth a name, significant or not."""
        gain = total(self.problem, more) - total(self.problem, fewer)
        return gain > MATERIAL or more.spread < NARROWER * fewer.spread

    def follows(self, model: Fit) -> bool:
        """Whether a model comes near the noise, where that is stated."""
        each = model.misfit(self.problem.shots) / self.problem.sizes
        # A driven block in which stick ends at the wrong moment is far off whatever the model.
        driven = self.problem.shots.excitation is Excitation.DRIVEN
        misfit = float(np.median(each) if driven else np.average(each, weights=self.problem.sizes))
        return not (self.certain and misfit > LARGE**2)

    def polished(self, fits: Sequence[Fit]) -> list[Contender]:
        """Refit on all samples, the likeliest out of shot first."""
        tasks = [(self.problem, one.effects, [np.empty(0)], one, POLISH) for one in fits]
        return ranked(self.problem, [made for made in self.mapper(_refit, tasks) if made is not None])


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


def backward(nominal: Fit, model: Fit) -> list[Fit]:
    """Start fits of a model without each of its new effects in turn, from where it stands.

    What a second effect seems to add may be no more than a way round the place where the fit of the first
    had come to rest.
    """
    made = []
    for left_out in model.effects[len(nominal.effects) :]:
        kept = tuple(effect for effect in model.effects if effect != left_out)
        mine = np.array([one.effect != left_out for one in model.coordinates])
        made.append(replace(model, effects=kept, at=model.at[mine]))
    return made


def search(setup: Setup, nominal: Fit) -> Search:
    """Look for the smallest set of effects that leaves nothing significant."""
    first = setup.look(nominal)
    if setup.suffices(first):
        return Search(first, first, nominal, (), {}, {})
    rough = refits(setup, first.scan, REFITS)
    if not rough:
        return Search(first, first, None, (), {}, {})
    singles = setup.polished(_finalists(setup, rough))
    against = setup.look(singles[0].fit)
    if setup.closes(against):
        return _accept_single(setup.problem, first, against, singles)
    plausible = _plausible(setup, first, against, singles[0].fit, rough, alternatives(singles))
    if plausible is not None:
        return plausible
    tasks = [(setup.coarse, one, setup.library, (setup.seed, 1)) for one in rough[1:SEEDS_OF_PAIRS]]
    sources = [against.scan, *setup.mapper(_scan, tasks)]
    rough_pairs = _pairs(setup, sources)
    if not rough_pairs:
        return Search(first, against, None, (), {}, {}, alternatives(singles))
    pairs = setup.polished(_finalists(setup, rough_pairs))
    again = setup.polished(backward(nominal, pairs[0].fit))
    if again and total(setup.problem, again[0].fit) > total(setup.problem, singles[0].fit) + BETTER:
        effects = {one.fit.effects for one in again}
        singles = [*again, *(one for one in singles if one.fit.effects not in effects)]
        singles.sort(key=lambda one: -float(one.each.sum()))
        against = setup.look(singles[0].fit)
        if setup.closes(against):
            return _accept_single(setup.problem, first, against, singles)
    everything = alternatives([*pairs, *singles])
    if not setup.material_gain(singles[0].fit, pairs[0].fit) and setup.follows(singles[0].fit):
        return _accept_single(setup.problem, first, against, singles)
    last = setup.look(pairs[0].fit)
    if not setup.closes(last):
        return Search(first, last, None, (), {}, {}, everything)
    return _accept_pair(setup.problem, first, last, pairs, rough, sources, everything)


def _pairs(setup: Setup, sources: list[Scan]) -> list[Fit]:
    """Fit the most promising second effects beside several first ones, the likeliest first."""
    best: dict[frozenset[str], Fit] = {}
    for source in sources:
        for made in refits(setup, source, SECONDS):
            key = frozenset(made.effects)
            if key not in best or total(setup.coarse, made) > total(setup.coarse, best[key]):
                best[key] = made
    return by_likelihood(setup.coarse, best.values())


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
    in_sample = [Contender(one, one.log_likelihood(setup.coarse.shots)) for one in rough[:MOST_FINALISTS]]
    return [
        one.fit
        for place, one in enumerate(in_sample)
        if place < FINALISTS or is_tied(setup.coarse, in_sample[0], one)
    ]


def _accept_single(problem: Problem, first: Evidence, against: Evidence, singles: list[Contender]) -> Search:
    best = singles[0].fit
    effect = best.effects[-1]
    tied = tuple(other.fit.effects[-1] for other in singles[1:] if is_tied(problem, singles[0], other))
    return Search(
        first,
        against,
        best,
        (effect,),
        {effect: tied},
        {effect: first.scan.p_of(effect)},
        alternatives(singles),
    )


def _accept_pair(
    problem: Problem,
    first: Evidence,
    last: Evidence,
    pairs: list[Contender],
    rough: list[Fit],
    sources: list[Scan],
    everything: tuple[Alternative, ...],
) -> Search:
    best = pairs[0].fit
    order = {one.effects[-1]: place for place, one in enumerate(rough)}
    new = [effect for effect in best.effects if effect not in first.fit.effects]
    added = tuple(sorted(new, key=lambda effect: order.get(effect, len(order))))
    ties: dict[str, tuple[str, ...]] = dict.fromkeys(added, ())
    for rival in pairs[1:]:
        other = rival.fit.effects
        if len(set(other) & set(added)) == 1 and is_tied(problem, pairs[0], rival):
            replaced = next(effect for effect in added if effect not in other)
            instead = next(effect for effect in other if effect not in best.effects)
            ties[replaced] = (*ties[replaced], instead)
    p_values = {added[0]: first.scan.p_of(added[0])}
    beside = [source for source in sources if source.fit.effects[-1:] == added[:1]]
    p_values[added[1]] = beside[0].p_of(added[1]) if beside else first.scan.p_of(added[1])
    return Search(first, last, best, added, ties, p_values, everything)
