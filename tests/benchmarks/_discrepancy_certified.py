"""Regimes of LISDD: a term chosen on some shots, certified on others, the false discovery rate controlled."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f

RATE = 0.05
"""False discovery rate, of flagged regimes and of certified terms."""
FOLDS = 5
ALIKE = 0.99
"""Cosine beyond which two terms are one."""
CUT = 1e-9
"""Of the largest singular value, what counts as nothing."""
SPLIT = 2606
"""Seed of the halves."""

Term = tuple[str, ...]
"""Effect, and what else tells its terms apart; columns of the same term are fitted together."""


@dataclass(frozen=True)
class Regime:
    """Products, shot by shot, of a regime's residual, physics and terms, in this order.

    Attributes
    ----------
    terms : tuple of Term
        One a column behind the physics.
    physics : int
        Number of columns of it.
    products : ndarray, shape (n, 1 + p + Q, 1 + p + Q)
    free : ndarray, shape (n,)
        Samples less the numbers of the shot's own.
    """

    terms: tuple[Term, ...]
    physics: int
    products: np.ndarray
    free: np.ndarray

    def columns(self, chosen: Sequence[Term]) -> np.ndarray:
        """Places of the physics and of some terms."""
        places = [1 + self.physics + place for place, term in enumerate(self.terms) if term in chosen]
        return np.array([*range(1, 1 + self.physics), *places], dtype=np.int64)

    def solve(self, columns: np.ndarray, shots: np.ndarray) -> np.ndarray:
        """Least squares over some shots."""
        whole = self.products[shots].sum(0)
        size = np.sqrt(np.maximum(np.diag(whole)[columns], 1e-300))
        scaled = whole[np.ix_(columns, columns)] / np.outer(size, size)
        made: np.ndarray = np.linalg.lstsq(scaled, whole[columns, 0] / size, rcond=CUT)[0] / size
        return made

    def left(self, columns: np.ndarray, values: np.ndarray, shots: np.ndarray) -> np.ndarray:
        """Sum of squares that a fit leaves in each of some shots."""
        part = self.products[shots]
        cross, inner = part[:, columns, 0], part[:, columns[:, None], columns]
        made: np.ndarray = part[:, 0, 0] - 2.0 * cross @ values + inner @ values @ values
        return made


def regime(parts: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray, int]], terms: Sequence[Term]) -> Regime:
    """Regime of every shot's residual, physics, terms (a column each) and count of numbers of its own."""
    stacks = [np.column_stack([residual, physics, columns]) for residual, physics, columns, _ in parts]
    free = np.array([len(residual) - own for residual, _, _, own in parts])
    return Regime(tuple(terms), parts[0][1].shape[1], np.stack([one.T @ one for one in stacks]), free)


def halves(count: int) -> np.ndarray:
    """Which shots locate and choose; the others certify."""
    first = np.zeros(count, dtype=bool)
    first[np.random.default_rng(SPLIT).permutation(count)[: (count + 1) // 2]] = True
    return first


def certified(regimes: Sequence[Regime], first: np.ndarray) -> list[list[str]]:
    """Effects of the terms that the first shots choose and the others certify."""
    chosen = [(one, choose(one, first)) for one in regimes]
    tested = [(one, term, p_value(one, term, ~first)) for one, term in chosen if term is not None]
    found: list[list[str]] = []
    for (one, term, _), certain in zip(tested, below_rate(np.array([p for _, _, p in tested])), strict=True):
        group = alike(one, term, first) if certain else []
        if group and not any(group[0] in other for other in found):
            found.append(group)
    return found


def choose(one: Regime, shots: np.ndarray) -> Term | None:
    """Term by exhaustive holdout; None if all of them make it worse."""
    places = np.flatnonzero(shots)
    fold = np.arange(len(places)) % FOLDS

    def error(*chosen: Term) -> float:
        columns = one.columns(chosen)
        parts = [(places[fold != out], places[fold == out]) for out in range(FOLDS)]
        return float(sum(one.left(columns, one.solve(columns, rest), out).sum() for rest, out in parts))

    tried = {term: error(term) for term in dict.fromkeys(one.terms)}
    best = min(tried, key=lambda term: tried[term], default=None)
    return best if best is not None and tried[best] < error() else None


def p_value(one: Regime, term: Term, shots: np.ndarray) -> float:
    """F test of a term beside the physics, by some shots."""
    places = np.flatnonzero(shots)
    with_it, without = one.columns([term]), one.columns([])
    after, before = (
        float(one.left(columns, one.solve(columns, places), places).sum()) for columns in (with_it, without)
    )
    more, free = len(with_it) - len(without), int(one.free[places].sum()) - len(with_it)
    if free < 1 or after <= 0.0:
        return 1.0
    return float(f.sf(max(before - after, 0.0) / more / (after / free), more, free))


def below_rate(p: np.ndarray) -> np.ndarray:
    """Which p-values Benjamini and Hochberg reject at `RATE`."""
    if not p.size:
        return np.zeros(0, dtype=bool)
    ordered = np.sort(p)
    under = ordered <= RATE * np.arange(1, p.size + 1) / p.size
    return p <= (ordered[under].max() if under.any() else -1.0)


def alike(one: Regime, term: Term, shots: np.ndarray) -> list[str]:
    """Effect of a term, with others that have one of nearly the same direction beside the physics."""
    whole = one.products[shots].sum(0)
    p = 1 + one.physics
    physics = slice(1, p)
    inner = (
        whole[p:, p:] - whole[p:, physics] @ np.linalg.pinv(whole[physics, physics], CUT) @ whole[physics, p:]
    )
    size = np.sqrt(np.maximum(np.diag(inner), 1e-300))
    mine = [place for place, other in enumerate(one.terms) if other == term]
    near = np.max(np.abs(inner[mine] / np.outer(size[mine], size)), axis=0) > ALIKE
    others = [other[0] for other, is_near in zip(one.terms, near, strict=True) if is_near]
    return list(dict.fromkeys([term[0], *others]))
