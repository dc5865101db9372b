"""One capture in, one `FrictionEstimate` out: every predictor, and the one that is published."""

import math
from dataclasses import replace

from impactcell.errors import NotConvergedError, PhysicsError, PredictionError
from impactcell.prediction.equations import (
    beyond_calibration,
    by_distance,
    by_force,
    combined,
    mix,
    out_of_range,
)
from impactcell.prediction.feature_extraction import Reading, peak_force, sensed
from impactcell.prediction.model import Model
from impactcell.prediction.phase_reweighting import DOUBTED
from impactcell.prediction.slide_features import Slide, slide
from impactcell.prediction.waveform import Waveform, braking_friction, fit
from impactcell.records import Capture, Coefficient, Estimator, FrictionEstimate, Quality

NOT_READ = Reading(math.nan, math.nan)


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
        force=sensed(capture.force, "force", smoothed=True),
        position=sensed(capture.position, "position"),
    )
    peak, force_fault = _peak(capture)
    slid, slide_fault = _slide(capture)
    distance = slid.distance if slid is not None else _reported_distance(capture)
    mu_force = _coefficient(force_fault)
    mu_distance = _coefficient(slide_fault)
    mu_combined = _coefficient("; ".join(dict.fromkeys(filter(None, (force_fault, slide_fault)))))
    warning = ""
    try:
        mixed = mix(model, capture.mass_kg, capture.velocity_m_s)
        warning = out_of_range(model, mixed, capture.velocity_m_s, math.nan, capture.stroke_m)
        try:
            if math.isfinite(peak.value):
                mu_force = _warned(by_force(model, mixed, capture.velocity_m_s, peak), warning, force_fault)
        except PredictionError as fault:
            mu_force = _coefficient(str(fault))
        try:
            if math.isfinite(distance.value):
                mu_distance = _warned(
                    by_distance(model, mixed, capture.velocity_m_s, distance), warning, slide_fault
                )
        except PredictionError as fault:
            mu_distance = _coefficient(str(fault))
        if mu_force.quality < Quality.BAD and mu_distance.quality < Quality.BAD:
            mu_combined = _warned(
                combined(model, mixed, capture.velocity_m_s, (mu_force, peak), (mu_distance, distance)),
                warning,
                "; ".join(filter(None, (force_fault, slide_fault))),
            )
        else:
            faults = [one.reason for one in (mu_force, mu_distance) if one.quality is Quality.BAD]
            mu_combined = _coefficient("; ".join(dict.fromkeys(faults)))
    except PredictionError as fault:
        mu_force = mu_distance = mu_combined = _coefficient(str(fault))
    mu_s, estimator = _published(capture, mu_combined, mu_force, mu_distance)
    gap = math.nan
    if force_fault or slid is None:
        mu_k = _mu_k(model, slid, mu_s, capture.mass_kg)
    else:
        try:
            found = fit(capture, model, slid)
        except PredictionError as fault:
            mu_k = _mu_k(model, slid, mu_s, capture.mass_kg)
            mu_s = _warned(mu_s, f"no waveform estimate: {fault}")
            gap = fault.gap if isinstance(fault, NotConvergedError) else math.nan
        else:
            mu_s_seen, mu_k, gap = _from_waveform(model, capture, found)
            if misfit <= DOUBTED or mu_s.quality is Quality.BAD:
                mu_s, estimator = mu_s_seen, Estimator.WAVEFORM
            else:
                missed = f"the model misses these taps: residuals are {misfit:.3g} times the noise"
                mu_s, mu_k = _warned(mu_s, missed), _warned(mu_k, missed)
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


def _from_waveform(model: Model, capture: Capture, found: Waveform) -> tuple[Coefficient, Coefficient, float]:
    """Coefficients as published, with a warning for a tap outside the calibration or unlike the model."""
    warnings = [beyond_calibration(model, capture, found.mu_s)]
    if found.misfit > DOUBTED:
        warnings.append(f"residuals are {found.gap:.3g} times the sensors' noise: the model lacks something")
    told = "mu_s through mu_k/mu_s of the model: the part moved at once" if found.immediate > 0.5 else ""
    mu_s = Coefficient(found.mu_s, found.mu_s_std, Quality.GOOD, told)
    mu_k = Coefficient(found.mu_k, found.mu_k_std, Quality.GOOD)
    return _warned(mu_s, *warnings), _warned(mu_k, *warnings), found.gap


def _peak(capture: Capture) -> tuple[Reading, str]:
    """Peak force and what is wrong with it; the module's own figure where no force was recorded."""
    if capture.force is None and capture.summary is not None:
        reported = capture.summary.peak_force_n
        if math.isfinite(reported) and reported > 0.0:
            return Reading(reported, 0.01 * reported), "from the module's summary: no force was recorded"
        return NOT_READ, f"the module reports a peak force of {reported} N and no record"
    try:
        return peak_force(capture.force), ""  # type: ignore[arg-type]
    except (PredictionError, PhysicsError) as fault:
        return NOT_READ, str(fault)


def _slide(capture: Capture) -> tuple[Slide | None, str]:
    if capture.summary is not None and (lacking := _lacking(capture)):
        return None, f"from the module's summary: {lacking}"
    try:
        return slide(capture), ""
    except (PredictionError, PhysicsError) as fault:
        return None, str(fault)


def _lacking(capture: Capture) -> str:
    """Say which channel was not recorded, of the two that show a slide."""
    if capture.position is None:
        return "no position was recorded"
    return "no force was recorded" if capture.force is None else ""


def _reported_distance(capture: Capture) -> Reading:
    if capture.summary is not None and _lacking(capture):
        reported = capture.summary.sliding_distance_m
        if math.isfinite(reported) and reported > 0.0:
            return Reading(reported, 0.01 * reported)
    return NOT_READ


def _coefficient(reason: str) -> Coefficient:
    return Coefficient(reason=reason)


def _warned(given: Coefficient, *warnings: str) -> Coefficient:
    """Mark a coefficient uncertain for each warning that says something."""
    said = [text for text in warnings if text]
    if not said:
        return given
    reasons = dict.fromkeys([*filter(None, given.reason.split("; ")), *"; ".join(said).split("; ")])
    return Coefficient(given.value, given.std, max(given.quality, Quality.UNCERTAIN), "; ".join(reasons))


def _published(
    capture: Capture, mu_combined: Coefficient, mu_force: Coefficient, mu_distance: Coefficient
) -> tuple[Coefficient, Estimator]:
    """Choose what is published without a waveform.

    One equation alone is published only where the other's channel was not recorded. Where it was and cannot
    be used, the capture is not to be trusted.
    """
    if mu_combined.quality < Quality.BAD:
        return mu_combined, Estimator.COMBINED
    if capture.force is None and mu_distance.quality < Quality.BAD:
        return _warned(mu_distance, "by sliding distance only: no force was recorded"), Estimator.DISTANCE
    if capture.position is None and mu_force.quality < Quality.BAD:
        return _warned(mu_force, "by peak force only: no position was recorded"), Estimator.FORCE
    return mu_combined, Estimator.NONE


def _mu_k(model: Model, slid: Slide | None, mu_s: Coefficient, mass_kg: float) -> Coefficient:
    """mu_k from the mean deceleration of the slide, or, without one, from mu_s through the ratio."""
    if slid is not None and (value := braking_friction(model, mass_kg, slid)) > 0.0:
        std = slid.deceleration.std / model.plant.gravity_m_s2
        return Coefficient(value, std, Quality.UNCERTAIN, "from the mean deceleration of the slide")
    if mu_s.quality < Quality.BAD:
        ratio = model.ratio
        std = ratio * math.hypot(mu_s.std, mu_s.value * model.prior.ratio_std / ratio)
        return Coefficient(ratio * mu_s.value, std, Quality.UNCERTAIN, "through mu_k/mu_s of the model")
    return Coefficient(reason=mu_s.reason)
