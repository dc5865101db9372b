"""Friction of a tap, from its arrays or from the shots of a campaign."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from impactcell.api.stated_tap import a_path, check_ascending, check_fastest
from impactcell.campaign.pretrigger import is_late, late_onset
from impactcell.errors import CaptureError, NotConvergedError, PhysicsError, PredictionError, SettingsError
from impactcell.features import Features, extract, impulse_balance, noise_std, with_noise_at_rest
from impactcell.numerics.stated_numbers import numbers, one_number
from impactcell.physics import TapInput
from impactcell.physics.local_friction import friction_factor
from impactcell.prediction import Model, calibrate, estimate_from_features
from impactcell.prediction.joint_plant_fit import estimate_mass, fit_plant
from impactcell.process.console import print_note
from impactcell.process.progress import progress
from impactcell.records import (
    Capture,
    Channel,
    FrictionEstimate,
    Samples,
    as_recorded,
    sampling_step_s,
)

FRICTIONS = 9
"""Values of mu_s that are swept for each mass of a campaign: three times the coefficients of (4) and (5)."""
VELOCITIES = 9
"""Velocities swept for each mass, and most masses swept; as `FRICTIONS`."""
WIDEST = 0.3
"""Friction is swept at least this far, relative, to either side of the plant's."""
NARROWEST = 0.8
"""Velocity is swept at least from this share of the fastest shot's."""
LEAST_NOISE = 1e-4
"""Noise of a channel is at least this share of its largest value: sensors of 16 bits whose range is used to
a sixth. Without it a simulated trace without noise would be held to the last bit of a float."""
GRAVITY_M_S2 = 9.81
"""Of a tap given as arrays; m/s²."""


def estimate(
    time_s: ArrayLike,
    force_n: ArrayLike,
    position_m: ArrayLike,
    velocity_m_s: float,
    mass_kg: float,
    stroke_m: float = math.inf,
    *,
    model: str | PathLike[str] | None = None,
) -> FrictionEstimate:
    """Estimate mu_s and mu_k of one tap from its traces.

    By peak force (4), sliding distance (5), both (6), and by the whole waveform, each with its standard
    deviation; the best of them is published as `mu_s` and `mu_k`.

    Parameters
    ----------
    time_s, force_n, position_m : array_like, shape (n,)
        Strictly ascending times, 0 at first contact; contact force, positive in compression; position along
        the tap. Samples that are masked, nan or inf count as lost. Record until the part is at rest. The
        sensors' noise is taken from the traces, and is at least 1e-4 of their largest values.
    velocity_m_s, mass_kg : float
        Constant velocity of the actuator, and mass of the part.
    stroke_m : float
        Travel from first contact after which the actuator halts; inf if it halts as it loses contact.
    model : path, optional
        Model file of the cell, as `impactcell calibrate` writes it. Without it k, b and mu_k/mu_s are fitted
        to this one tap, with k_v = 0, which shows mu_k well and mu_s only as far as stiction shows in it.

    Returns
    -------
    FrictionEstimate
        Traces in which no tap can be seen give a bad quality and the reason.

    Raises
    ------
    CaptureError
        Arrays of different lengths, or of more than one dimension; times that fall; a velocity, mass or
        stroke that cannot be, or what is no number; a force that pulls, a position that falls, a contact that
        does not begin at t = 0.
    SettingsError
        The model file cannot be read.
    PredictionError
        Without a model: the plant cannot be fitted.

    Examples
    --------
    >>> from impactcell import simulate_tap
    >>> tap = simulate_tap(0.04, 18.9, plant={"mu_s": 0.21, "mu_k": 0.16})
    >>> friction = estimate(tap.time_s, tap.force_n, tap.position_m, 0.04, 18.9)
    >>> f"{friction.mu_k.value:.4f}"
    '0.1600'
    """
    time = numbers("time_s", time_s, CaptureError)
    force, position = _samples("force_n", force_n), _samples("position_m", position_m)
    if time.ndim != 1 or force.shape != time.shape or position.shape != time.shape:
        raise CaptureError(
            f"time_s, force_n and position_m must be of one length and one dimension, "
            f"not of shapes {time.shape}, {force.shape} and {position.shape}"
        )
    check_ascending(time)
    velocity = one_number("velocity_m_s", velocity_m_s, CaptureError)
    mass = one_number("mass_kg", mass_kg, CaptureError)
    stroke = one_number("stroke_m", stroke_m, CaptureError)
    _check_velocity(velocity, is_needed=model is None)
    _check_mass(mass, is_needed=model is None)
    if not stroke > 0.0:
        raise CaptureError(
            f"stroke_m = {stroke:g}: give the actuator's travel from first contact in m, above 0, or "
            "leave it out where it halts as it loses contact"
        )
    model_file = None if model is None else a_path("model", model, SettingsError)
    capture = Capture(
        cycle=1,
        velocity_m_s=velocity,
        mass_kg=mass,
        force=Channel(time, force),
        position=Channel(time, position),
        stroke_m=stroke,
    )
    (capture,), _ = with_noise_at_rest([capture], [capture])
    capture = replace(capture, force=_with_noise(capture.force), position=_with_noise(capture.position))
    features = extract(as_recorded(capture))
    _check_signs_and_start(features)
    if model_file is not None:
        from impactcell.settings.model_file import read_model

        return estimate_from_features(features, read_model(model_file))
    try:
        fit = fit_plant([features], GRAVITY_M_S2)
    except (PredictionError, PhysicsError) as fault:
        raise _of_one_tap(fault) from fault
    return fit.estimate(features, calibrated_where_possible(fit.model, [capture]))


def _check_velocity(velocity_m_s: float, *, is_needed: bool) -> None:
    check_fastest(velocity_m_s, CaptureError)
    if velocity_m_s < 0.0 or (is_needed and not velocity_m_s > 0.0):
        raise CaptureError(
            f"velocity_m_s = {velocity_m_s:g}: give the actuator's speed in m/s, above 0; position_m is "
            "positive along the tap"
        )


def _check_mass(mass_kg: float, *, is_needed: bool) -> None:
    if mass_kg < 0.0 or math.isinf(mass_kg) or (is_needed and not mass_kg > 0.0):
        raise CaptureError(f"mass_kg = {mass_kg:g}: give the mass of the part in kg, above 0")


def _check_signs_and_start(features: Features) -> None:
    """Refuse traces of the other sign, and of another t = 0, with what would mend them."""
    if pull := impulse_balance.pull_n(features):
        raise CaptureError(f"force_n pulls with {pull:.4g} N, where a contact only pushes: give -force_n")
    if back_m := impulse_balance.moved_back_m(features):
        raise CaptureError(
            f"position_m falls by {1e3 * back_m:.4g} mm, and is positive along the tap: give -position_m"
        )
    force, step_s = features.capture.force, sampling_step_s(features.capture)
    onset = late_onset(force)
    if force is None or onset is None:
        return
    begin_s = float(force.time_s[onset])
    if is_late(begin_s, step_s, is_stated=bool(force.time_s[0] < 0.0)):
        raise CaptureError(
            f"the force begins at {1e3 * begin_s:.4g} ms, and t = 0 is first contact: give "
            f"time_s - {begin_s - step_s:.6g}, or look for a step of the force before"
        )


def _of_one_tap(fault: PredictionError | PhysicsError) -> PredictionError:
    """Say of the one tap that was given what a fit says of a campaign."""
    if isinstance(fault, NotConvergedError):
        return NotConvergedError(
            "no k, b and mu_k/mu_s explain the tap; see that velocity, mass, stroke, the units of the traces "
            "and t = 0, first contact, are right, or give the cell's model",
            fault.gap,
        )
    reason = re.sub(
        r"^no tap of the campaign can be (?:used|modelled); |shot 1: |\. Command a stroke$", "", str(fault)
    )
    hint = "; check velocity, mass, stroke and the units of the traces" if "modelled" in str(fault) else ""
    return PredictionError(f"the tap cannot be used: {reason}{'' if 'check' in reason else hint}")


def _samples(name: str, given: ArrayLike) -> Samples:
    """Give the samples of a channel; nan those that were lost: masked, or infinite."""
    values = numbers(name, given, CaptureError)
    return np.where(np.isfinite(values), values, math.nan)


def _with_noise(channel: Channel | None) -> Channel | None:
    """Give the channel its own noise, or the least that a sensor has."""
    if channel is None:
        return None
    least = LEAST_NOISE * float(
        np.max(np.abs(channel.values), initial=0.0, where=np.isfinite(channel.values))
    )
    return replace(channel, noise_std=max(noise_std(channel), least))


def with_masses(taps: Sequence[Features]) -> tuple[Features, ...]:
    """Give a mass to the taps that lack one, by their momentum balance."""
    complete = []
    for tap in taps:
        capture = tap.capture
        if math.isnan(capture.mass_kg):
            try:
                capture = replace(capture, mass_kg=estimate_mass(tap))
            except (PredictionError, PhysicsError) as error:
                print_note(f"shot {capture.cycle}: mass_kg is empty and cannot be fitted: {error}")
        complete.append(replace(tap, capture=capture))
    return tuple(complete)


def calibrated_where_possible(model: Model, shots: Sequence[Capture]) -> Model:
    """Calibrate a model; it stays as it is, with a note, where its parts do not slide free."""
    try:
        return calibrated(model, shots)
    except PredictionError as fault:  # the waveform of a tap needs no equations
        print_note(f"no estimates by equations (4), (5) and (6): {fault}")
        return model


def calibrated(model: Model, shots: Sequence[Capture]) -> Model:
    """Calibrate a model that has no predictors to the masses, velocities and stroke of a campaign."""
    if model.predictors:
        return model
    usable = [shot for shot in shots if shot.mass_kg > 0.0 and shot.velocity_m_s > 0.0]
    if not usable:
        return model
    strokes = {shot.stroke_m for shot in usable}
    stroke = usable[0].stroke_m if len(strokes) == 1 else math.inf
    masses = sorted({round(shot.mass_kg, 2) for shot in usable})
    if len(masses) > VELOCITIES:
        masses = np.geomspace(masses[0], masses[-1], VELOCITIES).tolist()
    fastest = max(shot.velocity_m_s for shot in usable)
    slowest = min(NARROWEST * fastest, *(shot.velocity_m_s for shot in usable))
    tap = TapInput(
        fastest,
        masses[0],
        stroke,
        direction=usable[0].direction if len({shot.direction for shot in usable}) == 1 else 1,
        halts_at_separation=math.isinf(stroke),
        start_m=float(np.median([shot.start_m for shot in usable])),
    )
    mu_s = friction_factor(model.plant, tap) * model.plant.mu_s
    frictions = np.linspace(1.0 - WIDEST, 1.0 + WIDEST, FRICTIONS) * mu_s
    velocities = np.linspace(slowest, fastest, VELOCITIES)
    with progress("calibrating", len(masses)) as advance:
        predictors = calibrate(
            model.plant, tap, masses, velocities, frictions, lambda at, _: advance() if at else None
        )
    return replace(model, predictors=predictors, stroke_m=stroke)
