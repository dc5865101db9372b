"""mu_s and mu_k from the whole waveform of a tap: maximum a posteriori, with k and b as nuisances.

Gauss-Newton on the blocks of a capture (`capture_blocks`), started from the curvature of
the slide. Priors are those of the model: mu_k is free; mu_k/mu_s, k and b are log-normal about its plant's.
Where breakaway may be immediate the posterior has a kink and is fitted on either side of it
(`impactcell.prediction.posterior`): mu_s is then seen only through the prior on mu_k/mu_s, and its
standard deviation says so.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.errors import CaptureError, NotConvergedError, PhysicsError
from impactcell.features import Features, SlideFeatures, required
from impactcell.features.contact import refuse_clipped
from impactcell.prediction import capture_blocks
from impactcell.prediction.linearised_model import (
    LATEST_ONSET,
    MU_K,
    ONSET,
    PARAMETERS,
    WITH_RECORDER,
    LinearisedModel,
    parameter_count,
    parameters_of,
    with_parameters,
)
from impactcell.prediction.model import Model
from impactcell.prediction.phase_reweighting import (
    LATE_FACTORS,
    MISFIT_THRESHOLD,
    interval_of_blocks,
    std_factors,
)
from impactcell.prediction.posterior import Posterior, mixture
from impactcell.prediction.record_faults import begun_at, may_have_begun_elsewhere, record_fault
from impactcell.prediction.tap_problem import GaussianPrior, Minimum, TapProblem
from impactcell.records import Samples

KINK_DISTANCE_STD = 6.0
"""Standard deviations of z beyond which the other side of the kink has no weight."""
MU_K_FORM, MU_S_FORM = np.array([1.0, 0.0, 0.0, 0.0]), np.array([1.0, -1.0, 0.0, 0.0])
"""How ln mu_k and ln mu_s follow theta."""
MAX_MISFIT = 4.0
"""Misfit of blocks from which on the waveform is not believed at all."""
SURELY_OVERCOME = 0.8
"""Share of a tap's largest force below which static friction surely was, noise and all. Our choice."""
LARGEST_STD = 3.0
"""Standard deviation of ln mu from which on, a factor of twenty, a tap says nothing of friction."""
OPEN_ONSET_S, SEEN_STDS = 1e-4, 6.0
"""Standard deviation of first contact about t = 0 [s], as of triggers, that is tried of a tap that is missed,
or whose contact comes to the end of a sampling step; and how many of its own have to show it beyond that."""
REWEIGHTING_ROUNDS = 3
"""Rounds of doubting the phases that the model misses."""


@dataclass(frozen=True, slots=True, eq=False)
class WaveformFit:
    """Outcome of a waveform fit.

    Attributes
    ----------
    mu_s, mu_s_std, mu_k, mu_k_std : float
        Posterior means and standard deviations; of the plant, without the factor of `physics.local_friction`.
    mu_s_common_std, mu_k_common_std : float
        The part of these that taps like this one share: errors of the plant's constants, of mass, velocity
        and scales as told; first contact is each tap's own.
    theta : ndarray, shape (4,) or (9,)
        Most probable ln(mu_k, mu_k/mu_s, k, b), and of a tap that was measured its first contact, mass,
        velocity and scales of force and position, in standard deviations from what is known of them.
    posterior : Posterior
        Of theta.
    immediate : float
        Probability that the part moved at once, so that the capture does not show mu_s.
    gap : float
        RMS of the residuals of single samples over the sensors' noise; 1 = noise.
    misfit : float
        The same for blocks, and for what is known of the record. The standard deviations are widened by it
        where it is above 1; where it is well above, the phases that the model misses count for less
        (`impactcell.prediction.phase_reweighting`).
    record_fault : str
        What is wrong with the record, or with friction in slow slip, by what it explains.
    """

    mu_s: float
    mu_s_std: float
    mu_k: float
    mu_k_std: float
    mu_s_common_std: float
    mu_k_common_std: float
    theta: Samples
    posterior: Posterior
    immediate: float
    gap: float
    misfit: float
    record_fault: str = ""


def prior_of(model: Model, parameters: int = PARAMETERS) -> GaussianPrior:
    """Prior of a tap's parameters, with those of its record where they are; nothing is known of mu_k."""
    plant, prior = model.plant, model.prior
    weight = np.array(
        [
            0.0,
            model.ratio / prior.ratio_std,
            plant.stiffness_n_per_m / prior.stiffness_std_n_per_m,
            plant.damping_n_s_per_m / prior.damping_std_n_s_per_m,
        ]
    )
    beyond = parameters - PARAMETERS
    mean = np.append(parameters_of(plant), np.zeros(beyond))
    return GaussianPrior(mean, np.append(weight, np.ones(beyond)))


def fit(features: Features, model: Model) -> WaveformFit:
    """Fit the whole waveform of one tap.

    Parameters
    ----------
    features : Features
        With force and position.
    model : Model
        With a `ratio_std` of next to nothing mu_k/mu_s is the plant's, as the paper takes it.

    Raises
    ------
    CaptureError, ClippedForceError, NoBreakawayError, NoSeparationError, NoStopError
        The capture cannot be used.
    NotConvergedError
        The fit did not reach a minimum, or the model is not that of this tap.
    """
    refuse_clipped(required(features.force))
    slide, capture = required(features.slide), features.capture
    prior = prior_of(model, parameter_count(capture_blocks.recorder_std_of(capture)))
    theta = prior.mean.copy()
    if not (capture.mass_kg > 0.0 and capture.velocity_m_s > 0.0):
        raise CaptureError("the part's mass or the actuator's velocity is not known")
    is_seen = slide.deceleration.is_seen
    here = capture_blocks.friction_factor_of(capture, model.plant)
    mu_k = deceleration_friction(model, capture.mass_kg, slide) if is_seen else here * model.plant.mu_k
    theta[MU_K] = math.log(max(min(mu_k, _friction_overcome(features, model)) / here, 1e-3))
    return _fitted(features, model, prior, theta)


def _begun_elsewhere(features: Features, model: Model, start: Samples) -> WaveformFit | None:
    """Fit a tap with its first contact farther from t = 0; None where that does not explain it either."""
    capture = features.capture
    opened = replace(features, capture=replace(capture, onset_std_s=OPEN_ONSET_S))
    theta = np.zeros(WITH_RECORDER)
    theta[: len(start)] = start
    try:
        found = _fitted(opened, model, prior_of(model, WITH_RECORDER), theta)
    except NotConvergedError:
        return None
    onset, onset_std = found.posterior.moments(np.eye(WITH_RECORDER)[ONSET])
    beyond = abs(onset) - LATEST_ONSET * capture.onset_std_s / OPEN_ONSET_S
    if found.misfit > MISFIT_THRESHOLD or beyond < SEEN_STDS * onset_std:
        return None
    told = filter(None, (begun_at(1e6 * OPEN_ONSET_S * onset), found.record_fault))
    return replace(found, record_fault="; ".join(told))


def _fitted(features: Features, model: Model, prior: GaussianPrior, start: Samples) -> WaveformFit:
    try:
        return _fit(features, model, prior, start)
    except PhysicsError as fault:
        raise NotConvergedError(f"the model does not make this tap: {fault}") from fault
    except np.linalg.LinAlgError as fault:
        raise NotConvergedError(f"the fit is singular: {fault}") from fault


def _fit(features: Features, model: Model, prior: GaussianPrior, start: Samples) -> WaveformFit:
    plant = model.plant
    response = capture_blocks.linearised_model(features, with_parameters(plant, start))
    if (before := capture_blocks.until_next_contact(response, features)) is not response:
        start = min(_fit_both_sides(before, prior, start), key=lambda minimum: minimum.cost).theta
        response = capture_blocks.linearised_model(features, with_parameters(plant, start))
    kink_form = response.kink_form
    offset = response.kink_coordinate(start) - float(kink_form @ start)
    fits = _fit_both_sides(response, prior, start)
    plain, misfit = _likelier_side(fits, prior, (kink_form, offset))
    if misfit > MISFIT_THRESHOLD:  # perhaps only because the start had its kinks elsewhere
        response = capture_blocks.linearised_model(features, with_parameters(plant, plain.theta))
        fits = _fit_both_sides(response, prior, plain.theta)
        plain, misfit = _likelier_side(fits, prior, (kink_form, offset))
    gap, told = response.gap(plain.residual), ""
    fault = record_fault(response, prior, plain, fits=misfit <= MISFIT_THRESHOLD)
    if fault is not None:
        disturbed = response.disturbed_by(fault.shape)
        others = _fit_both_sides(disturbed, prior, start)
        other, other_misfit = _likelier_side(others, prior, (kink_form, offset))
        if other.converged and other_misfit <= MISFIT_THRESHOLD:
            told = fault.told(response, other)
            response, fits, plain, misfit = disturbed, others, other, other_misfit
    is_at_bound = abs(plain.theta[ONSET : ONSET + 1]).max(initial=0.0) >= LATEST_ONSET
    if (misfit > MISFIT_THRESHOLD or is_at_bound) and features.capture.onset_std_s < OPEN_ONSET_S:
        elsewhere = may_have_begun_elsewhere(response, prior, plain, OPEN_ONSET_S)
        if elsewhere and (found := _begun_elsewhere(features, model, start)) is not None:
            return replace(found, gap=gap)
    if misfit > MAX_MISFIT:
        raise NotConvergedError(f"the model misses this tap: residuals are {gap:.3g} times the noise", gap)
    widening, best = max(misfit, 1.0), plain
    if misfit > MISFIT_THRESHOLD:
        widening = 1.0
        slide = required(features.slide)
        phase = interval_of_blocks(response, slide.separation_s, slide.stop_s)
        for _ in range(REWEIGHTING_ROUNDS):
            residual = response.linearise(best.theta, best.side).residual
            fits = _fit_both_sides(
                response.reweighted(std_factors(residual, phase) * LATE_FACTORS[phase]), prior, best.theta
            )
            best, _ = _likelier_side(fits, prior, (kink_form, offset))
    if not best.converged:
        raise NotConvergedError("the waveform fit did not settle", gap)
    sides = tuple(minimum.truncated(prior, widening) for minimum in fits)
    if len(sides) == 1:
        sides = (replace(sides[0], sign=0),)
    posterior = mixture(sides, kink_form, offset)
    slips_at_once = [minimum.side < 0 for minimum in fits]
    (mu_s, mu_s_std), (mu_k, mu_k_std) = (_log_normal_moments(posterior, of) for of in (MU_S_FORM, MU_K_FORM))
    shared = prior.weight.copy()
    shared[ONSET : ONSET + 1] = 0.0
    in_mu_s, in_mu_k = (posterior.shared_std(_over(of, len(shared)), shared) for of in (MU_S_FORM, MU_K_FORM))
    return WaveformFit(
        mu_s=mu_s,
        mu_s_std=mu_s_std,
        mu_k=mu_k,
        mu_k_std=mu_k_std,
        mu_s_common_std=min(mu_s * in_mu_s, mu_s_std),
        mu_k_common_std=min(mu_k * in_mu_k, mu_k_std),
        theta=best.theta,
        posterior=posterior,
        immediate=float(posterior.weights[slips_at_once].sum()),
        gap=gap,
        misfit=misfit,
        record_fault=told,
    )


def _fit_both_sides(response: LinearisedModel, prior: GaussianPrior, start: Samples) -> list[Minimum]:
    """Descend on the side of the start, and on the other where the kink is near."""
    side = 1 if response.kink_coordinate(start) >= 0.0 else -1
    minimum = TapProblem(response, prior, side).fit(start)
    form = response.kink_form
    spread = math.sqrt(float(form @ minimum.truncated(prior).covariance @ form))
    if side * response.kink_coordinate(minimum.theta) >= KINK_DISTANCE_STD * spread:
        return [minimum]
    return [minimum, TapProblem(response, prior, -side).fit(minimum.theta)]


def _over(form: Samples, parameters: int) -> Samples:
    """Give a linear form over all of theta: nothing of it follows what is known of the record."""
    return np.concatenate([form, np.zeros(parameters - len(form))])


def _likelier_side(
    fits: list[Minimum], prior: GaussianPrior, kink: tuple[Samples, float]
) -> tuple[Minimum, float]:
    """Side with the greater probability, and its misfit; the lower minimum may lie beyond its side's end."""
    misfit = min(minimum.misfit for minimum in fits)
    if len(fits) == 1:
        return fits[0], misfit
    sides = tuple(minimum.truncated(prior, max(misfit, 1.0)) for minimum in fits)
    weights = mixture(sides, *kink).weights
    best = fits[int(np.argmax(weights))]
    return best, best.misfit


def _log_normal_moments(posterior: Posterior, of: Samples) -> tuple[float, float]:
    """Mean and standard deviation of exp(`of` @ theta)."""
    mean, std = posterior.moments(_over(of, len(posterior.form)))
    if not std < LARGEST_STD:
        raise NotConvergedError("the waveform does not show friction")
    value = math.exp(mean + 0.5 * std * std)
    return value, value * math.sqrt(math.expm1(std * std))


def _friction_overcome(features: Features, model: Model) -> float:
    """Give a mu_k whose mu_s the force of a tap did overcome: where nothing moves no step leads away.

    A slide of few samples may look as if it slowed down by any deceleration.
    """
    largest_force_n = float(np.max(required(features.force).values))
    weight_n = features.capture.mass_kg * model.plant.gravity_m_s2
    return SURELY_OVERCOME * model.ratio * largest_force_n / weight_n


def deceleration_friction(model: Model, mass_kg: float, slide: SlideFeatures) -> float:
    """mu_k from the mean deceleration of a slide, less what viscous friction took of it.

    nan where the mass is not known: that share goes with it.
    """
    if not mass_kg > 0.0:
        return math.nan
    effect = model.plant.effects.get("viscous_friction", {})
    viscous = float(np.mean(effect.get("viscous_coefficient_n_s_per_m", 0.0)))
    mean_speed = slide.distance.value / max(slide.stop_s - slide.separation_s, 1e-9)
    return (slide.deceleration.value - viscous * mean_speed / mass_kg) / model.plant.gravity_m_s2
