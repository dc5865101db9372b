"""Predictions of the plant for a whole set of shots, in the layout of `ShotSet`."""

import math
from dataclasses import dataclass, fields

import numpy as np

from impactcell.discrepancy.data.phases import Trajectory
from impactcell.discrepancy.data.shots import IndexArray, ShotSet
from impactcell.numerics.jit import IntArray
from impactcell.physics import TapInput
from impactcell.physics import memory_layout as at
from impactcell.physics.batch_integration import sample_taps
from impactcell.physics.law_table import build_law_table, tap_columns
from impactcell.physics.memory_layout import TapArrays
from impactcell.records import Samples

LONGEST_S = 60.0
"""Time [s] after which a part that still moves is given up."""


@dataclass(frozen=True, slots=True, eq=False)
class ShotParameters:
    """What every shot has of its own, each of shape (n,).

    Attributes
    ----------
    log_factor : ndarray
        Logarithm of the shot's friction factor.
    mass_kg : ndarray
    speed_m_s : ndarray
        Initial speed; nan where an actuator strikes.
    shift_m : ndarray
        Added to the positions: error of the first sample, which a free slide counts from.
    """

    log_factor: Samples
    mass_kg: Samples
    speed_m_s: Samples
    shift_m: Samples

    def select(self, places: IndexArray) -> "ShotParameters":
        """Return the numbers of some of the shots."""
        return ShotParameters(*(getattr(self, item.name)[places] for item in fields(self)))

    def put(self, places: IndexArray, replacement: "ShotParameters") -> "ShotParameters":
        """Return the same numbers but for those of some shots, which are taken from `replacement`."""
        values_by_name = {item.name: getattr(self, item.name).copy() for item in fields(self)}
        for name, values in values_by_name.items():
            values[places] = getattr(replacement, name)
        return ShotParameters(**values_by_name)


class ForwardModel:
    """The plant's answers for one set of shots.

    Parameters
    ----------
    shots : Shots
    batches : int
        How many batches the whole campaign has; a part of it may show fewer.
    """

    def __init__(self, shots: ShotSet, batches: int) -> None:
        self.shots = shots
        taps = [
            TapInput(
                velocity_m_s=shot.velocity_m_s if shots.excitation.has_contact else 1.0,
                mass_kg=shot.mass_kg if math.isfinite(shot.mass_kg) else 1.0,
                stroke_m=shots.stroke_m,
                direction=shot.direction,
                start_m=shot.start_m,
                dwell_s=shot.dwell_s,
                shot=shot.place,
                shots=shot.shots,
                batch=shot.batch,
            )
            for shot in shots.items
        ]
        self._columns = tap_columns(taps)
        self.batches = batches
        self._times = shots.times
        self._sample_index = np.zeros((len(taps), at.SAMPLE_INDEX_COUNT), dtype=np.int64)
        for i, shot in enumerate(shots.items):
            place = int(shots.bounds[i])
            for channel in range(3):
                self._sample_index[i, channel] = place
                place += len(shot.times[channel])
                self._sample_index[i, at.CHANNEL_COUNT + channel] = place
        drives = [np.concatenate(shot.drive) for shot in shots.items]
        self._drive = np.concatenate(drives)
        self._drive_bounds = np.concatenate([[0], np.cumsum([len(one) for one in drives])]).astype(np.int64)

    def names(self, effects: tuple[str, ...]) -> tuple[str, ...]:
        """Parameters of a row: nominal four, then those of the effects."""
        return build_law_table(effects, self.batches).names

    def rows(self, effects: tuple[str, ...], parameters: Samples, shot_parameters: ShotParameters) -> Samples:
        """Rows for the integrator; `parameters` has shape (P,) or (n, P)."""
        taps = self._columns | {
            "mass_kg": shot_parameters.mass_kg,
            "initial_speed_m_s": shot_parameters.speed_m_s,
        }
        table = np.broadcast_to(parameters, (len(self.shots), parameters.shape[-1]))
        rows = build_law_table(effects, self.batches).tap_parameters(table, self.shots.gravity_m_s2, taps)
        factor = np.exp(shot_parameters.log_factor)
        rows[:, at.MU_S] *= factor
        rows[:, at.MU_K] *= factor
        return rows

    def _taps(
        self, effects: tuple[str, ...], parameters: Samples, shot_parameters: ShotParameters
    ) -> TapArrays:
        rows = self.rows(effects, parameters, shot_parameters)
        laws = build_law_table(effects, self.batches).laws
        return TapArrays(rows, laws, self._drive, self._drive_bounds)

    def samples(
        self, effects: tuple[str, ...], parameters: Samples, shot_parameters: ShotParameters
    ) -> Samples:
        """Predicted samples, shape (N,); not finite where the plant has no answer."""
        out = sample_taps(
            self._taps(effects, parameters, shot_parameters), self._sample_index, self._times, LONGEST_S
        )
        if shot_parameters.shift_m.any():
            out += np.repeat(shot_parameters.shift_m, np.diff(self.shots.bounds))
        return out

    def trajectory(
        self, effects: tuple[str, ...], parameters: Samples, shot_parameters: ShotParameters
    ) -> Trajectory:
        """Follow what the part does at every sample's time, whatever channel the sample belongs to."""
        order = _time_order(self.shots, self._times)
        times = self._times[order]
        states = np.empty((3, times.size))
        taps = self._taps(effects, parameters, shot_parameters)
        for k, channel in enumerate((at.POSITION, at.PART_VELOCITY, at.ACTUATOR)):
            sample_index = np.zeros_like(self._sample_index)
            sample_index[:, channel] = self.shots.bounds[:-1]
            sample_index[:, at.CHANNEL_COUNT + channel] = self.shots.bounds[1:]
            states[k] = sample_taps(taps, sample_index, times, LONGEST_S)
        back = np.empty_like(order)
        back[order] = np.arange(order.size)
        sign = np.repeat(self._columns["direction"], np.diff(self.shots.bounds))
        return Trajectory(*(sign * states[k][back] for k in range(3)))


def _time_order(shots: ShotSet, times: Samples) -> IntArray:
    """Order that sorts the samples of every shot by time."""
    owner = np.repeat(np.arange(len(shots)), np.diff(shots.bounds))
    order: IntArray = np.lexsort((times, owner)).astype(np.int64)
    return order
