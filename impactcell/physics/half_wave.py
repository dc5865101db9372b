"""Half a wave of a decaying oscillator, in closed form: where it gets to, and when a part stops or separates.

e'' + 2 z e' + w² e = 0; e is the indentation about its static value and r = e' the approach speed.
"""

import math
from typing import NamedTuple

from impactcell.numerics.jit import compiled
from impactcell.physics.linear_slide import CONVERGED, NEVER, NEWTON_STEPS, narrowed


class Oscillator(NamedTuple):
    """Indentation about its static value while contact and slip last: z, w² and sqrt(w² - z²)."""

    decay: float
    squared_frequency: float
    frequency: float


class Swing(NamedTuple):
    """Half a wave: e(t) = exp(-z t) (e cos wd t + f sin wd t), r(t) = exp(-z t) (r cos wd t - c sin wd t)."""

    e: float
    r: float
    f: float
    c: float
    decay: float
    frequency: float


@compiled
def swing_from(e: float, r: float, of: Oscillator) -> Swing:
    """Work out the half wave that begins with indentation e about its static value and approach speed r."""
    f = (r + of.decay * e) / of.frequency
    c = (of.squared_frequency * e + of.decay * r) / of.frequency
    return Swing(e, r, f, c, of.decay, of.frequency)


@compiled
def swing_at(s: float, swing: Swing) -> tuple[float, float]:
    """Indentation about its static value and approach speed after a time s."""
    decay = math.exp(-swing.decay * s)
    cosine, sine = math.cos(swing.frequency * s), math.sin(swing.frequency * s)
    return (
        decay * (swing.e * cosine + swing.f * sine),
        decay * (swing.r * cosine - swing.c * sine),
    )


@compiled
def stop_time(e: float, r: float, v: float, of: Oscillator) -> float:
    """When the approach speed r(t), rising from `r`, reaches `v`: the part stops; NEVER if it does not."""
    z, w2, wd = of.decay, of.squared_frequency, of.frequency
    c = (w2 * e + z * r) / wd
    p = -(w2 * e + 2.0 * z * r)
    if p <= 0.0:
        return NEVER
    high = math.atan2(p, r * wd - z * c) / wd
    if math.exp(-z * high) * (r * math.cos(wd * high) - c * math.sin(wd * high)) < v:
        return NEVER
    low = 0.0
    t = 0.5 * high
    for _ in range(NEWTON_STEPS):
        decay, cosine, sine = math.exp(-z * t), math.cos(wd * t), math.sin(wd * t)
        excess = decay * (r * cosine - c * sine) - v
        slope = decay * (p * cosine + (z * c - r * wd) * sine)
        new, low, high = narrowed(t, -excess, -slope, low, high)
        if abs(new - t) <= CONVERGED * (t + 1e-9):
            return new
        t = new
    return t


@compiled
def separation_time(e: float, ends: float, rest: float, of: Oscillator) -> float:
    """When contact is lost in a half wave of departure from e that lasts `ends`; NEVER if it only fades."""
    z, w2, wd = of.decay, of.squared_frequency, of.frequency
    if e * math.exp(-z * ends) * -1.0 >= -rest:
        return NEVER
    low, high = 0.0, ends
    s = math.acos(max(-rest / e, -1.0)) / wd
    if z == 0.0:
        return s
    for _ in range(NEWTON_STEPS):
        decay, cosine, sine = math.exp(-z * s), math.cos(wd * s), math.sin(wd * s)
        value = e * decay * (cosine + z / wd * sine) + rest
        slope = -e * decay * w2 / wd * sine
        new, low, high = narrowed(s, value, slope, low, high)
        converged = abs(new - s) <= CONVERGED * ends
        s = new
        if converged:
            break
    return s
