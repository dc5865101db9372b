"""Fits that a search tries: several starts of every promising effect, a race, and the finalists.

A few Gauss-Newton steps on few samples tell who cannot win; the likeliest run to the end, on all samples.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.prepared_campaign import Material
from impactcell.discrepancy.model.fit import Fit, fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.search import candidate_scores
from impactcell.discrepancy.search.evidence import ALPHA, Evidence, Scan, examine
from impactcell.discrepancy.search.indistinguishability import (
    Contender,
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
AHEAD = 5
POLISH = 40
FINALISTS = 2
MOST_FINALISTS = 6
STARTS = 2
SMALLEST_GAIN = 15.0
LARGE = 1.1
MATERIAL = 30.0
"""Log-likelihood that a second effect has to add; an effect that is worth less has no visible gap."""
NARROWER = 0.85
"""Or by which factor it has to lower the spread of the friction factors, if it acts between shots."""
END = 0.01
"""Share of the (logarithmic) range of a shape that counts as its end."""

Mapper = Callable[[Callable[[Any], Any], Iterable[Any]], list[Any]]


def _refit(task: tuple[Problem, tuple[str, ...], list[Samples], Fit, int]) -> Fit | None:
    """Fit a set of effects from several starts of its last effect, and keep the best.

    None if the plant has no answer at any start.
    """
    problem, effects, starts, base, steps = task
    first = min(steps, FIRST) if len(starts) > 1 else steps
    tried = [_try(problem, effects, np.concatenate([base.at, start]), base, first) for start in starts]
    best = next(iter(by_likelihood(problem, [made for made in tried if made is not None])), None)
    if best is None or first == steps:
        return best
    return _try(problem, effects, best.at, best, steps - first) or best


def _try(problem: Problem, effects: tuple[str, ...], at: Samples, base: Fit, steps: int) -> Fit | None:
    try:
        return fit(problem, effects, at, base.local, spread=base.spread, most_steps=steps)
    except DiscrepancyError:
        return None


def at_an_end(model: Fit) -> bool:
    """Whether the shape of an effect was fitted to the end of its range.

    It is then used for something that it is not: a patch wider than any slide is a gradient of friction.
    """
    return any(
        one.effect
        and one.form == "log"
        and min(float(at) - one.lower, one.upper - float(at)) < END * (one.upper - one.lower)
        for one, at in zip(model.coordinates, model.at, strict=True)
    )


def inside_first(problem: Problem, ranking: list[Contender]) -> list[Contender]:
    """Put what is tied with the likeliest, and fitted inside its range, before a likeliest that is not."""
    if not ranking or not at_an_end(ranking[0].fit):
        return ranking
    inside = [one for one in ranking[1:] if not at_an_end(one.fit) and is_tied(problem, ranking[0], one)]
    return [*inside, *(one for one in ranking if one not in inside)]


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


def race(setup: Setup, scanned: Scan, most: int) -> list[Fit]:
    """Fit the most promising candidates beside what the model has already by a few steps."""
    tasks = []
    gains = scanned.gains()
    for effect in sorted(gains, key=lambda one: -gains[one])[:most]:
        if gains[effect] < SMALLEST_GAIN and scanned.p_of(effect) > ALPHA:
            continue
        starts = candidate_scores.starts(scanned.candidates, scanned.scores, effect, STARTS)
        if starts:
            tasks.append((setup.coarse, (*scanned.fit.effects, effect), starts, scanned.fit, RACE))
    return by_likelihood(setup.coarse, [made for made in setup.mapper(_refit, tasks) if made is not None])


def finish(setup: Setup, raced: list[Fit]) -> list[Fit]:
    """Run the likeliest of a race to the end."""
    none = [np.empty(0)]
    ahead = [(setup.coarse, one.effects, none, one, STEPS) for one in raced[:AHEAD]]
    finished = [made for made in setup.mapper(_refit, ahead) if made is not None]
    return by_likelihood(setup.coarse, [*finished, *raced[AHEAD:]])


def finalists(setup: Setup, rough: list[Fit]) -> list[Fit]:
    """Keep the likeliest, and those that fewer samples do not tell from it."""
    in_sample = [Contender(one, one.log_likelihood(setup.coarse.shots)) for one in rough[:MOST_FINALISTS]]
    return [
        one.fit
        for place, one in enumerate(in_sample)
        if place < FINALISTS or is_tied(setup.coarse, in_sample[0], one)
    ]


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
