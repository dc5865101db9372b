"""What friction along the stroke usually looks like: the mean of a material, and how cycles differ from it.

A cycle's deviation from its material's mean is a mixed model (Laird & Ware 1982, Biometrics 38:963)::

    beta_c = m + B a_c,   a_c ~ N(0, Lambda)

Lambda: see `impactcell.tracking.variation`; it outlives a change of material. The mean is the generalised
least-squares one under a roughness penalty, slowly forgetting, so that wear does not pass for deviance.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from impactcell.records import Samples
from impactcell.tracking import linear, profile, variation
from impactcell.tracking.variation import MODES, Variation

MEMORY = 300.0  # cycles the mean remembers
SMOOTHED_AT = (0.0, 4.0, 16.0, 64.0)  # weights at which the mean's smoothing is settled anew
FEWEST = 8.0  # cycles that have met a place before the mean is known there
VAGUE = 1.0  # information on each coefficient beforehand: friction is known to about 1


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
    variation : Variation
    components : ndarray, shape (j, 6)
        Principal components of the variation as columns, largest first, scaled to their standard deviations.
    met : ndarray, shape (j,)
        Cycles of this material that slid over each coefficient.
    spe_sum : float
        Summed SPE over its degrees of freedom, of judged normal cycles.
    spe_count : int
    """

    weight: float = 0.0
    matrix: Samples = field(default_factory=lambda: np.zeros((0, 0)))
    vector: Samples = field(default_factory=lambda: np.zeros(0))
    mean: Samples = field(default_factory=lambda: np.zeros(0))
    strength: float = 0.0
    variation: Variation = field(default_factory=Variation)
    components: Samples = field(default_factory=lambda: np.zeros((0, MODES)))
    met: Samples = field(default_factory=lambda: np.zeros(0))
    spe_sum: float = 0.0
    spe_count: int = 0


def empty(coefficients: int) -> Reference:
    """Before the first cycle."""
    square, line = np.zeros((coefficients, coefficients)), np.zeros(coefficients)
    components = np.zeros((coefficients, MODES))
    return Reference(matrix=square, vector=line, mean=line, met=line, components=components)


def restart(reference: Reference) -> Reference:
    """Another material: its mean is learned anew, how cycles vary is kept."""
    square, line = np.zeros_like(reference.matrix), np.zeros_like(reference.vector)
    return replace(reference, weight=0.0, matrix=square, vector=line, met=line)


def reach(reference: Reference) -> int:
    """Coefficients, from the first on, that enough cycles have met for the mean to be known there."""
    return int(np.count_nonzero(reference.met >= min(reference.weight, FEWEST)))


def within(reference: Reference, matrix: Samples, vector: Samples) -> tuple[Samples, Samples]:
    """Leave of a cycle what it says where the mean is known, with friction beyond that free.

    Beyond the slides learned from, a longer one tells neither deviance nor how cycles vary.

    Returns
    -------
    matrix, vector : ndarray
        G11 - G12 G22^-1 G21 and its vector, of the coefficients within `reach`; zero beyond.
    """
    n = reach(reference)
    if n == len(vector):
        return matrix, vector
    beyond = matrix[n:, n:].copy()
    beyond.flat[:: len(beyond) + 1] += VAGUE
    crossed = matrix[:n, n:] @ linear.solved(beyond, np.column_stack([matrix[n:, :n], vector[n:]]))
    inner, outer = np.zeros_like(matrix), np.zeros_like(vector)
    inner[:n, :n], outer[:n] = matrix[:n, :n] - crossed[:, :-1], vector[:n] - crossed[:, -1]
    return inner, outer


def precision(reference: Reference) -> Samples:
    """Inverse covariance of the mean's coefficients, shape (j, j)."""
    n = len(reference.vector)
    return reference.matrix + reference.strength * profile.roughness(n) + VAGUE * np.eye(n)


def learn(reference: Reference, slide: profile.Information, settled: float) -> Reference:
    """Take one normal cycle into the reference.

    Parameters
    ----------
    settled : float
        Cycles, at least 1, before which the mean is too rough to show how a cycle differs from it.
    """
    varied, components = reference.variation, reference.components
    if reference.weight >= settled:
        known, own = within(reference, slide.matrix, slide.vector - slide.matrix @ reference.mean)
        varied = variation.learn(varied, known, own, reference.weight)
        components = variation.components(varied, len(own))
    elif reference.weight == 0.0 and varied.cycles == 0:
        first, _, _ = profile.smooth(slide)
        varied = variation.guess(float(np.median(first)))
        components = variation.components(varied, len(slide.vector))
    kept = 1.0 - 1.0 / MEMORY if reference.weight >= MEMORY else 1.0
    own_matrix, own_vector = without_variation(components, slide.matrix, slide.vector)
    matrix, vector = reference.matrix * kept + own_matrix, reference.vector * kept + own_vector
    strength = reference.strength
    if reference.weight in SMOOTHED_AT:
        _, _, strength = profile.smooth(profile.Information(matrix, vector, slide.reached_m, len(vector)))
    fresh = replace(
        reference,
        weight=min(reference.weight + 1.0, MEMORY),
        matrix=matrix,
        vector=vector,
        strength=strength,
        variation=varied,
        components=components,
        met=reference.met * kept + (np.arange(len(vector)) < slide.seen - 1),
    )
    return replace(fresh, mean=linear.solved(precision(fresh), vector))


def without_variation(components: Samples, matrix: Samples, vector: Samples) -> tuple[Samples, Samples]:
    """Information on the mean rather than on one cycle: (G^-1 + C C')^-1, and its vector."""
    image = matrix @ components
    inner = components.T @ image
    inner.flat[:: len(inner) + 1] += 1.0
    along = image @ linear.solved(inner, np.column_stack([image.T, components.T @ vector]))
    return matrix - along[:, :-1], vector - along[:, -1]
