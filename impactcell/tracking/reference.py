"""What friction along the stroke usually looks like: the mean of a material, and how cycles differ from it.

A cycle's deviation from its material's mean is a mixed model (Laird & Ware 1982, Biometrics 38:963)::

    beta_c = m + B a_c,   a_c ~ N(0, Lambda)

Lambda: see `impactcell.tracking.variation`; it outlives a change of material. The mean is the generalised
least-squares one under a roughness penalty, slowly forgetting, so that wear does not pass for deviance.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from impactcell.compiled import compiled
from impactcell.records import Samples
from impactcell.tracking import linear, profile, variation
from impactcell.tracking.variation import MODES, Variation

MEMORY = 300.0  # cycles the mean remembers
SMOOTHED_AT = (0.0, 4.0, 16.0, 64.0)  # weights at which the mean's smoothing is settled anew
FEWEST = 8.0  # cycles that have met a place before the mean is known there
FEWEST_VARIED = 25.0  # cycles from which variation was learned at a place before cycles are judged there
CONTINUES = 0.15  # of the friction itself: its steps from coefficient to coefficient where it is unknown
LEAST = 1e-3  # friction below this is none
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
    varied : ndarray, shape (j,)
        Cycles of any material from which variation was learned there.
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
    varied: Samples = field(default_factory=lambda: np.zeros(0))
    spe_sum: float = 0.0
    spe_count: int = 0


def empty(coefficients: int) -> Reference:
    """Before the first cycle."""
    square, line = np.zeros((coefficients, coefficients)), np.zeros(coefficients)
    components = np.zeros((coefficients, MODES))
    return Reference(matrix=square, vector=line, mean=line, met=line, varied=line, components=components)


def restart(reference: Reference) -> Reference:
    """Another material: its mean is learned anew, how cycles vary is kept."""
    square, line = np.zeros_like(reference.matrix), np.zeros_like(reference.vector)
    return replace(reference, weight=0.0, matrix=square, vector=line, met=line)


def reach(reference: Reference) -> int:
    """Coefficients, from the first on, that enough cycles have met for the mean to be known there."""
    return int(np.count_nonzero(reference.met >= min(reference.weight, FEWEST)))


def judged(reference: Reference) -> int:
    """Coefficients, from the first on, where cycles can be judged: mean and variation are known."""
    enough = min(float(reference.variation.cycles), FEWEST_VARIED)
    return min(reach(reference), int(np.count_nonzero(reference.varied >= enough)))


def deviating(reference: Reference, slide: profile.Information, n: int) -> tuple[Samples, Samples]:
    """Leave of a cycle what it says of its first n coefficients: information, and h - G m.

    Friction beyond is no better known than that it goes on from where it was, in steps of a share `CONTINUES`
    of itself: a longer slide tells neither deviance nor how cycles vary.
    """
    return _deviating(slide.matrix, slide.vector, reference.mean, n, slide.seen)


def unsure(reference: Reference, matrix: Samples, vector: Samples) -> tuple[Samples, Samples]:
    """Information (G^-1 + V)^-1 and its vector, V the covariance of the mean's error."""
    return _unsure(matrix, vector, reference.matrix, reference.strength)


@compiled
def usual(mean: Samples, n: int) -> float:
    """Friction of the material over its first n coefficients."""
    return max(abs(float(mean[:n].mean())), LEAST)


@compiled
def _deviating(matrix: Samples, vector: Samples, mean: Samples, n: int, seen: int) -> tuple[Samples, Samples]:
    own = vector[:seen].copy()
    for i in range(seen):
        for j in range(seen):
            own[i] -= matrix[i, j] * mean[j]
    known = matrix[:n, :n].copy()
    if seen <= n:
        return known, own[:n].copy()
    continues = 1.0 / (CONTINUES * usual(mean, n)) ** 2
    inner, cross = matrix[n:seen, n:seen].copy(), matrix[n:seen, :n].copy()
    known[n - 1, n - 1] += continues
    cross[0, n - 1] -= continues
    for i in range(seen - n):
        inner[i, i] += continues
        if i > 0:
            inner[i - 1, i - 1] += continues
            inner[i, i - 1] -= continues
            inner[i - 1, i] -= continues
    return linear.marginal(known, own[:n].copy(), inner, cross, own[n:].copy())


@compiled
def _unsure(matrix: Samples, vector: Samples, pooled: Samples, strength: float) -> tuple[Samples, Samples]:
    n, precise = len(vector), precision(pooled, strength)
    beyond = np.zeros(len(precise) - n)
    known, _ = linear.marginal(
        precise[:n, :n].copy(), vector, precise[n:, n:].copy(), precise[n:, :n].copy(), beyond
    )
    return linear.marginal(matrix, vector, matrix + known, matrix, vector)


@compiled
def precision(pooled: Samples, strength: float) -> Samples:
    """Inverse covariance of the mean's coefficients from their pooled information, shape (j, j)."""
    n = len(pooled)
    return pooled + strength * profile.roughness(n) + VAGUE * np.eye(n)


def learn(reference: Reference, slide: profile.Information, settled: float) -> Reference:
    """Take one normal cycle into the reference.

    Parameters
    ----------
    settled : float
        Cycles, at least 1, before which the mean is too rough to show how a cycle differs from it.
    """
    varied, components, met = reference.variation, reference.components, reference.varied
    total = len(slide.vector)
    if reference.weight >= settled:
        n = min(reach(reference), slide.seen)
        varied = variation.learn(varied, *deviating(reference, slide, n), reference.weight, total)
        components = variation.components(varied, total)
        met = met + (np.arange(total) < min(n, slide.seen - 1))
    elif reference.weight == 0.0 and varied.cycles == 0:
        first, _, _ = profile.smooth(slide)
        varied = variation.guess(float(np.median(first)))
        components = variation.components(varied, total)
    kept = 1.0 - 1.0 / MEMORY if reference.weight >= MEMORY else 1.0
    strength = reference.strength
    matrix, vector = _pooled(
        reference.matrix, reference.vector, kept, components, slide.matrix, slide.vector, slide.seen
    )
    if reference.weight in SMOOTHED_AT:
        _, _, strength = profile.smooth(profile.Information(matrix, vector, slide.reached_m, total))
    return replace(
        reference,
        weight=min(reference.weight + 1.0, MEMORY),
        matrix=matrix,
        vector=vector,
        mean=linear.solved(precision(matrix, strength), vector),
        strength=strength,
        variation=varied,
        components=components,
        met=reference.met * kept + (np.arange(total) < slide.seen - 1),
        varied=met,
    )


@compiled
def _pooled(
    matrix: Samples,
    vector: Samples,
    kept: float,
    components: Samples,
    own_matrix: Samples,
    own_vector: Samples,
    seen: int,
) -> tuple[Samples, Samples]:
    """Information on the mean with one cycle more, which says less of it the more cycles vary."""
    pooled, summed = matrix * kept, vector * kept
    own = own_matrix[:seen, :seen].copy()
    left, rest = linear.varied(components[:seen].copy(), own, own_vector[:seen].copy())
    pooled[:seen, :seen] += left
    summed[:seen] += rest
    return pooled, summed
