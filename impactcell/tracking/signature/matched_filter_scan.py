"""Looks for all shapes that a deviant cycle may have at once: bumps, ripples, level and tilt.

A shape s in friction is seen with the score z = s' u / sqrt(s' P s), standard normal when the cycle is normal
and the Neyman-Pearson statistic for s when it is not. The largest score of a family of shapes that fills a
surface M on the sphere exceeds a high c about as often as the Euler characteristic of what exceeds it is
expected to be (Adler & Taylor 2007, Random Fields and Geometry, theorem 12.4.1)::

    P(max z > c) = chi(M) Phi(-c) + L_1(M) exp(-c^2/2) / (2 pi) + L_2(M) c exp(-c^2/2) / (2 pi)^(3/2)

with L_1 half the length of the edge of M and L_2 its area, arc lengths being arccos of correlations.
"""

import math
from typing import NamedTuple

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

FAMILIES = ("level", "tilt", "bump", "ripple")


class LookedFor(NamedTuple):
    """Shapes, (m, s), and places of bumps and waves among them, as `DeviationShapes.within` gives them."""

    rows: Samples
    across: int
    waves: int


class Scores(NamedTuple):
    """Information P, (s, s), and scores u, (s,), of the coefficients seen; components C, (s, k)."""

    P: Samples
    u: Samples
    C: Samples


class Bounds(NamedTuple):
    """What a shape is held against.

    Attributes
    ----------
    least : float
        Information on its size that a shape must have to be looked for.
    scale : float
        Variance of a score of a normal cycle.
    cycles : float
        From which the variation was learned.
    """

    least: float
    scale: float
    cycles: float


class Projected(NamedTuple):
    """The shapes s in rows, and what they make of P, C and u.

    Attributes
    ----------
    rows, image : ndarray, shape (m, s)
        s and P s.
    along : ndarray, shape (m, k)
        s' P C.
    score, information : ndarray, shape (m,)
        s' u and s' P s.
    """

    rows: Samples
    image: Samples
    along: Samples
    score: Samples
    information: Samples


@compiled
def scan(shapes: LookedFor, scores: Scores, bounds: Bounds) -> tuple[Samples, int]:
    """Look for every family of shapes in one cycle.

    Returns
    -------
    p_values : ndarray, shape (4,)
        Of the most telling shape of each of `FAMILIES`.
    centre : int
        Grid point of the likeliest bump; -1 if none can be seen.
    """
    rows = shapes.rows
    image = rows @ scores.P
    along, score, information = image @ scores.C, rows @ scores.u, np.empty(len(rows))
    for i in range(len(rows)):
        information[i] = _dot(rows[i], image[i])
    level, tilt = len(rows) - 2, len(rows) - 1
    projected = Projected(rows, image, along, score, information)
    p_values = np.empty(4)
    p_values[0] = _single_p_value(score[level], information[level], _dot(along[level], along[level]), bounds)
    # slope about the point where it does not depend on the level, so that the two are looked for apart
    pivot = _dot(rows[tilt], image[level]) / information[level]
    tilt_score, varied = score[tilt] - pivot * score[level], 0.0
    of_tilt = information[tilt] - pivot**2 * information[level]
    for k in range(along.shape[1]):
        varied += (along[tilt, k] - pivot * along[level, k]) ** 2
    p_values[1] = _single_p_value(tilt_score, of_tilt, varied, bounds)
    p_values[2], row = _largest_bump(projected, level - 2 * shapes.waves, shapes.across, bounds)
    p_values[3] = _largest_ripple(projected, level - 2 * shapes.waves, level, bounds)
    return p_values, row % shapes.across if row >= 0 else -1


@compiled
def _single_p_value(score: float, information: float, varied: float, bounds: Bounds) -> float:
    """Find the p-value of a single shape, of either sign; 1 where it cannot be seen."""
    if information < bounds.least:
        return 1.0
    z = _normal_score(score**2 / (information * bounds.scale), varied / information, bounds.cycles)
    return math.erfc(z / math.sqrt(2.0))


@compiled
def _normal_score(squared: float, learned_share: float, cycles: float) -> float:
    """Make the square of a score, a share of whose variance was learned, into a normal score as rare.

    Student's t with nu = cycles / share^2 degrees of freedom (Satterthwaite 1946, Biometrics Bulletin 2:110),
    g^2 = nu log(1 + z^2 / nu).
    """
    freedom = cycles / max(learned_share, 1e-6) ** 2
    return math.sqrt(freedom * math.log1p(squared / freedom))


@compiled
def _dot(a: Samples, b: Samples) -> float:
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@compiled
def _largest_bump(projected: Projected, bumps: int, centres: int, bounds: Bounds) -> tuple[float, int]:
    """Find p-value of the most telling bump, and row of the likeliest one.

    They are not the same: a score that owes much to what was learned of the variation may be large and not
    rare.
    """
    along, score, information = projected.along, projected.score, projected.information
    best, c, highest = -1, 0.0, 0.0
    for i in range(bumps):
        if information[i] >= bounds.least:
            share = _dot(along[i], along[i]) / information[i]
            squared = score[i] ** 2 / (information[i] * bounds.scale)
            c = max(c, _normal_score(squared, share, bounds.cycles))
            if best < 0 or squared > highest:
                best, highest = i, squared
    if best < 0:
        return 1.0, -1
    euler, edge, area = _euler_edge_area(projected, bounds.least, centres, bumps // centres)
    high = math.exp(-0.5 * c * c)
    tail = euler * 0.5 * math.erfc(c / math.sqrt(2.0)) + edge * high / (2.0 * math.pi)
    tail += area * c * high / (2.0 * math.pi) ** 1.5
    return min(1.0, 2.0 * tail), best


@compiled
def _euler_edge_area(
    projected: Projected, least: float, across: int, down: int
) -> tuple[float, float, float]:
    """Euler characteristic, half the edge and area of the triangulated surface of visible shapes."""
    euler, length = _vertices_and_edges(projected, least, across, down)
    edge, area, beside = 0.0, 0.0, np.zeros((3, across * down))
    for i in range(down - 1):
        for k in range(across - 1):
            a = i * across + k
            upper = _triangle_area(length[0, a], length[1, a], length[2, a])
            if upper == upper:
                euler, area = euler + 1.0, area + upper
                beside[0, a] += 1.0
                beside[1, a] += 1.0
                beside[2, a] += 1.0
            lower = _triangle_area(length[0, a + across], length[1, a + 1], length[2, a])
            if lower == lower:
                euler, area = euler + 1.0, area + lower
                beside[0, a + across] += 1.0
                beside[1, a + 1] += 1.0
                beside[2, a] += 1.0
    for kind in range(3):
        for a in range(across * down):
            if length[kind, a] == length[kind, a]:
                edge += length[kind, a] * (1.0 - beside[kind, a] / 2.0)
    return euler, edge, area


@compiled
def _vertices_and_edges(projected: Projected, least: float, across: int, down: int) -> tuple[float, Samples]:
    """Visible vertices less edges, and lengths of the edges, nan where one is not.

    Edges of each vertex go right, down, and diagonally from the right one to the lower one.
    """
    rows, image, information = projected.rows, projected.image, projected.information
    euler, length = 0.0, np.full((3, across * down), np.nan)
    for i in range(down):
        for k in range(across):
            a = i * across + k
            euler += 1.0 if information[a] >= least else 0.0
            for kind in range(3):
                if (kind != 1 and k + 1 == across) or (kind != 0 and i + 1 == down):
                    continue
                p = a + 1 if kind == 2 else a
                q = a + 1 if kind == 0 else a + across
                if information[p] >= least and information[q] >= least:
                    near = _dot(rows[p], image[q]) / math.sqrt(information[p] * information[q])
                    length[kind, a] = math.acos(min(max(near, -1.0), 1.0))
                    euler -= 1.0
    return euler, length


@compiled
def _triangle_area(a: float, b: float, c: float) -> float:
    """Area from the sides (Heron); nan if one is missing."""
    half = (a + b + c) / 2.0
    inside = half * (half - a) * (half - b) * (half - c)
    return math.sqrt(max(inside, 0.0)) if inside == inside else inside


@compiled
def _largest_ripple(projected: Projected, first: int, end: int, bounds: Bounds) -> float:
    """Find p-value of the most telling ripple.

    The phase goes round, so that the edge of the surface is two circles. Between neighbouring waves it is as
    wide as the root mean square of the two angles between their planes.
    """
    rows, image, along, score = projected.rows, projected.image, projected.along, projected.score
    c, area, before = -1.0, 0.0, -1
    for i in range(first, end, 2):
        j = i + 1
        cc, ss, cs = _dot(rows[i], image[i]), _dot(rows[j], image[j]), _dot(rows[i], image[j])
        if (cc + ss) / 2.0 - math.sqrt(((cc - ss) / 2.0) ** 2 + cs * cs) < bounds.least:
            continue
        solid = cc * ss - cs * cs
        a, b = (ss * score[i] - cs * score[j]) / solid, (cc * score[j] - cs * score[i]) / solid
        squared, varied = score[i] * a + score[j] * b, 0.0
        for k in range(along.shape[1]):
            varied += (a * along[i, k] + b * along[j, k]) ** 2
        c = max(
            c, _normal_score(max(squared, 0.0) / bounds.scale, varied / max(squared, 1e-300), bounds.cycles)
        )
        if before == i - 2:
            area += 2.0 * math.pi * _angle_between_planes(rows, image, i - 2, i)
        before = i
    if c < 0.0:
        return 1.0
    high = math.exp(-0.5 * c * c)
    tail: float = high + area * c * high / (2.0 * math.pi) ** 1.5
    return min(1.0, tail)


@compiled
def _angle_between_planes(rows: Samples, image: Samples, wave: int, next_wave: int) -> float:
    """Root mean square angle between the planes that two waves span with their cosines and sines."""
    shared = 0.0
    a, b = math.sqrt(_dot(rows[wave], image[wave])), _dot(rows[wave], image[wave + 1])
    c = math.sqrt(_dot(rows[wave + 1], image[wave + 1]) - (b / a) ** 2)
    d, e = math.sqrt(_dot(rows[next_wave], image[next_wave])), _dot(rows[next_wave], image[next_wave + 1])
    f = math.sqrt(_dot(rows[next_wave + 1], image[next_wave + 1]) - (e / d) ** 2)
    for k in range(2):
        first = _dot(rows[wave], image[next_wave + k]) / a
        second = (_dot(rows[wave + 1], image[next_wave + k]) - b / a * first) / c
        if k == 0:
            x, y = first / d, second / d
        else:
            first, second = (first - e / d * x) / f, (second - e / d * y) / f
            shared += x * x + y * y + first * first + second * second
    return math.asin(math.sqrt(min(max(1.0 - shared / 2.0, 0.0), 1.0)))
