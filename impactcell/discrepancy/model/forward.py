"""Predictions of the plant for a whole set of shots, in the layout of `ShotSet`."""

import math

import numpy as np
from numpy.typing import NDArray

from impactcell.discrepancy.data import IndexArray, ShotSet, Trajectory
from impactcell.discrepancy.model.shot_parameters import ShotParameters
from impactcell.physics import Ensemble, TapInput
from impactcell.records import Samples


class ForwardModel:
    """The plant's answers for one set of shots.

    Parameters
    ----------
    shots : ShotSet
    batches : int
        How many batches the whole campaign has; a part of it may show fewer.
    """

    def __init__(self, shots: ShotSet, batches: int) -> None:
        self.shots = shots
        self.batches = batches
        force, position, actuator = zip(*(shot.times for shot in shots.items), strict=True)
        self._ensemble = Ensemble(
            self._taps(),
            force_time_s=force,
            position_time_s=position,
            actuator_time_s=actuator,
            gravity_m_s2=shots.gravity_m_s2,
            drives=self._drives(),
            batches=batches,
            by_tap=True,
        )

    def _taps(self) -> list[TapInput]:
        has_contact = self.shots.excitation.has_contact
        return [
            TapInput(
                velocity_m_s=shot.velocity_m_s if has_contact else 1.0,
                mass_kg=shot.mass_kg if math.isfinite(shot.mass_kg) else 1.0,
                stroke_m=self.shots.stroke_m,
                direction=shot.direction,
                halts_at_separation=has_contact and math.isinf(self.shots.stroke_m),
                start_m=shot.start_m,
                dwell_s=shot.dwell_s,
                shot=shot.record,
                shots=shot.records,
                batch=shot.batch,
                columns=shot.columns,
            )
            for shot in self.shots.items
        ]

    def _drives(self) -> list[tuple[Samples, Samples]] | None:
        if not self.shots.items[0].drive.size:
            return None
        return [(shot.drive[0], shot.drive[1]) for shot in self.shots.items]

    def with_effects(self, effects: tuple[str, ...]) -> Ensemble:
        """Give the shots' taps with some effects at work."""
        return self._ensemble.with_effects(effects)

    def names(self, effects: tuple[str, ...]) -> tuple[str, ...]:
        """Names of the plant's parameters: nominal four, then those of the effects."""
        return self.with_effects(effects).names

    def samples(
        self,
        taps: Ensemble,
        parameters: Samples,
        shot_parameters: ShotParameters,
        only: NDArray[np.bool_] | None = None,
    ) -> Samples:
        """Predicted samples, shape (N,), of all shots or some; not finite where the plant has no answer.

        `taps` are those of `with_effects`.
        """
        out = _sample(taps, parameters, shot_parameters, only)
        if shot_parameters.shift_m.any():
            out += np.repeat(shot_parameters.shift_m, np.diff(self.shots.bounds))
        return out

    def trajectory(
        self, effects: tuple[str, ...], parameters: Samples, shot_parameters: ShotParameters
    ) -> Trajectory:
        """Follow what the part does at every sample's time, whatever channel the sample belongs to."""
        order = self._time_order()
        times = np.split(self.shots.times[order], self.shots.bounds[1:-1])
        everything = Ensemble(
            self._taps(),
            effects,
            position_time_s=times,
            actuator_time_s=times,
            velocity_time_s=times,
            gravity_m_s2=self.shots.gravity_m_s2,
            drives=self._drives(),
            batches=self.batches,
        )
        states = _sample(everything, parameters, shot_parameters).reshape(3, -1)
        back = np.empty_like(order)
        back[order] = np.arange(order.size)
        sign = np.repeat([float(shot.direction) for shot in self.shots.items], np.diff(self.shots.bounds))
        position, actuator, velocity = (sign * state[back] for state in states)
        return Trajectory(position, velocity, actuator)

    def _time_order(self) -> IndexArray:
        """Order that sorts the samples of every shot by time."""
        owner = np.repeat(np.arange(len(self.shots)), np.diff(self.shots.bounds))
        order: IndexArray = np.lexsort((self.shots.times, owner)).astype(np.int64)
        return order


def _sample(
    ensemble: Ensemble,
    parameters: Samples,
    shot_parameters: ShotParameters,
    only: NDArray[np.bool_] | None = None,
) -> Samples:
    return ensemble.samples(
        parameters,
        np.exp(shot_parameters.log_factor),
        mass_kg=shot_parameters.mass_kg * np.exp(shot_parameters.log_mass),
        velocity_m_s=ensemble.velocity_m_s * np.exp(shot_parameters.log_velocity),
        initial_speed_m_s=shot_parameters.speed_m_s,
        onset_s=shot_parameters.onset_s if shot_parameters.onset_s.any() else None,
        only=only,
    )
