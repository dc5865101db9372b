"""How much taps scatter, learned: a probability for each of a grid of standard deviations.

Each tap has a friction factor of its own, 1 + sigma_f z; beside it the displacement scatters by a share
sigma_d of itself and by a share sigma_c of the indentation, as a contact or a surface does that is not the
same everywhere. What one tap deviates by, with a variance S that is not scatter, is told of all three::

    p(deviation | sigma) = N(0, S + (sigma_f dD/dz)² + (sigma_d D)² + (sigma_c delta)²)

Taps at which these differ tell them apart. The sum over the grid is exact; a tap in 50 may be an outlier.
"""

import numpy as np
from scipy.special import ndtr, ndtri

from impactcell.records import Samples

FRICTION_STD = np.array([0.004, 0.0075, 0.012, 0.02, 0.03, 0.042, 0.06, 0.085])
"""sigma_f: surfaces scatter by 0.5 to 8 %."""
FRICTION_PRIOR = np.array([0.02, 0.03, 0.07, 0.18, 0.42, 0.2, 0.06, 0.02])
"""About the 3 % of the paper's surfaces."""
DISPLACEMENT_STD = np.array([0.001, 0.003, 0.006, 0.012, 0.024, 0.045, 0.085])
"""sigma_d: next to nothing where the model is right, up to 8 %."""
DISPLACEMENT_PRIOR = np.array([0.6, 0.2, 0.1, 0.05, 0.025, 0.015, 0.01])
"""Most cells have a model that is right but for friction."""
CONTACT_STD = np.array([0.005, 0.03, 0.08, 0.2, 0.4])
"""sigma_c: of the indentation."""
CONTACT_PRIOR = np.array([0.72, 0.17, 0.06, 0.03, 0.02])
"""As for the displacement."""
OUTLIER = 0.02
"""Share of taps that do not belong ..."""
OUTLIER_STD = 5.0
"""... and deviate by so many times as much."""
MEMORY = 400.0
"""Taps after which what was learned of the scatter fades."""
LEAST_LOG_DENSITY = -700.0
"""Of a tap that no combination could have foretold: the least number's logarithm."""
SAME_CONTACT_STD = 0.05
"""sigma_c up to which a contact is the same at each tap, as far as the model's linearisation can tell."""
REACH = np.concatenate([[0.0], np.geomspace(1e-4, 0.8, 120)])
"""Deviations at which the distribution of the scatter is tabulated."""

GRID = np.stack(np.meshgrid(FRICTION_STD, DISPLACEMENT_STD, CONTACT_STD, indexing="ij"), axis=-1).reshape(
    -1, 3
)
"""All combinations, shape (g, 3)."""
SHAPE = (FRICTION_STD.size, DISPLACEMENT_STD.size, CONTACT_STD.size)
"""Of the grid."""

TailScores = tuple[Samples, Samples, Samples]
"""Of friction, displacement and contact, each at the deviations `REACH`."""
TAILS = tuple(ndtr(-REACH / std[:, None]) for std in (FRICTION_STD, DISPLACEMENT_STD, CONTACT_STD))
"""Of each standard deviation, the probability to reach further than each of these."""


def prior_weights() -> Samples:
    """Probability of each combination before the first tap, shape (g,)."""
    prior = np.einsum("i,j,k->ijk", FRICTION_PRIOR, DISPLACEMENT_PRIOR, CONTACT_PRIOR).ravel()
    weights: Samples = prior / prior.sum()
    return weights


PRIOR_WEIGHTS = prior_weights()
"""Worked out once."""


def mean_variances(weights: Samples) -> Samples:
    """Return the expected squares of sigma_f, sigma_d and sigma_c, shape (3,)."""
    variances: Samples = weights @ GRID**2
    return variances


def same_contact_by_displacement(weights: Samples) -> Samples:
    """Probability of each sigma_d together with a contact that is the same at each tap, shape (7,)."""
    cube: Samples = weights.reshape(SHAPE)[:, :, CONTACT_STD <= SAME_CONTACT_STD]
    shares: Samples = cube.sum(axis=(0, 2))
    return shares


def update_weights(
    weights: Samples, components: Samples, innovations: Samples, variances: Samples, reaches: Samples
) -> tuple[Samples, float]:
    """Probabilities after one tap, and the logarithm of the density with which it was foretold.

    Parameters
    ----------
    weights : ndarray, shape (g,)
    components, innovations, variances : ndarray, shape (c,)
        Probability of each Gaussian of the posterior, what the tap deviated from it by (m), and the variance
        of that which is not scatter (m²).
    reaches : ndarray, shape (c, 3)
        What one unit of each scatter moves the part by, m.
    """
    total = variances[:, None] + reaches**2 @ (GRID**2).T
    square = innovations[:, None] ** 2 / total
    usual = np.exp(-0.5 * square)
    odd = np.exp(-0.5 * square / OUTLIER_STD**2) / OUTLIER_STD
    likelihood = components @ (((1.0 - OUTLIER) * usual + OUTLIER * odd) / np.sqrt(total))
    faded = weights ** (1.0 - 1.0 / MEMORY) * PRIOR_WEIGHTS ** (1.0 / MEMORY)
    after = faded * likelihood
    if not after.sum() > 0.0:
        return weights, LEAST_LOG_DENSITY
    normalised: Samples = after / after.sum()
    return normalised, float(np.log(weights @ likelihood))


def tail_scores(weights: Samples) -> TailScores:
    """Return how far each scatter reaches: the score z of the probability to reach beyond each `REACH`."""
    cube, scores = weights.reshape(SHAPE), []
    for n, tails in enumerate(TAILS):
        share = cube.sum(axis=tuple(axis for axis in range(3) if axis != n))
        scores.append(-ndtri(np.maximum(share @ tails, 1e-300)))
    friction, displacement, contact = scores
    return friction, displacement, contact


def quantile_scales(scores: TailScores, z: Samples) -> Samples:
    """Return the standard deviation that each scatter has at the nodes z, shape (nodes, 3).

    A sum of normal distributions has heavier tails than one: at node z it reaches Q(z), and counts there as
    a normal one of standard deviation Q(z) / z.
    """
    nodes = np.maximum(np.abs(z), 0.05)
    scales = np.empty((z.size, 3))
    for n, score in enumerate(scores):
        scales[:, n] = np.interp(nodes, score, REACH) / nodes
    return scales
