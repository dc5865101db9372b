"""What friction along the stroke usually looks like: the mean of a material, and how cycles differ from it.

A cycle's deviation from its material's mean is a mixed model (Laird & Ware 1982, Biometrics 38:963)::

    beta_c = m + B a_c,   a_c ~ N(0, Lambda),   B: the lowest cosines along the grid

Lambda comes from incremental EM (Neal & Hinton 1998), which takes out what is only sensor noise and does
not mind that slides end in different places. The mean is the generalised least-squares one, slowly
forgetting, so that wear does not pass for deviance. Lambda outlives a change of material.
"""

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from impactcell.records import Samples
from impactcell.tracking import profile

COMPONENTS = 3  # principal components of T^2
MODES = 6  # cosines in which cycles are allowed to vary
MEMORY = 300.0  # cycles the mean remembers
FIRST_SPREAD = 0.05  # of the friction itself: how much cycles vary before anything is known
FIRST_WEIGHT = 0.5  # cycles that guess counts for
FORGETS = (8, 24)  # cycles after which learning begins again from what is known by then


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Pooled information of the present material, and how cycles vary.

    Attributes
    ----------
    weight : float
        Cycles the mean rests on.
    matrix, vector : ndarray
        Pooled information on the mean's coefficients, shapes (j, j) and (j,).
    mean : ndarray, shape (j,)
    strength : float
        Smoothing of the mean.
    cycles : int
        Cycles seen.
    counted : float
        Cycles that Lambda rests on.
    scatter : ndarray, shape (6, 6)
        Summed second moments of a.
    components : ndarray, shape (j, 6)
        Principal components as columns, largest first, scaled to their standard deviations.
    spe_sum : float
        Summed SPE over its degrees of freedom, of judged normal cycles.
    spe_count : int
    """

    weight: float = 0.0
    matrix: Samples = field(default_factory=lambda: np.zeros((0, 0)))
    vector: Samples = field(default_factory=lambda: np.zeros(0))
    mean: Samples = field(default_factory=lambda: np.zeros(0))
    strength: float = 0.0
    cycles: int = 0
    counted: float = FIRST_WEIGHT
    scatter: Samples = field(default_factory=lambda: np.zeros((MODES, MODES)))
    components: Samples = field(default_factory=lambda: np.zeros((0, MODES)))
    spe_sum: float = 0.0
    spe_count: int = 0


def empty(coefficients: int) -> Reference:
    """Before the first cycle."""
    square, line = np.zeros((coefficients, coefficients)), np.zeros(coefficients)
    return Reference(matrix=square, vector=line, mean=line, components=np.zeros((coefficients, MODES)))


def restart(reference: Reference) -> Reference:
    """Another material: its mean is learned anew, how cycles vary is kept."""
    square, line = np.zeros_like(reference.matrix), np.zeros_like(reference.vector)
    return replace(reference, weight=0.0, matrix=square, vector=line)


def without_variation(components: Samples, matrix: Samples, vector: Samples) -> tuple[Samples, Samples]:
    """Information on the mean rather than on one cycle: (G^-1 + C C')^-1, and its vector."""
    image = matrix @ components
    inner = np.eye(components.shape[1]) + components.T @ image
    solved = np.linalg.solve(inner, np.column_stack([image.T, components.T @ vector]))
    return matrix - image @ solved[:, :-1], vector - image @ solved[:, -1]


def learn(reference: Reference, slide: profile.Information, penalty: Samples) -> Reference:
    """Take one normal cycle into the reference."""
    if reference.cycles == 0 and reference.weight == 0.0:
        reference = _first(reference, slide, penalty)
    if reference.weight >= 1.0:
        reference = _learn_variation(reference, slide)
    kept = 1.0 - 1.0 / MEMORY if reference.weight >= MEMORY else 1.0
    own_matrix, own_vector = without_variation(reference.components, slide.matrix, slide.vector)
    matrix, vector = reference.matrix * kept + own_matrix, reference.vector * kept + own_vector
    strength = reference.strength
    if reference.weight in (0.0, 4.0, 16.0, 64.0):
        _, _, strength = profile.smooth(matrix, vector, penalty)
    mean = _solved(matrix + strength * penalty, vector)
    weight = min(reference.weight + 1.0, MEMORY)
    return replace(reference, weight=weight, matrix=matrix, vector=vector, mean=mean, strength=strength)


def _solved(matrix: Samples, vector: Samples) -> Samples:
    """Solve for the mean; where next to nothing is known of a place, by the smallest solution."""
    try:
        return np.asarray(cho_solve(cho_factor(matrix), vector), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(matrix, vector, rcond=1e-14)[0], dtype=np.float64)


def _first(reference: Reference, slide: profile.Information, penalty: Samples) -> Reference:
    mean, _, _ = profile.smooth(slide.matrix, slide.vector, penalty)
    spread = FIRST_SPREAD * abs(float(np.median(mean)))
    falling = (spread / np.arange(1.0, MODES + 1.0)) ** 2
    scatter = FIRST_WEIGHT * np.diag(falling)
    return replace(reference, scatter=scatter, components=_principal(scatter / FIRST_WEIGHT, len(mean)))


def _learn_variation(reference: Reference, slide: profile.Information) -> Reference:
    """One step of incremental EM on this cycle's deviation from the mean of those before it."""
    basis = cosines(len(reference.mean))
    spread = reference.scatter / reference.counted
    # the deviation also holds the error of the mean, 1 / weight of a cycle's variance
    share = reference.weight / (reference.weight + 1.0)
    own = slide.vector - slide.matrix @ reference.mean
    known = basis.T @ slide.matrix @ basis
    posterior = np.linalg.inv(np.linalg.inv(spread) + known * share)
    score = posterior @ (basis.T @ own) * share
    scatter = reference.scatter + np.outer(score, score) + posterior
    cycles = reference.cycles + 1
    counted = reference.counted + 1.0
    if cycles in FORGETS:
        # what was learned against a first, rough mean is kept as no more than a guess
        scatter, counted = scatter / counted * FIRST_WEIGHT, FIRST_WEIGHT
    components = _principal(scatter / counted, len(reference.mean))
    scatter = (scatter + scatter.T) / 2.0
    return replace(reference, scatter=scatter, cycles=cycles, counted=counted, components=components)


def _principal(spread: Samples, coefficients: int) -> Samples:
    values, vectors = np.linalg.eigh(spread)
    scaled = vectors[:, ::-1] * np.sqrt(np.maximum(values[::-1], 0.0))
    components: Samples = cosines(coefficients) @ scaled
    return components


@lru_cache(maxsize=8)
def cosines(coefficients: int) -> Samples:
    """Lowest cosines along the grid, of unit mean square, shape (j, 6)."""
    place = (np.arange(coefficients) + 0.5) / coefficients
    modes = np.cos(math.pi * np.outer(place, np.arange(MODES)))
    unit: Samples = modes / np.sqrt((modes**2).mean(axis=0))
    return unit
