"""What the planner's model may lack: a discrepancy of the displacement, linear in a few weights.

The part moves by D instead of the model's D_0 (Kennedy and O'Hagan, 2001)::

    ln D = ln D_0 + phi(tap) · w,   w ~ N(0, W)

and the weights w are learned with the parameters, as one Gaussian. Where the model is right they come out
as zero, within a standard deviation that shrinks with each tap. phi takes a displacement apart into what is
pushed, which is off by a share of the indentation delta = mu_k m g / k, and what slides freely, which is off
by a share of itself::

    f = (D_0 - (stroke - delta)) / D_0     share that slides, 0 to 1
    c = (1 - f) delta / D_0                indentation beside what is pushed
"""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

FEATURES = 10
"""Weights of the discrepancy: one a line of `discrepancy_features`."""
PRIOR_STD = np.full(FEATURES, 0.03)
"""Of a weight before the first tap: 3 % of a displacement, or of an indentation; a choice."""
LEARNED_STD = np.full(FEATURES, 0.012)
"""Of a weight after a handful of taps, for what is to be expected of the taps to come."""
VELOCITY_M_S = 0.03
"""In the middle of what a tap may have: the discrepancy is told against it."""
MASS_KG = 15.0
"""In the middle of what a cell handles: the discrepancy is told against it."""
POSITION_M = 0.02
"""Over which a discrepancy of the position grows to its weight."""
LOSS_M = 1e-3
"""Displacement beside which a loss of energy in the contact is told."""


@compiled
def discrepancy_features(
    tap: Samples, displacement: float, part: Samples, place: Samples, out: Samples
) -> None:
    """Write phi of a tap to `out`, shape (FEATURES,); zero for a tap that moves nothing.

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
    """
    if not displacement > 0.0:
        out[:] = 0.0
        return
    velocity, stroke, indentation = tap
    pushed = 0.0 if math.isinf(stroke) else stroke - indentation
    f = min(max((displacement - pushed) / displacement, 0.0), 1.0)
    c = (1.0 - f) * min(indentation / displacement, 1.0)
    speed, mass = math.log(velocity / VELOCITY_M_S), math.log(part[0] / MASS_KG)
    # friction slows what slides and deepens the indentation: halfway along the way, in its direction
    along = (f + c) * (place[0] + 0.5 * place[1] * displacement) / POSITION_M
    out[0] = f
    out[1] = f * speed
    out[2] = f * mass
    out[3] = along
    out[4] = along * MASS_KG / part[0]
    out[5] = c
    out[6] = c * mass
    out[7] = c * speed
    out[8] = f * min(LOSS_M / displacement, 1.0) * MASS_KG / part[0]
    out[9] = f * place[1]


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
