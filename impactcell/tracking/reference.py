"""What friction along the stroke usually looks like: the mean of a material, and how cycles differ from it.

A cycle's deviation from its material's mean is a mixed model (Laird & Ware 1982, Biometrics 38:963)::

    beta_c = m + B a_c,   a_c ~ N(0, Lambda)

Lambda: see `impactcell.tracking.variation`; it outlives a change of material. The mean is the generalised
least-squares one under a roughness penalty, slowly forgetting, so that wear does not pass for deviance.

Viscous friction that the model does not know looks like mu(x) while the velocity stays, and makes a cycle
of another velocity look deviant. How far k_v / m is off is learned from cycles of different velocities.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from impactcell.records import Samples
from impactcell.tracking import linear, profile, variation
from impactcell.tracking.variation import MODES, Variation

MEMORY = 300.0  # cycles the mean remembers
SMOOTHED_AT = (0.0, 4.0, 16.0, 64.0)  # weights at which the mean's smoothing is settled anew
VISCOUS_STD = 5.0  # 1/s: the model's k_v / m is known to this beforehand; all of the paper's plant is 4.5
LAUNCH_STD = 0.03  # relative: launches that differ less do so by noise, or by friction taken for speed
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
    drag : ndarray, shape (j, 2)
        What `vector` would be if friction were that of `profile.viscous`, seconds.
    mean : ndarray, shape (j,)
    strength : float
        Smoothing of the mean.
    variation : Variation
    components : ndarray, shape (j, 6)
        Principal components of the variation as columns, largest first, scaled to their standard deviations.
    viscous_known, viscous_seen : float
        Information on how far k_v / m is off the model's, s^2, and its product with that, s.
    spe_sum : float
        Summed SPE over its degrees of freedom, of judged normal cycles.
    spe_count : int
    """

    weight: float = 0.0
    matrix: Samples = field(default_factory=lambda: np.zeros((0, 0)))
    vector: Samples = field(default_factory=lambda: np.zeros(0))
    drag: Samples = field(default_factory=lambda: np.zeros((0, 2)))
    mean: Samples = field(default_factory=lambda: np.zeros(0))
    strength: float = 0.0
    variation: Variation = field(default_factory=Variation)
    components: Samples = field(default_factory=lambda: np.zeros((0, MODES)))
    viscous_known: float = VISCOUS_STD**-2
    viscous_seen: float = 0.0
    spe_sum: float = 0.0
    spe_count: int = 0


def empty(coefficients: int) -> Reference:
    """Before the first cycle."""
    square, line = np.zeros((coefficients, coefficients)), np.zeros(coefficients)
    drag, components = np.zeros((coefficients, 2)), np.zeros((coefficients, MODES))
    return Reference(matrix=square, vector=line, drag=drag, mean=line, components=components)


def restart(reference: Reference) -> Reference:
    """Another material: its mean is learned anew, how cycles vary is kept."""
    square, line = np.zeros_like(reference.matrix), np.zeros_like(reference.vector)
    return replace(reference, weight=0.0, matrix=square, vector=line, drag=np.zeros_like(reference.drag))


def precision(reference: Reference) -> Samples:
    """Inverse covariance of the mean's coefficients, shape (j, j)."""
    n = len(reference.vector)
    return reference.matrix + reference.strength * profile.roughness(n) + VAGUE * np.eye(n)


def difference(reference: Reference, slide: profile.Information) -> tuple[Samples, Samples, Samples]:
    """Tell how a cycle differs from the true mean, at its own velocity.

    Returns
    -------
    matrix : ndarray, shape (j, j)
        Information (G^-1 + V)^-1. V, the inverse of `precision`, is what the mean is known to; it grows
        beyond the longest slides.
    vector : ndarray, shape (j,)
        And its vector, from h - G m.
    viscous : ndarray, shape (j, 2)
        Friction by 1/s of k_v / m beyond the model's: that at the cycle's velocity less that in the mean.
        How much there is shows between cycles of different velocities; `vector` is without it.
    """
    known, G = precision(reference), slide.matrix
    own = slide.vector - G @ reference.mean
    lost = G @ linear.solved(G + known, np.column_stack([G, own]))
    left = G - lost[:, :-1]
    viscous = profile.viscous(slide, reference.mean) - linear.solved(known, reference.drag)
    off = reference.viscous_seen / reference.viscous_known
    return (left + left.T) / 2.0, own - lost[:, -1] - off * (left @ viscous[:, 0]), viscous


def learn(reference: Reference, slide: profile.Information, settled: float) -> Reference:
    """Take one normal cycle into the reference.

    Parameters
    ----------
    settled : float
        Cycles, at least 1, before which the mean is too rough to show how a cycle differs from it.
    """
    varied, components = reference.variation, reference.components
    viscous_known, viscous_seen = reference.viscous_known, reference.viscous_seen
    kept = 1.0 - 1.0 / MEMORY if reference.weight >= MEMORY else 1.0
    if reference.weight >= settled:
        # where the mean is not known yet, beyond the longest slide so far, nothing is learned of variation
        matrix, vector, viscous = difference(reference, slide)
        doubt = viscous[:, :1] / math.sqrt(viscous_known)
        varied = variation.learn(varied, *without_variation(doubt, matrix, vector))
        sure, left = without_variation(components, matrix, vector)
        # the part of it that friction does not change is the instrument: else friction would pass for it
        faster = float(viscous[1, 1]) * slide.gravity_m_s2 / slide.launch_m_s
        launched = viscous[:, 1] * faster**2 / (faster**2 + LAUNCH_STD**2)
        new = float(launched @ sure @ launched)
        viscous_seen = kept * viscous_seen + float(launched @ left) + new * viscous_seen / viscous_known
        viscous_known = VISCOUS_STD**-2 + kept * (viscous_known - VISCOUS_STD**-2) + new
        components = variation.components(varied, len(vector))
    elif reference.weight == 0.0 and varied.cycles == 0:
        first, _, _ = profile.smooth(slide)
        varied = variation.guess(float(np.median(first)))
        components = variation.components(varied, len(slide.vector))
    own_matrix, own_vector = without_variation(components, slide.matrix, slide.vector)
    matrix, vector = reference.matrix * kept + own_matrix, reference.vector * kept + own_vector
    strength = reference.strength
    if reference.weight in SMOOTHED_AT:
        _, _, strength = profile.smooth(replace(slide, matrix=matrix, vector=vector, seen=len(vector)))
    fresh = replace(
        reference,
        weight=min(reference.weight + 1.0, MEMORY),
        matrix=matrix,
        vector=vector,
        strength=strength,
        variation=varied,
        components=components,
        viscous_known=viscous_known,
        viscous_seen=viscous_seen,
    )
    mean = linear.solved(precision(fresh), vector)
    drag = reference.drag * kept + own_matrix @ profile.viscous(slide, mean)
    return replace(fresh, mean=mean, drag=drag)


def without_variation(components: Samples, matrix: Samples, vector: Samples) -> tuple[Samples, Samples]:
    """Information on the mean rather than on one cycle: (G^-1 + C C')^-1, and its vector."""
    image = matrix @ components
    inner = components.T @ image
    inner.flat[:: len(inner) + 1] += 1.0
    along = image @ linear.solved(inner, np.column_stack([image.T, components.T @ vector]))
    return matrix - along[:, :-1], vector - along[:, -1]
