"""What the planner's model may lack: a discrepancy of the displacement, linear in a few weights.

The part moves by D instead of the model's D_0 (Kennedy and O'Hagan, 2001)::

    D = D_0(stroke + delta psi(tap) · w) exp(phi(tap) · w) + delta beta(tap) · w,   w ~ N(0, W)
    ln mu_k = ln mu_k(0) - xi(place) · w

and the weights w are learned with the parameters, as one Gaussian. phi acts on what slides freely, which is
off by a share of itself; psi on the indentation delta = mu_k m g / k, whose error is one of the stroke: it
shows in a push as it is, in a strike not at all; beta on where the part only just moves, a stroke of about
delta, where the model may know nothing of how friction builds up; xi on friction itself: where it is higher,
less slides and the indentation is deeper, as the model has it. With u = sqrt(2 mu_k g f D_0), the speed
at which the part leaves the actuator::

    f = (D_0 - (stroke - delta)) / D_0     share that slides, 0 to 1
"""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

FEATURES = 14
"""Number of weights."""
(
    SLIDE, SLIDE_BY_SPEED, SLIDE_BY_MASS, POSITION, POSITION_BY_MASS, INDENTATION, INDENTATION_BY_MASS,
    INDENTATION_BY_SPEED, LOSS, DIRECTION, DRAG, BREAKAWAY, BREAKAWAY_BY_SPEED, SHORT_PUSH,
) = range(FEATURES)  # fmt: skip
"""Weights, each a line of phi, psi, beta or xi.

Of what slides by a share, by its speed and by its mass; of a friction that goes with the place, as a share of
friction and as a force of its own; of the indentation, by mass and by velocity; of a loss in the contact; of
friction that is higher one way; of a resistance that grows with speed; of breakaway, by velocity, and of
short pushes after it.
"""
LEARNED_STD = np.full(FEATURES, 0.012)
"""Of a weight after a handful of taps, for what is to be expected of the taps to come."""
VELOCITY_M_S = 0.03
"""In the middle of what a tap may have: the discrepancy of the contact is told against it."""
SPEED_M_S = 0.06
"""In the middle of those at which parts leave the actuator: that of the slide is told against it."""
MASS_KG = 15.0
"""In the middle of what a cell handles: the discrepancy is told against it."""
POSITION_M = 0.02
"""Over which a discrepancy of the position grows to its weight."""
FAR = 3.0
"""So many times `POSITION_M` from 0 it grows more slowly."""
WIDTH = 0.5
"""Of the neighbourhood of a stroke, in its logarithm: some 50 % up and down."""
BEYOND = 1.0
"""Logarithm of the stroke over delta of the second neighbourhood, that of short pushes."""
RISE = 1.5
"""A weight of beta counts so many indentations: breakaway is what the model knows least of."""
BREAKAWAY_SHARE = 0.3
"""Of `RISE` indentations: what the scatter of the contact reaches at breakaway, though little moves there."""
HALTING_STD = 0.08
"""Standard deviation of what no weight explains where a part slides ahead of an actuator that then halts: a
share of `halting_m`, chosen on closed loops with an effect hidden."""
SWING_SHARE = 0.04
"""Share of a stroke by which the moment at which a push ends may be another than the model has it."""
LOSS_M = 1e-3
"""Displacement beside which a loss of energy in the contact is told."""


@compiled
def sliding_share(displacement: float, stroke: float, indentation: float) -> float:
    """Share f of a displacement (m) that slides freely; 0 where nothing moves."""
    if not displacement > 0.0:
        return 0.0
    pushed = 0.0 if math.isinf(stroke) else stroke - indentation
    return min(max((displacement - pushed) / displacement, 0.0), 1.0)


@compiled
def halting_m(displacement: float, stroke: float) -> float:
    """Return how far a part slides ahead of its actuator, times the share of the way that it is pushed, m.

    There the displacement hardly depends on friction, since what a push loses by it a slide gains; and where
    friction is not the same for both, as with one that rises at low speed or goes with the position, it moves
    by more than the discrepancy of either. A strike and a slow push have next to none of it.
    """
    if math.isinf(stroke) or not displacement > stroke:
        return 0.0
    return (displacement - stroke) * stroke / displacement


@compiled
def swing_m(before: float, displacement: float, after: float, stroke: float, indentation: float) -> float:
    """Return by how much a displacement hangs on where in its swing a part is as the actuator halts, m.

    A pushed part swings on the contact, so that what it is pushed depends on the moment at which the actuator
    halts by some tenths of the indentation, beside the stroke itself. Whatever slows actuator or part, or
    holds it a moment longer, moves that moment, and the longer the push, the further.

    Parameters
    ----------
    before, displacement, after : float
        Of the model at a stroke shorter by `SWING_SHARE`, at the stroke itself, and at one longer by it, m.
    """
    if math.isinf(stroke) or not displacement > 0.0:
        return 0.0
    pushed = 1.0 - sliding_share(displacement, stroke, indentation)
    way = SWING_SHARE * stroke * pushed
    return max(abs(displacement - before - way), abs(after - displacement - way))


@compiled
def position_feature(position: float) -> float:
    """Return what a friction that goes with the place goes with, at a position in m.

    Proportional to it near 0; like its logarithm far away, since cells count from anywhere, and friction
    there is not to be beyond all bounds before the first tap.
    """
    return FAR * math.asinh(position / (FAR * POSITION_M))


@compiled
def discrepancy_features(
    tap: Samples, displacement: float, part: Samples, place: Samples, out: Samples
) -> None:
    """Write phi of a tap to `out`, shape (FEATURES,); zero for a tap that moves nothing.

    Parameters
    ----------
    tap : ndarray, shape (3,)
        Stroke (m), the indentation delta (m) of the part while it is pushed, and its friction mu_k.
    displacement : float
        Of the model without discrepancy, m.
    part : ndarray
        Mass (kg) and gravity (m/s²) first.
    place : ndarray, shape (2,)
        Where the part lies (m, along +1) and the direction of the tap.
    """
    out[:] = 0.0
    f = sliding_share(displacement, tap[0], tap[1])
    if f <= 0.0:
        return
    speed = math.sqrt(2.0 * tap[2] * part[1] * f * displacement) / SPEED_M_S
    lighter = MASS_KG / part[0]
    middle = place[0] + place[1] * (1.0 - 0.5 * f) * displacement
    along = f * (position_feature(middle) - position_feature(place[0]))
    out[SLIDE] = f
    out[SLIDE_BY_SPEED] = f * math.log(max(speed, 0.05))
    out[SLIDE_BY_MASS] = -f * math.log(lighter)
    out[POSITION] = along
    out[POSITION_BY_MASS] = along * lighter
    out[LOSS] = f * min(LOSS_M / displacement, 1.0) * lighter
    out[DIRECTION] = f * place[1]
    out[DRAG] = f * speed * lighter


@compiled
def indentation_features(velocity: float, part: Samples, place: Samples, out: Samples) -> None:
    """Write psi of the taps at this velocity (m/s) to `out`, shape (FEATURES,); otherwise as above."""
    out[:] = 0.0
    out[INDENTATION] = 1.0
    out[INDENTATION_BY_MASS] = math.log(part[0] / MASS_KG)
    out[INDENTATION_BY_SPEED] = math.log(velocity / VELOCITY_M_S)
    out[DIRECTION] = place[1]


def friction_features(part: Samples, place: Samples) -> Samples:
    """Return xi, shape (FEATURES,): where the part lies, ln mu_k is lower by xi · w than at 0."""
    xi = np.zeros(FEATURES)
    xi[POSITION] = position_feature(place[0])
    xi[POSITION_BY_MASS] = xi[POSITION] * MASS_KG / part[0]
    return xi


@compiled
def breakaway_features(velocity: float, stroke: float, indentation: float, out: Samples) -> None:
    """Write beta of a tap to the weights of `out`, shape (FEATURES,), that are its own; SI."""
    if math.isinf(stroke) or stroke <= 0.0 or indentation <= 0.0:
        out[BREAKAWAY:] = 0.0
        return
    size, speed = math.log(stroke / indentation), math.log(velocity / VELOCITY_M_S)
    near = RISE * math.exp(-((size / WIDTH) ** 2))
    out[BREAKAWAY] = near
    out[BREAKAWAY_BY_SPEED] = near * speed
    out[SHORT_PUSH] = RISE * math.exp(-(((size - BEYOND) / WIDTH) ** 2)) * speed


DEPENDS_ON = {
    "slide": (SLIDE,),
    "velocity": (SLIDE_BY_SPEED, INDENTATION_BY_SPEED, DRAG),
    "mass": (SLIDE_BY_MASS, INDENTATION_BY_MASS),
    "position": (POSITION, POSITION_BY_MASS),
    "contact": (INDENTATION, LOSS, BREAKAWAY, BREAKAWAY_BY_SPEED, SHORT_PUSH),
    "direction": (DIRECTION,),
}
"""Which weights speak of what."""


def largest_weight(mean: Samples, cov: Samples) -> tuple[str, float, float]:
    """Return what the displacement that is missed depends on most surely: name, weight and its std."""
    std = np.sqrt(np.diag(cov))
    n = int(np.abs(mean / std).argmax())
    name = next(name for name, weights in DEPENDS_ON.items() if n in weights)
    return name, float(mean[n]), float(std[n])
