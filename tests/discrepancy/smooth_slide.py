"""A slide that a smooth force acts on, in closed form: records of its motion and of the force it takes."""

import math
from collections.abc import Callable

import numpy as np

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import BaseModel, NumberPrior, Response, TermChoice
from impactcell.records import Capture, Channel, Samples

Law = Callable[[Samples, Samples], Samples]
"""Force on the part by position and velocity, N."""

SLIDE = BaseModel(
    response=Response.FORCE,
    inertia=NumberPrior(2.0, 0.1),
    force_offset=NumberPrior(0.0, math.inf),
    terms=(TermChoice("coulomb_friction"),),
)


def slide(law: Law, seed: int) -> Campaign:
    """Six records of a slide that sums of three sines move, and what moves it in closed form."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, 12.0, 4e-3)
    shots = []
    for number in range(1, 7):
        position, velocity, acceleration = np.zeros((3, time_s.size))
        for _ in range(3):
            rate, phase = 2.0 * np.pi * rng.uniform(0.3, 1.2), rng.uniform(0.0, 2.0 * np.pi)
            size = 0.08 * rng.uniform(0.5, 1.0)
            position += size * np.sin(rate * time_s + phase)
            velocity += size * rate * np.cos(rate * time_s + phase)
            acceleration -= size * rate**2 * np.sin(rate * time_s + phase)
        force = 2.0 * acceleration + 3.0 * np.tanh(velocity / 1e-3) - law(position, velocity)
        force += 0.2 * rng.standard_normal(time_s.size)
        shots.append(
            Capture(number, math.nan, math.nan, Channel(time_s, force, None), Channel(time_s, position, None))
        )
    return Campaign(Excitation.DRIVEN, tuple(shots))


def wandering(position: Samples, velocity: Samples) -> Samples:
    """Smooth force that no term has [N]."""
    return 0.15 * (
        np.sin(11.0 * position - 2.5 * velocity + 0.4)
        + np.sin(-6.0 * position - 3.3 * velocity + 2.0)
        + np.sin(13.0 * position + 1.1 * velocity + 4.0)
    )
