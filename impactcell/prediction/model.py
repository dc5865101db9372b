"""What is known of a cell before a tap: its plant, how well that is known, and its calibrated predictors."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from impactcell.physics import Plant
from impactcell.records import MM_PER_MIN

REFERENCE_VELOCITY = 0.1
"""Velocity in m/s (6000 mm/min) at which the terms of equation (5) are stated, so that they are in metres."""


@dataclass(frozen=True, slots=True)
class Prior:
    """How well the plant is known, as standard deviations about its nominal values.

    Attributes
    ----------
    stiffness_std_n_per_m, damping_std_n_s_per_m : float
    ratio_std : float
        Scatter of mu_k / mu_s from tap to tap, about the plant's mu_k / mu_s.
    """

    stiffness_std_n_per_m: float
    damping_std_n_s_per_m: float
    ratio_std: float


@dataclass(frozen=True, slots=True)
class ForceForm:
    """Equation (4), F_p = friction_n mu_s + velocity_n_s_per_m v; printed for 18.9 kg as 146.2 and 0.0529.

    Attributes
    ----------
    friction_n, velocity_n_s_per_m : float
    rms : float
        Error of mu_s over the calibrated range, root mean square.
    """

    friction_n: float
    velocity_n_s_per_m: float
    rms: float = 0.0


@dataclass(frozen=True, slots=True)
class DistanceForm:
    """Equation (5), d = square_m u^square_power (limit - mu_s)² + offset_m u^offset_power, u = v / 0.1 m/s.

    Attributes
    ----------
    limit : float
        Printed as 0.3415; the root is real below it.
    square_m, square_power, offset_m, offset_power : float
        Printed, for v in mm/min and d in µm, as 0.07379, 1.6428, 0.00041, 1.8997.
    rms : float
        Error of mu_s over the calibrated range, root mean square.
    """

    limit: float
    square_m: float
    square_power: float
    offset_m: float
    offset_power: float
    rms: float = 0.0

    def root(self, distance_m: float, velocity_m_s: float) -> float:
        """mu_s at which a part slides so far, no less than the form allows at this velocity."""
        u = velocity_m_s / REFERENCE_VELOCITY
        beyond = max(distance_m - self.offset_m * u**self.offset_power, 0.0)
        return self.limit - math.sqrt(beyond / (self.square_m * u**self.square_power))


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Relative change of a predicted mu_s per relative change of what the calibration took as known.

    A part whose stiffness is 1 % above the plant's is given a mu_s that is `stiffness` % wrong.
    """

    stiffness: float = 0.0
    damping: float = 0.0
    ratio: float = 0.0


@dataclass(frozen=True, slots=True)
class Predictor:
    """Equations (4) and (5) for one mass, and where they hold.

    Attributes
    ----------
    mass_kg : float
    mu_s_range, velocity_range_m_s : tuple of float
        What was swept; outside it a value is uncertain.
    force, distance : ForceForm, DistanceForm
    force_sensitivity, distance_sensitivity : Sensitivity
    """

    mass_kg: float
    mu_s_range: tuple[float, float]
    velocity_range_m_s: tuple[float, float]
    force: ForceForm
    distance: DistanceForm
    force_sensitivity: Sensitivity = Sensitivity()
    distance_sensitivity: Sensitivity = Sensitivity()


PROVISIONAL: Final = "provisional"
"""In the provenance of a model that nothing was measured of."""
REMAINS: Final = "what remains"
"""In the provenance of a model of `discrepancy` beside whose effects something remains: how much, where."""


@dataclass(frozen=True, slots=True)
class Model:
    """All that a cell's predictors need to know.

    Attributes
    ----------
    name : str
        As published under `Model/Name`.
    plant : Plant
        Nominal values; its mu_k / mu_s is the ratio assumed where a capture shows only one of them.
    prior : Prior
    predictors : tuple of Predictor
        In order of mass; empty before calibration.
    stroke_m : float
        Stroke for which the predictors were calibrated; inf for an actuator that halts as it loses contact.
    intervals : mapping
        95 % interval of each effect's parameters, where it is known.
    provenance : mapping of str to str
        Where the figures come from.
    """

    name: str
    plant: Plant
    prior: Prior
    predictors: tuple[Predictor, ...] = ()
    stroke_m: float = math.inf
    intervals: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    provenance: Mapping[str, str] = field(default_factory=dict)

    @property
    def ratio(self) -> float:
        """mu_k / mu_s of the plant."""
        return self.plant.mu_k / self.plant.mu_s

    @property
    def is_provisional(self) -> bool:
        """Whether nothing of it was measured on its cell."""
        return PROVISIONAL in self.provenance


def printed_predictor() -> Predictor:
    """Equations (4) and (5) as printed in the paper: 18.9 kg of steel on carbide.

    Units are not printed; they come out as v in mm/min, F_p in N and d in µm. The range is that over
    which the paper reports its errors.
    """
    per_mm_per_min = REFERENCE_VELOCITY / MM_PER_MIN
    return Predictor(
        mass_kg=18.9,
        mu_s_range=(0.15, 0.25),
        velocity_range_m_s=(0.05, 0.1),
        force=ForceForm(friction_n=146.2, velocity_n_s_per_m=0.0529 / MM_PER_MIN),
        distance=DistanceForm(
            limit=0.3415,
            square_m=0.07379 * per_mm_per_min**1.6428 * 1e-6,
            square_power=1.6428,
            offset_m=0.00041 * per_mm_per_min**1.8997 * 1e-6,
            offset_power=1.8997,
        ),
    )
