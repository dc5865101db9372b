"""Is a cycle deviant? T^2 on the principal components, noise-whitened SPE, and a scan over shapes.

A cycle's information vector y = h - G m, m the material's mean known to a covariance V, has covariance
G + G (V + C C') G when normal: sensor noise, the mean's own error and the components C. With
P = (G^-1 + V + C C')^-1 and u = P G^-1 y a shape s in friction is seen with the score s' u / sqrt(s' P s).
T^2 and SPE find what was not thought of; the scan over bumps, ripples, level and tilt comes close to the
oracle that knows the shape. Each gets a share w of the false alarms; together their p-value is the weighted
harmonic mean 1 / sum(w / p) (Wilson 2019, PNAS 116:1195), which for small ones is the averaged likelihood
ratio, the best that can be done without knowing which of them it will be.

The variation is itself learned from n cycles. What is tested against a covariance of k learned dimensions
varies 1 + 2 k / n times as much as it says (Reed, Mallett & Brennan 1974, IEEE Trans. AES 10:853), and the
share of a score that comes from it follows Student's t.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, chdtri, fdtrc, fdtri

from impactcell.numerics import small_linalg
from impactcell.numerics.jit import compiled
from impactcell.records import Samples
from impactcell.tracking.signature import (
    deviation_shapes,
    deviation_size,
    friction_profile,
    matched_filter_scan,
)
from impactcell.tracking.signature import reference as references
from impactcell.tracking.signature.pca_variation import MODES
from impactcell.tracking.signature.reference import Reference

COMPONENTS = 3
"""Principal components of T^2: level, tilt and bend are how cycles usually vary. Our choice."""
KINDS = ("t_squared", "spe", *matched_filter_scan.FAMILIES)
"""Parts of the test."""
FALSE_ALARM_SHARES = (0.02, 0.02, 0.08, 0.08, 0.42, 0.38)
"""Share of the false alarms that each part gets. Our choice: most where most shapes are looked for."""
MIN_INFORMATION = 400.0
"""Directions known worse than 1 / sqrt of this in friction, 0.05, say nothing."""
MIN_COMPONENT_SIZE = 1e-9
"""Components smaller than this against the noise are not seen."""
MIN_P_VALUE = 1e-300
"""Least p-value, so that its inverse is finite."""
SIZED_P_VALUE = 0.01
"""p-value below which a shape is sized: no cell may be set to more false alarms."""
MAX_RELATIVE_SIZE, MIN_SCORE_SQUARED = 0.5, 30.0
"""Shapes that even so large a share of the friction would not show, by a score of so much squared, are not
looked for."""


@dataclass(frozen=True, slots=True)
class DeviationTest:
    """How normal a cycle is.

    Attributes
    ----------
    p_value : float
        Of the whole test, all shares together.
    t_squared, spe : float
    spe_freedom : int
        Degrees of freedom of `spe`.
    spe_scale : float
        What normal cycles have of it over its freedom, where that is certain to be above 1.
    kind : str
        Which part of the test says most.
    at_m : float
        Where the cycle deviates most.
    size, size_std : float
        Friction of the likeliest family of shapes, and its standard deviation, by `deviation_size`; nan
        where the p-value is not below `SIZED_P_VALUE`. A cycle that T^2 or SPE says most of is sized as a
        bump.
    """

    p_value: float
    t_squared: float
    spe: float
    spe_freedom: int
    spe_scale: float
    kind: str
    at_m: float
    size: float
    size_std: float


def test_deviation(
    reference: Reference, slide: friction_profile.SplineInformation, grid_m: Samples
) -> DeviationTest:
    """Test one cycle against its material's reference."""
    cycles = reference.variation.cycles
    shapes = deviation_shapes.deviation_shapes(float(grid_m[-1]), len(grid_m))
    rows, across, waves = shapes.within(slide.reached_m, len(slide.vector))
    spe_of_normal = reference.spe_sum, float(max(reference.spe_count, 1))
    statistics = _statistics(
        reference.fields(reference.components, cycles), spe_of_normal, slide.fields, (rows, across, waves)
    )
    t_squared, spe, freedom, scale, p_scan, centre, least, score_variance, P, u = statistics
    chi_squared = float(chdtrc(freedom, spe / scale)) if freedom > 0 else 1.0
    p_values = (_hotelling_p_value(t_squared, cycles), chi_squared, *p_scan.tolist())
    odds = [share / max(p, MIN_P_VALUE) for share, p in zip(FALSE_ALARM_SHARES, p_values, strict=True)]
    likeliest = odds.index(max(odds))
    at = float(grid_m[centre]) if centre >= 0 else math.nan
    p_value, size, std = 1.0 / sum(odds), math.nan, math.nan
    if p_value < SIZED_P_VALUE:
        family = likeliest - 2 if likeliest >= 2 else deviation_size.BUMP
        size, std = deviation_size.estimate_size(family, P, u, grid_m, slide.reached_m, least, score_variance)
    return DeviationTest(p_value, t_squared, spe, freedom, scale, KINDS[likeliest], at, size, std)


@compiled
def _statistics(
    reference_fields: references.ReferenceFields,
    spe_of_normal: tuple[float, float],
    slide_fields: tuple[Samples, Samples, int],
    shapes: tuple[Samples, int, int],
) -> tuple[float, float, int, float, Samples, int, float, float, Samples, Samples]:
    """T^2, SPE, its freedom and the scale of the noise, what `scan` finds, and what it was told.

    `spe_of_normal` are the sum of SPE over its freedom and how many cycles it is of, `shapes` what
    `DeviationShapes.within` gives.
    """
    reference = references.ReferenceArrays(*reference_fields)
    cycle = friction_profile.SlideInformation(*slide_fields)
    (spe_sum, spe_count), (rows, across, waves) = spe_of_normal, shapes
    n = min(cycle.coefficients, references.judged_coefficients(reference))
    information, deviation = references.information_on_deviation(cycle, reference.mean, n)
    G, y = references.with_mean_error(information, deviation, reference.matrix, reference.strength)
    C = small_linalg.block(reference.components, 0, n, 0, MODES)
    t_squared, spe, freedom = _t_squared_and_spe(G, y, C, COMPONENTS)
    # variation beyond the modes, or noise that was declared too low, widens everything once it is certain
    least_spe = spe_sum / spe_count - 2.0 * math.sqrt(2.0 / (max(freedom, 1) * spe_count))
    scale = max(1.0, least_spe)
    P, u = small_linalg.with_random_effects(C, G, y)
    least = MIN_SCORE_SQUARED / (MAX_RELATIVE_SIZE * references.mean_friction(reference.mean, n)) ** 2
    within_slide = small_linalg.block(rows, 0, len(rows), 0, n)
    score_variance = scale * (1.0 + 2.0 * MODES / reference.cycles)
    p_values, centre = matched_filter_scan.scan(
        matched_filter_scan.LookedFor(within_slide, across, waves),
        matched_filter_scan.Scores(P, u, C),
        matched_filter_scan.Bounds(least, score_variance, reference.cycles),
    )
    return t_squared, spe, freedom, scale, p_values, centre, least, score_variance, P, u


@compiled
def _t_squared_and_spe(G: Samples, y: Samples, C: Samples, leading: int) -> tuple[float, float, int]:
    """Hotelling's T^2, and the squared prediction error over the sensor noise with its freedom."""
    n, modes = C.shape
    # the lesser components widen the noise that SPE is whitened by; T^2 is on the leading ones
    matrix, vector = small_linalg.with_random_effects(small_linalg.block(C, 0, n, leading, modes), G, y)
    image = small_linalg.transposed_product(matrix, small_linalg.block(C, 0, n, 0, leading))
    whitened, components, freedom, squares = _whiten(matrix, vector, image)
    gram = small_linalg.transposed_product(components, components)
    scores, sizes = np.zeros(leading), np.empty(leading)
    for a in range(leading):
        sizes[a] = math.sqrt(gram[a, a])
        for k in range(n):
            scores[a] += components[k, a] * whitened[k]
    if freedom <= leading or sizes.min() < MIN_COMPONENT_SIZE:
        return 0.0, squares, freedom
    for a in range(leading):
        scores[a] /= sizes[a]
        for b in range(leading):
            gram[a, b] /= sizes[a] * sizes[b]
    spread = gram.copy()
    for a in range(leading):
        for b in range(leading):
            for c in range(leading):
                spread[a, b] += gram[a, c] * sizes[c] ** 2 * gram[c, b]
    t_squared, spe = 0.0, squares
    usual, by_noise = small_linalg.solve(spread, scores), small_linalg.solve(gram, scores)
    for a in range(leading):
        t_squared += scores[a] * usual[a]
        spe -= scores[a] * by_noise[a]
    return t_squared, max(spe, 0.0), freedom - leading


@compiled
def _whiten(matrix: Samples, vector: Samples, image: Samples) -> tuple[Samples, Samples, int, float]:
    """Whiten by a Cholesky factor that takes the best known direction next and ends where nothing is known.

    Parameters
    ----------
    matrix, vector, image : ndarray, shapes (n, n), (n,), (n, c)
        Information, its vector, and its product with the components; used up.

    Returns
    -------
    whitened, components : ndarray, shapes (n,), (n, c)
        The vector and the components.
    freedom : int
        Directions known.
    squares : float
        Sum of squares of `whitened`.
    """
    n, leading = image.shape
    whitened, components, column = np.zeros(n), np.zeros((n, leading)), np.empty(n)
    freedom, squares = 0, 0.0
    for k in range(n):
        best = 0
        for i in range(n):
            if matrix[i, i] > matrix[best, best]:
                best = i
        if matrix[best, best] < MIN_INFORMATION:
            break
        root = math.sqrt(matrix[best, best])
        whitened[k] = vector[best] / root
        for j in range(leading):
            components[k, j] = image[best, j] / root
        for i in range(n):
            column[i] = matrix[i, best] / root
        for i in range(n):
            vector[i] -= column[i] * whitened[k]
            for j in range(n):
                matrix[i, j] -= column[i] * column[j]
            for j in range(leading):
                image[i, j] -= column[i] * components[k, j]
        squares += whitened[k] ** 2
        freedom += 1
    return whitened, components, freedom, squares


def _hotelling_p_value(t_squared: float, cycles: int) -> float:
    """p-value of T^2 when the components were learned from `cycles` cycles."""
    n, k = cycles, COMPONENTS
    if n <= k + 1:
        return 1.0
    return float(fdtrc(k, n - k, t_squared * (n - k) / (k * (n - 1.0))))


def limits(test: DeviationTest, cycles: int, false_alarm_cycles: float) -> tuple[float, float]:
    """Give the T^2 and the SPE from which on each makes a cycle deviant by itself; nan where none can.

    The inverse of each p-value at its share of the false alarms: there w / p reaches `false_alarm_cycles`.
    """
    n, k = cycles, COMPONENTS
    by_t_squared, by_spe = (share / false_alarm_cycles for share in FALSE_ALARM_SHARES[:2])
    t_squared = (
        float(fdtri(k, n - k, 1.0 - by_t_squared)) * k * (n - 1.0) / (n - k) if n > k + 1 else math.nan
    )
    spe = test.spe_scale * float(chdtri(test.spe_freedom, by_spe)) if test.spe_freedom > 0 else math.nan
    return t_squared, spe
