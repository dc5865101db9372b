"""A part that slides without contact, in closed form: how far, how fast, and whether its actuator catches it.

m x'' = -mu_k m g - k_v x'
"""

import math

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

NEVER = 1e300  # time of what does not happen [s]
SERIES_BELOW = 1e-3  # argument below which a difference that cancels is summed as a series: 1e-13 exact
NEWTON_STEPS = 60  # at most; where Newton's method leaves the bracket, the bracket is halved
CONVERGED = 1e-13  # of the time looked for: rounding


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
def slide_distance(speed: float, mass: float, friction: float, viscous: float) -> float:
    """Distance to rest from `speed` (m/s) under `friction` (N) and `viscous` (N s/m) without contact."""
    ratio = viscous * speed / friction
    if ratio < SERIES_BELOW:  # (u - log(1 + u)) / u² as a series: the difference cancels
        return mass * speed * speed / friction * (0.5 - ratio / 3.0 + ratio * ratio / 4.0)
    return mass * friction / (viscous * viscous) * (ratio - math.log1p(ratio))


@compiled
def fading(u: float) -> float:
    """Return (1 - exp(-u)) / u - 1, u >= 0, without its cancellation."""
    if u < SERIES_BELOW:
        return -u * (0.5 - u * (1.0 / 6.0 - u / 24.0))
    return -math.expm1(-u) / u - 1.0


@compiled
def decayed_speed(speed: float, t: float, tau: float, terminal: float) -> float:
    """Speed (m/s) after `t` of free slide; tau = m / k_v, terminal = mu_k m g / k_v."""
    return speed * math.exp(-t / tau) + terminal * math.expm1(-t / tau)


@compiled
def speed_after(speed: float, t: float, mass: float, friction: float, viscous: float) -> float:
    """Speed (m/s) after `t` of free slide."""
    if viscous == 0.0:
        return speed - friction / mass * t
    return decayed_speed(speed, t, mass / viscous, friction / viscous)


@compiled
def narrowed(t: float, value: float, slope: float, low: float, high: float) -> tuple[float, float, float]:
    """Newton step from t towards the zero that `value` falls through in (low, high); then the new bracket.

    A step that rounding ends at t itself, which is now an end of the bracket, stays there: it has arrived.
    """
    if value > 0.0:
        low = t
    else:
        high = t
    new = t - value / slope if slope < 0.0 else 0.5 * (low + high)
    if not low <= new <= high:
        new = 0.5 * (low + high)
    return new, low, high


@compiled
def catch_time(speed: float, v: float, mass: float, friction: float, viscous: float) -> float:
    """When the actuator at `v` catches a part that left it at `speed` > v; NEVER if it rests first."""
    if viscous == 0.0:
        return 2.0 * (speed - v) * mass / friction if speed <= 2.0 * v else NEVER
    tau = mass / viscous
    terminal = friction / viscous
    rest = tau * math.log1p(speed / terminal)
    if slide_distance(speed, mass, friction, viscous) > v * rest:
        return NEVER
    low = tau * math.log1p((speed - v) / (v + terminal))
    high = rest
    t = 0.5 * (low + high)
    for _ in range(NEWTON_STEPS):
        gone = fading(t / tau)
        value = t * (speed * (1.0 + gone) + terminal * gone - v)
        slope = decayed_speed(speed, t, tau, terminal) - v
        new, low, high = narrowed(t, value, slope, low, high)
        if abs(new - t) <= CONVERGED * t:
            return new
        t = new
    return t
