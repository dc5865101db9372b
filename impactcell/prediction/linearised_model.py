"""What the model says a capture should be: blocks of force and position for given parameters, and residuals.

theta = ln(mu_k, mu_k / mu_s, k, b), with stiffness k [N/m] and damping b [N s/m] of the contact. Steps in it
are relative, whatever the units. Of a tap that was measured, theta has what nobody knows exactly as well, in
standard deviations from what is known of it: the moment of first contact, ln m, ln v and the logarithms of
the scales of force and position. z (`kink_coordinate`) says whether the part sticks before it moves; at z = 0
(the kink) the response to theta has a bend.
"""

import math
from copy import copy
from dataclasses import replace

import numpy as np

from impactcell.errors import PhysicsError
from impactcell.physics import Ensemble, Plant, TapInput
from impactcell.prediction.block_averaging import BlockMeans
from impactcell.prediction.block_residuals import Linearisation, add_bends, linearise_blocks, sample_squares
from impactcell.prediction.whitened_blocks import WhitenedBlocks
from impactcell.records import Samples

MU_K, RATIO, STIFFNESS, DAMPING, ONSET, MASS, VELOCITY, FORCE_SCALE, POSITION_SCALE = range(9)
"""Places in theta."""
PARAMETERS, WITH_RECORDER = 4, 9
"""Length of theta without what nobody knows of a record exactly, and with it."""
RecorderStd = tuple[float, float, float, float, float]
"""Standard deviations of first contact [s], and relative ones of mass, velocity and the scales of force and
position."""
EXACT: RecorderStd = (0.0, 0.0, 0.0, 0.0, 0.0)
"""Of a record that tells all of these."""
JUST_STICKING = 1e-7
"""z above which the model is that of a part that sticks first (see above)."""
STEP_SENSES = np.array([1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
"""Senses of small steps in theta that do not make a part slip that sticks."""
RELATIVE_STEP = 1e-5
"""Step of a difference in theta: small against the noise, large against rounding. Our choice."""
RECORDER_STEP = 1e-3
"""The same of what is known of a record only so well, in its standard deviations. Our choice."""
LATEST_ONSET = 2.0
"""How far from t = 0 first contact may lie, in its standard deviations: a sampling step."""
FARTHEST = np.array([LATEST_ONSET, 10.0, 10.0, 10.0, 10.0])
"""How far what is known of a record only so well may lie from that, in standard deviations."""
STEPS_OUT = STEP_SENSES * np.repeat([RELATIVE_STEP, RECORDER_STEP], [PARAMETERS, WITH_RECORDER - PARAMETERS])
STEPS = np.vstack([np.zeros(WITH_RECORDER), np.diag(STEPS_OUT)])
"""Of theta, in each of the copies of a tap, shape (10, 9); the last two are integrated with the first."""


def parameter_count(recorder_std: RecorderStd) -> int:
    """Length of theta: of a tap of which all is known exactly, or of one that was measured."""
    return WITH_RECORDER if any(recorder_std) else PARAMETERS


def with_parameters(plant: Plant, theta: Samples) -> Plant:
    """Give a plant the parameters `theta`, shape (p,)."""
    mu_k, ratio, stiffness, damping = np.exp(theta[:PARAMETERS]).tolist()
    return replace(
        plant, stiffness_n_per_m=stiffness, damping_n_s_per_m=damping, mu_s=mu_k / ratio, mu_k=mu_k
    )


def parameters_of(plant: Plant) -> Samples:
    """Nominal parameters of a plant, shape (4,)."""
    return np.log(
        [plant.mu_k, plant.mu_k / plant.mu_s, plant.stiffness_n_per_m, max(plant.damping_n_s_per_m, 1e-6)]
    )


class LinearisedModel:
    """A capture in blocks, and the model that should reproduce them.

    Parameters
    ----------
    plant : Plant
        Its effects and gravity are kept; its four nominal parameters are those asked for.
    tap : TapInput
    force, position : BlockMeans
    recorder_std : RecorderStd
        If one of these is above 0, what they are of is fitted.
    zero_std : tuple of float
        Standard deviations of the zeros of force [N] and position [m], where they were taken from the record.

    Attributes
    ----------
    plant : Plant
    parameters : int
        Length p of theta.
    kink_form : ndarray, shape (p,)
        How z follows theta.
    """

    def __init__(
        self,
        plant: Plant,
        tap: TapInput,
        force: BlockMeans,
        position: BlockMeans,
        recorder_std: RecorderStd = EXACT,
        zero_std: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.plant, self.tap = plant, tap
        self.recorder_std = np.array(recorder_std)
        self.parameters = parameter_count(recorder_std)
        _, mass_std, velocity_std, *_ = recorder_std
        kink_form = np.array([1.0, -1.0, 0.0, -1.0, 0.0, mass_std, -velocity_std, 0.0, 0.0])
        self.kink_form = kink_form[: self.parameters]
        self.force_time_s, self.position_time_s = force.time_s, position.time_s
        self.size = len(force.values) + len(position.values)
        self._block_weights = 1.0 / np.concatenate([force.std, position.std])
        self._whitened = WhitenedBlocks(force, position)
        self._values = self._whitened.innovations(np.concatenate([force.values, position.values]))
        self._weights = 1.0 / self._whitened.std
        self._weight_n = tap.mass_kg * plant.gravity_m_s2
        copies = min(self.parameters + 1, FORCE_SCALE + 1)
        self._ensemble = Ensemble(
            [tap] * copies,
            tuple(plant.effects),
            force_time_s=[force.time_s] * copies,
            position_time_s=[position.time_s] * copies,
            gravity_m_s2=plant.gravity_m_s2,
        )
        self._scatters = force.scatter, position.scatter
        self._spreads = force.scatter.spread, position.scatter.spread
        is_force = np.arange(self.size) < len(force.values)
        zeros = np.array([is_force * zero_std[0], ~is_force * zero_std[1]])
        self._disturbances = self._whitened.innovations(zeros[np.array(zero_std) > 0.0])
        self._table = np.tile(self._ensemble.parameters(plant), (copies, 1))

    def reweighted(self, factor: Samples) -> "LinearisedModel":
        """Give the same blocks and model with the standard deviation of each block multiplied, shape (n,)."""
        other = copy(self)
        other._weights = self._weights / factor  # noqa: SLF001  # its own copy
        other._block_weights = self._block_weights / factor  # noqa: SLF001
        return other

    def disturbed_by(self, shape: Samples) -> "LinearisedModel":
        """Give the same blocks and model with one more disturbance of the record, eliminated from the fit.

        `shape`, (n,), is what one standard deviation of it adds to the blocks, in N and m.
        """
        other = copy(self)
        shape = self._whitened.innovations(shape)
        other._disturbances = np.vstack([self._disturbances, shape])  # noqa: SLF001  # its own copy
        return other

    def size_of(self, shape: Samples, residual: Samples) -> float:
        """Size of a disturbance of this shape, in its standard deviations, in a fit that has it.

        With U its weighted shapes and S = U U' + 1 what is left of residuals r is r' = r - U' S^-1 U r, so
        that U r' = S^-1 U r: the sizes that were eliminated.
        """
        return float((self._whitened.innovations(shape) * self._weights) @ residual)

    def with_effects_of(self, plant: Plant) -> "LinearisedModel":
        """Give the same blocks and what a plant with other effects makes of them."""
        other = copy(self)
        other.plant, other._ensemble = plant, self._ensemble.with_effects(tuple(plant.effects))  # noqa: SLF001
        other._table = np.tile(other._ensemble.parameters(plant), (len(self._table), 1))  # noqa: SLF001
        return other

    def products_with(self, shapes: Samples, fitted: Linearisation) -> tuple[Samples, Samples, Samples]:
        """Products of disturbances that are not in a fit: with its residuals, its derivative, each other.

        Parameters
        ----------
        shapes : ndarray, shape (d, n)
            As for `disturbed_by`.

        Returns
        -------
        ndarray, shape (d,); ndarray, shape (d, p); ndarray, shape (d, d)
            All of what is left once the disturbances that are in the fit have been eliminated.
        """
        shapes = left = self._whitened.innovations(shapes) * self._weights
        if len(self._disturbances):
            known = self._disturbances * self._weights
            left = shapes - shapes @ known.T @ np.linalg.solve(known @ known.T + np.eye(len(known)), known)
        split, copies = len(self.force_time_s), self.parameters + 1
        force, position = self._whitened.of_traces(*fitted.traces)
        scaled = left * self._weights
        with_traces = scaled[:, :split] @ force.reshape(copies, split).T
        with_traces += scaled[:, split:] @ position.reshape(copies, self.size - split).T
        with_derivative = (with_traces[:, :1] - with_traces[:, 1:]) / STEPS_OUT[: self.parameters]
        return shapes @ fitted.residual, with_derivative, left @ shapes.T

    def modelled(self, residual: Samples) -> tuple[Samples, Samples]:
        """Give the blocks of force [N] and position [m] that leave a residual."""
        model = self._whitened.restored(self._values - residual / self._weights)
        return model[: len(self.force_time_s)], model[len(self.force_time_s) :]

    def curves(self, fitted: Linearisation) -> tuple[Samples, Samples]:
        """Give the blocks of force [N] and position [m] of the model where it was linearised."""
        force, position = fitted.traces
        return force[: len(self.force_time_s)], position[: len(self.position_time_s)]

    def gap(self, residual: Samples) -> float:
        """RMS of the residuals of single samples over the noise of their sensor, from those of the blocks.

        Within a block the model is taken as straight, which it is to a hundredth of the noise; blocks about a
        jump, whose means say nothing, are left out.
        """
        model = np.concatenate(self.modelled(residual))
        split = len(self.force_time_s)
        total = count = 0.0
        for times, scatter, part in (
            (self.force_time_s, self._scatters[0], slice(None, split)),
            (self.position_time_s, self._scatters[1], slice(split, None)),
        ):
            if len(times) > 2:
                sums = scatter.count, scatter.times, scatter.values, scatter.both, scatter.noise_std
                squares, counted = sample_squares(
                    times, model[part], residual[part], self._block_weights[part], sums
                )
                total += squares
                count += counted
        return math.sqrt(total / count)

    @property
    def onset_std_s(self) -> float:
        """Standard deviation of the moment of first contact [s]."""
        return float(self.recorder_std[0])

    def kink_coordinate(self, theta: Samples) -> float:
        """Give z = ln(mu_s m g / (b v)); positive if static friction bears the first contact force."""
        return float(self.kink_form @ theta) + math.log(self._weight_n / self.tap.velocity_m_s)

    @np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite is raised
    def linearise(self, theta: Samples, side: int = 0, beyond: float = 0.0) -> Linearisation:
        """Residuals and their normal equations at `theta`.

        The derivative is that of a step which leads away from the kink into the side that sticks.

        Parameters
        ----------
        theta : ndarray, shape (p,)
        side : int
            -1: as if breakaway were immediate, whatever mu_s. 0 or +1: as the parameters say.
        beyond : float
            How far ln(mu_k/mu_s) is to lie beyond `theta`: the residuals are continued linearly.

        Raises
        ------
        PhysicsError
            The motion is not finite with these parameters.
        """
        steps = STEPS_OUT[: self.parameters]
        force, position = self._traces(theta, side)
        disturbances = self._disturbances * self._weights
        fields = linearise_blocks(
            *self._whitened.of_traces(force, position), self._values, self._weights, steps,
            (RATIO, beyond), disturbances,
        )  # fmt: skip
        if not math.isfinite(fields[3]):
            raise PhysicsError("the motion is not finite with these parameters")
        return Linearisation(*fields, traces=(force, position))

    def _traces(self, theta: Samples, side: int) -> tuple[Samples, Samples]:
        """Integrate the motion at `theta` and beside it."""
        count = self.parameters
        moved = theta + STEPS[: len(self._table), :count]
        rows = np.exp(moved[:, :PARAMETERS])
        mu_k, damping = rows[:, MU_K], rows[:, DAMPING]
        mu_s = mu_k / rows[:, RATIO]
        mass_kg = velocity_m_s = onset_s = None
        slipping = damping * (self.tap.velocity_m_s / self._weight_n)
        if count > PARAMETERS:
            onset_s, log_mass, log_velocity, *_ = (moved[:, PARAMETERS:] * self.recorder_std).T
            mass_kg = self.tap.mass_kg * np.exp(log_mass)
            velocity_m_s = self.tap.velocity_m_s * np.exp(log_velocity)
            slipping = slipping * np.exp(log_velocity - log_mass)
        if side < 0:
            mu_s = np.minimum(mu_s, slipping * (1.0 - 1e-7))
        table = self._table.copy()
        table[:, 0], table[:, 1], table[:, 2], table[:, 3] = rows[:, STIFFNESS], damping, mu_s, mu_k
        traces = self._ensemble.traces(table, mass_kg=mass_kg, velocity_m_s=velocity_m_s, onset_s=onset_s)
        add_bends(traces.force_n, self.force_time_s, self._spreads[0])
        add_bends(traces.position_m, self.position_time_s, self._spreads[1])
        if count == PARAMETERS:
            return traces.force_n, traces.position_m
        return self._with_scales(traces.force_n, traces.position_m, theta[FORCE_SCALE:])

    def _with_scales(self, force: Samples, position: Samples, in_stds: Samples) -> tuple[Samples, Samples]:
        """Scale force and position of all copies, and add the copies in which either scale is stepped."""
        stds = self.recorder_std[FORCE_SCALE - PARAMETERS :]
        scales, steps = np.exp(stds * in_stds).tolist(), np.exp(stds * RECORDER_STEP).tolist()
        first, place = force[: len(self.force_time_s)], position[: len(self.position_time_s)]
        force = np.concatenate([force, steps[0] * first, first])
        position = np.concatenate([position, place, steps[1] * place])
        force *= scales[0]
        position *= scales[1]
        return force, position
