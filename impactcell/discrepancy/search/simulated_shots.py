"""Further shots of a model with noise, friction scatter, and what is not known of its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from impactcell.discrepancy.data import PreparedShot, ShotSet
from impactcell.discrepancy.model import Fit, Problem, ShotParameters, fit
from impactcell.discrepancy.search.further_shots import NewShots, shots_like
from impactcell.records import Samples

REFIT_STEPS = 8
"""Gauss-Newton steps of a refit: from where a model stands it has come to rest in them [1]."""


def simulate_shots(
    problem: Problem, model: Fit, items: Sequence[PreparedShot], rng: np.random.Generator
) -> ShotSet:
    """Simulate shots of a model with the sensors' noise and a friction factor of their own each.

    Raises
    ------
    PhysicsError
        The plant has no answer.
    """
    shots = shots_like(problem, items)
    bound = Problem(shots, problem.batches, model.effects)
    factors = model.spread * rng.standard_normal(len(items))
    residual = bound.residual(model.theta, replace(bound.initial_guess(), log_factor=factors))
    made = shots.values + shots.unwhiten(rng.standard_normal(residual.size) - residual)
    return _with_values(problem, shots, made)


def refit_with(problem: Problem, model: Fit, new: ShotSet) -> tuple[Problem, Fit]:
    """Fit a model to the shots of a problem and to further ones behind them.

    Raises
    ------
    DiscrepancyError
        The plant has no answer.
    """
    every = Problem(shots_like(problem, (*problem.shots.items, *new.items)), problem.batches, model.effects)
    guess = Problem(new, problem.batches, model.effects).initial_guess()
    start = ShotParameters(
        *(
            np.concatenate([getattr(model.shot_parameters, item.name), getattr(guess, item.name)])
            for item in fields(ShotParameters)
        )
    )
    return every, fit(every, model.theta, start, spread=model.spread, most_steps=REFIT_STEPS)


def _with_values(problem: Problem, shots: ShotSet, values: Samples) -> ShotSet:
    """Put other samples into the same shots."""
    items = []
    for place, shot in enumerate(shots.items):
        ends = np.cumsum([len(channel) for channel in shot.values])[:-1]
        force, position, actuator = np.split(values[shots.samples_of(place)], ends)
        items.append(replace(shot, values=(force, position, actuator)))
    return shots_like(problem, items)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnShots:
    """Draws of further shots, linearised: what they are beside the true model, and what noise is along.

    Attributes
    ----------
    kind : ndarray, shape (n,)
        Of each shot.
    along : ndarray, shape (R, n, w)
        Noise times each derivative.
    changes : ndarray, shape (R, n, w)
        Coefficients of the derivatives: the shots' friction, and where the true model's parameters may be.
    """

    kind: np.ndarray
    along: Samples
    changes: Samples

    def first(self, draws: int) -> "DrawnShots":
        """Return the first draws."""
        return DrawnShots(self.kind, self.along[:draws], self.changes[:draws])


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """What differs from draw to draw.

    Attributes
    ----------
    spread : float
        Standard deviation of the logarithm of the friction factors.
    noise : float
        Of a whitened sample: above 1 where the model leaves more than noise.
    uncertain : ndarray, shape (p, r)
        Of the true model's coordinates, a square root of their covariance.
    own : int
        Columns of the shots' own numbers, the friction factor first, before those of the coordinates.
    """

    spread: float
    noise: float
    uncertain: Samples
    own: int


def draw_linear_shots(
    new: NewShots, kind: np.ndarray, scatter: Scatter, draws: int, rng: np.random.Generator
) -> DrawnShots:
    """Draw shots of some kinds, so many times over."""
    count, width = len(kind), new.gram.shape[-1]
    along = np.empty((draws, count, width))
    for number in np.unique(kind):
        those = kind == number
        values, vectors = np.linalg.eigh(new.gram[number])
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        along[:, those] = scatter.noise * rng.standard_normal((draws, int(those.sum()), width)) @ root.T
    changes = np.zeros((draws, count, width))
    changes[..., 0] = scatter.spread * rng.standard_normal((draws, count))
    p = len(scatter.uncertain)
    shift = rng.standard_normal((draws, scatter.uncertain.shape[1])) @ scatter.uncertain.T
    changes[..., scatter.own : scatter.own + p] = shift[:, None, :]
    return DrawnShots(kind, along, changes)
