"""Displacement of a part for many strokes at one velocity, in closed form.

The nominal plant, equations (1)-(3) with viscous friction, is linear between its events. While the
actuator runs, its stroke does not matter; once it has halted, what is left is one half wave of an
oscillator and a slide. One course of the running actuator therefore answers for every stroke at once,
which is what a planner asks thousands of times a step and an integrator of single taps does not offer.
`impactcell.physics.simulate_tap` is the model; agreement with it is tested.

With indentation d = y - x, the static indentation L = (mu_k m g + k_v v) / k and e = d - L::

    contact, actuator at v:   e'' + 2 z e' + w² e = 0,   2 z = (b [d' > 0] + k_v) / m,   w² = k / m
    free:                     m x'' = -mu_k m g - k_v x'
"""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.positioning.free_slide import NEVER, along_profile, catch_time, slide, slowed
from impactcell.records import Samples

MAX_PHASES = 4000


@compiled
def halted(
    indentation: float, speed: float, k: float, friction: float, viscous: float, part: Samples
) -> float:
    """Travel to rest of a part in contact with an actuator that has just halted.

    `indentation` >= 0 (m) and `speed` > 0 (m/s) at the halt. The damper is off: the part departs.
    """
    mass = part[0]
    w2 = k / mass
    rest = friction / k
    e = indentation - rest
    if viscous == 0.0:
        amplitude = math.sqrt(e * e + speed * speed / w2)
        if amplitude <= rest:
            return indentation - rest + amplitude
        return indentation + along_profile(0.5 * (amplitude * amplitude - rest * rest) / rest, part)
    z = 0.5 * viscous / mass
    wd = math.sqrt(w2 - z * z)
    c = (z * e - speed) / wd  # e(t) = exp(-z t) (e cos wd t + c sin wd t), e'(0) = -speed
    p = (w2 * e - z * speed) / wd  # e'(t) = -exp(-z t) (speed cos wd t + p sin wd t)
    turn = math.atan2(speed, -p) / wd
    low, high = 0.0, turn
    if math.exp(-z * turn) * (e * math.cos(wd * turn) + c * math.sin(wd * turn)) >= -rest:
        return float(e - math.exp(-z * turn) * (e * math.cos(wd * turn) + c * math.sin(wd * turn)))
    t = 0.5 * turn
    for _ in range(60):
        decay, cosine, sine = math.exp(-z * t), math.cos(wd * t), math.sin(wd * t)
        value = decay * (e * cosine + c * sine) + rest
        slope = -decay * (speed * cosine + p * sine)
        if value > 0.0:
            low = t
        else:
            high = t
        new = t - value / slope if slope < 0.0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - t) <= 1e-13 * turn:
            t = new
            break
        t = new
    departure = math.exp(-z * t) * (speed * math.cos(wd * t) + p * math.sin(wd * t))
    return indentation + along_profile(slide(max(departure, 0.0), mass, friction, viscous), part)


@compiled
def stop_time(e: float, r: float, z: float, w2: float, wd: float, v: float) -> float:
    """When the approach speed r(t), rising from `r`, reaches `v`: the part stops; NEVER if it does not."""
    c = (w2 * e + z * r) / wd
    p = -(w2 * e + 2.0 * z * r)
    if p <= 0.0:
        return NEVER
    high = math.atan2(p, r * wd - z * c) / wd
    if math.exp(-z * high) * (r * math.cos(wd * high) - c * math.sin(wd * high)) < v:
        return NEVER
    low = 0.0
    t = 0.5 * high
    for _ in range(60):
        decay, cosine, sine = math.exp(-z * t), math.cos(wd * t), math.sin(wd * t)
        value = decay * (r * cosine - c * sine) - v
        slope = decay * (p * cosine + (z * c - r * wd) * sine)
        if value < 0.0:
            low = t
        else:
            high = t
        new = t - value / slope if slope > 0.0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - t) <= 1e-13 * (t + 1e-9):
            return new
        t = new
    return t


@compiled
def displacements(v: float, strokes: Samples, plant: Samples, part: Samples, out: Samples) -> None:
    """Displacement from first contact to rest for each stroke, written to `out` (m).

    Parameters
    ----------
    v : float
        Actuator velocity, m/s.
    strokes : ndarray, shape (n,)
        Increasing, m. An infinite one stands for a cell without a commanded stroke, whose actuator
        halts at the first loss of contact.
    plant : ndarray, shape (5,)
        k, b, mu_s, mu_k and k_v; SI; mu_s >= mu_k > 0.
    part : ndarray, shape (2,) or (3 + n,)
        Mass and gravity; then, where friction varies along the slide, a step of distance and what is slid
        instead of 0, 1, 2, ... such steps.
    out : ndarray, shape (n,)
        nan where contact is never lost and the stroke is infinite, or after `MAX_PHASES` rests.
    """
    count = strokes.size
    k, b, mu_s, mu_k, viscous = plant
    mass, gravity = part[0], part[1]
    static, kinetic = mu_s * mass * gravity, mu_k * mass * gravity
    w2 = k / mass
    rest = (kinetic + viscous * v) / k
    z_on, z_off = 0.5 * (b + viscous) / mass, 0.5 * viscous / mass
    wd_on, wd_off = math.sqrt(max(w2 - z_on * z_on, 1e-9 * w2)), math.sqrt(w2 - z_off * z_off)
    need = max((static - b * v) / k, 0.0)  # indentation at which it breaks away
    j = 0
    t, d = 0.0, 0.0  # x = v t - d
    for i in range(count):
        out[i] = math.nan
    for _ in range(MAX_PHASES):
        # at rest, the actuator approaching or pressing
        x = v * t - d
        moves_at = t + (need - d) / v if d < need else t
        while j < count and strokes[j] <= v * moves_at:
            out[j] = x
            j += 1
        if j == count:
            return
        t, e, r = moves_at, max(d, need) - rest, v
        resting = False
        while not resting:
            # r = d': approach speed; r > 0 loads through the damper, r <= 0 unloads without it
            if r > 0.0 or e < 0.0:
                z, wd = z_on, wd_on
                c = (w2 * e + z * r) / wd
                ends = math.atan2(r, c) / wd
                if ends <= 0.0:
                    ends += math.pi / wd
                stops = stop_time(e, r, z, w2, wd, v)
                separates = NEVER
            else:
                z, wd = z_off, wd_off
                c = (w2 * e + z * r) / wd
                ends = math.pi / wd  # of half a wave from r = 0, which is how unloading starts
                stops = NEVER
                separates = NEVER
                lowest = e * math.exp(-z * ends) * -1.0
                if lowest < -rest:
                    low, high = 0.0, ends
                    s = math.acos(max(-rest / e, -1.0)) / wd
                    for _n in range(60):
                        if z == 0.0:
                            break
                        decay, cosine, sine = math.exp(-z * s), math.cos(wd * s), math.sin(wd * s)
                        value = e * decay * (cosine + z / wd * sine) + rest
                        slope = -e * decay * w2 / wd * sine
                        if value > 0.0:
                            low = s
                        else:
                            high = s
                        new = s - value / slope if slope < 0.0 else 0.5 * (low + high)
                        if not low < new < high:
                            new = 0.5 * (low + high)
                        if abs(new - s) <= 1e-13 * ends:
                            s = new
                            break
                        s = new
                    separates = s
                else:  # the swing only fades from here: contact is never lost
                    while count > j and math.isinf(strokes[count - 1]):
                        count -= 1
                    if j == count:
                        return
            step = min(ends, stops, separates)
            f = (r + z * e) / wd
            while j < count and strokes[j] <= v * (t + step):
                s = strokes[j] / v - t
                decay, cosine, sine = math.exp(-z * s), math.cos(wd * s), math.sin(wd * s)
                depth = max(decay * (e * cosine + f * sine) + rest, 0.0)
                speed = v - decay * (r * cosine - c * sine)
                out[j] = strokes[j] - depth
                if speed > 0.0:
                    out[j] += halted(depth, speed, k, kinetic, viscous, part)
                j += 1
            if j == count:
                return
            decay, cosine, sine = math.exp(-z * step), math.cos(wd * step), math.sin(wd * step)
            e, r = decay * (e * cosine + f * sine), decay * (r * cosine - c * sine)
            t += step
            if step == stops:
                d, resting = e + rest, True
            elif step == ends and step != separates:
                r = 0.0
            else:
                speed = v - r
                x = v * t
                goes = along_profile(slide(speed, mass, kinetic, viscous), part)
                caught = catch_time(speed, v, mass, kinetic, viscous)
                while count > j and math.isinf(strokes[count - 1]):
                    count -= 1
                    out[count] = x + goes
                if caught < NEVER:
                    while j < count and strokes[j] <= v * (t + caught):
                        out[j] = x + goes
                        j += 1
                    if j == count:
                        return
                    t += caught
                    if viscous == 0.0:
                        speed -= kinetic / mass * caught
                    else:
                        speed = slowed(speed, caught, mass / viscous, kinetic / viscous)
                    e, r = -rest, v - speed
                else:
                    d, resting = v * t - (x + goes), True


@compiled
def displacement_of(v: float, stroke: float, rows: Samples, factor: Samples, part: Samples) -> Samples:
    """Displacement (m) by one tap for each plant (k, b, mu_s, mu_k, k_v), friction times `factor`."""
    one, out, moved = np.empty(1), np.empty(1), np.empty(factor.size)
    one[0] = stroke
    plant = np.empty(5)
    for n in range(factor.size):
        plant[:] = rows[n]
        plant[2:4] *= factor[n]
        displacements(v, one, plant, part, out)
        moved[n] = out[0]
    return moved
