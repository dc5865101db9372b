"""How far further shots take a model from a rival that is fitted to them as well as to those there are.

Of a design that tells models apart the distance counts that is left when the rival's parameters have done
what they can: T-optimality (Atkinson & Fedorov, Biometrika 62, 1975). Here all is linearised: a shot is the
products of what its model can do with each other and with its residual, its own numbers are eliminated from
these, and the rival's step to old and new shots together is one of Gauss and Newton.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.model import Fit, Problem, gram_of_shots, known_std
from impactcell.discrepancy.search.indistinguishability import each_times
from impactcell.records import Samples

RIDGE = 1e-10
"""Relative ridge on a shot's own equations: a number that the shot cannot see stays where it is [1]."""
UNSEEN = 1e-12
"""Share of the largest information, scaled to a unit diagonal, below which a step does not go that way."""


@dataclass(frozen=True, slots=True, eq=False)
class LinearShots:
    """Shots linearised about where a model stands.

    Attributes
    ----------
    gram : ndarray, shape (n, q + p, q + p)
        Products of the whitened derivatives by the shots' own numbers and by the shared coordinates.
    along : ndarray, shape (..., n, q + p)
        Of the residual with these; leading axes are draws of the same shots.
    square : ndarray, shape (..., n)
        Of the residual with itself.
    own : ndarray, shape (n, q) or (n, 1)
        Where the shots' own numbers stand, as far as something is known of them; 0 for the others.
    """

    gram: Samples
    along: Samples
    square: Samples
    own: Samples

    @classmethod
    def of(cls, problem: Problem, model: Fit) -> "LinearShots":
        """Linearise the shots that a model was fitted to."""
        bound, state = problem.with_effects(model.effects), model.state
        J, Jl = bound.linearise(state)
        known = known_std(model.spread)
        zero = np.zeros(problem.count)
        names = bound.shot_parameter_names
        own = [getattr(model.shot_parameters, name) if name in known else zero for name in names]
        gram = gram_of_shots(np.vstack([Jl, J, state.residual]), problem.shots.bounds)
        return cls(gram[:, :-1, :-1], gram[:, -1, :-1], gram[:, -1, -1], np.array(own).T)

    def eliminate(self, weights: Samples) -> "EliminatedShots":
        """Eliminate the shots' own numbers.

        Parameters
        ----------
        weights : ndarray, shape (q,)
            One over the variance of what is known of each; 0 where nothing is.
        """
        q = len(weights)
        A, C, shared = self.gram[:, :q, :q].copy(), self.gram[:, :q, q:], self.gram[:, q:, q:]
        A[:, np.arange(q), np.arange(q)] += weights
        diagonal = np.einsum("iqq->iq", A)
        A[:, np.arange(q), np.arange(q)] += RIDGE * diagonal + (diagonal == 0.0)
        inverse = np.asarray(np.linalg.inv(A), dtype=np.float64)
        gradient = self.along[..., :q] - weights * self.own
        moved, best = inverse @ C, each_times(gradient, inverse)
        return EliminatedShots(
            shared - np.swapaxes(C, 1, 2) @ moved,
            self.along[..., q:] - each_times(gradient, moved),
            self.square + (weights * self.own**2).sum(-1) - (gradient * best).sum(-1),
            self.own[:, 0] + best[..., 0],
            moved[:, 0],
        )


@dataclass(frozen=True, slots=True, eq=False)
class EliminatedShots:
    """Shots of which the shared coordinates s are all that is free: they cost `cost` - 2 u's + s'H s.

    Attributes
    ----------
    H : ndarray, shape (n, p, p)
    u : ndarray, shape (..., n, p)
    cost : ndarray, shape (..., n)
    factor : ndarray, shape (..., n)
        Logarithm of each shot's friction factor, less `lever` s where the coordinates move.
    lever : ndarray, shape (n, p)
    """

    H: Samples
    u: Samples
    cost: Samples
    factor: Samples
    lever: Samples

    def moved(self, step: Samples) -> "EliminatedShots":
        """Return the same shots after a step, shape (..., p), of the shared coordinates."""
        n, p = self.lever.shape
        bent = (step @ self.H.reshape(n * p, p).T).reshape(*step.shape[:-1], n, p)
        cost = self.cost - ((2.0 * self.u - bent) @ step[..., None])[..., 0]
        return EliminatedShots(self.H, self.u - bent, cost, self.factor - step @ self.lever.T, self.lever)

    def join(self, other: "EliminatedShots") -> "EliminatedShots":
        """Put further shots behind these, of which there may be several draws."""
        draws = other.cost.shape[:-1]
        return EliminatedShots(
            np.concatenate([self.H, other.H]),
            np.concatenate([np.broadcast_to(self.u, (*draws, *self.u.shape[-2:])), other.u], axis=-2),
            np.concatenate([np.broadcast_to(self.cost, (*draws, self.cost.shape[-1])), other.cost], axis=-1),
            np.concatenate(
                [np.broadcast_to(self.factor, (*draws, self.factor.shape[-1])), other.factor], axis=-1
            ),
            np.concatenate([self.lever, other.lever]),
        )


def weights_of(names: Sequence[str], spread: float) -> Samples:
    """One over the variance of what is known of each of the shots' own numbers, shape (q,)."""
    std = known_std(spread)
    return np.array([1.0 / std[name] ** 2 if name in std else 0.0 for name in names])


def best_step(H: Samples, u: Samples) -> Samples:
    """Return steps H^-1 u, shape (..., p), in the directions that the shots see."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-300))
    inverse = np.linalg.pinv(H * np.outer(scale, scale), rcond=UNSEEN, hermitian=True)
    step: Samples = u @ (inverse * np.outer(scale, scale))
    return step


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """A model that is taken for the true one, and its rival, on the shots that there are.

    Attributes
    ----------
    problem : Problem
        Of the training shots.
    models : tuple of Fit
        The true one and the rival.
    old : tuple of LinearShots
        The training shots, linearised about each of them.
    by_factors : bool
        They are held against each other by the spread of the friction factors alone.
    """

    problem: Problem
    models: tuple[Fit, Fit]
    old: tuple[LinearShots, LinearShots]
    by_factors: bool = False

    @classmethod
    def of(cls, problem: Problem, true: Fit, rival: Fit, *, by_factors: bool = False) -> "Pair":
        """Linearise both models."""
        old = (LinearShots.of(problem, true), LinearShots.of(problem, rival))
        return cls(problem, (true, rival), old, by_factors)

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the shots' own numbers."""
        return self.problem.shot_parameter_names

    @property
    def columns(self) -> tuple[int, int]:
        """How many numbers of its own and coordinates each model has."""
        first, second = (len(self.own) + len(model.coordinates) for model in self.models)
        return first, second

    def swapped(self) -> "Pair":
        """Return the pair with the rival for the true one."""
        return Pair(self.problem, self.models[::-1], self.old[::-1], self.by_factors)


def refitted_separation(old: EliminatedShots, new: EliminatedShots, counts: Sequence[int]) -> float:
    """Squared distance that is left between a model and its rival when that is refitted.

    The least over the rival's coordinates of what old shots cost more than now and new ones cost at all:
    twice the log-likelihood by which the rival will be behind, in the mean over noise.

    Parameters
    ----------
    old : EliminatedShots
        Shots that there are, about the rival's optimum.
    new : EliminatedShots
        Kinds of new shots that the true model makes, without noise.
    counts : sequence of int
        How many shots of each kind.
    """
    weights = np.asarray(counts, dtype=np.float64)
    H = old.H.sum(0) + np.einsum("k,kab->ab", weights, new.H)
    u = weights @ new.u
    return max(float(weights @ new.cost - u @ best_step(H, u)), 0.0)
