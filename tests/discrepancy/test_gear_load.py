"""Friction that grows with the load on gears, where the torque is predicted: the path is a closed form."""

import math

import numpy as np
import pytest

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import BaseModel, NumberPrior, Response, investigate_machine
from impactcell.records import Capture, Channel

pytestmark = pytest.mark.slow

INERTIA, GRAVITY, SHARE = 0.007, 0.45, 0.18
"""Of the arm [kg m², N m], and friction over what the gears carry."""
ARM = BaseModel(
    coordinate=Coordinate.ROTATION,
    response=Response.FORCE,
    inertia=NumberPrior(INERTIA),
    gravity_torque=NumberPrior(GRAVITY),
    force_offset=NumberPrior(0.0, 0.02),
)
NOISE = 1e-2
"""Of the torque [N m]."""


def lifts() -> Campaign:
    """Six paths on which the arm's inertia needs as much torque as its weight."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 8.0, 4e-3)
    shots = []
    for number in range(1, 7):
        rates = 2.0 * np.pi * rng.uniform(0.4, 1.3, 3)
        angles = rates[:, None] * time + rng.uniform(0.0, 2.0 * np.pi, (3, 1))
        sizes = 0.5 * rng.uniform(0.5, 1.0, 3)
        angle = sizes @ np.sin(angles)
        speed, acceleration = (sizes * rates) @ np.cos(angles), -(sizes * rates**2) @ np.sin(angles)
        weight = GRAVITY * np.sin(angle)
        needed = INERTIA * acceleration + weight
        torque = needed + (0.01 + SHARE * np.abs(needed + weight)) * np.tanh(speed / 1e-3)
        torque += NOISE * rng.standard_normal(time.size)
        channels = Channel(time, torque, NOISE), Channel(time, angle, 1e-6)
        shots.append(Capture(number, math.nan, math.nan, *channels))
    return Campaign(Excitation.DRIVEN, tuple(shots), coordinate=Coordinate.ROTATION)


def test_gears_are_loaded_by_weight_and_by_what_accelerates_the_arm() -> None:
    finding = investigate_machine(lifts(), ARM)
    assert finding.established == ("load_dependent_friction",)
    assert finding.fall.after < 1.2 < 5.0 < finding.fall.before
    column = ("load_dependent_friction", 0.0, 0)
    place = finding.final.fit.columns.index(column)
    assert finding.final.value(column) == pytest.approx(SHARE, rel=0.02)
    assert finding.final.fit.low[place] < SHARE < finding.final.fit.high[place]
