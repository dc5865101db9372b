"""What friction along the stroke usually looks like: the mean of a material, and how cycles differ from it.

The mean is the pooled least-squares profile of the material's cycles, slowly forgetting, so that wear
does not pass for deviance. Between cycles friction varies along three principal components, learned from
smoothed profiles with the part that is only sensor noise taken out; they outlive a change of material.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from impactcell.records import Samples
from impactcell.tracking import profile

COMPONENTS = 3
MEMORY = 300.0  # cycles the mean remembers
RELEARN = (1.0, 1.2)  # components are found anew when so many times more cycles have been seen


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
        Cycles the components rest on.
    learned : int
        Cycles they rested on when they were last found.
    scatter, noise : ndarray, shape (j, j)
        Summed outer products of smoothed deviations, and of their sensor noise.
    components : ndarray, shape (j, 3)
        Directions, columns; scaled to standard deviation one.
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
    learned: int = 0
    scatter: Samples = field(default_factory=lambda: np.zeros((0, 0)))
    noise: Samples = field(default_factory=lambda: np.zeros((0, 0)))
    components: Samples = field(default_factory=lambda: np.zeros((0, COMPONENTS)))
    spe_sum: float = 0.0
    spe_count: int = 0


def empty(coefficients: int) -> Reference:
    """Before the first cycle."""
    square = np.zeros((coefficients, coefficients))
    line = np.zeros(coefficients)
    return Reference(0.0, square, line, line, 0.0, 0, 0, square, square, np.zeros((coefficients, COMPONENTS)))


def restart(reference: Reference) -> Reference:
    """Another material: its mean is learned anew, how cycles vary is kept."""
    return replace(
        reference, weight=0.0, matrix=np.zeros_like(reference.matrix), vector=np.zeros_like(reference.vector)
    )


def learn(reference: Reference, slide: profile.Information, penalty: Samples) -> Reference:
    """Take one normal cycle into the reference."""
    kept = 1.0 - 1.0 / MEMORY if reference.weight >= MEMORY else 1.0
    weight = min(reference.weight + 1.0, MEMORY)
    matrix, vector = reference.matrix * kept + slide.matrix, reference.vector * kept + slide.vector
    strength = reference.strength
    if strength == 0.0 or reference.weight in (0.0, 4.0, 16.0, 64.0):
        _, _, strength = profile.smooth(matrix, vector, penalty)
    mean = cho_solve(cho_factor(matrix + strength * penalty), vector)
    fresh = replace(reference, weight=weight, matrix=matrix, vector=vector, mean=mean, strength=strength)
    return fresh if reference.weight < 1.0 else _learn_scatter(reference, fresh, slide, penalty)


def _learn_scatter(
    before: Reference, fresh: Reference, slide: profile.Information, penalty: Samples
) -> Reference:
    """Add this cycle's deviation from the mean of those before it."""
    own = slide.vector - slide.matrix @ before.mean
    # smoothed as much as the mean of one cycle would be
    strength = fresh.strength
    smoothing = cho_factor(slide.matrix + strength * penalty)
    deviation = cho_solve(smoothing, own)
    noise = cho_solve(smoothing, cho_solve(smoothing, slide.matrix).T)
    # a mean of w cycles has 1/w of their variance
    share = before.weight / (before.weight + 1.0)
    scatter = before.scatter + share * np.outer(deviation, deviation)
    cycles = before.cycles + 1
    fresh = replace(fresh, scatter=scatter, noise=before.noise + noise, cycles=cycles)
    if cycles < 2 * COMPONENTS or cycles < RELEARN[1] * before.learned:
        return fresh
    values, vectors = np.linalg.eigh((scatter - fresh.noise) / cycles)
    leading = np.maximum(values[::-1][:COMPONENTS], 0.0)
    return replace(fresh, components=vectors[:, ::-1][:, :COMPONENTS] * np.sqrt(leading), learned=cycles)
