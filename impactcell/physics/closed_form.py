"""Displacement of a part for many strokes at one velocity, in closed form.

The nominal plant, equations (1)-(3) with viscous friction, is linear between its events. While the
actuator runs, its stroke does not matter; once it has halted, what is left is one half wave of an
oscillator and a slide. One course of the running actuator therefore answers for every stroke at once,
which is what a planner asks thousands of times a step and an integrator of single taps does not offer.
It takes no steps in time; what does, `impactcell.physics.simulate_tap`, is what the tests hold it to.

With indentation d = y - x, the static indentation L = (mu_k m g + k_v v) / k and e = d - L::

    contact, actuator at v:   e'' + 2 z e' + w² e = 0,   2 z = (b [d' > 0] + k_v) / m,   w² = k / m
    free:                     m x'' = -mu_k m g - k_v x'
"""

import math
from typing import Final, NamedTuple

import numpy as np

from impactcell.errors import PhysicsError
from impactcell.numerics.jit import compiled
from impactcell.physics.half_wave import Oscillator, Swing, separation_time, stop_time, swing_at, swing_from
from impactcell.physics.linear_slide import (
    NEVER,
    NEWTON_STEPS,
    along_profile,
    catch_time,
    narrowed,
    slide_distance,
    speed_after,
)
from impactcell.records import Samples

MAX_SWINGS = 1_000_000  # half waves of one push: a part of 0.1 kg pushed 1.5 m at 5 mm/s has some 250 000
MAX_RESTS = 4000  # of a part under one push, after which it is taken to creep without end
CONVERGED_NEXT = 1e-8  # step, over the phase from halt to turn, after which Newton's method is at rounding
SLOWEST_SWING = 1e-9  # of w², least squared frequency: a contact damped beyond that is taken as this

TURNS: Final = 0  # how a half wave ends: compression turns into departure or back
STOPS: Final = 1  # the part comes to rest against the actuator
SEPARATES: Final = 2  # contact is lost
FADES: Final = 3  # departure turns back, and will never again separate


class Contact(NamedTuple):
    """A part that an actuator pushes at `velocity`; SI, `friction` a force, `part` as in `displacements`."""

    velocity: float
    stiffness: float
    friction: float
    viscous: float
    static_indentation: float
    loading: Oscillator
    unloading: Oscillator
    part: Samples


class Strokes(NamedTuple):
    """Strokes asked for, increasing, and the displacements by them; m."""

    strokes: Samples
    displacements: Samples


@compiled
def contact_of(v: float, plant: Samples, part: Samples) -> Contact:
    """Work out what is constant while an actuator at v pushes."""
    k, b, _, mu_k, viscous = plant
    mass = part[0]
    kinetic = mu_k * mass * part[1]
    w2 = k / mass
    z_on, z_off = 0.5 * (b + viscous) / mass, 0.5 * viscous / mass
    on = math.sqrt(max(w2 - z_on * z_on, SLOWEST_SWING * w2))
    off = math.sqrt(max(w2 - z_off * z_off, SLOWEST_SWING * w2))
    rest = (kinetic + viscous * v) / k
    return Contact(v, k, kinetic, viscous, rest, Oscillator(z_on, w2, on), Oscillator(z_off, w2, off), part)


@compiled
def travel_after_halt(indentation: float, speed: float, contact: Contact) -> float:
    """Travel to rest of a part in contact with an actuator that has just halted.

    `indentation` >= 0 (m) and `speed` > 0 (m/s) at the halt. The damper is off: the part departs.
    """
    friction, viscous, part = contact.friction, contact.viscous, contact.part
    mass = part[0]
    w2 = contact.stiffness / mass
    rest = friction / contact.stiffness
    e = indentation - rest
    if viscous == 0.0:
        amplitude = math.sqrt(e * e + speed * speed / w2)
        if amplitude <= rest:
            return indentation - rest + amplitude
        return indentation + along_profile(0.5 * (amplitude * amplitude - rest * rest) / rest, part)
    z, wd = contact.unloading.decay, contact.unloading.frequency
    c = (z * e - speed) / wd  # e(t) = exp(-z t) (e cos wd t + c sin wd t), e'(0) = -speed
    p = (w2 * e - z * speed) / wd  # e'(t) = -exp(-z t) (speed cos wd t + p sin wd t)
    turn = math.atan2(speed, -p)  # of the phase wd t
    furthest = math.exp(-z / wd * turn) * (e * p - c * speed) / math.sqrt(speed * speed + p * p)
    if furthest <= rest:
        return float(e + furthest)
    departure = furthest * wd * departing(z / wd, rest / furthest, turn)
    return indentation + along_profile(slide_distance(departure, mass, friction, viscous), part)


@compiled
def departing(ratio: float, q: float, most: float) -> float:
    """Speed of departure where contact is lost, over `furthest` wd.

    Seen back from where the part would turn if it stuck to its actuator, a phase y before it, the
    indentation is -furthest g(y), and contact is lost where g(y) = q::

        g(y) = exp(ratio y) (cos y - ratio sin y),   g'(y) = -(1 + ratio²) exp(ratio y) sin y

    Parameters
    ----------
    ratio : float
        z / wd; usually some hundredths, so that its first order is where to begin.
    q : float
        0 < q < 1.
    most : float
        Phase from the halt to the turn.
    """
    y, sine = math.acos(q), math.sqrt(1.0 - q * q)
    if sine > 0.0:
        y += ratio * (y * q / sine - 1.0)
    low, high = 0.0, most
    y = min(max(y, low), high)
    for _ in range(NEWTON_STEPS):
        growth, cosine, sine = math.exp(ratio * y), math.cos(y), math.sin(y)
        value = growth * (cosine - ratio * sine) - q
        slope = -(1.0 + ratio * ratio) * growth * sine
        new, low, high = narrowed(y, value, slope, low, high)
        converged = abs(new - y) <= CONVERGED_NEXT * most
        y = new
        if converged:
            break
    return (1.0 + ratio * ratio) * math.exp(ratio * y) * math.sin(y)


@compiled
def half_wave(e: float, r: float, contact: Contact, breaks_away: bool) -> tuple[float, int]:  # noqa: FBT001
    """How long the damper stays as it is, and how that ends.

    r = d' is the approach speed; r > 0 loads through the damper, r <= 0 unloads without it. A part that
    `breaks_away` from rest speeds up, so that it does not stop in that half wave: with mu_s = mu_k it
    begins with no acceleration at all, and rounding would say that it stops where it has just started.
    """
    if r > 0.0 or e < 0.0:
        of = contact.loading
        c = (of.squared_frequency * e + of.decay * r) / of.frequency
        ends = math.atan2(r, c) / of.frequency
        if ends <= 0.0:
            ends += math.pi / of.frequency
        stops = NEVER if breaks_away else stop_time(e, r, contact.velocity, of)
        return (stops, STOPS) if stops <= ends else (ends, TURNS)
    ends = math.pi / contact.unloading.frequency  # of half a wave from r = 0, which is how unloading starts
    separates = separation_time(e, ends, contact.static_indentation, contact.unloading)
    if separates == NEVER:
        return ends, FADES
    return (separates, SEPARATES) if separates <= ends else (ends, TURNS)


@compiled
def halt_apart(j: int, travel: float, place: float, asked: Strokes) -> int:
    """Fill the strokes from the j-th up to `travel`, where the part rests at `place`; the first beyond."""
    while j < asked.strokes.size and asked.strokes[j] <= travel:
        asked.displacements[j] = place
        j += 1
    return j


@compiled
def halt_in_contact(j: int, t: float, duration: float, swing: Swing, contact: Contact, asked: Strokes) -> int:
    """Fill the strokes from the j-th that end in a half wave that begins at t; the first beyond."""
    v = contact.velocity
    while j < asked.strokes.size and asked.strokes[j] <= v * (t + duration):
        stroke = asked.strokes[j]
        e, r = swing_at(stroke / v - t, swing)
        depth = max(e + contact.static_indentation, 0.0)
        speed = v - r
        asked.displacements[j] = stroke - depth
        if speed > 0.0:
            asked.displacements[j] += travel_after_halt(depth, speed, contact)
        j += 1
    return j


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
        nan where contact is never lost and the stroke is infinite, or after `MAX_RESTS` rests.

    Raises
    ------
    PhysicsError
        Where one push takes more than `MAX_SWINGS` half waves, or has no end: no tap of a cell does.
    """
    contact, asked = contact_of(v, plant, part), Strokes(strokes, out)
    rest, mass = contact.static_indentation, part[0]
    # indentation at which the part breaks away
    need = max((plant[2] * mass * part[1] - plant[1] * v) / plant[0], 0.0)
    out[:] = math.nan
    j, count = 0, strokes.size
    t, d = 0.0, 0.0  # x = v t - d
    for _ in range(MAX_RESTS):
        # at rest, the actuator approaching or pressing
        moves_at = t + (need - d) / v if d < need else t
        j = halt_apart(j, v * moves_at, v * t - d, asked)
        if j == count:
            return
        t, e, r = moves_at, max(d, need) - rest, v
        resting, swings = False, 0
        while not resting:
            swings += 1
            if swings > MAX_SWINGS:
                raise PhysicsError(
                    "the part would swing on its actuator without end: velocity, stroke, mass or place of "
                    "this tap are not those of a cell, in m/s, m, kg and m"
                )
            duration, ending = half_wave(e, r, contact, swings == 1)
            if ending == FADES and count > j and math.isinf(strokes[count - 1]):
                count -= 1
            swing = swing_from(e, r, contact.loading if r > 0.0 or e < 0.0 else contact.unloading)
            j = halt_in_contact(j, t, duration, swing, contact, asked)
            if j == count:
                return
            e, r = swing_at(duration, swing)
            t += duration
            if ending == STOPS:
                d, resting = e + rest, True
            elif ending != SEPARATES:
                r = 0.0
            else:
                speed = v - r
                reached = v * t + along_profile(
                    slide_distance(speed, mass, contact.friction, contact.viscous), part
                )
                if count > j and math.isinf(strokes[count - 1]):
                    count -= 1
                    out[count] = reached
                caught = catch_time(speed, v, mass, contact.friction, contact.viscous)
                if caught == NEVER:
                    d, resting = v * t - reached, True
                    continue
                j = halt_apart(j, v * (t + caught), reached, asked)
                if j == count:
                    return
                t += caught
                e, r = -rest, v - speed_after(speed, caught, mass, contact.friction, contact.viscous)


@compiled
def displacement_of(v: float, strokes: Samples, rows: Samples, factor: Samples, part: Samples) -> Samples:
    """Displacement (m) for each plant (k, b, mu_s, mu_k, k_v) and stroke, friction times `factor`."""
    stroke, out, moved = np.empty(1), np.empty(1), np.empty(factor.size)
    plant = np.empty(5)
    for n in range(factor.size):
        plant[:] = rows[n]
        plant[2:4] *= factor[n]
        stroke[0] = strokes[n]
        displacements(v, stroke, plant, part, out)
        moved[n] = out[0]
    return moved
