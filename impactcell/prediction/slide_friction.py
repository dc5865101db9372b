"""mu_k of a tap by how its slide slows down: what knows nothing of the contact, nor of what a model lacks."""

import math

from impactcell.features import Fault, Features, SlideFeatures, impulse_balance
from impactcell.records import Capture, Coefficient, Estimator, FrictionEstimate, Quality

NO_PLANT = "no plant could be fitted to these taps"
"""Why a tap without a fault of its own shows no mu_s."""


def coefficient_of_slide(
    mu_k: float, slide: SlideFeatures, capture: Capture, gravity_m_s2: float
) -> Coefficient:
    """Give mu_k of a mean deceleration; what friction does along the slide and the scale widen its std."""
    noise = math.hypot(slide.deceleration.std, slide.bend) / gravity_m_s2
    std = math.hypot(noise, capture.position_scale_std * mu_k)
    return Coefficient(mu_k, std, Quality.UNCERTAIN, "from the mean deceleration of the slide")


def friction_of_slide(features: Features, gravity_m_s2: float) -> FrictionEstimate:
    """Estimate mu_k alone, of a tap for which there is no plant."""
    slide, peak = features.slide, features.peak_force
    doubts = impulse_balance.doubts(features)
    why = "; ".join([*doubts, str(peak) if isinstance(peak, Fault) else NO_PLANT, *features.left_out])
    mu_k = nothing = Coefficient(reason=why)
    if isinstance(slide, Fault):
        mu_k = Coefficient(reason=str(slide))
    elif not doubts and (value := slide.deceleration.value / gravity_m_s2) > 0.0:
        mu_k = coefficient_of_slide(value, slide, features.capture, gravity_m_s2)
    return FrictionEstimate(
        mu_s=nothing, mu_k=mu_k, by_force=nothing, by_distance=nothing, combined=nothing,
        estimator=Estimator.NONE,
        peak_force_n=math.nan if isinstance(peak, Fault) else peak.value,
        sliding_distance_m=math.nan if isinstance(slide, Fault) else slide.distance.value,
    )  # fmt: skip
