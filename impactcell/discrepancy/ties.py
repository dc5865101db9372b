"""Which fitted models the shots do not tell apart (Vuong 1989, the shot as the unit)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.fit import Fit
from impactcell.discrepancy.problem import Problem

TIED = 2.2


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


def behind(problem: Problem, best: Fit, other: Fit) -> tuple[float, float]:
    """By how much `other` is less likely than `best`, and the standard deviation of that over shots."""
    difference = best.log_likelihood(problem.shots) - other.log_likelihood(problem.shots)
    return float(difference.sum()), float(difference.std() * np.sqrt(len(difference)))


def is_tied(problem: Problem, best: Fit, other: Fit) -> bool:
    """Whether the shots do not tell two models apart (Vuong's test, the shot as the unit)."""
    gap, std = behind(problem, best, other)
    return gap <= TIED * std or gap < 2.0


def total(problem: Problem, made: Fit) -> float:
    """Log-likelihood over all shots."""
    return float(made.log_likelihood(problem.shots).sum())


def by_likelihood(problem: Problem, fits: Iterable[Fit]) -> list[Fit]:
    """Sort fits, the likeliest first."""
    return sorted(fits, key=lambda made: (-total(problem, made), made.effects))


def alternatives(problem: Problem, fits: Sequence[Fit]) -> tuple[Alternative, ...]:
    """Compare fits with the likeliest of them."""
    made = []
    best = max(fits, key=lambda one: total(problem, one)) if fits else None
    for one in fits:
        if best is not None:
            gap, std = behind(problem, best, one)
            made.append(Alternative(one, total(problem, one), gap, std))
    return tuple(sorted(made, key=lambda one: -one.log_likelihood))
