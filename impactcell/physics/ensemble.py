"""Many taps at once: arrays of parameters in, samples and outputs out, without objects for each tap."""

import copy
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from impactcell.errors import PhysicsError
from impactcell.numerics.jit import IntArray
from impactcell.physics import memory_layout as at
from impactcell.physics.batch_integration import (
    MAX_DURATION_S,
    NO_SAMPLES,
    integrate_to_rest,
    sample_taps,
    undriven,
)
from impactcell.physics.law_table import build_law_table, parameter_range, parameter_vector, tap_columns
from impactcell.physics.memory_layout import TapArrays
from impactcell.physics.motion import TapOutputs, Traces
from impactcell.physics.plant import Plant, TapInput
from impactcell.physics.sample_layout import lay_out_samples
from impactcell.records import Samples


class Ensemble:
    """A set of taps with fixed sample times, to be integrated for many parameter vectors.

    Parameters
    ----------
    taps : sequence of TapInput
        n taps.
    effects : sequence of str
        Identifiers of the effects at work; their parameters join the parameter vector.
    force_time_s, position_time_s, actuator_time_s, velocity_time_s : sequence of ndarray, optional
        For each channel the ascending sample times of each tap, n arrays (of any lengths, empty allowed).
    gravity_m_s2 : float
    initial_speed_m_s : ndarray of shape (n,), optional
        Free slides: no contact, the part slides from t = 0 with this speed along the shot's direction.
    batches : int, optional
        How many batches there are, should the taps show fewer.
    by_tap : bool
        Samples lie tap after tap, in a tap channel after channel, instead of the other way round.
    drives : sequence of (time_s, force_n), optional
        Driven parts: no contact but a measured force along +1, linear between its ascending times; the part
        begins at the first of them with `initial_speed_m_s`, at rest where that is not given.

    Attributes
    ----------
    names : tuple of str
        What a parameter vector holds: "stiffness_n_per_m", "damping_n_s_per_m", "mu_s", "mu_k", then
        "effect.parameter" ("effect.parameter[1]", ... where there is one for each batch after the first).

    Raises
    ------
    PhysicsError
        For effects the library does not have, or sample times that do not ascend.
    """

    def __init__(
        self,
        taps: Sequence[TapInput],
        effects: Sequence[str] = (),
        *,
        force_time_s: Sequence[Samples] | None = None,
        position_time_s: Sequence[Samples] | None = None,
        actuator_time_s: Sequence[Samples] | None = None,
        velocity_time_s: Sequence[Samples] | None = None,
        gravity_m_s2: float = 9.81,
        initial_speed_m_s: Samples | None = None,
        drives: Sequence[tuple[Samples, Samples]] | None = None,
        batches: int | None = None,
        by_tap: bool = False,
    ) -> None:
        self._columns = tap_columns(taps)
        if initial_speed_m_s is not None:
            self._columns["initial_speed_m_s"] = np.asarray(initial_speed_m_s, dtype=np.float64)
        self.batches = batches or 1 + max((tap.batch for tap in taps), default=0)
        self._table = build_law_table(tuple(effects), self.batches)
        self.names = self._table.names
        self.gravity_m_s2 = gravity_m_s2
        self._count = len(taps)
        times_by_channel = (force_time_s, position_time_s, actuator_time_s, velocity_time_s)
        layout = lay_out_samples(times_by_channel, len(taps), by_tap=by_tap)
        self._times, self._sample_index, self._channels = layout
        self._drives, self._drive_ends = NO_SAMPLES, np.zeros(len(taps) + 1, dtype=np.int64)
        if drives is not None:
            self._set_drives(drives, given_speed=initial_speed_m_s is not None)

    def _set_drives(self, drives: Sequence[tuple[Samples, Samples]], *, given_speed: bool) -> None:
        for i, (time_s, force_n) in enumerate(drives):
            if len(time_s) < 2 or len(time_s) != len(force_n) or not (np.diff(time_s) > 0.0).all():
                raise PhysicsError(f"drive {i}: needs two samples or more, at ascending times")
            self._drive_ends[i + 1] = self._drive_ends[i] + 2 * len(time_s)
        self._drives = np.concatenate([np.concatenate(drive).astype(np.float64) for drive in drives])
        if not given_speed:
            self._columns["initial_speed_m_s"] = np.zeros(self._count)

    @property
    def velocity_m_s(self) -> Samples:
        """Velocity of every tap, shape (n,)."""
        return self._columns["velocity_m_s"]

    def with_effects(self, effects: Sequence[str]) -> "Ensemble":
        """Return the same taps and samples with other effects at work."""
        other = copy.copy(self)
        table = build_law_table(tuple(effects), self.batches)
        other._table, other.names = table, table.names  # noqa: SLF001 - of the same class
        return other

    def parameters(self, plant: Plant) -> Samples:
        """Give the parameter vector of `plant`, shape (len(names),).

        Raises
        ------
        PhysicsError
            The plant has effects that the ensemble was made without.
        """
        unknown = set(plant.effects) - {effect.identifier for effect in self._table.effects}
        if unknown:
            raise PhysicsError(f"the ensemble was made without {', '.join(sorted(unknown))}")
        return parameter_vector(plant, self._table, self.batches)

    def _tap_parameters(
        self,
        values: Samples,
        friction_factor: Samples | float,
        mass_kg: Samples | None,
        initial_speed_m_s: Samples | None,
        velocity_m_s: Samples | None = None,
    ) -> Samples:
        taps = self._columns
        if mass_kg is not None:
            taps = {**taps, "mass_kg": mass_kg}
        if velocity_m_s is not None:
            taps = {**taps, "velocity_m_s": velocity_m_s}
        if initial_speed_m_s is not None:
            taps = {**taps, "initial_speed_m_s": initial_speed_m_s}
        rows, shape = np.asarray(values, np.float64), (self._count, len(self.names))
        if rows.shape != shape:
            rows = np.broadcast_to(rows, shape)
        parameters = self._table.tap_parameters(rows, self.gravity_m_s2, taps)
        parameters[:, at.MU_S] *= friction_factor
        parameters[:, at.MU_K] *= friction_factor
        return parameters

    def traces(
        self,
        values: Samples,
        friction_factor: Samples | float = 1.0,
        *,
        mass_kg: Samples | None = None,
        velocity_m_s: Samples | None = None,
        initial_speed_m_s: Samples | None = None,
        onset_s: Samples | None = None,
    ) -> Traces:
        """Integrate every tap and sample it at the ensemble's times.

        Parameters
        ----------
        values : ndarray
            Shape (len(names),), or (n, len(names)) for a vector a tap. No ranges are checked.
        friction_factor : float or ndarray of shape (n,)
            Multiplies mu_s and mu_k of each shot.
        mass_kg, velocity_m_s, initial_speed_m_s : ndarray of shape (n,), optional
            Instead of the taps' own.
        onset_s : ndarray of shape (n,), optional
            When first contact was, as for `samples`.
        """
        parameters = self._tap_parameters(values, friction_factor, mass_kg, initial_speed_m_s, velocity_m_s)
        out = self._sample(parameters, onset_s)
        return self._split(out)

    def samples(
        self,
        values: Samples,
        friction_factor: Samples | float = 1.0,
        *,
        mass_kg: Samples | None = None,
        velocity_m_s: Samples | None = None,
        initial_speed_m_s: Samples | None = None,
        onset_s: Samples | None = None,
        only: NDArray[np.bool_] | None = None,
    ) -> Samples:
        """Return the samples of `traces` in one row, all taps and channels end to end.

        `onset_s`, shape (n,): when first contact was, by the clock of the sample times; 0 unless given. No
        sample may lie before it. `only`, shape (n,): taps to integrate, where nothing drives them; samples of
        the others are 0.
        """
        parameters = self._tap_parameters(values, friction_factor, mass_kg, initial_speed_m_s, velocity_m_s)
        return self._sample(parameters, onset_s, only)

    def _sample(
        self, parameters: Samples, onset_s: Samples | None = None, only: NDArray[np.bool_] | None = None
    ) -> Samples:
        times = self._times if onset_s is None else self._times - self._each_sample(onset_s)
        if only is None or self._drives.size:
            taps = TapArrays(parameters, self._table.laws, self._drives, self._drive_ends)
            return sample_taps(taps, self._sample_index, times)
        return sample_taps(undriven(parameters[only], self._table.laws), self._sample_index[only], times)

    def _split(self, out: Samples) -> Traces:
        force, position, actuator, velocity = (out[..., channel] for channel in self._channels)
        return Traces(force, position, actuator, velocity)

    def sensitivities(
        self,
        values: Samples,
        wrt: Sequence[str],
        friction_factor: Samples | float = 1.0,
        *,
        mass_kg: Samples | None = None,
        initial_speed_m_s: Samples | None = None,
        relative_step: float = 1e-5,
    ) -> Traces:
        """Differentiate the samples with respect to the parameters named; shape (len(wrt), samples).

        "friction_factor" and "initial_speed_m_s" are also possible: each shot's own samples with respect
        to its own value. Central differences; one-sided where a step would leave the parameter's range.
        """
        table = np.array(np.broadcast_to(np.asarray(values, np.float64), (self._count, len(self.names))))
        derivatives = np.empty((len(wrt), self._times.size))
        for q, name in enumerate(wrt):
            ends: list[Samples] = []
            if name in {"friction_factor", "initial_speed_m_s"}:
                speed = self._columns["initial_speed_m_s"] if initial_speed_m_s is None else initial_speed_m_s
                steps = [relative_step, -relative_step]
                for step in steps:
                    factor, moved = friction_factor, speed
                    if name == "friction_factor":
                        factor = friction_factor * (1.0 + step)
                    else:
                        moved = speed * (1.0 + step)
                    ends.append(self._sample(self._tap_parameters(table, factor, mass_kg, moved)))
                base = friction_factor if name == "friction_factor" else speed
                width = 2.0 * relative_step * np.broadcast_to(np.asarray(base, np.float64), self._count)
                derivatives[q] = (ends[0] - ends[1]) / self._each_sample(width)
                continue
            column = self.names.index(name)
            lower, upper, typical = parameter_range(name)
            step = relative_step * max(float(np.max(np.abs(table[:, column]))), 0.1 * typical)
            above = step if np.all(table[:, column] + step <= upper) else 0.0
            below = step if np.all(table[:, column] - step >= lower) else 0.0
            for change in (above, -below):
                moved_table = table.copy()
                moved_table[:, column] += change
                ends.append(
                    self._sample(
                        self._tap_parameters(moved_table, friction_factor, mass_kg, initial_speed_m_s)
                    )
                )
            derivatives[q] = (ends[0] - ends[1]) / (above + below)
        return self._split(derivatives)

    def _each_sample(self, values: Samples) -> Samples:
        by_sample: Samples = values[self._owner]
        return by_sample

    @cached_property
    def _owner(self) -> IntArray:
        """Tap of each sample."""
        owner = np.empty(self._times.size, dtype=np.int64)
        for i, row in enumerate(self._sample_index.tolist()):
            for channel in range(at.CHANNEL_COUNT):
                owner[row[channel] : row[at.CHANNEL_COUNT + channel]] = i
        return owner

    def outputs(
        self,
        values: Samples,
        friction_factor: Samples | float = 1.0,
        *,
        mass_kg: Samples | None = None,
        horizon_s: float = MAX_DURATION_S,
    ) -> TapOutputs:
        """Peak force, displacement, sliding distance and times of events, without any samples."""
        parameters = self._tap_parameters(values, friction_factor, mass_kg, None)
        outputs = integrate_to_rest(undriven(parameters, self._table.laws), horizon_s)
        return TapOutputs(
            peak_force_n=outputs[:, at.PEAK_FORCE],
            displacement_m=outputs[:, at.DISPLACEMENT],
            sliding_distance_m=outputs[:, at.DISTANCE],
            breakaway_s=outputs[:, at.BREAKAWAY_TIME],
            separation_s=outputs[:, at.SEPARATION_TIME],
            stop_s=outputs[:, at.STOP_TIME],
            at_rest=outputs[:, at.STATUS] == at.AT_REST,
        )
