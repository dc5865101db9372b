"""Predictors of a mass between those that were calibrated: coefficients go with powers of the mass."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from impactcell.errors import PredictionError
from impactcell.prediction.model import REFERENCE_VELOCITY, DistanceForm, Model, Predictor


@dataclass(frozen=True, slots=True)
class MassInterpolation:
    """The predictors of one mass: those of the masses on either side of it, and their shares."""

    mass_kg: float
    parts: tuple[tuple[float, Predictor], ...]
    inside: bool

    def mean(self, of: Callable[[Predictor], float]) -> float:
        """Interpolate a figure that is not a power of the mass, such as an error or a sensitivity."""
        return sum(share * of(predictor) for share, predictor in self.parts)

    @property
    def friction_n(self) -> float:
        """Coefficient of mu_s in equation (4); between masses it goes with a power of the mass."""
        return math.exp(sum(share * math.log(predictor.force.friction_n) for share, predictor in self.parts))

    @property
    def velocity_n_s_per_m(self) -> float:
        """Coefficient of v in equation (4); between masses it goes with a power of the mass."""
        slopes = [predictor.force.velocity_n_s_per_m for _, predictor in self.parts]
        if min(slopes) <= 0.0:
            return self.mean(lambda predictor: predictor.force.velocity_n_s_per_m)
        return math.exp(
            sum(share * math.log(slope) for (share, _), slope in zip(self.parts, slopes, strict=True))
        )

    @property
    def velocity_range_m_s(self) -> tuple[float, float]:
        """Velocities that it is calibrated for."""
        slowest, fastest = zip(*(predictor.velocity_range_m_s for _, predictor in self.parts), strict=True)
        return max(slowest), min(fastest)

    def peak_force(self, mu_s: float, velocity_m_s: float) -> float:
        """Equation (4) forward, N."""
        return self.friction_n * mu_s + self.velocity_n_s_per_m * velocity_m_s

    def sliding_distance(self, mu_s: float, velocity_m_s: float) -> float:
        """Equation (5) forward, m."""
        return math.exp(
            sum(
                share * math.log(max(sliding_distance(predictor.distance, mu_s, velocity_m_s), 1e-12))
                for share, predictor in self.parts
            )
        )

    def slope_of_distance(self, mu_s: float, velocity_m_s: float) -> float:
        """Differentiate the sliding distance with respect to mu_s, m; negative below the limit."""
        step = 1e-5
        return (
            self.sliding_distance(mu_s + step, velocity_m_s)
            - self.sliding_distance(mu_s - step, velocity_m_s)
        ) / (2.0 * step)


def sliding_distance(form: DistanceForm, mu_s: float, velocity_m_s: float) -> float:
    """Equation (5) forward for one mass, m."""
    u = velocity_m_s / REFERENCE_VELOCITY
    square: float = form.square_m * u**form.square_power * (form.limit - mu_s) ** 2
    offset: float = form.offset_m * u**form.offset_power
    return square + offset


def interpolate_mass(model: Model, mass_kg: float, velocity_m_s: float) -> MassInterpolation:
    """Choose the predictors for a mass and velocity.

    Raises
    ------
    PredictionError
        The model has not been calibrated, or the mass or velocity is not known.
    """
    if not model.predictors:
        raise PredictionError(
            f"model {model.name!r} has no predictors: run `impactcell calibrate` on its cell"
        )
    if not (math.isfinite(mass_kg) and mass_kg > 0.0):
        raise PredictionError("the part's mass is not known")
    if not (math.isfinite(velocity_m_s) and velocity_m_s > 0.0):
        raise PredictionError("the actuator's velocity is not known")
    masses = sorted({predictor.mass_kg for predictor in model.predictors})
    close = min(masses, key=lambda mass: abs(mass - mass_kg))
    if abs(close / mass_kg - 1.0) < 1e-3:
        return MassInterpolation(mass_kg, ((1.0, _for_velocity(model, close, velocity_m_s)),), inside=True)
    for low, high in pairwise(masses):
        if low < mass_kg < high:
            share = math.log(mass_kg / low) / math.log(high / low)
            parts = (
                (1.0 - share, _for_velocity(model, low, velocity_m_s)),
                (share, _for_velocity(model, high, velocity_m_s)),
            )
            return MassInterpolation(mass_kg, parts, inside=True)
    return MassInterpolation(mass_kg, ((1.0, _for_velocity(model, close, velocity_m_s)),), inside=False)


def velocity_range_m_s(model: Model, mass_kg: float) -> tuple[float, float]:
    """Velocities that a mass is calibrated for, in whatever regime; raises as `interpolate_mass`."""
    slowest, fastest = zip(*(predictor.velocity_range_m_s for predictor in model.predictors), strict=True)
    slow, fast = (interpolate_mass(model, mass_kg, velocity) for velocity in (min(slowest), max(fastest)))
    return slow.velocity_range_m_s[0], fast.velocity_range_m_s[1]


def _for_velocity(model: Model, mass_kg: float, velocity_m_s: float) -> Predictor:
    """Predictor of a mass whose velocities contain this one, or come nearest to it."""

    def distance_to_range(predictor: Predictor) -> float:
        low, high = predictor.velocity_range_m_s
        return max(low - velocity_m_s, velocity_m_s - high, 0.0)

    return min(
        (predictor for predictor in model.predictors if predictor.mass_kg == mass_kg), key=distance_to_range
    )
