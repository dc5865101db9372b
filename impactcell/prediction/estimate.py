"""One capture in, one `FrictionEstimate` out: every predictor, and the one that is published."""

import math
from dataclasses import replace

from impactcell.errors import NotConvergedError, PhysicsError, PredictionError
from impactcell.prediction.equations import (
    beyond_calibration,
    by_distance,
    by_force,
    combined,
    interpolate_mass,
    out_of_range,
)
from impactcell.prediction.feature_extraction import MeasuredFeature, check_if_usable, peak_force
from impactcell.prediction.model import Model
from impactcell.prediction.phase_reweighting import MISFIT_THRESHOLD
from impactcell.prediction.slide_features import SlideFeatures, extract_slide
from impactcell.prediction.waveform import WaveformFit, deceleration_friction, fit
from impactcell.records import Capture, Coefficient, Estimator, FrictionEstimate, Quality

NO_FEATURE = MeasuredFeature(math.nan, math.nan)


def estimate(capture: Capture, model: Model, misfit: float = 1.0) -> FrictionEstimate:
    """Estimate mu_s and mu_k of one tap by equations (4), (5), (6) and by its waveform.

    Published is the waveform's estimate where it converges, else (6), else (4) or (5) alone where only one
    channel was recorded.
    A capture that cannot be used gives a bad estimate that says why; nothing is raised for it.

    Parameters
    ----------
    capture : Capture
    model : Model
    misfit : float
        RMS of the model's residuals over many taps, 1 = noise, where it is known. A model that misses those
        bends mu_s even in a tap that it seems to fit: then mu_s comes from the equations, whose few
        coefficients bend less.
    """
    capture = replace(
        capture,
        force=check_if_usable(capture.force, "force", smoothed=True),
        position=check_if_usable(capture.position, "position"),
    )
    peak, force_fault = _peak_force(capture)
    slide, slide_fault = _slide(capture)
    distance = slide.distance if slide is not None else _reported_distance(capture)
    mu_force = _no_coefficient(force_fault)
    mu_distance = _no_coefficient(slide_fault)
    mu_combined = _no_coefficient("; ".join(dict.fromkeys(filter(None, (force_fault, slide_fault)))))
    warning = ""
    try:
        mixed = interpolate_mass(model, capture.mass_kg, capture.velocity_m_s)
        warning = out_of_range(model, mixed, capture.velocity_m_s, math.nan, capture.stroke_m)
        try:
            if math.isfinite(peak.value):
                mu_force = _with_warnings(
                    by_force(model, mixed, capture.velocity_m_s, peak), warning, force_fault
                )
        except PredictionError as fault:
            mu_force = _no_coefficient(str(fault))
        try:
            if math.isfinite(distance.value):
                mu_distance = _with_warnings(
                    by_distance(model, mixed, capture.velocity_m_s, distance), warning, slide_fault
                )
        except PredictionError as fault:
            mu_distance = _no_coefficient(str(fault))
        if mu_force.quality < Quality.BAD and mu_distance.quality < Quality.BAD:
            mu_combined = _with_warnings(
                combined(model, mixed, capture.velocity_m_s, (mu_force, peak), (mu_distance, distance)),
                warning,
                "; ".join(filter(None, (force_fault, slide_fault))),
            )
        else:
            faults = [one.reason for one in (mu_force, mu_distance) if one.quality is Quality.BAD]
            mu_combined = _no_coefficient("; ".join(dict.fromkeys(faults)))
    except PredictionError as fault:
        mu_force = mu_distance = mu_combined = _no_coefficient(str(fault))
    mu_s, estimator = _select_published(capture, mu_combined, mu_force, mu_distance)
    gap = math.nan
    if force_fault or slide is None:
        mu_k = _mu_k(model, slide, mu_s, capture.mass_kg)
    else:
        try:
            found = fit(capture, model, slide)
        except PredictionError as fault:
            mu_k = _mu_k(model, slide, mu_s, capture.mass_kg)
            mu_s = _with_warnings(mu_s, f"no waveform estimate: {fault}")
            gap = fault.gap if isinstance(fault, NotConvergedError) else math.nan
        else:
            mu_s_seen, mu_k, gap = _from_waveform(model, capture, found)
            if misfit <= MISFIT_THRESHOLD or mu_s.quality is Quality.BAD:
                mu_s, estimator = mu_s_seen, Estimator.WAVEFORM
            else:
                missed = f"the model misses these taps: residuals are {misfit:.3g} times the noise"
                mu_s, mu_k = _with_warnings(mu_s, missed), _with_warnings(mu_k, missed)
    return FrictionEstimate(
        mu_s=mu_s,
        mu_k=mu_k,
        by_force=mu_force,
        by_distance=mu_distance,
        combined=mu_combined,
        estimator=estimator,
        peak_force_n=peak.value,
        sliding_distance_m=distance.value,
        gap=gap,
    )


def _from_waveform(
    model: Model, capture: Capture, found: WaveformFit
) -> tuple[Coefficient, Coefficient, float]:
    """Coefficients as published, with a warning for a tap outside the calibration or unlike the model."""
    warnings = [beyond_calibration(model, capture, found.mu_s)]
    if found.misfit > MISFIT_THRESHOLD:
        warnings.append(f"residuals are {found.gap:.3g} times the sensors' noise: the model lacks something")
    told = "mu_s through mu_k/mu_s of the model: the part moved at once" if found.immediate > 0.5 else ""
    mu_s = Coefficient(found.mu_s, found.mu_s_std, Quality.GOOD, told)
    mu_k = Coefficient(found.mu_k, found.mu_k_std, Quality.GOOD)
    return _with_warnings(mu_s, *warnings), _with_warnings(mu_k, *warnings), found.gap


def _peak_force(capture: Capture) -> tuple[MeasuredFeature, str]:
    """Peak force and what is wrong with it; the module's own figure where no force was recorded."""
    if capture.force is None and capture.summary is not None:
        reported = capture.summary.peak_force_n
        if math.isfinite(reported) and reported > 0.0:
            return MeasuredFeature(
                reported, 0.01 * reported
            ), "from the module's summary: no force was recorded"
        return NO_FEATURE, f"the module reports a peak force of {reported} N and no record"
    try:
        return peak_force(capture.force), ""  # type: ignore[arg-type]
    except (PredictionError, PhysicsError) as fault:
        return NO_FEATURE, str(fault)


def _slide(capture: Capture) -> tuple[SlideFeatures | None, str]:
    if capture.summary is not None and (lacking := _missing_channel(capture)):
        return None, f"from the module's summary: {lacking}"
    try:
        return extract_slide(capture), ""
    except (PredictionError, PhysicsError) as fault:
        return None, str(fault)


def _missing_channel(capture: Capture) -> str:
    """Say which channel was not recorded, of the two that show a slide."""
    if capture.position is None:
        return "no position was recorded"
    return "no force was recorded" if capture.force is None else ""


def _reported_distance(capture: Capture) -> MeasuredFeature:
    if capture.summary is not None and _missing_channel(capture):
        reported = capture.summary.sliding_distance_m
        if math.isfinite(reported) and reported > 0.0:
            return MeasuredFeature(reported, 0.01 * reported)
    return NO_FEATURE


def _no_coefficient(reason: str) -> Coefficient:
    return Coefficient(reason=reason)


def _with_warnings(given: Coefficient, *warnings: str) -> Coefficient:
    """Mark a coefficient uncertain for each warning that says something."""
    said = [text for text in warnings if text]
    if not said:
        return given
    reasons = dict.fromkeys([*filter(None, given.reason.split("; ")), *"; ".join(said).split("; ")])
    return Coefficient(given.value, given.std, max(given.quality, Quality.UNCERTAIN), "; ".join(reasons))


def _select_published(
    capture: Capture, mu_combined: Coefficient, mu_force: Coefficient, mu_distance: Coefficient
) -> tuple[Coefficient, Estimator]:
    """Choose what is published without a waveform.

    One equation alone is published only where the other's channel was not recorded. Where it was and cannot
    be used, the capture is not to be trusted.
    """
    if mu_combined.quality < Quality.BAD:
        return mu_combined, Estimator.COMBINED
    if capture.force is None and mu_distance.quality < Quality.BAD:
        return _with_warnings(
            mu_distance, "by sliding distance only: no force was recorded"
        ), Estimator.DISTANCE
    if capture.position is None and mu_force.quality < Quality.BAD:
        return _with_warnings(mu_force, "by peak force only: no position was recorded"), Estimator.FORCE
    return mu_combined, Estimator.NONE


def _mu_k(model: Model, slide: SlideFeatures | None, mu_s: Coefficient, mass_kg: float) -> Coefficient:
    """mu_k from the mean deceleration of the slide, or, without one, from mu_s through the ratio."""
    if slide is not None and (value := deceleration_friction(model, mass_kg, slide)) > 0.0:
        std = slide.deceleration.std / model.plant.gravity_m_s2
        return Coefficient(value, std, Quality.UNCERTAIN, "from the mean deceleration of the slide")
    if mu_s.quality < Quality.BAD:
        ratio = model.ratio
        std = ratio * math.hypot(mu_s.std, mu_s.value * model.prior.ratio_std / ratio)
        return Coefficient(ratio * mu_s.value, std, Quality.UNCERTAIN, "through mu_k/mu_s of the model")
    return Coefficient(reason=mu_s.reason)
