"""What the planner's model says of one tap, as far as learning from it needs."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from impactcell.physics.closed_form import displacement_of
from impactcell.positioning.displacement_discrepancy import FEATURES, discrepancy_features
from impactcell.positioning.displacement_quantiles import plant_parameters
from impactcell.positioning.planner_posterior import PARAMETERS, PlannerPosterior
from impactcell.positioning.tap import Tap
from impactcell.records import Samples

LEAST_FACTOR = 0.05
"""Of a tap's friction: the model has no friction that is zero or less."""
NO_FEATURES = np.zeros(FEATURES)
"""Of a tap whose discrepancy is not asked for."""
Response = Callable[[Samples], Samples]
"""Displacements (m), shape (n,), for rows of (theta, z sigma), shape (n, 6)."""


class TapModel(NamedTuple):
    """Response to a tap, phi of its discrepancy, and the indentation delta (m)."""

    response: Response
    features: Samples = NO_FEATURES
    indentation_m: float = 0.0


def model_of_tap(tap: Tap, posterior: PlannerPosterior, part: Samples) -> TapModel:
    """Model of a tap on a part; `part` as in `impactcell.physics.closed_form.displacements`."""

    def response(states: Samples) -> Samples:
        factor = np.maximum(1.0 + states[:, PARAMETERS], LEAST_FACTOR)
        plants = plant_parameters(states[:, :PARAMETERS])
        return displacement_of(tap.velocity_m_s, tap.stroke_m, plants, factor, part)

    median = np.append(posterior.mean[:PARAMETERS], 0.0)[None]
    plant = plant_parameters(median)[0]
    indentation = float(plant[3] * part[0] * part[1] / plant[0])
    features = np.empty(FEATURES)
    place = np.array([tap.position_m, float(tap.direction)])
    commanded = np.array([tap.velocity_m_s, tap.stroke_m, indentation])
    discrepancy_features(commanded, float(response(median)[0]), part, place, features)
    return TapModel(response, features, indentation)
