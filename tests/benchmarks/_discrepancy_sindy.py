"""PySINDy on what the nominal model leaves: sparse regressions of residual forces on the effects' own terms.

Position and force of the training shots are smoothed and differentiated by PySINDy, slide and contact apart;
four balances of the fitted nominal model leave residuals, each regressed on what the effects would add to it:

- slide: -a/g - mu_k, on v, v², exp(-(v/v_s)²), x, sines, bumps, direction, order, batch, pull over a gap;
- contact: F - k d - b max(d', 0), on a constant, d ln d, d d', dF/dt, and what exceeds a limit;
- contact, momentum: F - m a - mu_k m g, on F, a constant and dF/dt;
- actuator, where it was recorded: y' - v, on F and on the missing speed of a ramp.

Terms that only adjust the nominal plant (k, b, mu_k) are projected out. An effect is named when one of its
terms survives the sequential thresholding (STLSQ); the threshold is the largest one whose error,
cross-validated over shots, is within a standard error of the best. Where two effects have the same term they
are named together. `presliding_compliance` and `stiction_ageing` act before there is motion to
differentiate, and have no term.
"""

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data.phases import FREE_SLIDE, LOADING, UNLOADING
from impactcell.discrepancy.data.prepared_shots import ACTUATOR, FORCE, POSITION, PreparedShot
from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.phase_of_samples import sample_phases, trajectory_of
from impactcell.discrepancy.model.problem import Problem

SMOOTH_SLIDE_S, SMOOTH_CONTACT_S = 0.010, 0.004
STRIBECK_M_S = (0.01, 0.02, 0.04, 0.08)
PERIODS_M = tuple(float(one) for one in np.geomspace(5e-4, 4e-3, 10))
RANGES_M = (1e-4, 3e-4, 1e-3)
RAMPS_S = (0.0003, 0.001, 0.003)
LIMITS = (0.7, 0.8, 0.9, 0.95)
BUMPS, WIDTH_M = 12, 5e-4
THRESHOLDS = tuple(float(one) for one in np.geomspace(0.03, 1.0, 7))
FOLDS = 5
SHARE = 4
"""Samples kept of each window: neighbours that were smoothed together say the same."""

RIDGE = 1e-6
NUISANCE = ""
Columns = dict[tuple[str, str], np.ndarray]
"""Terms of one shot by effects (joined by +) and by term."""

SAME = {
    "direction": "surface_tilt+direction_asymmetry",
    "rate": "force_sensor_lag+channel_skew",
    "gain": "mass_error+force_sensor_gain",
}


@dataclass(frozen=True)
class Smoothed:
    """One stretch of a shot, smoothed: along its direction, with the force at the same times."""

    t: np.ndarray
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    travel: np.ndarray
    travel_rate: np.ndarray


def sindy(problem: Problem, nominal: Fit, library: tuple[str, ...]) -> list[list[str]]:
    """Effects that PySINDy names, those with the same term together."""
    k, b, _, mu = (
        float(one) for one in problem.with_effects(nominal.effects).plant_parameters(nominal.theta)[:4]
    )
    force = problem.shots.values[problem.shots.channel == FORCE]
    peak = float(force.max(initial=0.0))
    span = max(float(np.max(np.abs(shot.values[POSITION]))) for shot in problem.shots.items)
    slides, contacts, momenta, speeds = [], [], [], []
    for shot, slow, fast in smoothed_shots(problem, nominal):
        if slow is not None:
            slides.append(slide(problem, shot, slow, mu, span))
        if fast is not None and len(shot.times[FORCE]):
            contacts.append(contact(fast, k, b, peak))
            momenta.append(momentum(problem, shot, fast, mu))
        runs = shot.times[POSITION] < 0.9 * problem.shots.stroke_m / shot.velocity_m_s
        running = smoothed(problem, shot, runs, SMOOTH_CONTACT_S)
        if running is not None and len(shot.times[ACTUATOR]):
            speeds.append(speed(shot.velocity_m_s, running))
    found: list[list[str]] = []
    for equation in (slides, contacts, momenta, speeds):
        for name in selected(equation):
            group = [effect for effect in name.split("+") if effect in library]
            if group and group not in found:
                found.append(group)
    return found


def smoothed_shots(
    problem: Problem, nominal: Fit
) -> Iterator[tuple[PreparedShot, Smoothed | None, Smoothed | None]]:
    """Smooth the free slide and the contact of every shot, by the phases of the nominal model."""
    phase = sample_phases(problem, trajectory_of(problem, nominal))
    for number, shot in enumerate(problem.shots.items):
        part = problem.shots.samples_of(number)
        mine = phase[part][problem.shots.channel[part] == POSITION]
        touching = (mine == LOADING) | (mine == UNLOADING)
        yield (
            shot,
            smoothed(problem, shot, mine == FREE_SLIDE, SMOOTH_SLIDE_S),
            smoothed(problem, shot, touching, SMOOTH_CONTACT_S),
        )


def smoothed(problem: Problem, shot: PreparedShot, on: np.ndarray, over_s: float) -> Smoothed | None:
    """Smooth and differentiate one stretch of a shot; None if it is too short."""
    t = shot.times[POSITION]
    window = max(2 * round(0.5 * over_s / float(np.median(np.diff(t)))) + 1, 7)
    places = np.flatnonzero(on)
    if len(places) < 2 * window:
        return None
    stretch = slice(int(places[0]), int(places[-1]) + 1)
    t = t[stretch]
    x = shot.values[POSITION][stretch] * shot.direction
    force = np.interp(t, shot.times[FORCE], shot.values[FORCE]) if len(shot.times[FORCE]) else 0.0 * t
    travel = np.minimum(shot.velocity_m_s * t, problem.shots.stroke_m)
    if len(shot.times[ACTUATOR]):
        travel = np.interp(t, shot.times[ACTUATOR], shot.values[ACTUATOR] * shot.direction)
    from pysindy import SmoothedFiniteDifference  # takes a second: not for who only collects tests

    slope = SmoothedFiniteDifference(smoother_kws={"window_length": window, "polyorder": 3})
    v, rate, travel_rate = np.asarray(slope(np.column_stack([x, force, travel]), t)).T
    a = np.asarray(slope(v[:, None], t))[:, 0]
    made = (t, x, v, a, force, rate, travel, travel_rate)
    return Smoothed(*(one[:: max(window // SHARE, 1)] for one in made))


def slide(
    problem: Problem, shot: PreparedShot, one: Smoothed, mu: float, span: float
) -> tuple[np.ndarray, Columns]:
    """Friction coefficient beyond the nominal one in the free slide, and its terms."""
    g = problem.shots.gravity_m_s2
    on = one.v > 0.1 * one.v.max()
    v, weight = one.v[on], problem.shots.gravity_m_s2 * shot.mass_kg
    place = shot.start_m + shot.direction * one.x[on]
    same = np.ones(int(on.sum()))
    terms: Columns = {
        (NUISANCE, "friction"): same,
        ("viscous_friction", "v"): v / weight,
        ("quadratic_drag", "v2"): v**2 / weight,
        (SAME["direction"], "direction"): same * shot.direction,
        ("position_dependent_friction", "x"): mu * place,
        ("restoring_force", "x"): place * shot.direction / weight,
        ("friction_drift", "order"): same * mu * (shot.record / shot.records - 0.5),
    }
    terms |= {("stribeck_friction", f"{vs}"): np.exp(-((v / vs) ** 2)) for vs in STRIBECK_M_S}
    terms |= {
        ("batch_shift", f"{batch}"): same * mu * (shot.batch == batch) for batch in range(1, problem.batches)
    }
    for period in PERIODS_M:
        terms["periodic_friction", f"sin {period}"] = mu * np.sin(2.0 * math.pi * place / period)
        terms["periodic_friction", f"cos {period}"] = mu * np.cos(2.0 * math.pi * place / period)
    for middle in np.linspace(-span, span, BUMPS):
        terms["friction_patch", f"{middle}"] = mu * np.exp(-(((place - middle) / WIDTH_M) ** 2) / 2.0)
    gap = np.maximum(one.x[on] - one.travel[on], 0.0)
    for reach in RANGES_M:
        terms["adhesion", f"{reach}"] = np.maximum(1.0 - gap / reach, 0.0) / weight
    return -one.a[on] / g - mu, terms


def contact(one: Smoothed, k: float, b: float, peak: float) -> tuple[np.ndarray, Columns]:
    """Contact force beyond the nominal one, and its terms."""
    on = one.travel > one.x
    d, closing = (one.travel - one.x)[on], (one.travel_rate - one.v)[on]
    known = k * d + b * np.maximum(closing, 0.0)
    terms: Columns = {
        (NUISANCE, "k"): d,
        (NUISANCE, "b"): np.maximum(closing, 0.0),
        ("force_sensor_offset", "1"): np.ones(len(d)),
        ("hertz_contact", "d ln d"): d * np.log(np.maximum(d, 1e-7) / 1e-4),
        ("hunt_crossley_damping", "d d'"): d * closing,
        (SAME["rate"], "dF/dt"): one.rate[on],
    }
    terms |= {("force_saturation", f"{share}"): np.maximum(known - share * peak, 0.0) for share in LIMITS}
    return one.force[on] - known, terms


def momentum(problem: Problem, shot: PreparedShot, one: Smoothed, mu: float) -> tuple[np.ndarray, Columns]:
    """Force that neither accelerates the part nor overcomes nominal friction, and its terms."""
    weight = problem.shots.gravity_m_s2 * shot.mass_kg
    terms: Columns = {
        (NUISANCE, "friction"): np.full(len(one.t), weight),
        (SAME["gain"], "F"): one.force,
        ("force_sensor_offset", "1"): np.ones(len(one.t)),
        (SAME["rate"], "dF/dt"): one.rate,
    }
    return one.force - shot.mass_kg * one.a - mu * weight, terms


def speed(velocity: float, one: Smoothed) -> tuple[np.ndarray, Columns]:
    """Speed that the actuator lacks while it runs, and its terms."""
    terms: Columns = {("actuator_droop", "F"): -one.force}
    for time in RAMPS_S:
        terms["actuator_ramp", f"{time}"] = -velocity * np.maximum(1.0 - one.t / time, 0.0)
    return one.travel_rate - velocity, terms


def selected(shots: list[tuple[np.ndarray, Columns]]) -> list[str]:
    """Effects with a term that survives, in the order of their terms."""
    if len(shots) < FOLDS:
        return []
    keys = list(shots[0][1])
    y = np.concatenate([residual for residual, _ in shots])
    columns = np.concatenate([np.column_stack([terms[key] for key in keys]) for _, terms in shots])
    nuisance = np.array([not effect for effect, _ in keys])
    if nuisance.any():
        # They are never thresholded: everything is taken orthogonal to them.
        basis = np.linalg.qr(columns[:, nuisance])[0]
        y, columns = y - basis @ (basis.T @ y), columns - basis @ (basis.T @ columns)
    size = np.sqrt(np.mean(columns**2, axis=0))
    seen = ~nuisance & (size > 0.0)
    columns, keys = columns[:, seen] / size[seen], [key for key, one in zip(keys, seen, strict=True) if one]
    y = y / float(np.std(y))
    fold = np.repeat(np.arange(len(shots)) % FOLDS, [len(residual) for residual, _ in shots])
    errors = np.array(
        [
            [
                np.mean((y[fold == out] - columns[fold == out] @ fitted(columns, y, fold != out, one)) ** 2)
                for out in range(FOLDS)
            ]
            for one in THRESHOLDS
        ]
    )
    mean = errors.mean(1)
    best = int(np.argmin(mean))
    limit = mean[best] + errors[best].std(ddof=1) / math.sqrt(FOLDS)
    threshold = max(one for one, error in zip(THRESHOLDS, mean, strict=True) if error <= limit)
    alive = fitted(columns, y, np.ones(len(y), dtype=bool), threshold) != 0.0
    return list(dict.fromkeys(key[0] for key, one in zip(keys, alive, strict=True) if one))


def fitted(
    columns: np.ndarray, y: np.ndarray, on: np.ndarray, threshold: float, ridge: float = RIDGE
) -> np.ndarray:
    """Coefficients of a sparse regression by PySINDy's optimizer; it warns where none is left."""
    from pysindy import STLSQ

    optimizer = STLSQ(threshold=threshold, alpha=ridge)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        optimizer.fit(columns[on], y[on][:, None])
    return np.asarray(optimizer.coef_)[0]
