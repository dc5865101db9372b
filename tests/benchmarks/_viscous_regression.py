"""k_v and mu_k together from the free slides of many taps: by least squares, and by decrement.

While the part slides free, m x'' = -mu_k m g - k_v x'. With r = k_v / m, phi(t) = (exp(-r t) - 1 + r t) / r²,

    x(t) = x_0 + x'_0 t - (mu_k g + r x'_0) phi(t),

which is linear in all but k_v. One tap shows k_v by how its deceleration fades; taps of several
velocities and masses show it against friction that depends on the place.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from impactcell.errors import CaptureError, PhysicsError, PredictionError
from impactcell.features import extract, required
from impactcell.prediction.block_averaging import average_blocks
from impactcell.records import Capture, Samples

BLOCK_S = 5e-4
MARGIN = 0.03
"""Of the slide, left out at either end, where contact and rest begin."""
INTERVALS = 8
MOST_RATE_PER_S = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class ViscousFit:
    """k_v of a set of taps and the mu_k of each.

    Attributes
    ----------
    coefficient_n_s_per_m, std : float
        k_v, and its standard deviation: from the sensors' noise (least squares) or from the
        regression's residuals (decrement).
    mu_k : ndarray, shape (n,)
        One a tap that could be used.
    used : tuple of int
        Their cycle numbers.
    """

    coefficient_n_s_per_m: float
    std: float
    mu_k: Samples
    used: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Block means of one slide: times, s, positions, m, and the standard deviations of these."""

    time_s: Samples
    values: Samples
    std: Samples


def by_least_squares(captures: Sequence[Capture], gravity_m_s2: float = 9.81) -> ViscousFit:
    """k_v by least squares on the positions of all slides, x_0, x'_0 and mu_k of each tap free.

    Raises
    ------
    CaptureError
        No slide can be used.
    """
    slides = _slides(captures)

    def cost(viscous: float) -> float:
        return sum(_fit_slide(path, viscous / mass)[1] for _, mass, path in slides)

    heaviest = max(mass for _, mass, _ in slides)
    best = minimize_scalar(cost, bounds=(-0.1 * heaviest, MOST_RATE_PER_S * heaviest), method="bounded",
                           options={"xatol": 1e-6})  # fmt: skip
    viscous = float(best.x)
    step = max(1e-3 * abs(viscous), 1e-2)
    curvature = (cost(viscous + step) - 2.0 * cost(viscous) + cost(viscous - step)) / step**2
    mu_k = []
    for _, mass, path in slides:
        (_, speed, bend), _ = _fit_slide(path, viscous / mass)
        mu_k.append((-bend - viscous / mass * speed) / gravity_m_s2)
    return ViscousFit(
        viscous,
        math.sqrt(2.0 / curvature) if curvature > 0.0 else math.inf,
        np.array(mu_k),
        tuple(cycle for cycle, _, _ in slides),
    )


def by_decrement(captures: Sequence[Capture], gravity_m_s2: float = 9.81) -> ViscousFit:
    """k_v from how the displacement over equal intervals T shrinks, after the decrement method.

    D_i = x(t_i + T) - x(t_i) obeys D_{i+1} = q D_i - p with q = exp(-k_v T / m) and p = mu_k g T (1 - q) / r,
    a straight line through the successive displacements of a tap. Noise in D_i flattens the line, so that k_v
    comes out too large: the price for needing no model of the start.

    Raises
    ------
    CaptureError
        No slide can be used.
    """
    slides = _slides(captures)
    rates, weights, mu_k = [], [], []
    for _, mass, path in slides:
        edges = np.linspace(path.time_s[0], path.time_s[-1], INTERVALS + 1)
        interval = float(edges[1] - edges[0])
        moved = np.diff([_at(path, edge, 0.25 * interval) for edge in edges])
        design = np.column_stack([moved[:-1], -np.ones(INTERVALS - 1)])
        (shrink, drop), *_ = np.linalg.lstsq(design, moved[1:])
        rate = -math.log(min(max(float(shrink), 1e-3), 10.0)) / interval
        residual = moved[1:] - design @ np.array([shrink, drop])
        spread = float(residual @ residual) / (INTERVALS - 3)
        inverse = np.linalg.inv(design.T @ design)
        variance = spread * float(inverse[0, 0]) / (float(shrink) * interval) ** 2 * mass**2
        rates.append(rate * mass)
        weights.append(1.0 / max(variance, 1e-12))
        fade = -math.expm1(-rate * interval) / rate if abs(rate) > 1e-9 else interval
        mu_k.append(float(drop) / (interval * fade) / gravity_m_s2)
    mean = float(np.average(rates, weights=weights))
    scatter = float(np.average((np.array(rates) - mean) ** 2, weights=weights))
    std = math.sqrt(max(scatter / max(len(rates) - 1, 1), 1.0 / float(np.sum(weights))))
    return ViscousFit(mean, std, np.array(mu_k), tuple(cycle for cycle, _, _ in slides))


def _slides(captures: Sequence[Capture]) -> list[tuple[int, float, Path]]:
    """Cycle, mass and blocks of position of each free slide, time counted from its beginning."""
    found, fault = [], "there is none"
    for capture in captures:
        try:
            features = extract(capture)
            read, path = required(features.slide), required(features.position)
        except (PredictionError, PhysicsError) as error:
            fault = f"cycle {capture.cycle}: {error}"
            continue
        if not capture.mass_kg > 0.0:
            fault = f"cycle {capture.cycle}: the part's mass is not known"
            continue
        margin = MARGIN * (read.stop_s - read.separation_s)
        inside = average_blocks(
            path, BLOCK_S, BLOCK_S, [], [read.separation_s + margin, read.stop_s - margin]
        )
        kept = (inside.time_s > read.separation_s + margin) & (inside.time_s < read.stop_s - margin)
        if kept.sum() < 2 * INTERVALS:
            fault = f"cycle {capture.cycle}: the slide is too short for its position samples"
            continue
        moved = capture.direction * inside.values[kept]
        times = inside.time_s[kept] - (read.separation_s + margin)
        found.append((capture.cycle, capture.mass_kg, Path(times, moved, inside.std[kept])))
    if not found:
        raise CaptureError(f"no slide can be used; {fault}")
    return found


def _fit_slide(path: Path, rate: float) -> tuple[tuple[float, float, float], float]:
    """x_0, x'_0 and the coefficient of phi, and the sum of squares, for k_v / m = `rate`."""
    t, weight = path.time_s, 1.0 / path.std
    x = rate * t
    small = np.abs(x) < 1e-3
    series = 0.5 * t**2 * (1.0 - x / 3.0 + x**2 / 12.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        phi = np.where(small, series, (np.expm1(-x) + x) / max(rate**2, 1e-300))
    design = np.column_stack([np.ones_like(t), t, phi]) * weight[:, None]
    solution, *_ = np.linalg.lstsq(design, path.values * weight)
    residual = path.values * weight - design @ solution
    start, speed, bend = solution.tolist()
    return (start, speed, bend), float(residual @ residual)


def _at(path: Path, time_s: float, half_s: float) -> float:
    """Position at a time, from a parabola through its neighbourhood."""
    near = np.flatnonzero(np.abs(path.time_s - time_s) <= half_s)
    if len(near) < 4:
        near = np.argsort(np.abs(path.time_s - time_s))[:4]
    return float(np.polyfit(path.time_s[near] - time_s, path.values[near], 2)[-1])
