"""A model on a set of shots as a least-squares problem: bounds, first guess, residuals and derivatives."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from impactcell.discrepancy.data import IndexArray, ShotSet
from impactcell.discrepancy.model.constraints import UNCONSTRAINED, Constraints
from impactcell.discrepancy.model.forward import ForwardModel
from impactcell.discrepancy.model.parameters import (
    Coordinate,
    default_parameters,
    effect_coordinates,
    is_friction_ratio,
    nominal_coordinates,
    parameter_columns,
    plant_parameters,
)
from impactcell.discrepancy.model.reach import shots_reached
from impactcell.discrepancy.model.shot_freedom import LARGEST_LOG_FACTOR, ShotFreedom
from impactcell.discrepancy.model.shot_parameters import ShotParameters
from impactcell.physics import Ensemble, LawKind
from impactcell.physics.effects import find_effect
from impactcell.records import Samples

DIFFERENCE_STEP = 2e-5
"""Step of a finite difference, relative or in a logarithm: far above the integrator's 1e-10, far below the
size at which samples bend."""
SMALLEST_SCALE = 0.1
"""A linear coordinate is stepped as if it were at least this large, in its own scale."""
SMALLEST_SPEED_M_S = 1e-3
"""A speed is stepped as if it were at least this large [m/s]."""
JUMP_FACTOR = 20.0
"""A sample that changes this many times more than its neighbours has been passed by a jump."""
ONSET_STEP_S = 1e-7
"""Step [s] of a finite difference by the moment of first contact: far below a sampling step."""


@dataclass(frozen=True, slots=True, eq=False)
class FitState:
    """Where a fit stands.

    Attributes
    ----------
    theta : ndarray, shape (p,)
        Shared coordinates.
    shot_parameters : ShotParameters
    spread : float
        Standard deviation of the logarithm of the friction factors.
    residual : ndarray, shape (N,)
        Whitened.
    cost : float
        |r|² + sum (log f_i / s)², and what is told alike; infinite where the plant has no answer.
    """

    theta: Samples
    shot_parameters: ShotParameters
    spread: float
    residual: Samples
    cost: float


class Problem:
    """One model on one set of shots; holds no state but those.

    Parameters
    ----------
    shots : ShotSet
    batches : int
        How many batches the whole campaign has.
    effects : tuple of str
        Of the model, beside the nominal plant.
    constraints : Constraints
        What is held, and what is penalised.
    """

    def __init__(
        self,
        shots: ShotSet,
        batches: int,
        effects: tuple[str, ...] = (),
        constraints: Constraints = UNCONSTRAINED,
    ) -> None:
        self._set(ForwardModel(shots, batches), effects, constraints)

    def _set(self, forward: ForwardModel, effects: tuple[str, ...], constraints: Constraints) -> None:
        self.forward = forward
        self.constraints = constraints
        self.shots = shots = forward.shots
        self.batches = forward.batches
        self.effects = effects
        self.count = len(shots)
        self.sizes = np.diff(shots.bounds)
        self.coordinates: tuple[Coordinate, ...] = nominal_coordinates(
            shots.excitation.free_plant_parameters
        ) + constraints.free(
            tuple(coordinate for effect in effects for coordinate in effect_coordinates(effect, self.batches))
        )
        self.penalty_matrix = constraints.penalty(self.coordinates)
        self.freedom = ShotFreedom.of(shots)
        self.onset_step_s = self.freedom.onset_step_s
        self.shot_parameter_names = self.freedom.names

    def with_effects(self, effects: tuple[str, ...]) -> "Problem":
        """Return another model on the same shots."""
        return self if effects == self.effects else self._like(effects, self.constraints)

    def constrained(self, effects: tuple[str, ...], constraints: Constraints) -> "Problem":
        """Return another model on the same shots, told what to hold and what to penalise."""
        return self._like(effects, constraints)

    def with_exact_contact(self) -> "Problem":
        """Return the same model of shots whose first contact is at t = 0."""
        items = tuple(replace(shot, onset_is_open=False) for shot in self.shots.items)
        shots = replace(self.shots, items=items)
        return Problem(shots, self.batches, self.effects, self.constraints)

    def pinned(self, column: int, value: float) -> "Problem":
        """Return the same model with one coordinate where it is put."""
        other = self._like(self.effects, self.constraints)
        coordinates = list(self.coordinates)
        coordinates[column] = replace(coordinates[column], lower=value, upper=value)
        other.coordinates = tuple(coordinates)
        return other

    def _like(self, effects: tuple[str, ...], constraints: Constraints) -> "Problem":
        other = object.__new__(Problem)
        other._set(self.forward, effects, constraints)
        return other

    def select(self, indices: IndexArray) -> "Problem":
        """Return the same model on some of the shots."""
        return Problem(self.shots.select(indices), self.batches, self.effects, self.constraints)

    def bounds(self) -> tuple[Samples, Samples]:
        """Lower and upper end of every coordinate, shape (p,) each."""
        return (
            np.array([coordinate.lower for coordinate in self.coordinates]),
            np.array([coordinate.upper for coordinate in self.coordinates]),
        )

    def initial_guess(self, share: float = 1.0) -> ShotParameters:
        """Where every shot's own numbers start, its state read off the first `share` of its record."""
        excitation, items = self.shots.excitation, self.shots.items
        states = np.array([excitation.initial_state(shot, share) for shot in items])
        speed, shift = states[:, 0].copy(), states[:, 1].copy()
        zeros = np.zeros(self.count)
        onset, velocity, mass = (zeros.copy() for _ in range(3))
        return ShotParameters(zeros, excitation.initial_mass(items), speed, shift, onset, velocity, mass)

    def plant_parameters(self, theta: Samples) -> Samples:
        """Parameter vector of the plant at some coordinates."""
        return plant_parameters(self.coordinates, theta, *self._parameter_layout)

    @cached_property
    def _parameter_layout(self) -> tuple[tuple[int, ...], Samples]:
        """Where the coordinates' parameters lie in the plant's vector, and what is held there."""
        names = self._taps.names
        held = self.constraints.hold(names, default_parameters(names))
        return parameter_columns(self.coordinates, names), held

    @cached_property
    def _taps(self) -> Ensemble:
        """The shots' taps with the model's effects at work."""
        return self.forward.with_effects(self.effects)

    def penalty(self, theta: Samples) -> float:
        """Penalty of a free-form term's roughness, in squared standard deviations."""
        return float(theta @ self.penalty_matrix @ theta)

    def residual(
        self, theta: Samples, shot_parameters: ShotParameters, only: NDArray[np.bool_] | None = None
    ) -> Samples:
        """Whitened residuals, shape (N,), of all shots or some."""
        parameters = self.plant_parameters(theta)
        predicted = self.forward.samples(self._taps, parameters, shot_parameters, only)
        return self.shots.whiten(np.subtract(self.shots.values, predicted, out=predicted))

    def evaluate(self, theta: Samples, shot_parameters: ShotParameters, spread: float) -> FitState:
        """Evaluate a state of a fit."""
        residual = self.residual(theta, shot_parameters)
        return FitState(
            theta, shot_parameters, spread, residual, total_cost(residual, shot_parameters, spread)
        )

    def linearise(self, state: FitState) -> tuple[Samples, Samples]:
        """Differentiate the whitened prediction: shared coordinates, shape (p, N), and shots' own, (q, N)."""
        of_shots = self.shot_jacobian(state)
        return self.shared_jacobian(state, of_shots[0]), of_shots

    def shared_jacobian(self, state: FitState, by_factor: Samples | None = None) -> Samples:
        """Differentiate the whitened prediction by the shared coordinates, shape (p, N).

        Where `by_factor`, the derivative by the friction factors' logarithms, is at hand, and those multiply
        all friction there is, it is that by the logarithm of mu_k as well.
        """
        jacobian = np.empty((len(self.coordinates), state.residual.size))
        reached = shots_reached(self.shots, self.constraints, self.coordinates, state.residual)
        for column, coordinate in enumerate(self.coordinates):
            if by_factor is not None and self._is_common_factor(coordinate, state):
                jacobian[column] = by_factor
            else:
                only = None if reached is None else reached[column]
                jacobian[column] = self.shared_derivative(state, column, only)
        return jacobian

    def shared_derivative(
        self, state: FitState, column: int, only: NDArray[np.bool_] | None = None
    ) -> Samples:
        """Differentiate the whitened prediction of all shots or some, shape (N,), by a shared coordinate."""
        coordinate, step = self.coordinates[column], DIFFERENCE_STEP
        if coordinate.form != "log":
            step *= max(abs(state.theta[column]), SMALLEST_SCALE)
        if state.theta[column] + step > coordinate.upper:
            step = -step
        moved = state.theta.copy()
        moved[column] += step
        change = state.residual - self.residual(moved, state.shot_parameters, only)
        if only is not None:
            change[~np.repeat(only, self.sizes)] = 0.0
        derivative: Samples = remove_jumps(change) / step
        return derivative

    def _is_common_factor(self, coordinate: Coordinate, state: FitState) -> bool:
        """Whether a step of this coordinate is the same step of every shot's friction factor."""
        return (
            coordinate.parameter == "mu_k"
            and not coordinate.effect
            and any(map(is_friction_ratio, self.coordinates))
            and not any(LawKind.KINETIC in find_effect(effect).laws for effect in self.effects)
            and float(np.abs(state.shot_parameters.log_factor).max()) < LARGEST_LOG_FACTOR - DIFFERENCE_STEP
        )

    def shot_jacobian(self, state: FitState, *, central: bool = False) -> Samples:
        """Differentiate the whitened prediction by each shot's own numbers, shape (q, N)."""
        jacobian = np.empty((len(self.shot_parameter_names), state.residual.size))
        speed = state.shot_parameters.speed_m_s
        for column, name in enumerate(self.shot_parameter_names):
            if name == "shift_m":
                jacobian[column] = self.shots.whiten((self.shots.channel == 1).astype(np.float64))
                continue
            steps = np.zeros((self.count, len(self.shot_parameter_names)))
            size = DIFFERENCE_STEP
            if name == "speed_m_s":
                size *= max(float(np.abs(speed).max()), SMALLEST_SPEED_M_S)
            elif name == "onset_s":
                size = ONSET_STEP_S
            # A part that starts at rest stays there until it breaks away: its speed is no free number.
            steps[:, column] = size if name != "speed_m_s" else size * (speed != 0.0)
            if name == "onset_s":  # towards the middle of its range
                steps[:, column] *= np.where(state.shot_parameters.onset_s > 0.0, -1.0, 1.0)
            ahead = self.residual(state.theta, self.freedom.step(state.shot_parameters, steps))
            if name == "onset_s":
                change = remove_jumps(state.residual - ahead)
                jacobian[column] = change / np.repeat(steps[:, column], self.sizes)
            elif central:
                back = self.residual(state.theta, self.freedom.step(state.shot_parameters, -steps))
                jacobian[column] = remove_jumps(back - ahead) / (2.0 * size)
            else:
                jacobian[column] = remove_jumps(state.residual - ahead) / size
        return jacobian


def total_cost(residual: Samples, shot_parameters: ShotParameters, spread: float) -> float:
    """Sum the squared misfit and what shots have of their own over its spread; infinite without an answer."""
    misfit = float(np.einsum("i,i->", residual, residual))
    cost = misfit + float(np.sum(shot_parameters.cost(spread)))
    return cost if math.isfinite(cost) else math.inf


def remove_jumps(change: Samples) -> Samples:
    """Take out, in place, single samples in which a tiny step of a parameter changed the prediction a lot.

    The contact force jumps to b v when the contact closes. A sample that the jump passes during the step says
    nothing about the slope, but divided by the step it would outweigh all others. Nor does one that is not
    finite: there the step came to where the plant has no answer.
    """
    size = np.abs(change)
    largest = float(size.max(initial=0.0))
    if largest <= 1.0:
        return change
    if not math.isfinite(largest):
        change[~np.isfinite(size)] = 0.0
        size = np.abs(change)
    beside = np.maximum(size[:-2], size[2:])
    change[1:-1][size[1:-1] > JUMP_FACTOR * beside + 1.0] = 0.0
    return change
