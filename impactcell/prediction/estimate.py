"""One capture in, one `FrictionEstimate` out: every predictor, and the one that is published."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from impactcell.errors import NotConvergedError, PredictionError
from impactcell.features import (
    Fault,
    Features,
    MeasuredFeature,
    SlideFeatures,
    extract,
    impulse_balance,
)
from impactcell.prediction.capture_blocks import friction_factor_of, halts_in_contact, recorder_std_of
from impactcell.prediction.equations import beyond_calibration, by_distance, by_force, combined, out_of_range
from impactcell.prediction.linearised_model import FORCE_SCALE, MASS, PARAMETERS, POSITION_SCALE, VELOCITY
from impactcell.prediction.mass_interpolation import interpolate_mass
from impactcell.prediction.model import Model
from impactcell.prediction.phase_reweighting import MISFIT_THRESHOLD
from impactcell.prediction.slide_friction import coefficient_of_slide
from impactcell.prediction.waveform import WaveformFit, deceleration_friction, fit
from impactcell.records import MM_PER_MIN, Capture, Coefficient, Estimator, FrictionEstimate, Quality

NO_FEATURE = MeasuredFeature(math.nan, math.nan)
SUMMARY_RELATIVE_STD = 0.01
"""Relative standard deviation of what the module reports without one: our choice, for it says nothing."""
MAX_DEVIATION = 3.0
"""Standard deviations by which what was told may be off: 3 % of mass and force, 1.5 % of velocity,
0.9 % of position."""


@dataclass(frozen=True, slots=True)
class _Equations:
    """mu_s by equations (4), (5) and (6)."""

    force: Coefficient
    distance: Coefficient
    combined: Coefficient


def estimate(capture: Capture, model: Model, misfit: float = 1.0) -> FrictionEstimate:
    """Estimate mu_s and mu_k of one tap by equations (4), (5), (6) and by its waveform.

    As `estimate_from_features`, from a capture of which no features have been extracted yet.
    """
    return estimate_from_features(extract(capture), model, misfit)


def estimate_from_features(features: Features, model: Model, misfit: float = 1.0) -> FrictionEstimate:
    """Estimate mu_s and mu_k of one tap by equations (4), (5), (6) and by its waveform.

    Published is the waveform's estimate where it converges, else (6), else (4) or (5) alone where only one
    channel was recorded. All are the friction of the place where the tap began, with the factor that the
    model's effects have there (`physics.local_friction`).
    A capture that cannot be used, or contradicts itself, gives a bad estimate that says why; nothing is
    raised for it.

    Parameters
    ----------
    features : Features
    model : Model
    misfit : float
        RMS of the model's residuals over many taps, 1 = noise, where it is known. A model that misses those
        bends mu_s even in a tap that it seems to fit: then mu_s comes from the equations, whose few
        coefficients bend less, and mu_k from the deceleration of the slide. Mass, velocity and scales count
        as told then, for they would follow what the model lacks.
    """
    capture = features.capture
    peak, force_fault = _peak_force(features)
    slide, distance, slide_fault = _slide(features)
    equations = _by_equations(capture, model, (peak, force_fault), (distance, slide_fault))
    mu_s, estimator = _select_published(capture, equations)
    gap = math.nan
    if force_fault or slide is None:
        mu_k = _mu_k(model, slide, mu_s, capture)
    else:
        try:
            waveform = fit(features if misfit <= MISFIT_THRESHOLD else _exactly_told(features), model)
        except PredictionError as fault:
            mu_k = _mu_k(model, slide, mu_s, capture)
            mu_s = _with_warnings(mu_s, f"no waveform estimate: {fault}")
            gap = fault.gap if isinstance(fault, NotConvergedError) else math.nan
        else:
            mu_s_seen, mu_k, gap = _from_waveform(model, features, waveform)
            if max(misfit, waveform.misfit) > MISFIT_THRESHOLD:
                mu_k = _with_warnings(_mu_k(model, slide, mu_s_seen, capture), mu_k.reason)
            if misfit <= MISFIT_THRESHOLD or mu_s.quality is Quality.BAD:
                mu_s, estimator = mu_s_seen, Estimator.WAVEFORM
            else:
                missed = f"the model misses these taps: residuals are {misfit:.3g} times the noise"
                mu_s, mu_k = _with_warnings(mu_s, missed), _with_warnings(mu_k, missed)
    if estimator is not Estimator.WAVEFORM and (cannot_be := impulse_balance.doubts(features)):
        mu_s, mu_k, estimator = _refused(mu_s, cannot_be), _refused(mu_k, cannot_be), Estimator.NONE
    return FrictionEstimate(
        mu_s=_with_notes(mu_s, features.left_out),
        mu_k=_with_notes(mu_k, features.left_out),
        by_force=equations.force,
        by_distance=equations.distance,
        combined=equations.combined,
        estimator=estimator,
        peak_force_n=peak.value,
        sliding_distance_m=distance.value,
        gap=gap,
    )


def _by_equations(
    capture: Capture, model: Model, peak: tuple[MeasuredFeature, str], distance: tuple[MeasuredFeature, str]
) -> _Equations:
    """mu_s by (4), (5) and (6) from two features, each with what is wrong with it."""
    (peak_force, force_fault), (sliding_distance, slide_fault) = peak, distance
    velocity_m_s, told_std = capture.velocity_m_s, recorder_std_of(capture)
    try:
        coefficients = interpolate_mass(model, capture.mass_kg, velocity_m_s)
        warning = out_of_range(model, coefficients, velocity_m_s, math.nan, capture.stroke_m)
    except PredictionError as fault:
        return _Equations(*[Coefficient(reason=force_fault or slide_fault or str(fault))] * 3)
    mu_force, mu_distance = Coefficient(reason=force_fault), Coefficient(reason=slide_fault)
    try:
        if math.isfinite(peak_force.value):
            mu_force = by_force(model, coefficients, velocity_m_s, peak_force, told_std)
            mu_force = _with_warnings(mu_force, warning, force_fault)
    except PredictionError as fault:
        mu_force = Coefficient(reason=str(fault))
    try:
        if math.isfinite(sliding_distance.value):
            mu_distance = by_distance(model, coefficients, velocity_m_s, sliding_distance, told_std)
            mu_distance = _with_warnings(mu_distance, warning, slide_fault)
    except PredictionError as fault:
        mu_distance = Coefficient(reason=str(fault))
    if mu_force.quality is Quality.BAD or mu_distance.quality is Quality.BAD:
        faults = [mu_s.reason for mu_s in (mu_force, mu_distance) if mu_s.quality is Quality.BAD]
        return _Equations(mu_force, mu_distance, Coefficient(reason="; ".join(dict.fromkeys(faults))))
    both = (mu_force, peak_force), (mu_distance, sliding_distance)
    mu_combined = combined(model, coefficients, velocity_m_s, *both, told_std)
    faults = [fault for fault in (force_fault, slide_fault) if fault]
    return _Equations(mu_force, mu_distance, _with_warnings(mu_combined, warning, "; ".join(faults)))


def _exactly_told(features: Features) -> Features:
    """Take mass, velocity and scales of a tap as they were told."""
    told = replace(
        features.capture, mass_std=0.0, velocity_std=0.0, force_scale_std=0.0, position_scale_std=0.0
    )
    return replace(features, capture=told)


def _from_waveform(
    model: Model, features: Features, waveform: WaveformFit
) -> tuple[Coefficient, Coefficient, float]:
    """Coefficients as published, with a warning for a tap outside the calibration or unlike the model."""
    capture, mu_k_std = features.capture, waveform.mu_k_std
    here = friction_factor_of(capture, model.plant)
    if capture.position_scale_std and halts_in_contact(capture, model.plant, waveform.theta):
        # The place of the halt tells the position's scale no better than anybody knows the stroke.
        mu_k_std = max(mu_k_std, capture.position_scale_std * waveform.mu_k)
    warnings = [beyond_calibration(model, capture, here * waveform.mu_s), *_told_otherwise(capture, waveform)]
    warnings.append(waveform.record_fault)
    if waveform.misfit > MISFIT_THRESHOLD:
        warnings.append(
            f"residuals are {waveform.gap:.3g} times the sensors' noise: the model lacks something"
        )
    at_once = waveform.immediate > 0.5
    reason = "mu_s through mu_k/mu_s of the model: the part moved at once" if at_once else ""
    own_variance = waveform.mu_k_std**2 - waveform.mu_k_common_std**2
    mu_k_common_std = math.sqrt(mu_k_std**2 - own_variance)
    mu_s = _times(here, waveform.mu_s, waveform.mu_s_std, waveform.mu_s_common_std, reason=reason)
    mu_k = _times(here, waveform.mu_k, mu_k_std, mu_k_common_std)
    return _with_warnings(mu_s, *warnings), _with_warnings(mu_k, *warnings), waveform.gap


def _times(factor: float, value: float, std: float, common_std: float, reason: str = "") -> Coefficient:
    """Return friction where a tap began, of that of the model that it was found with."""
    return Coefficient(factor * value, factor * std, Quality.GOOD, reason, factor * common_std)


def _told_otherwise(capture: Capture, waveform: WaveformFit) -> list[str]:
    """Name the mass, the velocity or the scale that the tap shows, where it is not as told."""
    if len(waveform.theta) == PARAMETERS:
        return []
    off = waveform.theta
    said = []
    if abs(off[MASS]) > MAX_DEVIATION:
        mass_kg = capture.mass_kg * math.exp(capture.mass_std * off[MASS])
        said.append(f"the tap is that of {mass_kg:.4g} kg, not {capture.mass_kg:.4g} kg: check the mass")
    if abs(off[VELOCITY]) > MAX_DEVIATION:
        told = capture.velocity_m_s / MM_PER_MIN
        shown = told * math.exp(capture.velocity_std * off[VELOCITY])
        said.append(f"the tap is that of {shown:.0f} mm/min, not {told:.0f} mm/min: check the velocity")
    if abs(off[FORCE_SCALE]) > MAX_DEVIATION:
        scale = math.exp(capture.force_scale_std * off[FORCE_SCALE])
        said.append(f"the force is {scale:.3f} times that of the model: check its scale")
    if abs(off[POSITION_SCALE]) > MAX_DEVIATION:
        scale = math.exp(capture.position_scale_std * off[POSITION_SCALE])
        said.append(f"the position is {scale:.3f} times that of the model: check its scale")
    return said


def _peak_force(features: Features) -> tuple[MeasuredFeature, str]:
    """Peak force and what is wrong with it; the module's own figure where no force was recorded."""
    capture = features.capture
    if capture.force is None and capture.summary is not None:
        reported = capture.summary.peak_force_n
        if math.isfinite(reported) and reported > 0.0:
            return _reported(reported, capture.summary.peak_force_std_n, "no force was recorded")
        return NO_FEATURE, f"the module reports a peak force of {reported} N and no record"
    if isinstance(features.peak_force, Fault):
        return NO_FEATURE, str(features.peak_force)
    return features.peak_force, ""


def _slide(features: Features) -> tuple[SlideFeatures | None, MeasuredFeature, str]:
    """Slide, sliding distance and what is wrong with them; the module's own distance without a channel."""
    summary, missing = features.capture.summary, _missing_channel(features.capture)
    if summary is not None and missing:
        reported = summary.sliding_distance_m
        if not (math.isfinite(reported) and reported > 0.0):
            return None, NO_FEATURE, f"{missing}, and the module reports a sliding distance of {reported} m"
        return None, *_reported(reported, summary.sliding_distance_std_m, missing)
    if isinstance(features.slide, Fault):
        return None, NO_FEATURE, str(features.slide)
    return features.slide, features.slide.distance, ""


def _missing_channel(capture: Capture) -> str:
    """Say which channel was not recorded, of the two that show a slide."""
    if capture.position is None:
        return "no position was recorded"
    return "no force was recorded" if capture.force is None else ""


def _reported(value: float, std: float, missing: str) -> tuple[MeasuredFeature, str]:
    """Figure of the module, and what is wrong with it: nothing where the module's map tells its error."""
    if std > 0.0:
        return MeasuredFeature(value, std), ""
    return MeasuredFeature(value, SUMMARY_RELATIVE_STD * value), f"from the module's summary: {missing}"


def _with_warnings(coefficient: Coefficient, *warnings: str) -> Coefficient:
    """Mark a coefficient uncertain for each warning that says something."""
    texts = [text for text in warnings if text]
    if not texts:
        return coefficient
    quality = max(coefficient.quality, Quality.UNCERTAIN)
    return _with_notes(replace(coefficient, quality=quality), texts)


def _with_notes(coefficient: Coefficient, notes: Sequence[str]) -> Coefficient:
    """Add what is to be said of a coefficient and makes it no worse."""
    said = filter(None, (*coefficient.reason.split("; "), *"; ".join(notes).split("; ")))
    return replace(coefficient, reason="; ".join(dict.fromkeys(said))) if notes else coefficient


def _refused(coefficient: Coefficient, why: Sequence[str]) -> Coefficient:
    """Publish none where force, position, mass and time of a tap contradict each other."""
    return _with_notes(Coefficient(reason="; ".join(why)), [coefficient.reason])


def _select_published(capture: Capture, equations: _Equations) -> tuple[Coefficient, Estimator]:
    """Choose what is published without a waveform.

    One equation alone is published only where the other's channel was not recorded. Where it was and cannot
    be used, the capture is not to be trusted.
    """
    if equations.combined.quality < Quality.BAD:
        return equations.combined, Estimator.COMBINED
    if capture.force is None and equations.distance.quality < Quality.BAD:
        return _with_warnings(
            equations.distance, "by sliding distance only: no force was recorded"
        ), Estimator.DISTANCE
    if capture.position is None and equations.force.quality < Quality.BAD:
        return _with_warnings(
            equations.force, "by peak force only: no position was recorded"
        ), Estimator.FORCE
    return equations.combined, Estimator.NONE


def _mu_k(model: Model, slide: SlideFeatures | None, mu_s: Coefficient, capture: Capture) -> Coefficient:
    """mu_k from the mean deceleration of the slide, or, without one, from mu_s through the ratio.

    A slide knows nothing of what a model lacks in the contact, where a waveform bends mu_k by a third for
    0.1 ms of delay.
    """
    if slide is not None and (value := deceleration_friction(model, capture.mass_kg, slide)) > 0.0:
        return coefficient_of_slide(value, slide, capture, model.plant.gravity_m_s2)
    if mu_s.quality < Quality.BAD:
        ratio = model.ratio
        std = ratio * math.hypot(mu_s.std, mu_s.value * model.prior.ratio_std / ratio)
        return Coefficient(ratio * mu_s.value, std, Quality.UNCERTAIN, "through mu_k/mu_s of the model")
    return Coefficient(reason=mu_s.reason)
