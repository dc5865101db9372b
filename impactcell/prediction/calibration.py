"""Calibration: equations (4) and (5) fitted to a cell's own plant, by sweeps of friction and velocity.

Nothing here is random and nothing depends on the order of work: the same plant gives the same bits.
"""

import enum
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy.optimize import least_squares

from impactcell.errors import PhysicsError, PredictionError
from impactcell.physics import Plant, TapEventKind, TapInput, simulate_tap
from impactcell.physics.local_friction import friction_factor
from impactcell.prediction.mass_interpolation import MassInterpolation
from impactcell.prediction.model import (
    REFERENCE_VELOCITY,
    DistanceForm,
    ForceForm,
    Predictor,
    Sensitivity,
    printed_predictor,
)
from impactcell.records import MM_PER_MIN, Samples

REGIME_GRID = 41
"""Velocities at which the regime is told: a regime's end is known to a fortieth of the range. Our choice."""
MIN_VELOCITIES = 4
"""Fewest of them that make a regime worth coefficients of its own. Our choice."""
RELATIVE_STEP = 0.01
"""Relative change of k, b or mu_k/mu_s by which sensitivities are found. Our choice."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """Peak force and sliding distance of one mass over velocity and friction.

    Attributes
    ----------
    velocity_m_s, mu_s : ndarray, shapes (v,) and (u,)
    peak_force_n, sliding_distance_m : ndarray, shape (v, u)
    """

    velocity_m_s: Samples
    mu_s: Samples
    peak_force_n: Samples
    sliding_distance_m: Samples


class Regime(enum.Enum):
    """What equation (5) describes: each of the first two by coefficients of its own, the last not at all."""

    CLEAN = "separated before the actuator halted"
    HALTED = "halted within the contact"
    EITHER = "one or the other, depending on friction"
    CAUGHT = "caught again, or stuck"


def regimes(plant: Plant, tap: TapInput, velocities: Samples, frictions: Samples) -> list[Regime]:
    """Tell the regime of each velocity over all frictions."""
    ratio = plant.mu_k / plant.mu_s
    by_velocity = []
    for velocity in velocities.tolist():
        kinds: set[Regime] = set()
        for mu in frictions.tolist():
            kinds.add(_regime(replace(plant, mu_s=mu, mu_k=ratio * mu), replace(tap, velocity_m_s=velocity)))
            if Regime.CAUGHT in kinds:  # and pushed without end, perhaps, which takes a second to tell
                kinds = {Regime.CAUGHT}
                break
        by_velocity.append(kinds.pop() if len(kinds) == 1 else Regime.EITHER)
    return by_velocity


def _regime(plant: Plant, tap: TapInput) -> Regime:
    try:
        motion = simulate_tap(plant, tap)
        separations = [event.time_s for event in motion.events if event.kind is TapEventKind.SEPARATION]
        if len(separations) != 1 or motion.sliding_distance_m <= 0.0:
            return Regime.CAUGHT
    except PhysicsError:
        return Regime.CAUGHT
    return Regime.HALTED if tap.stroke_m / tap.velocity_m_s < separations[0] else Regime.CLEAN


def velocity_spans(by_velocity: Sequence[Regime], velocities: Samples) -> list[tuple[float, float]]:
    """Velocities between which one describable regime holds; neighbours meet where it changes."""
    spans: list[tuple[float, float]] = []
    for caught, run in groupby(
        range(len(by_velocity)), key=lambda index: by_velocity[index] is Regime.CAUGHT
    ):
        indices = list(run)
        if caught or len(indices) < MIN_VELOCITIES:
            continue
        clean = [index for index in indices if by_velocity[index] is Regime.CLEAN]
        halted = [index for index in indices if by_velocity[index] is Regime.HALTED]
        low, high = float(velocities[indices[0]]), float(velocities[indices[-1]])
        if min(len(clean), len(halted)) < MIN_VELOCITIES:
            spans.append((low, high))
        else:
            border = 0.5 * float(velocities[clean[-1]] + velocities[halted[0]])
            spans += [(low, border), (border, high)]
    return spans


def sweep(plant: Plant, tap: TapInput, velocities: Samples, frictions: Samples) -> Sweep:
    """Strike the plant at every velocity and friction, mu_k / mu_s kept.

    Raises
    ------
    PhysicsError
        A part does not slide free.
    """
    ratio = plant.mu_k / plant.mu_s
    table = np.array(
        [
            [
                peak_and_distance(
                    replace(plant, mu_s=mu, mu_k=ratio * mu), replace(tap, velocity_m_s=velocity)
                )
                for mu in frictions.tolist()
            ]
            for velocity in velocities.tolist()
        ]
    )
    return Sweep(velocities, frictions, table[:, :, 0], table[:, :, 1])


def peak_and_distance(plant: Plant, tap: TapInput) -> tuple[float, float]:
    """Peak force, N, and sliding distance, m, of one tap."""
    motion = simulate_tap(plant, tap)
    return motion.peak_force_n, motion.sliding_distance_m


def fit_force(swept: Sweep) -> ForceForm:
    """Equation (4) by least squares in mu_s, in which it is linear."""
    v, mu = np.meshgrid(swept.velocity_m_s, swept.mu_s, indexing="ij")
    design = np.column_stack([swept.peak_force_n.ravel(), v.ravel()])
    (inverse, drop), *_ = np.linalg.lstsq(design, mu.ravel())
    rms = float(np.sqrt(np.mean((design @ np.array([inverse, drop]) - mu.ravel()) ** 2)))
    return ForceForm(friction_n=float(1.0 / inverse), velocity_n_s_per_m=float(-drop / inverse), rms=rms)


def fit_distance(swept: Sweep) -> DistanceForm:
    """Equation (5) by least squares in mu_s, starting from the printed coefficients."""
    u = (swept.velocity_m_s / REFERENCE_VELOCITY)[:, None]
    mu, slide = swept.mu_s[None, :], swept.sliding_distance_m
    slope = np.abs(np.gradient(slide, swept.mu_s, axis=1, edge_order=2))

    def form(p: Samples) -> Samples:
        shape: Samples = np.exp(p[1]) * u ** p[2] * (p[0] - mu) ** 2 + np.exp(p[3]) * u ** p[4]
        return shape

    def residual(p: Samples) -> Samples:
        error: Samples = ((form(p) - slide) / slope).ravel()
        return error

    start = printed_predictor().distance
    scale = float(np.median(slide / form(_packed(start))))
    first = _packed(replace(start, square_m=start.square_m * scale, offset_m=start.offset_m * scale))
    fit = least_squares(residual, first, method="lm", xtol=1e-13, ftol=1e-13, gtol=1e-13, max_nfev=20_000)
    limit, square, square_power, offset, offset_power = fit.x.tolist()
    rms = float(np.sqrt(np.mean(fit.fun**2)))
    return DistanceForm(limit, math.exp(square), square_power, math.exp(offset), offset_power, rms)


def fit_predictor(plant: Plant, tap: TapInput, velocities: Samples, frictions: Samples) -> Predictor:
    """Fit both equations for one mass in one regime; find how they depend on what is taken as known."""
    swept = sweep(plant, tap, velocities, frictions)
    fitted = Predictor(
        mass_kg=tap.mass_kg,
        mu_s_range=(float(frictions[0]), float(frictions[-1])),
        velocity_range_m_s=(float(velocities[0]), float(velocities[-1])),
        force=fit_force(swept),
        distance=fit_distance(swept),
    )
    changes = {
        "stiffness": replace(plant, stiffness_n_per_m=plant.stiffness_n_per_m * (1.0 + RELATIVE_STEP)),
        "damping": replace(plant, damping_n_s_per_m=plant.damping_n_s_per_m * (1.0 + RELATIVE_STEP)),
        "ratio": replace(plant, mu_k=plant.mu_k * (1.0 + RELATIVE_STEP)),
    }
    force, slide = {}, {}
    for name, plant_changed in changes.items():
        force[name], slide[name] = _sensitivities(fitted, plant, plant_changed, tap)
    return replace(fitted, force_sensitivity=Sensitivity(**force), distance_sensitivity=Sensitivity(**slide))


def scaled(predictor: Predictor, scale: float) -> Predictor:
    """Give the predictor of a mu_s that is `scale` times as large: both equations stay what they are."""
    force, distance = predictor.force, predictor.distance
    low, high = predictor.mu_s_range
    return replace(
        predictor,
        mu_s_range=(low * scale, high * scale),
        force=replace(force, friction_n=force.friction_n / scale, rms=force.rms * scale),
        distance=replace(
            distance,
            limit=distance.limit * scale,
            square_m=distance.square_m / scale**2,
            rms=distance.rms * scale,
        ),
    )


def calibrate(
    plant: Plant,
    tap: TapInput,
    masses_kg: Sequence[float],
    velocities_m_s: Samples,
    frictions: Samples,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Predictor, ...]:
    """Fit equations (4) and (5) for a range of masses.

    Where the actuator halts within the contact, the distance follows other coefficients than where it does
    not: a mass then has two predictors, for two ranges of velocity. Velocities at which the part is caught
    again are left out.

    Parameters
    ----------
    plant : Plant
        Its mu_k / mu_s is kept, mu_s is swept.
    tap : TapInput
        Stroke, direction, start and halt of the cell; its velocity and mass are swept.
    masses_kg, velocities_m_s : array_like
        In ascending order.
    frictions : array_like
        Static friction where the tap begins, as the equations will give it; in ascending order.
    progress : callable, optional
        Called with the masses done and their number.

    Raises
    ------
    PredictionError
        The part slides free at too few velocities.
    """
    scale = friction_factor(plant, tap)
    of_plant = np.asarray(frictions, dtype=np.float64) / scale
    predictors = []
    grid = np.linspace(velocities_m_s[0], velocities_m_s[-1], REGIME_GRID)
    for index, mass in enumerate(masses_kg):
        if progress is not None:
            progress(index, len(masses_kg))
        tap_of_mass = replace(tap, mass_kg=float(mass))
        for low, high in velocity_spans(regimes(plant, tap_of_mass, grid, of_plant), grid):
            within = np.linspace(low, high, len(velocities_m_s))
            predictors.append(scaled(fit_predictor(plant, tap_of_mass, within, of_plant), scale))
    if progress is not None:
        progress(len(masses_kg), len(masses_kg))
    if not predictors:
        told = (
            f"no part of {masses_kg[0]:.4g}-{masses_kg[-1]:.4g} kg slides free of the actuator between "
            f"{velocities_m_s[0] / MM_PER_MIN:.4g} and {velocities_m_s[-1] / MM_PER_MIN:.4g} mm/min"
        )
        deceleration = plant.mu_k * plant.gravity_m_s2
        longest_m = float(velocities_m_s[-1]) ** 2 / deceleration
        if tap.stroke_m > longest_m and math.isfinite(tap.stroke_m):
            fast = math.sqrt(tap.stroke_m * deceleration) / MM_PER_MIN
            raise PredictionError(
                f"{told}: it catches up with the part; tap from about {round(fast, -3):.0f} mm/min on, or "
                f"with a stroke of less than about {1e3 * longest_m:.2g} mm"
            )
        raise PredictionError(f"{told}; tap faster, or with another stroke")
    return tuple(predictors)


def _sensitivities(fitted: Predictor, plant: Plant, other: Plant, tap: TapInput) -> tuple[float, float]:
    """Mean relative change of both predicted mu_s per relative change of one property of the plant."""
    ratio = other.mu_k / other.mu_s
    mixed = MassInterpolation(tap.mass_kg, ((1.0, fitted),), inside=True)
    force, slide = [], []
    for velocity in np.linspace(*fitted.velocity_range_m_s, 3).tolist():
        mu = plant.mu_s
        try:
            peak, length = peak_and_distance(
                replace(other, mu_s=mu, mu_k=ratio * mu), replace(tap, velocity_m_s=velocity)
            )
            peak_0, length_0 = peak_and_distance(plant, replace(tap, velocity_m_s=velocity))
        except PhysicsError:
            continue
        force.append((peak - peak_0) / fitted.force.friction_n / mu / RELATIVE_STEP)
        slide.append((length - length_0) / mixed.slope_of_distance(mu, velocity) / mu / RELATIVE_STEP)
    return float(np.mean(force or [0.0])), float(np.mean(slide or [0.0]))


def _packed(form: DistanceForm) -> Samples:
    return np.array(
        [form.limit, math.log(form.square_m), form.square_power, math.log(form.offset_m), form.offset_power]
    )
