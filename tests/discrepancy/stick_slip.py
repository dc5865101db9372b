"""Driven slides that stick and slip, for the tests: Moreau's steps of a fiftieth of a sample and less."""

import math
from collections.abc import Callable

import numpy as np

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import BaseModel, NumberPrior, TermChoice
from impactcell.records import Capture, Channel, Samples

MASS_KG, COULOMB_N, VISCOUS_N_S_PER_M = 2.0, 1.5, 4.0
STEP_S = 8e-5
"""Of the integration, at most."""
SLIDE = BaseModel(
    inertia=NumberPrior(MASS_KG, math.inf),
    terms=(TermChoice("coulomb_friction"), TermChoice("viscous_friction")),
    force_offset=NumberPrior(0.0, 1.0),
)
"""What the slides of `slides` are, but for what is hidden in them."""
Friction = Callable[[Samples, Samples], Samples]
"""Level of friction and drag beside it [N], of place and speed; shape (lanes,)."""


def sines(amplitude_n: float, rng: np.random.Generator) -> Callable[[Samples], Samples]:
    """Four sines between 2 and 12 rad/s."""
    rates, phases = rng.uniform(2.0, 12.0, 4), rng.uniform(0.0, 2.0 * math.pi, 4)
    return lambda time: amplitude_n * np.sin(np.multiply.outer(time, rates) + phases).sum(axis=-1)


def levels(largest_n: float, hold_s: float, rng: np.random.Generator) -> Callable[[Samples], Samples]:
    """Levels that are held for so long each."""
    drawn = rng.uniform(-largest_n, largest_n, 1000)
    return lambda time: drawn[np.floor(time / hold_s + 1e-9).astype(int)]


def paths(
    drives: Samples,
    step_s: float,
    every: int,
    friction: Friction | None = None,
    spring_n_per_m: float = 0.0,
) -> Samples:
    """Positions of slides (samples, lanes) that drives (steps, lanes), held over a step each, lead to.

    Friction is an impulse that may stop a slide within a step and never turns it.
    """
    lanes = drives.shape[1]
    position, speed = np.zeros(lanes), np.zeros(lanes)
    half, gain = 0.5 * step_s, step_s / MASS_KG
    held = gain * np.full(lanes, COULOMB_N)
    out = []
    for number, drive in enumerate(drives):
        if number % every == 0:
            out.append(position)
        middle = position + half * speed
        force = drive - VISCOUS_N_S_PER_M * speed
        if spring_n_per_m:
            force = force - spring_n_per_m * middle
        free = speed + gain * force
        if friction is not None:
            held = gain * friction(middle, speed)
        speed = np.sign(free) * np.maximum(np.abs(free) - held, 0.0)
        position = middle + half * speed
    return np.array(out)


def slides(
    drive_of: Callable[[np.random.Generator], Callable[[Samples], Samples]],
    noise: tuple[float, float],
    friction: Friction | None = None,
    *,
    rate_hz: float = 250.0,
    duration_s: float = 12.0,
    count: int = 9,
    spring_n_per_m: float = 0.0,
) -> Campaign:
    """Records of slides, with noise of force [N] and of position [m] that is not stated."""
    every = max(math.ceil(1.0 / (rate_hz * STEP_S)), 1)
    step = 1.0 / (rate_hz * every)
    drives = [drive_of(np.random.default_rng([3, number])) for number in range(1, count + 1)]
    middles = step * np.arange(0.5, round(duration_s / step))
    forces = np.stack([drive(middles) for drive in drives], axis=1)
    moved = paths(forces, step, every, friction, spring_n_per_m)
    time = np.arange(len(moved)) / rate_hz
    rng = np.random.default_rng(11)
    shots = []
    for number, drive in enumerate(drives, 1):
        force = drive(time) + rng.normal(0.0, noise[0], time.size)
        read = moved[:, number - 1] + rng.normal(0.0, noise[1], time.size)
        channels = Channel(time, force, None), Channel(time, read, None)
        shots.append(Capture(number, math.nan, math.nan, *channels))
    return Campaign(Excitation.DRIVEN, tuple(shots))
