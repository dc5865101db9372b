"""The plant of a campaign: k, b and mu_k/mu_s shared by all taps, one friction a tap, fitted together.

Least squares on the waveforms of all taps. Each tap's own numbers are eliminated from the normal equations,
so the cost grows with the number of taps, not with its cube: its mu_k and, of a tap that was measured, its
first contact, mass, velocity and the sensors' scales. With those half a sampling step or 0.1 % off no plant
explains a tap.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impactcell.errors import NotConvergedError, PhysicsError, PredictionError
from impactcell.features import Features, required
from impactcell.features.contact import contact_spells
from impactcell.physics import Plant
from impactcell.prediction.campaign_problem import COMMON, NO_REST, SHARED, CampaignProblem
from impactcell.prediction.capture_blocks import linearised_model, until_next_contact
from impactcell.prediction.linearised_model import (
    DAMPING,
    MU_K,
    ONSET,
    PARAMETERS,
    RATIO,
    STIFFNESS,
    WITH_RECORDER,
    LinearisedModel,
    parameters_of,
    with_parameters,
)
from impactcell.prediction.model import Model, Prior
from impactcell.prediction.phase_reweighting import (
    LATE_FACTORS,
    MISFIT_THRESHOLD,
    Indices,
    interval_of_blocks,
    std_factors,
)
from impactcell.prediction.plant_fit import PlantFit
from impactcell.prediction.waveform import fit
from impactcell.records import Samples

MIN_MU_K = 1e-3
"""mu_k at which a fit starts at least: its logarithm is fitted."""
INITIAL_RATIO = 0.76
"""mu_k/mu_s from which a fit starts: that with which the paper's coefficients come back (own fit of them)."""
WEAK_STD = np.array([0.3, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
"""Standard deviations of what is shared about the start: of ln(mu_k/mu_s, k, b) they only hold what no tap
shows."""
CONTACT_STD = np.array([0.3, 3e-4, 2e-3, 1.0, 1.0, 1.0, 1.0])
"""The same where k and b of the contact alone are believed more than the model of the whole tap."""
MIN_RATIO_STD = 1e-3
"""Least standard deviation of mu_k/mu_s from tap to tap that a prior is given. Our choice."""
FEWEST_THAT_TELL, SCATTER_STD = 5, 0.03
"""Taps from which on a scatter of mu_k/mu_s is told, and the standard deviation of what is thought of it
before, as a share of mu_k/mu_s: the paper's predictors take 3 %."""
NO_RISE = (
    "the force does not rise with how far the actuator, at its velocity, has pressed into the part; check "
    "velocity, the units of times and position, and that t = 0 is first contact"
)
"""What is said where a contact that is no spring's shows no stiffness."""
REWEIGHTING_ROUNDS = 4
"""Rounds of weighing the phases by what the model misses of them. Our choice."""


def fit_plant(taps: Sequence[Features], gravity_m_s2: float, name: str = "fitted") -> PlantFit:
    """Fit k, b and mu_k/mu_s, with k_v = 0, to the taps of a campaign.

    Raises
    ------
    PredictionError
        No tap can be used, or the fit does not converge.
    """
    usable, faults = [], []
    for tap in taps:
        try:
            required(tap.slide)
            required(tap.peak_force)
        except (PredictionError, PhysicsError) as fault:
            faults.append(f"shot {tap.capture.cycle}: {fault}")
        else:
            usable.append(tap)
    if not usable:
        raise PredictionError(
            f"no tap of the campaign can be used; {faults[0] if faults else 'there is none'}"
        )
    contacts = np.array([contact_constants(tap) for tap in usable])
    stiffness, damping = np.median(contacts, axis=0).tolist()
    if not stiffness > 0.0:
        raise PredictionError(
            f"no tap of the campaign can be modelled; shot {usable[0].capture.cycle}: {NO_RISE}"
        )
    frictions = _initial_frictions(usable, gravity_m_s2)
    mean = float(np.mean(frictions))
    start = Plant(stiffness, max(damping, 1.0), mean / INITIAL_RATIO, mean, gravity_m_s2)
    responses, thetas, modelled = [], [], []
    for tap, mu_k in zip(usable, frictions, strict=True):
        plant = replace(start, mu_k=mu_k, mu_s=mu_k / INITIAL_RATIO)
        try:
            responses.append(linearised_model(tap, plant))
            thetas.append(np.append(parameters_of(plant), np.zeros(WITH_RECORDER - PARAMETERS + len(COMMON))))
            modelled.append(tap)
        except PhysicsError as fault:
            faults.append(f"shot {tap.capture.cycle}: {fault}")
    if not responses:
        raise PredictionError(f"no tap of the campaign can be modelled; {faults[0]}")
    anchor = thetas[0][SHARED]
    once = [until_next_contact(one, tap) for one, tap in zip(responses, modelled, strict=True)]
    fitted = CampaignProblem(once, anchor, WEAK_STD).fit(np.array(thetas))
    responses = _with_events_of(fitted.theta, modelled, responses, start)
    problem = CampaignProblem(responses, anchor, WEAK_STD)
    fitted = problem.fit(fitted.theta)
    thetas_fitted, covariance = fitted.theta, fitted.covariance.copy()
    onsets = [row[ONSET] * one.onset_std_s for row, one in zip(thetas_fitted, responses, strict=True)]
    count = sum(response.size for response in responses)
    misfit = math.sqrt(fitted.chi2 / max(count - len(thetas_fitted) - 3, 1))
    if misfit > MISFIT_THRESHOLD:
        anchored = thetas_fitted.copy()
        anchored[:, STIFFNESS], anchored[:, DAMPING] = math.log(stiffness), math.log(max(damping, 1.0))
        if not fitted.is_at_rest:  # to and fro over the kink at mu_k = mu_s, from where nothing leads back
            anchored[:, RATIO] = math.log(INITIAL_RATIO)
        slides = [required(tap.slide) for tap in modelled]
        intervals = [
            interval_of_blocks(one, slide.separation_s, slide.stop_s)
            for one, slide in zip(responses, slides, strict=True)
        ]
        thetas_fitted, covariance = _fit_reweighted(responses, anchored, intervals)
    elif not fitted.is_at_rest:
        raise NotConvergedError(NO_REST)
    else:
        covariance[0, 0] = problem.ratio_std(fitted) ** 2
    mu_k = float(np.exp(thetas_fitted[:, MU_K]).mean())
    ratio, stiffness, damping = np.exp(thetas_fitted[0, RATIO : DAMPING + 1]).tolist()
    stds = np.sqrt(np.diag(covariance)) * max(misfit, 1.0)
    plant = Plant(stiffness, damping, mu_k / ratio, mu_k, gravity_m_s2)
    prior = Prior(stds[1] * stiffness, stds[2] * damping, max(stds[0] * ratio, MIN_RATIO_STD))
    model = Model(name, plant, prior)
    scatter = ratio_scatter(usable, model)
    model = replace(model, prior=replace(prior, ratio_std=math.hypot(prior.ratio_std, scatter)))
    open_onset = [one.onset_std_s > 0.0 for one in responses]
    onset_s = float(np.mean(np.array(onsets)[open_onset])) if any(open_onset) else 0.0
    return PlantFit(model, tuple(tap.capture.cycle for tap in usable), misfit, float(stds[0]), onset_s)


def _initial_frictions(taps: Sequence[Features], gravity_m_s2: float) -> list[float]:
    """Give mu_k of each tap by its slide; where that is too short to show any, that of the other taps."""
    slowing = [required(tap.slide).deceleration for tap in taps]
    seen = [one.value for one in slowing if one.is_seen]
    usual = float(np.median(seen)) if seen else math.nan
    found = [one.value if one.is_seen or not seen else usual for one in slowing]
    return [max(value / gravity_m_s2, MIN_MU_K) for value in found]


def _with_events_of(
    thetas: Samples, taps: Sequence[Features], responses: Sequence[LinearisedModel], plant: Plant
) -> list[LinearisedModel]:
    """Average each tap anew, fine where the plant that was fitted to it has its events.

    The force jumps where a part is met again, and a block that the jump crosses is on either side of it by a
    hair: where the start had the jump elsewhere no step comes to rest. A plant that has no motion keeps its
    blocks.
    """
    found = []
    for row, tap, response in zip(thetas, taps, responses, strict=True):
        try:
            found.append(linearised_model(tap, with_parameters(plant, row)))
        except PhysicsError:
            found.append(response)
    return found


def contact_constants(tap: Features) -> tuple[float, float]:
    """K and b by regressing the force of the first contact on indentation and its rate.

    The rate comes from a spline-free derivative of the position: a polynomial over the contact, which is
    smooth enough for a start.

    Raises
    ------
    PredictionError
        The contact has fewer than twelve samples of the position.
    """
    capture, slide = tap.capture, required(tap.slide)
    force, position = required(tap.force), required(tap.position)
    spells = contact_spells(force)
    separation_s = spells[0][1] if len(spells) > 1 else slide.separation_s
    end = min(separation_s, capture.stroke_m / capture.velocity_m_s)
    inside = (position.time_s > 0.0) & (position.time_s < end)
    if inside.sum() < 12:
        raise PredictionError(f"shot {capture.cycle}: too few position samples within the contact")
    times = position.time_s[inside]
    moved = capture.direction * position.values[inside]
    basis = np.polynomial.Chebyshev.fit(times, moved, min(9, len(times) // 4))
    near = (force.time_s >= times[0]) & (force.time_s <= times[-1])
    at = force.time_s[near]
    indentation = capture.velocity_m_s * at - basis(at)
    rate = np.maximum(capture.velocity_m_s - basis.deriv()(at), 0.0)
    design = np.column_stack([indentation, rate])
    (stiffness, damping), *_ = np.linalg.lstsq(design, force.values[near])
    return float(stiffness), float(damping)


def estimate_mass(tap: Features) -> float:
    """Mass of the part, kg, from its momentum: the force's impulse is m (x'(t_2) - x'(t_1) + a (t_2 - t_1)).

    Between the middle of the contact, when the part slips, and its loss; a is the deceleration of the slide.
    """
    capture, slide = tap.capture, required(tap.slide)
    force, position = required(tap.force), required(tap.position)
    end, start = slide.separation_s, 0.4 * slide.separation_s
    inside = (position.time_s > 0.5 * start) & (position.time_s < end + 0.25 * (slide.stop_s - end))
    moved = capture.direction * position.values[inside]
    path = np.polynomial.Chebyshev.fit(
        position.time_s[inside], moved, min(12, max(4, int(inside.sum()) // 6))
    )
    speed = path.deriv()
    at = np.linspace(start, end, 2001)
    impulse = float(np.trapezoid(np.interp(at, force.time_s, force.values), at))
    return impulse / float(speed(end) - speed(start) + slide.deceleration.value * (end - start))


def ratio_scatter(taps: Sequence[Features], model: Model) -> float:
    """Scatter of mu_k/mu_s from tap to tap beyond its estimates' errors, from the taps that show mu_s.

    The root of its expected square: what few taps cannot exclude counts. The likelihood is that of restricted
    maximum likelihood (Patterson and Thompson, Biometrika 58, 1971), the prior half of a normal distribution
    (Gelman, Bayesian Analysis 1, 2006). Errors that all taps share, of mass and scales, scatter from none.
    """
    wide = replace(model, prior=replace(model.prior, ratio_std=0.2))
    values, variances = [], []
    for tap in taps:
        try:
            waveform = fit(tap, wide)
        except (PredictionError, PhysicsError):
            continue
        if waveform.immediate < 0.01 and waveform.mu_s_std < 0.05 * waveform.mu_s:
            values.append(waveform.mu_k / waveform.mu_s)
            own_variance = waveform.mu_s_std**2 - waveform.mu_s_common_std**2
            variances.append(own_variance * (values[-1] / waveform.mu_s) ** 2)
    if len(values) < FEWEST_THAT_TELL:
        return 0.0
    return _expected_scatter(np.array(values), np.array(variances), SCATTER_STD * float(np.mean(values)))


def _expected_scatter(values: Samples, variances: Samples, prior_std: float) -> float:
    """Root of the expected square of a scatter beside errors of known variances."""
    scatter = np.linspace(0.0, 5.0 * prior_std, 201)[:, None]
    weights = 1.0 / (variances + scatter**2)
    total = weights.sum(axis=1)
    mean = (weights @ values) / total
    chi2 = np.sum(weights * (values - mean[:, None]) ** 2, axis=1)
    scatter = scatter[:, 0]
    logarithm = 0.5 * (np.log(weights).sum(axis=1) - np.log(total) - chi2 - (scatter / prior_std) ** 2)
    probability = np.exp(logarithm - logarithm.max())
    square, whole = np.trapezoid(scatter**2 * probability), np.trapezoid(probability)
    return math.sqrt(square / whole)


def _fit_reweighted(
    responses: Sequence[LinearisedModel], thetas: Samples, intervals: Sequence[Indices]
) -> tuple[Samples, Samples]:
    """Fit again, with each phase of the tap believed as far as the model describes it there.

    k and b stay with the regression of force on indentation, which needs no law of friction, and mu_s with
    the first quarter of the contact, where all is slow and laws that depend on speed say little.
    """
    covariance = np.zeros((3, 3))
    anchor = thetas[0, SHARED].copy()
    for _ in range(REWEIGHTING_ROUNDS):
        reweighted = [
            response.reweighted(
                std_factors(response.linearise(row[: response.parameters]).residual, interval)
                * LATE_FACTORS[interval]
            )
            for response, row, interval in zip(responses, thetas, intervals, strict=True)
        ]
        fitted = CampaignProblem(reweighted, anchor, CONTACT_STD).fit(thetas)
        if not fitted.is_at_rest:
            raise NotConvergedError(NO_REST)
        thetas, covariance = fitted.theta, fitted.covariance
    return thetas, covariance
