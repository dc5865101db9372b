"""Is a cycle deviant? T^2 on the principal components, noise-whitened SPE, and a scan over shapes.

A cycle's information vector y = h - G m, m the material's mean, has covariance G + G C C' G when normal:
sensor noise and the components C. With P = G - G C (1 + C' G C)^-1 C' G and u = y - G C (1 + C' G C)^-1 C' y
a shape s in friction is seen with the score z = s' u / sqrt(s' P s), the Neyman-Pearson statistic for s.
T^2 and SPE find what was not thought of; the scan over bumps, ripples, level and tilt comes close to the
oracle that knows the shape. Each gets a share of the false alarms, and the maximum over a family of shapes is
bounded by the length of its curve on the sphere (Davies 1987, Biometrika 74:33)::

    P(max z > c) <= 1 - Phi(c) + L / (2 pi) exp(-c^2 / 2),   L = sum of arccos of neighbours' correlations
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import chdtrc, fdtrc, ndtr

from impactcell.records import Samples
from impactcell.tracking import profile
from impactcell.tracking.reference import COMPONENTS, Reference, without_variation

SHARES = {"t_squared": 0.1, "spe": 0.1, "level": 0.2, "tilt": 0.2, "bump": 0.2, "ripple": 0.2}
BUMP_WIDTHS_M = (0.2e-3, 0.4e-3, 0.8e-3)
LEAST_INFORMATION = 400.0  # directions known worse than 1 / sqrt of this in friction say nothing
LARGEST = 0.5  # shapes that even half of the friction would not show are not looked for


@dataclass(frozen=True, slots=True)
class Verdict:
    """How normal a cycle is.

    Attributes
    ----------
    p_value : float
        Of the whole test, all shares together.
    t_squared, spe : float
    spe_freedom : int
        Degrees of freedom of `spe`.
    kind : str
        Which part of the test says most.
    at_m : float
        Where the cycle deviates most.
    size, size_std : float
        Friction of the best shape.
    """

    p_value: float
    t_squared: float
    spe: float
    spe_freedom: int
    kind: str
    at_m: float
    size: float
    size_std: float


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """Spline coefficients of the shapes looked for, columns; ripples in pairs of cosine and sine."""

    bumps: Samples
    centres_m: Samples
    ripples: Samples
    level: Samples
    tilt: Samples


@lru_cache(maxsize=8)
def shapes(length_m: float, points: int) -> Shapes:
    """Make the shapes for a grid of `points` from 0 to `length_m`."""
    grid = np.linspace(0.0, length_m, points)
    to_coefficients = np.linalg.pinv(profile.on_grid(points))
    bumps = [np.exp(-0.5 * ((grid - c) / w) ** 2) for w in BUMP_WIDTHS_M for c in grid]
    shortest = max(4.0 * (grid[1] - grid[0]), 0.4e-3)
    waves = length_m / np.arange(1.0, length_m / shortest + 0.5, 0.5)
    ripples = [f(2.0 * math.pi * grid / w) for w in waves for f in (np.cos, np.sin)]
    return Shapes(
        to_coefficients @ np.array(bumps).T,
        np.tile(grid, len(BUMP_WIDTHS_M)),
        to_coefficients @ np.array(ripples).T,
        to_coefficients @ np.ones(points),
        to_coefficients @ (grid / length_m),
    )


def judge(reference: Reference, slide: profile.Information, grid_m: Samples, usual: float) -> Verdict:
    """Test one cycle against its material's reference.

    Parameters
    ----------
    usual : float
        Usual friction, which scales what is worth looking for.
    """
    grow = 1.0 + 1.0 / reference.weight
    y = (slide.vector - slide.matrix @ reference.mean) / math.sqrt(grow)
    G, C = slide.matrix, reference.components
    P, u = without_variation(C, G, y)
    # the lesser components widen the noise that SPE is whitened by; T^2 is on the leading ones
    t_squared, spe, freedom, spe_scale = _squares(
        reference, *without_variation(C[:, COMPONENTS:], G, y), C[:, :COMPONENTS]
    )
    found = {
        "t_squared": _hotelling(t_squared, int(reference.counted)),
        "spe": float(chdtrc(freedom, spe / spe_scale)) if freedom > 0 else 1.0,
    }
    grid = shapes(float(grid_m[-1]), len(grid_m))
    limit = 30.0 / (LARGEST * usual) ** 2
    best = {"level": _one(grid.level, u, P, limit, spe_scale), "tilt": _tilt(grid, u, P, limit, spe_scale)}
    bump, place = _bumps(grid.bumps, u, P, limit, spe_scale)
    best["bump"] = bump
    best["ripple"] = _ripples(grid.ripples, u, P, limit, spe_scale)
    found.update({name: b[0] for name, b in best.items()})
    kind = min(found, key=lambda name: found[name] / SHARES[name])
    p_value = min(1.0, found[kind] / SHARES[kind])
    size, size_std = best[kind][1:] if kind in best else bump[1:]
    at = float(grid.centres_m[place]) if place >= 0 else math.nan
    return Verdict(
        p_value, t_squared, spe, freedom, kind, at, size * math.sqrt(grow), size_std * math.sqrt(grow)
    )


def _squares(reference: Reference, G: Samples, y: Samples, C: Samples) -> tuple[float, float, int, float]:
    """Hotelling's T^2, and the squared prediction error over the sensor noise with its freedom and scale."""
    values, vectors = np.linalg.eigh(G)
    seen = values > LEAST_INFORMATION
    root = np.sqrt(values[seen])
    whitened = (vectors[:, seen].T @ y) / root
    inside = (vectors[:, seen].T @ C) * root[:, np.newaxis]
    basis, upper = np.linalg.qr(inside)
    active = np.abs(np.diag(upper)) > 1e-9
    if len(whitened) <= COMPONENTS or not active.all():
        return 0.0, float(whitened @ whitened), int(seen.sum()), 1.0
    along = basis.T @ whitened
    t_squared = float(along @ np.linalg.solve(np.eye(COMPONENTS) + upper @ upper.T, along))
    rest = float(whitened @ whitened - along @ along)
    freedom = int(seen.sum()) - COMPONENTS
    # small variation beyond the three components, or noise that was declared too low, widens everything
    usual = (reference.spe_sum + 20.0) / (reference.spe_count + 20.0)
    return t_squared, max(rest, 0.0), freedom, max(1.0, usual)


def _hotelling(t_squared: float, cycles: int) -> float:
    """p-value of T^2 when the components were learned from `cycles` cycles."""
    n, k = cycles, COMPONENTS
    if n <= k + 1:
        return 1.0
    return float(fdtrc(k, n - k, t_squared * (n - k) / (k * (n - 1.0))))


def _one(shape: Samples, u: Samples, P: Samples, limit: float, scale: float) -> tuple[float, float, float]:
    known = float(shape @ P @ shape)
    if known < limit:
        return 1.0, 0.0, math.inf
    z = float(shape @ u) / math.sqrt(known * scale)
    return 2.0 * float(ndtr(-abs(z))), float(shape @ u) / known, math.sqrt(scale / known)


def _tilt(grid: Shapes, u: Samples, P: Samples, limit: float, scale: float) -> tuple[float, float, float]:
    """Slope about the point where it does not depend on the level, so that the two are looked for apart."""
    against = float(grid.level @ P @ grid.level)
    shift = float(grid.tilt @ P @ grid.level) / against if against > 0.0 else 0.0
    return _one(grid.tilt - shift * grid.level, u, P, limit, scale)


def _bumps(
    bumps: Samples, u: Samples, P: Samples, limit: float, scale: float
) -> tuple[tuple[float, float, float], int]:
    image = P @ bumps
    known = np.einsum("ij,ij->j", bumps, image)
    visible = np.flatnonzero(known >= limit)
    if len(visible) == 0:
        return (1.0, 0.0, math.inf), -1
    z = (u @ bumps[:, visible]) / np.sqrt(known[visible] * scale)
    best = int(np.argmax(np.abs(z)))
    i, j = visible[:-1], visible[1:]
    near = np.einsum("ij,ij->j", bumps[:, i], image[:, j]) / np.sqrt(known[i] * known[j])
    length = float(np.arccos(np.clip(near, -1.0, 1.0)).sum())
    c = abs(float(z[best]))
    p_value = min(1.0, 2.0 * (float(ndtr(-c)) + length / (2.0 * math.pi) * math.exp(-0.5 * c * c)))
    place = int(visible[best])
    return (p_value, float(u @ bumps[:, place]) / known[place], math.sqrt(scale / known[place])), place


def _ripples(
    ripples: Samples, u: Samples, P: Samples, limit: float, scale: float
) -> tuple[float, float, float]:
    cosine, sine = ripples[:, ::2], ripples[:, 1::2]
    image_c, image_s = P @ cosine, P @ sine
    cc = np.einsum("ij,ij->j", cosine, image_c)
    cs = np.einsum("ij,ij->j", cosine, image_s)
    ss = np.einsum("ij,ij->j", sine, image_s)
    # two by two: least eigenvalue, and the amplitudes that solve it
    determinant = cc * ss - cs**2
    visible = (cc + ss) / 2.0 - np.sqrt(((cc - ss) / 2.0) ** 2 + cs**2) >= limit
    if not visible.any():
        return 1.0, 0.0, math.inf
    uc, us = u @ cosine, u @ sine
    safe = np.where(visible, determinant, 1.0)
    a, b = (ss * uc - cs * us) / safe, (cc * us - cs * uc) / safe
    score = np.where(visible, (uc * a + us * b) / scale, 0.0)
    best = int(np.argmax(score))
    p_value = min(1.0, int(visible.sum()) * math.exp(-0.5 * float(score[best])))
    return p_value, float(np.hypot(a[best], b[best])), math.sqrt(2.0 * scale / float(cc[best] + ss[best]))
