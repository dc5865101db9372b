"""What the planner's model says of one tap, as far as learning from it needs."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from impactcell.physics.closed_form import displacement_of
from impactcell.positioning.displacement_discrepancy import (
    FEATURES,
    SWING_SHARE,
    breakaway_features,
    discrepancy_features,
    friction_features,
    halting_m,
    indentation_features,
    swing_m,
)
from impactcell.positioning.displacement_quantiles import plant_parameters
from impactcell.positioning.planner_posterior import PARAMETERS, PlannerPosterior, mean_at
from impactcell.positioning.tap import Tap
from impactcell.records import Samples

LEAST_FACTOR = 0.05
"""Of a tap's friction: the model has no friction that is zero or less."""
NO_FEATURES = np.zeros(FEATURES)
"""Of a tap whose discrepancy is not asked for."""
Response = Callable[[Samples], Samples]
"""Displacements (m), shape (n,), for rows of (theta, z sigma, psi · w), shape (n, 7)."""


class TapModel(NamedTuple):
    """Response to a tap, phi, psi, beta and xi of its discrepancy, the indentation delta (m).

    And what no weight explains: `halting_m` and `swing_m`.
    """

    response: Response
    features: Samples = NO_FEATURES
    indenting: Samples = NO_FEATURES
    breakaway: Samples = NO_FEATURES
    easing: Samples = NO_FEATURES
    indentation_m: float = 0.0
    halting_m: float = 0.0
    swing_m: float = 0.0


def model_of_tap(tap: Tap, posterior: PlannerPosterior, part: Samples) -> TapModel:
    """Model of a tap on a part; `part` as in `impactcell.physics.closed_form.displacements`."""
    place = np.array([tap.position_m, float(tap.direction)])
    mean = mean_at(posterior, part, place)
    plant = plant_parameters(mean[None, :PARAMETERS])[0]
    indentation = float(plant[3] * part[0] * part[1] / plant[0])

    def response(states: Samples, share: float = 0.0) -> Samples:
        factor = np.maximum(1.0 + states[:, PARAMETERS], LEAST_FACTOR)
        plants = plant_parameters(states[:, :PARAMETERS])
        strokes = (1.0 + share) * tap.stroke_m + indentation * states[:, PARAMETERS + 1]
        return displacement_of(tap.velocity_m_s, strokes, plants, factor, part)

    features, indenting, breakaway = np.empty(FEATURES), np.empty(FEATURES), np.zeros(FEATURES)
    breakaway_features(tap.velocity_m_s, tap.stroke_m, indentation, breakaway)
    indentation_features(tap.velocity_m_s, part, place, indenting)
    shift = float(indenting @ mean[PARAMETERS:])
    median = np.concatenate([mean[:PARAMETERS], [0.0, shift]])[None]
    commanded = np.array([tap.stroke_m + indentation * shift, indentation, plant[3]])
    moved = float(response(median)[0])
    discrepancy_features(commanded, moved, part, place, features)
    swing = 0.0
    if math.isfinite(tap.stroke_m):
        before, after = (float(response(median, share)[0]) for share in (-SWING_SHARE, SWING_SHARE))
        swing = swing_m(before, moved, after, tap.stroke_m, indentation)
    easing = friction_features(part, place)
    halting = halting_m(moved, tap.stroke_m)
    return TapModel(response, features, indenting, breakaway, easing, indentation, halting, swing)
