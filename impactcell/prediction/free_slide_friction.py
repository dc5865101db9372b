"""Friction of a free slide: no contact, unknown initial speed, constant deceleration until it stops.

`impactcell.features.slide` is for taps: it begins at separation and refuses a part that still moves when its
record ends, as parts do in records of free slides (all 467 of the ContactNets tosses).
"""

import math

import numpy as np
from scipy.optimize import least_squares

from impactcell.errors import CaptureError
from impactcell.features.channels import check_channel
from impactcell.records import Capture, Coefficient, Quality, Samples


def free_slide_friction(capture: Capture, gravity_m_s2: float) -> Coefficient:
    """mu_k of a free slide by least squares on x = x_0 + v t - mu_k g t²/2 until v = mu_k g t, then at rest.

    The standard deviation is that of the residuals, so that scatter beyond the sensor's noise widens it.

    Raises
    ------
    CaptureError
        The position cannot be used, or nothing slide.
    """
    position = check_channel(capture.position, "position")
    times = position.time_s - position.time_s[0]
    sign = math.copysign(1.0, position.values[-1] - position.values[0])
    moved = sign * (position.values - position.values[0])
    if moved[-1] < 6.0 * position.sigma:
        raise CaptureError("the part did not slide")

    def residual(p: Samples) -> Samples:
        start, speed, braking = p
        sliding = np.minimum(times, max(speed, 0.0) / max(braking, 1e-9))
        misfit: Samples = start + speed * sliding - 0.5 * braking * sliding**2 - moved
        return misfit

    early = times <= 0.6 * times[-1]
    curve = np.polyfit(
        times[early] if early.sum() > 4 else times, moved[early] if early.sum() > 4 else moved, 2
    )
    braking = max(-2.0 * float(curve[0]), 0.05 * gravity_m_s2)
    speed = max(float(curve[1]), math.sqrt(2.0 * braking * float(moved[-1])))
    fit = least_squares(residual, [0.0, speed, braking], x_scale=[1e-3, speed, braking])
    slope = np.asarray(fit.jac)
    freedom = max(len(times) - 3, 1)
    spread = math.sqrt(2.0 * float(fit.cost) / freedom)
    try:
        covariance = np.linalg.inv(slope.T @ slope)
    except np.linalg.LinAlgError as fault:
        raise CaptureError("the slide is too short to show its deceleration") from fault
    value = float(fit.x[2]) / gravity_m_s2
    std = spread * math.sqrt(float(covariance[2, 2])) / gravity_m_s2
    if not (value > 0.0 and math.isfinite(std)):
        raise CaptureError("the part did not slow down")
    return Coefficient(value, std, Quality.GOOD)
