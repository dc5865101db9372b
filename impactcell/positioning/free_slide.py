"""A part that slides without contact: how far, how fast, and whether its actuator catches it.

m x'' = -mu_k m g - k_v x'
"""

import math

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

NEVER = 1e300


@compiled
def along_profile(distance: float, part: Samples) -> float:
    """Distance slid where friction varies, for the `distance` slid (m) at its mean.

    `part` as in `displacements`.
    """
    last = part.size - 4
    if last < 1:
        return distance
    place = distance / part[2]
    n = int(place)
    if n >= last:
        return float(part[3 + last] + distance - last * part[2])
    return float(part[3 + n] + (place - n) * (part[4 + n] - part[3 + n]))


@compiled
def slide(speed: float, mass: float, friction: float, viscous: float) -> float:
    """Distance to rest from `speed` (m/s) under `friction` (N) and `viscous` (N s/m) without contact."""
    ratio = viscous * speed / friction
    if ratio < 1e-3:  # (u - log(1 + u)) / u² as a series: the difference cancels
        return mass * speed * speed / friction * (0.5 - ratio / 3.0 + ratio * ratio / 4.0)
    return mass * friction / (viscous * viscous) * (ratio - math.log1p(ratio))


@compiled
def fading(u: float) -> float:
    """Return (1 - exp(-u)) / u - 1, u >= 0, without its cancellation."""
    if u < 1e-3:
        return -u * (0.5 - u * (1.0 / 6.0 - u / 24.0))
    return -math.expm1(-u) / u - 1.0


@compiled
def slowed(speed: float, t: float, tau: float, terminal: float) -> float:
    """Speed (m/s) after `t` of free slide; tau = m / k_v, terminal = mu_k m g / k_v."""
    return speed * math.exp(-t / tau) + terminal * math.expm1(-t / tau)


@compiled
def catch_time(speed: float, v: float, mass: float, friction: float, viscous: float) -> float:
    """When the actuator at `v` catches a part that left it at `speed` > v; NEVER if it rests first."""
    if viscous == 0.0:
        return 2.0 * (speed - v) * mass / friction if speed <= 2.0 * v else NEVER
    tau = mass / viscous
    terminal = friction / viscous
    rest = tau * math.log1p(speed / terminal)
    if slide(speed, mass, friction, viscous) > v * rest:
        return NEVER
    low = tau * math.log1p((speed - v) / (v + terminal))
    high = rest
    t = 0.5 * (low + high)
    for _ in range(60):
        gone = fading(t / tau)
        value = t * (speed * (1.0 + gone) + terminal * gone - v)
        slope = slowed(speed, t, tau, terminal) - v
        if value > 0.0:
            low = t
        else:
            high = t
        new = t - value / slope if slope < 0.0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - t) <= 1e-13 * t:
            return new
        t = new
    return t
