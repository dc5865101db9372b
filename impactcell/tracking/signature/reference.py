"""What friction along the stroke usually looks like: the mean of a material, and how cycles differ from it.

A cycle's deviation from its material's mean is a mixed model (Laird & Ware 1982, Biometrics 38:963)::

    beta_c = m + B a_c,   a_c ~ N(0, Lambda)

Lambda: see `pca_variation`; it outlives a change of material. The mean is the generalised
least-squares one under a roughness penalty, slowly forgetting, so that wear does not pass for deviance.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from impactcell.numerics import small_linalg
from impactcell.numerics.jit import compiled
from impactcell.records import Samples
from impactcell.tracking.signature import friction_profile, pca_variation
from impactcell.tracking.signature.pca_variation import MODES, Variation

MEMORY = 300.0
"""Cycles that the mean remembers: what is slower, as wear, is no deviance. Our choice."""
SMOOTHING_WEIGHTS = (0.0, 4.0, 16.0, 64.0)
"""Weights, in cycles, at which the mean's smoothing is fitted anew. Our choice."""
MIN_CYCLES = 8.0
"""Cycles that have met a place before the mean is known there. Our choice."""
MIN_VARIATION_CYCLES = 25.0
"""Cycles from which variation was learned at a place before cycles are judged there. Our choice."""
RELATIVE_CONTINUATION_STEP = 0.15
"""Steps of friction between coefficients where it is unknown, of the friction itself. Our choice."""
MIN_FRICTION = 1e-3
"""Friction below this is none."""
PRIOR_INFORMATION = 1.0
"""Information on each coefficient beforehand, 1 over friction squared: friction is known to about 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Pooled information of the present material, and how cycles vary.

    Attributes
    ----------
    weight : float
        Cycles the mean rests on.
    matrix, vector : ndarray
        Pooled information on the mean's coefficients: the lower triangle by rows, and shape (j,).
    mean : ndarray, shape (j,)
    strength : float
        Smoothing of the mean.
    variation : Variation
    components : ndarray, shape (j, 6)
        Principal components of the variation as columns, largest first, scaled to their standard deviations.
    cycles_met : ndarray, shape (j,)
        Cycles of this material that slid over each coefficient.
    cycles_varied : ndarray, shape (j,)
        Cycles of any material from which variation was learned there.
    spe_sum : float
        Summed SPE over its degrees of freedom, of judged normal cycles.
    spe_count : int
    """

    weight: float = 0.0
    matrix: Samples = field(default_factory=lambda: np.zeros(0))
    vector: Samples = field(default_factory=lambda: np.zeros(0))
    mean: Samples = field(default_factory=lambda: np.zeros(0))
    strength: float = 0.0
    variation: Variation = field(default_factory=Variation)
    components: Samples = field(default_factory=lambda: np.zeros((0, MODES)))
    cycles_met: Samples = field(default_factory=lambda: np.zeros(0))
    cycles_varied: Samples = field(default_factory=lambda: np.zeros(0))
    spe_sum: float = 0.0
    spe_count: int = 0

    def fields(self, components: Samples, cycles: int) -> "ReferenceFields":
        """Give what a `ReferenceArrays` is made of: compiled code takes plain tuples in less time."""
        return (
            self.weight, self.matrix, self.vector, self.mean, self.strength, components, self.cycles_met,
            self.cycles_varied, float(cycles),
        )  # fmt: skip


class ReferenceArrays(NamedTuple):
    """Fields of a `Reference` in compiled code, and the cycles from which its variation was learned."""

    weight: float
    matrix: Samples
    vector: Samples
    mean: Samples
    strength: float
    components: Samples
    cycles_met: Samples
    cycles_varied: Samples
    cycles: float


ReferenceFields = tuple[float, Samples, Samples, Samples, float, Samples, Samples, Samples, float]
"""Fields of a `ReferenceArrays`."""


def initial_state(coefficients: int) -> Reference:
    """Before the first cycle."""
    triangle, line = np.zeros(coefficients * (coefficients + 1) // 2), np.zeros(coefficients)
    components = np.zeros((coefficients, MODES))
    return Reference(
        matrix=triangle, vector=line, mean=line, cycles_met=line, cycles_varied=line, components=components
    )


def restart(reference: Reference) -> Reference:
    """Another material: its mean is learned anew, how cycles vary is kept."""
    triangle, line = np.zeros_like(reference.matrix), np.zeros_like(reference.vector)
    return replace(reference, weight=0.0, matrix=triangle, vector=line, cycles_met=line)


@compiled
def known_coefficients(cycles_met: Samples, weight: float) -> int:
    """Coefficients, from the first on, that enough cycles have met for the mean to be known there."""
    n = 0
    for cycles in cycles_met:
        n += 1 if cycles >= min(weight, MIN_CYCLES) else 0
    return n


@compiled
def judged_coefficients(reference: ReferenceArrays) -> int:
    """Coefficients, from the first on, where cycles can be judged: mean and variation are known."""
    n = 0
    for learned in reference.cycles_varied:
        n += 1 if learned >= min(reference.cycles, MIN_VARIATION_CYCLES) else 0
    return min(known_coefficients(reference.cycles_met, reference.weight), n)


@compiled
def mean_friction(mean: Samples, n: int) -> float:
    """Friction of the material over its first n coefficients."""
    total = 0.0
    for i in range(n):
        total += mean[i]
    return max(abs(total / n), MIN_FRICTION)


@compiled
def information_on_deviation(
    cycle: friction_profile.SlideInformation, mean: Samples, n: int
) -> tuple[Samples, Samples]:
    """Leave of a cycle what it says of its first n coefficients: information, and h - G m.

    Friction beyond is no better known than that it goes on from where it was, in steps of
    `RELATIVE_CONTINUATION_STEP` of itself: a longer slide tells neither deviance nor how cycles vary.
    """
    matrix, vector, coefficients = cycle
    residual = np.empty(coefficients)
    for i in range(coefficients):
        residual[i] = vector[i]
        for j in range(coefficients):
            residual[i] -= matrix[i, j] * mean[j]
    information = small_linalg.block(matrix, 0, n, 0, n)
    if coefficients <= n:
        return information, residual
    continues = 1.0 / (RELATIVE_CONTINUATION_STEP * mean_friction(mean, n)) ** 2
    inner = small_linalg.block(matrix, n, coefficients, n, coefficients)
    cross = small_linalg.block(matrix, n, coefficients, 0, n)
    information[n - 1, n - 1] += continues
    cross[0, n - 1] -= continues
    for i in range(coefficients - n):
        inner[i, i] += continues
        if i > 0:
            inner[i - 1, i - 1] += continues
            inner[i, i - 1] -= continues
            inner[i - 1, i] -= continues
    return small_linalg.marginalise(information, residual[:n], inner, cross, residual[n:])


@compiled
def with_mean_error(
    matrix: Samples, vector: Samples, pooled: Samples, strength: float
) -> tuple[Samples, Samples]:
    """Information (G^-1 + V)^-1 and its vector, V the covariance of the mean's error."""
    mean_precision = precision(pooled, strength)
    n, j = len(vector), len(mean_precision)
    beyond = small_linalg.block(mean_precision, n, j, n, j)
    cross = small_linalg.block(mean_precision, n, j, 0, n)
    total, _ = small_linalg.marginalise(
        small_linalg.block(mean_precision, 0, n, 0, n), vector, beyond, cross, np.zeros(j - n)
    )
    for i in range(n):
        for k in range(n):
            total[i, k] += matrix[i, k]
    return small_linalg.marginalise(matrix, vector, total, matrix, vector)


@compiled
def precision(pooled: Samples, strength: float) -> Samples:
    """Inverse covariance of the mean's coefficients from their pooled information, shape (j, j)."""
    matrix = small_linalg.unpack_triangle(pooled)
    rough = friction_profile.roughness(len(matrix))
    for i in range(len(matrix)):
        matrix[i, i] += PRIOR_INFORMATION
        for j in range(len(matrix)):
            matrix[i, j] += strength * rough[i, j]
    return matrix


def update(
    reference: Reference,
    slide: friction_profile.SplineInformation,
    grid_m: Samples,
    settled: float,
    spe: float | None = None,
) -> Reference:
    """Take one normal cycle into the reference.

    Parameters
    ----------
    settled : float
        Cycles, at least 1, before which the mean is too rough to show how a cycle differs from it.
    spe : float or None
        SPE of a judged cycle over its degrees of freedom.
    """
    variation, components, strength = reference.variation, reference.components, reference.strength
    total = len(slide.vector)
    varies = reference.weight >= settled
    if not varies and reference.weight == 0.0 and variation.cycles == 0:
        first, _ = friction_profile.smooth(slide, grid_m)
        variation = pca_variation.initial_guess(float(np.median(first)))
        components = pca_variation.components(np.eye(MODES), pca_variation.cosines(total) * variation.scale)
    cycles = variation.cycles + 1 if varies else variation.cycles
    basis = variation.scale, pca_variation.cosines(total)
    matrix, vector, mean, components, cycles_met, cycles_varied, sums = _update_arrays(
        reference.fields(components, cycles), variation.sums, basis, slide.fields, varies
    )
    if reference.weight in SMOOTHING_WEIGHTS:
        pooled = friction_profile.SplineInformation(
            small_linalg.unpack_triangle(matrix), vector, slide.reached_m, total
        )
        _, strength = friction_profile.smooth(pooled, grid_m)
        mean = small_linalg.solve(precision(matrix, strength), vector)
    return Reference(
        min(reference.weight + 1.0, MEMORY),
        matrix,
        vector,
        mean,
        strength,
        Variation(cycles, variation.scale, *sums),
        components,
        cycles_met,
        cycles_varied,
        reference.spe_sum if spe is None else reference.spe_sum + spe,
        reference.spe_count if spe is None else reference.spe_count + 1,
    )


@compiled
def _update_arrays(
    reference_fields: ReferenceFields,
    sums_fields: pca_variation.SumsFields,
    basis: tuple[Samples, Samples],
    slide_fields: tuple[Samples, Samples, int],
    varies: bool,  # noqa: FBT001  # compiled code takes its arguments by position
) -> tuple[Samples, Samples, Samples, Samples, Samples, Samples, pca_variation.SumsFields]:
    """Take one cycle more into all that a reference keeps; it says less of the mean the more cycles vary.

    `basis` are the first guesses of the modes' standard deviations, shape (6,), and the modes, shape (j, 6).
    """
    before, sums = ReferenceArrays(*reference_fields), pca_variation.Sums(*sums_fields)
    cycle = friction_profile.SlideInformation(*slide_fields)
    cycles_met, cycles_varied = before.cycles_met.copy(), before.cycles_varied.copy()
    coefficients = cycle.coefficients
    matrix, vector, components = before.matrix.copy(), before.vector.copy(), before.components
    if varies:
        scale, cosines = basis
        n, B = min(known_coefficients(cycles_met, before.weight), coefficients), cosines.copy()
        for i in range(len(B)):
            for k in range(MODES):
                B[i, k] *= scale[k]
        information, deviation = information_on_deviation(cycle, before.mean, n)
        sums = pca_variation.update_sums(B, information, deviation, before.weight, sums)
        components = pca_variation.components(pca_variation.covariance(sums, before.cycles), B)
        for i in range(min(n, coefficients - 1)):
            cycles_varied[i] += 1.0
    retention = 1.0 - 1.0 / MEMORY if before.weight >= MEMORY else 1.0
    modes = small_linalg.block(components, 0, coefficients, 0, MODES)
    of_cycle = small_linalg.block(cycle.matrix, 0, coefficients, 0, coefficients)
    of_mean, score = small_linalg.with_random_effects(modes, of_cycle, cycle.vector[:coefficients])
    p = 0
    for i in range(len(vector)):
        cycles_met[i] = cycles_met[i] * retention + (1.0 if i < coefficients - 1 else 0.0)
        vector[i] = vector[i] * retention + (score[i] if i < coefficients else 0.0)
        for j in range(i + 1):
            matrix[p] = matrix[p] * retention + (of_mean[i, j] if i < coefficients else 0.0)
            p += 1
    mean = small_linalg.solve(precision(matrix, before.strength), vector)
    sums_after = sums.weights, sums.moments, sums.signal, sums.noise
    return matrix, vector, mean, components, cycles_met, cycles_varied, sums_after
