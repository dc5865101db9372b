"""Many taps on the nominal plant in closed form: each phase is a damped oscillator or a decaying slide.

For closed loops of 10 000 tasks the adaptive integrator of `simulator.plant` is too slow; this agrees with it
to about 1e-9 and takes microseconds. Nominal means equations (1)-(3) with viscous friction: the part is
pushed forward only, so that it never slides back.

In contact and sliding, d = y - x obeys m d'' + (B + k_v) d' + k d = mu_k m g + k_v u with u the actuator's
speed and B = b while d grows, 0 while it shrinks. Within such a phase d is monotonic, which makes every event
either closed or safely bracketed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, cos, exp, expm1, inf, isinf, log1p, nan, pi, sin, sqrt
from typing import ParamSpec, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

Samples = NDArray[np.float64]
P = ParamSpec("P")
R = TypeVar("R")

STICK, SLIP, APART = 0, 1, 2
MOST_PHASES = 1_000_000


def _compiled(function: Callable[P, R]) -> Callable[P, R]:
    return cast("Callable[P, R]", njit(cache=True, error_model="numpy")(function))


@dataclass(frozen=True, slots=True)
class Outcomes:
    """What became of many taps; every array has shape (n,).

    `sliding_distance_m` and `separation_s` are nan where contact was never lost.
    """

    displacement_m: Samples
    sliding_distance_m: Samples
    peak_force_n: Samples
    stop_s: Samples
    separation_s: Samples


def nominal_taps(
    stiffness_n_per_m: ArrayLike,
    damping_n_s_per_m: ArrayLike,
    mu_s: ArrayLike,
    mu_k: ArrayLike,
    mass_kg: ArrayLike,
    velocity_m_s: ArrayLike,
    stroke_m: ArrayLike,
    viscous_n_s_per_m: ArrayLike = 0.0,
    gravity_m_s2: float = 9.81,
    *,
    halts_at_separation: bool = False,
) -> Outcomes:
    """Strike many parts; all arguments broadcast against each other.

    Raises
    ------
    ValueError
        A contact that does not oscillate (overdamped), an actuator that never halts, or a quantity that is
        not positive.
    """
    arrays = np.broadcast_arrays(
        *(
            np.atleast_1d(np.asarray(value, dtype=np.float64))
            for value in (
                stiffness_n_per_m,
                damping_n_s_per_m,
                mu_s,
                mu_k,
                viscous_n_s_per_m,
                mass_kg,
                velocity_m_s,
                stroke_m,
            )
        )
    )
    k, b, static, kinetic, viscous, mass, velocity, stroke = (np.ascontiguousarray(array) for array in arrays)
    for name, positive in (("stiffness", k), ("mass", mass), ("velocity", velocity), ("mu_k", kinetic)):
        if not (positive > 0.0).all():
            message = f"{name} has to be positive"
            raise ValueError(message)
    if ((b + viscous) ** 2 >= 4.0 * k * mass).any():
        message = "contact is overdamped; strike it on simulator.plant"
        raise ValueError(message)
    if np.isinf(stroke).any() and not halts_at_separation:
        message = "an actuator without a stroke has to halt at separation"
        raise ValueError(message)
    out = np.empty((len(k), 5))
    _taps(k, b, static, kinetic, viscous, mass, velocity, stroke, gravity_m_s2, halts_at_separation, out)
    return Outcomes(*np.ascontiguousarray(out.T))


@_compiled
def _zero(cosine: float, sine: float, omega: float) -> float:
    """First t > 0 at which cosine cos(omega t) + sine sin(omega t) = 0."""
    turn = (-atan2(cosine, sine)) % pi
    return (turn if turn > 0.0 else pi) / omega


@_compiled
def _oscillator(
    t: float, mean: float, first: float, second: float, gamma: float, omega: float
) -> tuple[float, float]:
    """Displacement and rate of mean + exp(-gamma t)(first cos + second sin)."""
    c, s, decay = cos(omega * t), sin(omega * t), exp(-gamma * t)
    value = mean + decay * (first * c + second * s)
    rate = decay * ((second * omega - gamma * first) * c - (first * omega + gamma * second) * s)
    return value, rate


@_compiled
def _reach(
    which: int,
    target: float,
    low: float,
    high: float,
    mean: float,
    first: float,
    second: float,
    gamma: float,
    omega: float,
) -> float:
    """Time at which d (which = 0) or d' (which = 1) passes `target`, between two times that enclose it."""
    below = _oscillator(low, mean, first, second, gamma, omega)[which] < target
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if (_oscillator(middle, mean, first, second, gamma, omega)[which] < target) == below:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@_compiled
def _slide(t: float, v: float, drag: float, rate: float) -> tuple[float, float]:
    """Distance and speed after t of a slide that begins with v; drag = mu_k g, rate = k_v/m."""
    if rate * t < 1e-9:
        return (v - 0.5 * (drag + rate * v) * t) * t, v - (drag + rate * v) * t
    steady = drag / rate
    lost = -expm1(-rate * t)
    return (v + steady) * lost / rate - steady * t, v - (v + steady) * lost


@_compiled
def _slowed(v: float, to: float, drag: float, rate: float) -> float:
    """Time in which a slide slows down from v to `to`."""
    if rate == 0.0:
        return (v - to) / drag
    return log1p(rate * (v - to) / (drag + rate * to)) / rate


@_compiled
def _taps(
    k: Samples,
    b: Samples,
    mu_s: Samples,
    mu_k: Samples,
    viscous: Samples,
    mass: Samples,
    velocity: Samples,
    stroke: Samples,
    gravity: float,
    halts: bool,  # noqa: FBT001 - compiled code takes no keywords
    out: Samples,
) -> None:
    for i in range(len(k)):
        out[i] = _tap(
            k[i], b[i], mu_s[i], mu_k[i], viscous[i], mass[i], velocity[i], stroke[i], gravity, halts
        )


@_compiled
def _tap(
    k: float,
    b: float,
    mu_s: float,
    mu_k: float,
    viscous: float,
    mass: float,
    velocity: float,
    stroke: float,
    gravity: float,
    halts: bool,  # noqa: FBT001 - compiled code takes no keywords
) -> tuple[float, float, float, float, float]:
    holds = max(mu_s, mu_k) * mass * gravity
    friction, drag, rate = mu_k * mass * gravity, mu_k * gravity, viscous / mass
    t, x, v, y, u = 0.0, 0.0, 0.0, 0.0, velocity
    peak, stop_s, separation_s, separation_x = 0.0, 0.0, nan, nan
    contact, slip, opening, d, d_rate = True, False, False, 0.0, velocity
    for _ in range(MOST_PHASES):
        left = (stroke - y) / u if u > 0.0 else inf
        if contact and not slip:
            if u == 0.0:
                break
            wait = max((holds - b * u - k * d) / (k * u), 0.0)
            step = min(wait, left)
            peak = max(peak, k * (d + u * step) + b * u)
            d, y, t = d + u * step, y + u * step, t + step
            d_rate = u
            if wait <= left:
                slip, opening = True, False
            else:
                u, d_rate = 0.0, 0.0
        elif contact:
            damping = (0.0 if opening else b) + viscous
            gamma = 0.5 * damping / mass
            omega = sqrt(k / mass - gamma * gamma)
            mean = (friction + viscous * u) / k
            first = d - mean
            second = (d_rate + gamma * first) / omega
            # d' = exp(-gamma t)(along cos + across sin); each further derivative has the same form.
            along, across = d_rate, -(first * omega + gamma * second)
            turn = _zero(along, across, omega)
            step, event = turn, 0
            if left < step:
                step, event = left, 1
            if opening:
                peak = max(peak, k * d)
                if _oscillator(step, mean, first, second, gamma, omega)[0] < 0.0:
                    step = _reach(0, 0.0, 0.0, step, mean, first, second, gamma, omega)
                    event = 2
            else:
                along_2, across_2 = across * omega - gamma * along, -(along * omega + gamma * across)
                crest = min(_zero(along_2, across_2, omega), step)
                if along_2 > 0.0 and _oscillator(crest, mean, first, second, gamma, omega)[1] > u:
                    step = _reach(1, u, 0.0, crest, mean, first, second, gamma, omega)
                    event = 3
                top = _zero(k * along + b * along_2, k * across + b * across_2, omega)
                for place in (0.0, min(top, step), step):
                    value, speed = _oscillator(place, mean, first, second, gamma, omega)
                    peak = max(peak, k * value + b * speed)
            before = d
            d, d_rate = _oscillator(step, mean, first, second, gamma, omega)
            y += u * step
            x += u * step - (d - before)
            t += step
            if event == 0:
                d_rate, opening = 0.0, not opening
                if u == 0.0:
                    slip, stop_s = False, t
            elif event == 1:
                # The actuator halts at once: what was the part's speed is now the rate at which d shrinks.
                d_rate, opening, u = min(d_rate - u, 0.0), True, 0.0
            elif event == 2:
                contact, separation_s, separation_x = False, t, x
                v, d = u - d_rate, 0.0
                if halts:
                    u = 0.0
            else:
                slip, stop_s, d_rate = False, t, u
        elif v > 0.0:
            rest = _slowed(v, 0.0, drag, rate)
            step, event = rest, 0
            if left < step:
                step, event = left, 1
            if u > 0.0:
                gap = x - y
                low = _slowed(v, u, drag, rate) if v > u else 0.0
                if low < step and gap + _slide(step, v, drag, rate)[0] - u * step < 0.0:
                    high, event = step, 2
                    for _ in range(200):
                        step = 0.5 * (low + high)
                        if step in (low, high):
                            break
                        if gap + _slide(step, v, drag, rate)[0] - u * step < 0.0:
                            high = step
                        else:
                            low = step
            moved, v = _slide(step, v, drag, rate)
            x, y, t = x + moved, y + u * step, t + step
            if event == 0:
                v, slip, stop_s = 0.0, False, t
            elif event == 1:
                u = 0.0
            else:
                contact, opening, d, d_rate = True, False, 0.0, u - v
                y = x
        else:
            wait = (x - y) / u if u > 0.0 else inf
            if isinf(wait) or wait > left:
                break
            contact, d, d_rate = True, 0.0, u
            y, t = x, t + wait
    return x, x - separation_x, peak, stop_s, separation_s
