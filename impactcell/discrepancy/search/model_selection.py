"""Which effects join the model: forward with every candidate refitted, one at a time or two, then backward.

A set of effects is accepted when nothing significant is left against the model that has it. Of all sets of
the smallest size the likeliest is taken; sets that are not significantly less likely, shot by shot, are tied
with it. When no set suffices nothing is added: forward selection on an effect outside the library would add
wrong names until it gives up.
"""

from dataclasses import dataclass, field

from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.search.candidate_fits import (
    REFITS,
    Setup,
    at_an_end,
    backward,
    finalists,
    finish,
    inside_first,
    race,
)
from impactcell.discrepancy.search.evidence import Evidence, Scan, scan
from impactcell.discrepancy.search.indistinguishability import (
    Alternative,
    Contender,
    alternatives,
    by_likelihood,
    is_tied,
    total,
)

SEEDS_OF_PAIRS = 4
SECONDS = 5
MOST = 0.5
BETTER = 2.0
RIVAL = 0.5


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


def _scan(task: tuple[Problem, Fit, tuple[str, ...], tuple[int, ...]]) -> Scan:
    return scan(*task)


def search(setup: Setup, nominal: Fit) -> Search:
    """Look for the smallest set of effects that leaves nothing significant."""
    first = setup.look(nominal)
    if setup.suffices(first):
        return Search(first, first, nominal, (), {}, {})
    rough = finish(setup, race(setup, first.scan, REFITS))
    if not rough:
        return Search(first, first, None, (), {}, {})
    singles = inside_first(setup.problem, setup.polished(finalists(setup, rough)))
    against = setup.look(singles[0].fit)
    if setup.closes(against):
        return _accept_single(setup.problem, first, against, singles)
    plausible = _plausible(setup, first, against, singles[0].fit, rough, alternatives(singles))
    if plausible is not None:
        return plausible
    # The likeliest on all samples need not have been so on few.
    others = [one for one in rough if one.effects != singles[0].fit.effects]
    tasks = [(setup.coarse, one, setup.library, (setup.seed, 1)) for one in others[: SEEDS_OF_PAIRS - 1]]
    sources = [against.scan, *setup.mapper(_scan, tasks)]
    rough_pairs = _pairs(setup, sources)
    if not rough_pairs:
        return Search(first, against, None, (), {}, {}, alternatives(singles))
    pairs = inside_first(setup.problem, setup.polished(finalists(setup, rough_pairs)))
    if not setup.follows(pairs[0].fit):
        return Search(first, against, None, (), {}, {}, alternatives([*pairs, *singles]))
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
    if not setup.suffices(last) or at_an_end(pairs[0].fit):
        return Search(first, last, None, (), {}, {}, everything)
    return _accept_pair(setup.problem, first, last, pairs, rough, sources, everything)


def _pairs(setup: Setup, sources: list[Scan]) -> list[Fit]:
    """Fit the most promising second effects beside several first ones, the likeliest first."""
    best: dict[frozenset[str], Fit] = {}
    for source in sources:
        for made in race(setup, source, SECONDS):
            key = frozenset(made.effects)
            if key not in best or total(setup.coarse, made) > total(setup.coarse, best[key]):
                best[key] = made
    return finish(setup, by_likelihood(setup.coarse, best.values()))


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
    if setup.certain or at_an_end(best):
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


def _accept_single(problem: Problem, first: Evidence, against: Evidence, singles: list[Contender]) -> Search:
    best = singles[0].fit
    if at_an_end(best):
        return Search(first, against, None, (), {}, {}, alternatives(singles))
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
