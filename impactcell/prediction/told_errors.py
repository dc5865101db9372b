"""What mu_s by equations (4) and (5) is off by where mass, velocity and scales are not as they were told.

Each function gives an array, shape (4,): the change of mu_s, with its sign, for one standard deviation of
mass, of velocity, and of the scales of force and position, told or shown as too large. The four are
independent, one moves both equations: of a weighted mean the shifts add up before they are squared.
"""

import numpy as np

from impactcell.prediction.linearised_model import RecorderStd
from impactcell.prediction.mass_interpolation import MassInterpolation
from impactcell.records import Samples

VELOCITY_STEP = 1e-4
"""Relative step of the velocity in a difference of sliding distances: error and rounding below 1e-6."""


def force_shifts(
    mixed: MassInterpolation, mu_s: float, velocity_m_s: float, told_std: RecorderStd
) -> Samples:
    """Give the shifts of (4), mu_s = (F_p - velocity_n_s_per_m v) / friction_n.

    friction_n goes with m, as friction does, and velocity_n_s_per_m with its root, as the force at which
    k stops m does: by calibrations of 9 to 38 kg the powers are 1.1 and 0.53.
    """
    _, mass_std, velocity_std, force_std, _ = told_std
    of_friction, of_velocity = mu_s, mixed.velocity_n_s_per_m * velocity_m_s / mixed.friction_n
    return np.array(
        [
            -mass_std * (of_friction + 0.5 * of_velocity),
            -velocity_std * of_velocity,
            force_std * (of_friction + of_velocity),
            0.0,
        ]
    )


def distance_shifts(
    mixed: MassInterpolation, mu_s: float, velocity_m_s: float, told_std: RecorderStd
) -> Samples:
    """Give the shifts of (5), which sliding distance d and velocity move, and next to nothing of the mass.

    By calibrations 1 % of mass moves mu_s by 0.3 %, a tenth of what mu_k/mu_s does.
    """
    _, _, velocity_std, _, position_std = told_std
    slope = max(abs(mixed.slope_of_distance(mu_s, velocity_m_s)), 1e-12)
    slow, fast = (
        mixed.sliding_distance(mu_s, velocity_m_s * factor)
        for factor in (1.0 - VELOCITY_STEP, 1.0 + VELOCITY_STEP)
    )
    farther = (fast - slow) / (2.0 * VELOCITY_STEP)
    distance = mixed.sliding_distance(mu_s, velocity_m_s)
    return np.array([0.0, velocity_std * farther / slope, 0.0, -position_std * distance / slope])
