"""Further shots of a model, without noise, and what a rival that is fitted to them too has to say of them.

The shots that there are stay linear in the rival's step, as it has to explain them; further ones may lie
where it is far off, and are linearised anew in every step of Gauss and Newton.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from impactcell.discrepancy.data import IndexArray, PreparedShot, ShotSet, concatenate_shots
from impactcell.discrepancy.model import Fit, Problem, gram_of_shots
from impactcell.discrepancy.search.indistinguishability import each_times
from impactcell.discrepancy.search.separation import LinearShots, Pair, best_step, weights_of
from impactcell.records import Samples

REFIT_STEPS = 8
"""Gauss-Newton steps, shorter ones among them, of a rival that is fitted to further shots."""
SETTLED = 0.05
"""Fall of the cost [one squared standard deviation] below which it has come to rest."""
LARGEST_FACTOR = 1.0
"""Of the logarithm of a friction factor, by which a further shot may look otherwise than it is."""


@dataclass(frozen=True, slots=True, eq=False)
class NewShots:
    """Kinds of further shots of the true model, without noise, linearised about both models.

    Attributes
    ----------
    gram : ndarray, shape (k, w, w)
        Products of derivatives of the true model (shots' own numbers, shared coordinates), of those of the
        rival, and of what lies between the two models' predictions, with each other.
    square : ndarray, shape (k,)
        Squared distance of the predictions there.
    is_known : ndarray of bool, shape (k,)
        Both models have an answer.
    """

    gram: Samples
    square: Samples
    is_known: NDArray[np.bool_]

    def seen_by(self, first: int, width: int, along: Samples, changes: Samples) -> LinearShots:
        """Draws of these shots as one of the models sees them.

        Parameters
        ----------
        first, width : int
            Where its columns begin, and how many there are.
        along : ndarray, shape (..., k, w)
            Noise times each derivative.
        changes : ndarray, shape (..., k, w)
            Coefficients by which the shots differ from what the model predicts.
        """
        mine = slice(first, first + width)
        bent = each_times(changes, self.gram)
        return LinearShots(
            self.gram[:, mine, mine],
            (along + bent)[..., mine],
            ((2.0 * along + bent) * changes).sum(-1),
            np.zeros((len(self.gram), 1)),
        )

    def without_noise(self, first: int, width: int) -> LinearShots:
        """Return these shots as the rival sees them, which lacks what lies between the models."""
        nothing = np.zeros(self.gram.shape[:-1])
        changes = nothing.copy()
        changes[:, -1] = 1.0
        return self.seen_by(first, width, nothing, changes)

    def select(self, kinds: IndexArray) -> "NewShots":
        """Return shots of some kinds."""
        return NewShots(self.gram[kinds], self.square[kinds], self.is_known[kinds])


def shots_like(problem: Problem, items: Sequence[PreparedShot]) -> ShotSet:
    """Lay out further shots as those of a problem are."""
    shots = problem.shots
    return concatenate_shots(
        shots.excitation, shots.gravity_m_s2, shots.stroke_m, tuple(items), shots.noise_std
    )


def answers_of(pair: Pair, items: Sequence[PreparedShot]) -> list[bytes]:
    """Give what both models of a pair predict for some shots, one entry each, to be compared.

    Raises
    ------
    PhysicsError, ValueError
        The plant has no answer.
    """
    problem = Problem(shots_like(pair.problem, items), pair.problem.batches)
    guess = problem.initial_guess()
    both = [problem.with_effects(model.effects).residual(model.theta, guess) for model in pair.models]
    begins = problem.shots.bounds.tolist()
    return [b"".join(one[begin:end].tobytes() for one in both) for begin, end in pairwise(begins)]


class FurtherShots:
    """Kinds of further shots that the true model of a pair would make, and what its rival has to say of them.

    Parameters
    ----------
    pair : Pair
    items : sequence of PreparedShot
        One of each kind.

    Raises
    ------
    PhysicsError, ValueError
        The plant has no answer.
    """

    def __init__(self, pair: Pair, items: Sequence[PreparedShot]) -> None:
        self.pair = pair
        self.problem = Problem(shots_like(pair.problem, items), pair.problem.batches)
        self._guess = self.problem.initial_guess()
        self._true = self._linearised(pair.models[0], pair.models[0].theta, np.zeros(len(items)))

    def _linearised(self, model: Fit, theta: Samples, log_factor: Samples) -> tuple[Samples, Samples]:
        """Give derivatives, shape (q + p, N), and the whitened residual of samples that nobody has yet."""
        bound = self.problem.with_effects(model.effects)
        state = bound.evaluate(theta, replace(self._guess, log_factor=log_factor), model.spread)
        J, Jl = bound.linearise(state)
        return np.vstack([_in_places(Jl, bound.shot_parameter_names, self.pair.own), J]), state.residual

    def about(self, theta: Samples, log_factor: Samples) -> NewShots:
        """Linearise them about a place of the rival, its steps being counted from where it stands now."""
        rows, residual = self._linearised(self.pair.models[1], theta, log_factor)
        between = residual - self._true[1]
        moved = (theta - self.pair.models[1].theta) @ rows[len(self.pair.own) :]
        moved += np.repeat(log_factor, self.problem.sizes) * rows[0]
        every = np.vstack([self._true[0], rows, between + moved])
        gram = gram_of_shots(np.vstack([every, between]), self.problem.shots.bounds)
        is_known = np.asarray(np.isfinite(gram).all((1, 2)))
        gram[~is_known] = 0.0
        return NewShots(gram[:, :-1, :-1], gram[:, -1, -1], is_known)

    def about_now(self) -> NewShots:
        """Linearise them about where the rival stands."""
        return self.about(self.pair.models[1].theta, np.zeros(self.problem.count))

    def about_refit(self, count: int) -> NewShots:
        """Linearise them about where the rival comes when it is fitted to so many of each kind, too.

        The old shots are taken as linear in its step: it stays where it explains them.
        """
        first, width = self.pair.columns
        rival = self.pair.models[1]
        weights = weights_of(self.pair.own, rival.spread)
        H = self.pair.old[1].eliminate(weights).H.sum(0)
        lower, upper = self.problem.with_effects(rival.effects).bounds()
        theta, factor = rival.theta, np.zeros(self.problem.count)
        best: tuple[float, Samples, Samples, NewShots] | None = None
        for _ in range(REFIT_STEPS):
            new = self.about(theta, factor)
            step = theta - rival.theta
            cost = float(step @ H @ step) + count * float((new.square + weights[0] * factor**2).sum())
            if not new.is_known.all() or (best is not None and cost > best[0]):
                if best is None:
                    return new
                theta, factor = 0.5 * (theta + best[1]), 0.5 * (factor + best[2])
                continue
            is_settled = best is not None and best[0] - cost < SETTLED
            best = (cost, theta, factor, new)
            if is_settled:
                break
            seen = new.without_noise(first, width).eliminate(weights)
            step = best_step(H + count * seen.H.sum(0), count * seen.u.sum(0))
            theta = np.clip(rival.theta + step, lower, upper)
            factor = np.clip(
                seen.factor - seen.lever @ (theta - rival.theta), -LARGEST_FACTOR, LARGEST_FACTOR
            )
        return new if best is None else best[3]


def _in_places(rows: Samples, names: Sequence[str], wanted: Sequence[str]) -> Samples:
    """Put rows where names are wanted; what shots do not have of their own changes nothing."""
    every = np.zeros((len(wanted), rows.shape[1]))
    for name, row in zip(names, rows, strict=True):
        every[wanted.index(name)] = row
    return every
