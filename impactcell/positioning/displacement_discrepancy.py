"""What the planner's model may lack: a discrepancy of the displacement, linear in a few weights.

The part moves by D instead of the model's D_0 (Kennedy and O'Hagan, 2001)::

    D = D_0 exp(phi · w) + delta psi · w,   w ~ N(0, W)

and the weights w are learned with the parameters, as one Gaussian. Where the model is right they come out
as zero, within a standard deviation that shrinks with each tap. What slides freely is off by a share of
itself, phi, and what is pushed by a share of the indentation delta = mu_k m g / k, psi::

    f = (D_0 - (stroke - delta)) / (D_0 + delta)     share that slides, 0 to 1
"""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

FEATURES = 10
"""Weights of the discrepancy: one a line of `discrepancy_features`."""
PRIOR_STD = np.array([0.03, 0.03, 0.03, 0.03, 0.03, 0.1, 0.05, 0.05, 0.05, 0.03])
"""Of a weight before the first tap: 3 % of a displacement, up to 10 % of an indentation; a choice."""
LEARNED_STD = np.full(FEATURES, 0.012)
"""Of a weight after a handful of taps, for what is to be expected of the taps to come."""
VELOCITY_M_S = 0.03
"""In the middle of what a tap may have: the discrepancy is told against it."""
MASS_KG = 15.0
"""In the middle of what a cell handles: the discrepancy is told against it."""
POSITION_M = 0.02
"""Over which a discrepancy of the position grows to its weight."""
LOSS_M = 0.5e-3
"""Displacement beside which a loss of energy in the contact is told."""


@compiled
def discrepancy_features(
    tap: Samples, displacement: float, part: Samples, place: Samples, out: Samples
) -> float:
    """Write phi of a tap to the first row of `out`, psi to the second, and return the share f that slides.

    Both are zero for a tap that moves nothing.

    Parameters
    ----------
    tap : ndarray, shape (3,)
        Velocity (m/s), stroke (m) and the indentation delta (m) of the part while it is pushed.
    displacement : float
        Of the model without discrepancy, m.
    part : ndarray
        Mass (kg) first.
    place : ndarray, shape (2,)
        Where the part lies (m, along +1) and the direction of the tap.
    out : ndarray, shape (2, FEATURES)
    """
    out[:] = 0.0
    if not displacement > 0.0:
        return 0.0
    velocity, stroke, indentation = tap
    pushed = 0.0 if math.isinf(stroke) else stroke - indentation
    f = min(max((displacement - pushed) / (displacement + indentation), 0.0), 1.0)
    speed, mass = math.log(velocity / VELOCITY_M_S), math.log(part[0] / MASS_KG)
    # friction of the place: halfway along the way, in its direction
    along = (place[0] + 0.5 * place[1] * displacement) / POSITION_M
    phi, psi = out
    phi[0] = f
    phi[1] = f * speed
    phi[2] = f * mass
    phi[3] = f * along
    phi[4] = f * along * MASS_KG / part[0]
    phi[8] = f * min(LOSS_M / displacement, 1.0) * MASS_KG / part[0]
    phi[9] = f * place[1]
    psi[3] = (1.0 - f) * along
    psi[4] = psi[3] * MASS_KG / part[0]
    psi[5] = math.exp(-displacement / indentation)
    psi[6] = (1.0 - f) * mass
    psi[7] = (1.0 - f) * speed
    return float(f)


DEPENDS_ON = {
    "slide": (0,),
    "velocity": (1, 7),
    "mass": (2, 6),
    "position": (3, 4),
    "contact": (5, 8),
    "direction": (9,),
}
"""Which weights speak of what."""


def largest_weight(mean: Samples, cov: Samples) -> tuple[str, float, float]:
    """Return what the displacement that is missed depends on most surely: name, weight and its std."""
    std = np.sqrt(np.diag(cov))
    n = int(np.abs(mean / std).argmax())
    name = next(name for name, weights in DEPENDS_ON.items() if n in weights)
    return name, float(mean[n]), float(std[n])


def log_bayes_factor(mean: Samples, cov: Samples) -> float:
    """Evidence that something is missing: Bayes factor of free weights over zero, natural logarithm.

    The Savage-Dickey ratio p(w = 0) / p(w = 0 | taps) (Dickey, 1971); with nothing missing its expectation
    is 1 after any number of taps, so that it exceeds 1/alpha at any time with a probability of at most
    alpha (Ville, 1939).

    Parameters
    ----------
    mean, cov : ndarray, shapes (FEATURES,) and (FEATURES, FEATURES)
        Of the weights.
    """
    _, determinant = np.linalg.slogdet(cov / np.outer(PRIOR_STD, PRIOR_STD))
    return float(0.5 * mean @ np.linalg.solve(cov, mean) + 0.5 * determinant)
