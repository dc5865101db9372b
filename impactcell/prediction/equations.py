"""Equations (4), (5) and (6): mu_s from the peak force, from the sliding distance, and from both.

The forms are the paper's, the coefficients a cell's own (`impactcell.prediction.model.Predictor`), one set
a mass; between two masses coefficients of the force and distances go with powers of the mass.
"""

import math
from collections.abc import Callable
from dataclasses import replace

from scipy.optimize import brentq

from impactcell.errors import NegativeRootError, PredictionError
from impactcell.features import MeasuredFeature
from impactcell.prediction.linearised_model import EXACT, RecorderStd
from impactcell.prediction.mass_interpolation import MassInterpolation
from impactcell.prediction.model import Model, Predictor, Sensitivity
from impactcell.prediction.told_errors import distance_shifts, force_shifts
from impactcell.records import MM_PER_MIN, Capture, Coefficient, Quality

MIN_MU_S = 1e-3
"""Least mu_s that (5) is solved for: a part without friction. Our choice."""
DISAGREEMENT_STDS = 4.0
"""Standard deviations that mu_s by (4) and by (5) may differ by. Our choice: over 1800 taps of five plants,
right in all but noise and scatter, those beyond were off by 6 % and more, as the forms do not hold there."""


def by_force(
    model: Model,
    mixed: MassInterpolation,
    velocity_m_s: float,
    peak: MeasuredFeature,
    told_std: RecorderStd = EXACT,
) -> Coefficient:
    """Equation (4): mu_s = (F_p - velocity_n_s_per_m v) / friction_n.

    `told_std` is how well mass, velocity and scales are known, here and in (5) and (6).

    Raises
    ------
    PredictionError
        The force is smaller than that of a part without friction.
    """
    slope = mixed.friction_n
    value = (peak.value - mixed.velocity_n_s_per_m * velocity_m_s) / slope
    if value <= 0.0:
        raise PredictionError(
            f"peak force {peak.value:.4g} N is below that of a part without friction; "
            f"{_way_out(model, 'mass and velocity')}"
        )
    sensitivity = _sensitivity(mixed, lambda predictor: predictor.force_sensitivity)
    rms = mixed.mean(lambda predictor: predictor.force.rms)
    calibration_std = value * _relative_calibration_std(model, sensitivity)
    common_std = math.hypot(rms, calibration_std, *force_shifts(mixed, value, velocity_m_s, told_std))
    return _graded(model, mixed, velocity_m_s, value, math.hypot(peak.std / slope, common_std), common_std)


def _way_out(model: Model, suspects: str) -> str:
    """Say what to do about a figure that no friction makes: a provisional model is to blame itself."""
    if model.is_provisional:
        return "the model is provisional: run `impactcell model fit` after 30 taps"
    return f"check {suspects}"


def by_distance(
    model: Model,
    mixed: MassInterpolation,
    velocity_m_s: float,
    slide: MeasuredFeature,
    told_std: RecorderStd = EXACT,
) -> Coefficient:
    """Equation (5): mu_s = limit - sqrt((d - offset_m u^offset_power) / (square_m u^square_power)).

    Raises
    ------
    NegativeRootError
        The distance is shorter than the form allows at this velocity: there is no real root.
    PredictionError
        It is longer than that of a part without friction.
    """
    limit = min(predictor.distance.limit for _, predictor in mixed.parts)
    shortest = mixed.sliding_distance(limit, velocity_m_s)
    if slide.value < shortest:
        raise NegativeRootError(
            f"sliding distance {1e6 * slide.value:.4g} µm is below {1e6 * shortest:.4g} µm, the shortest for "
            f"which equation (5) has a root at {velocity_m_s:.4g} m/s; "
            f"{_way_out(model, 'mass, stroke and velocity')}"
        )
    if slide.value > mixed.sliding_distance(MIN_MU_S, velocity_m_s):
        raise PredictionError(
            f"sliding distance {1e6 * slide.value:.4g} µm is that of a part without friction; "
            f"{_way_out(model, 'mass and velocity')}"
        )
    if len(mixed.parts) == 1:
        value = mixed.parts[0][1].distance.root(slide.value, velocity_m_s)
    else:
        value = float(
            brentq(
                lambda mu_s: mixed.sliding_distance(mu_s, velocity_m_s) - slide.value,
                MIN_MU_S, limit, xtol=1e-15,
            )
        )  # fmt: skip
    slope = abs(mixed.slope_of_distance(value, velocity_m_s))
    sensitivity = _sensitivity(mixed, lambda predictor: predictor.distance_sensitivity)
    rms = mixed.mean(lambda predictor: predictor.distance.rms)
    calibration_std = value * _relative_calibration_std(model, sensitivity)
    common_std = math.hypot(rms, calibration_std, *distance_shifts(mixed, value, velocity_m_s, told_std))
    std = math.hypot(slide.std / max(slope, 1e-12), common_std)
    return _graded(model, mixed, velocity_m_s, value, std, common_std)


def combined(
    model: Model,
    mixed: MassInterpolation,
    velocity_m_s: float,
    force: tuple[Coefficient, MeasuredFeature],
    slide: tuple[Coefficient, MeasuredFeature],
    told_std: RecorderStd = EXACT,
) -> Coefficient:
    """Equation (6): mu_s = mu_force w_F + mu_dist w_d, weighted by the gradients of both figures.

    w_F = dF/dmu / (dF/dmu + dd/dmu ΔF/Δd) and w_d = 1 - w_F, with ΔF and Δd the spans of peak force and
    sliding distance over the calibrated range of mu_s at this velocity.

    A wrong mass, velocity or scale moves the two apart: beyond `DISAGREEMENT_STDS` of what is not known the
    value is uncertain.
    """
    (mu_force, peak), (mu_dist, distance) = force, slide
    weight = force_weight(mixed, 0.5 * (mu_force.value + mu_dist.value), velocity_m_s)
    value = weight * mu_force.value + (1.0 - weight) * mu_dist.value
    of_force = _sensitivity(mixed, lambda predictor: predictor.force_sensitivity)
    of_distance = _sensitivity(mixed, lambda predictor: predictor.distance_sensitivity)
    distance_weight = 1.0 - weight
    sensitivity = Sensitivity(
        weight * of_force.stiffness + distance_weight * of_distance.stiffness,
        weight * of_force.damping + distance_weight * of_distance.damping,
        weight * of_force.ratio + distance_weight * of_distance.ratio,
    )
    slope = abs(mixed.slope_of_distance(mu_dist.value, velocity_m_s))
    forms = (
        mixed.mean(lambda predictor: predictor.force.rms),
        mixed.mean(lambda predictor: predictor.distance.rms),
    )
    stds = (
        math.hypot(peak.std / mixed.friction_n, forms[0]),
        math.hypot(distance.std / max(slope, 1e-12), forms[1]),
    )
    calibration_std = value * _relative_calibration_std(model, sensitivity)
    shifts = weight * force_shifts(mixed, mu_force.value, velocity_m_s, told_std)
    shifts += distance_weight * distance_shifts(mixed, mu_dist.value, velocity_m_s, told_std)
    std = math.hypot(weight * stds[0], distance_weight * stds[1], calibration_std, *shifts)
    common_std = math.hypot(weight * forms[0], distance_weight * forms[1], calibration_std, *shifts)
    found = _graded(model, mixed, velocity_m_s, value, std, common_std)
    between = Sensitivity(
        of_force.stiffness - of_distance.stiffness,
        of_force.damping - of_distance.damping,
        of_force.ratio - of_distance.ratio,
    )
    unknown = math.hypot(*stds, value * _relative_calibration_std(model, between))
    if abs(mu_force.value - mu_dist.value) <= DISAGREEMENT_STDS * unknown:
        return found
    doubt = (
        f"peak force says mu_s {mu_force.value:.4g}, sliding distance {mu_dist.value:.4g}: "
        "mass, velocity, or the scale of one of them is wrong, or the model"
    )
    return replace(
        found, quality=Quality.UNCERTAIN, reason="; ".join(text for text in (found.reason, doubt) if text)
    )


def force_weight(mixed: MassInterpolation, mu_s: float, velocity_m_s: float) -> float:
    """w_F of equation (6)."""
    low = max(predictor.mu_s_range[0] for _, predictor in mixed.parts)
    high = min(predictor.mu_s_range[1] for _, predictor in mixed.parts)
    inside = min(max(mu_s, low), high)
    slope_f = mixed.friction_n
    span_f = slope_f * (high - low)
    span_d = mixed.sliding_distance(low, velocity_m_s) - mixed.sliding_distance(high, velocity_m_s)
    slope_d = abs(mixed.slope_of_distance(inside, velocity_m_s))
    return slope_f / (slope_f + slope_d * span_f / max(abs(span_d), 1e-12))


def out_of_range(
    model: Model, mixed: MassInterpolation, velocity_m_s: float, mu_s: float, stroke_m: float
) -> str:
    """Say in which ways a tap lies outside the calibration; empty where it does not.

    `mu_s` is not judged where it is nan.
    """
    reasons = []
    if not mixed.inside:
        low, high = model.predictors[0].mass_kg, model.predictors[-1].mass_kg
        reasons.append(f"mass {mixed.mass_kg:.4g} kg is outside the calibrated {low:.4g}-{high:.4g} kg")
    slowest, fastest = mixed.velocity_range_m_s
    if not slowest * (1 - 1e-9) <= velocity_m_s <= fastest * (1 + 1e-9):
        reasons.append(
            f"velocity {velocity_m_s / MM_PER_MIN:.5g} mm/min is outside the calibrated "
            f"{slowest / MM_PER_MIN:.5g}-{fastest / MM_PER_MIN:.5g} mm/min"
        )
    low = max(predictor.mu_s_range[0] for _, predictor in mixed.parts)
    high = min(predictor.mu_s_range[1] for _, predictor in mixed.parts)
    if math.isfinite(mu_s) and not low <= mu_s <= high:
        reasons.append(f"mu_s {mu_s:.4g} is outside the calibrated {low:.4g}-{high:.4g}")
    same = stroke_m == model.stroke_m or abs(stroke_m / model.stroke_m - 1.0) < 0.01
    if math.isfinite(stroke_m) != math.isfinite(model.stroke_m) or not same:
        reasons.append(
            f"stroke {_millimetres(stroke_m)} is not the {_millimetres(model.stroke_m)} of the calibration"
        )
    return "; ".join(reasons)


def beyond_calibration(model: Model, capture: Capture, mu_s: float) -> str:
    """Say in which ways a tap lies outside all that was calibrated, whatever the regime."""
    if not model.predictors:
        return ""
    masses = [predictor.mass_kg for predictor in model.predictors]
    velocities = [end for predictor in model.predictors for end in predictor.velocity_range_m_s]
    frictions = [end for predictor in model.predictors for end in predictor.mu_s_range]
    reasons = []
    for name, value, ends, unit, scale in (
        ("mass", capture.mass_kg, masses, " kg", 1.0),
        ("velocity", capture.velocity_m_s, velocities, " mm/min", 1.0 / MM_PER_MIN),
        ("mu_s", mu_s, frictions, "", 1.0),
    ):
        low, high = min(ends), max(ends)
        if not low * (1 - 1e-3) <= value <= high * (1 + 1e-3):
            reasons.append(
                f"{name} {scale * value:.4g}{unit} is outside the calibrated "
                f"{scale * low:.4g}-{scale * high:.4g}{unit}"
            )
    return "; ".join(reasons)


def _graded(
    model: Model, mixed: MassInterpolation, velocity_m_s: float, value: float, std: float, common_std: float
) -> Coefficient:
    reason = out_of_range(model, mixed, velocity_m_s, value, model.stroke_m)
    return Coefficient(value, std, Quality.UNCERTAIN if reason else Quality.GOOD, reason, common_std)


def _relative_calibration_std(model: Model, sensitivity: Sensitivity) -> float:
    """Relative error of mu_s that comes from what the calibration took as known."""
    plant, prior = model.plant, model.prior
    return math.hypot(
        sensitivity.stiffness * prior.stiffness_std_n_per_m / plant.stiffness_n_per_m,
        sensitivity.damping * prior.damping_std_n_s_per_m / max(plant.damping_n_s_per_m, 1e-12),
        sensitivity.ratio * prior.ratio_std / model.ratio,
    )


def _sensitivity(mixed: MassInterpolation, of: Callable[[Predictor], Sensitivity]) -> Sensitivity:
    return Sensitivity(
        mixed.mean(lambda predictor: of(predictor).stiffness),
        mixed.mean(lambda predictor: of(predictor).damping),
        mixed.mean(lambda predictor: of(predictor).ratio),
    )


def _millimetres(stroke_m: float) -> str:
    return f"{1e3 * stroke_m:.4g} mm" if math.isfinite(stroke_m) else "without limit"
