"""Friction that falls with speed on a swing that turns within some samples, by an integrator with events."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import BaseModel, NumberPrior, investigate_machine
from impactcell.records import Capture, Channel, Samples

pytestmark = pytest.mark.slow

INERTIA, GRAVITY, COULOMB, INCREASE, STRIBECK, NOISE = 0.02, 0.6, 0.002, 0.06, 0.12, 2e-5
"""kg m², N m, N m, N m at rest beyond it, rad/s, and noise of the angle [rad]."""
BASE = BaseModel(
    coordinate=Coordinate.ROTATION,
    inertia=NumberPrior(INERTIA),
    gravity_torque=NumberPrior(0.55, math.inf),
    position_offset=NumberPrior(0.0, 0.05),
    force_offset=NumberPrior(0.0, 0.01),
)


def swing(released: float, time: Samples) -> Samples:
    """Angles of a swing, integrated from turn to turn."""
    angle = np.empty(time.size)
    state, begin, sense = [released, 0.0], float(time[0]), -1.0
    while True:

        def rates(_: float, now: Samples, sense: float = sense) -> list[float]:
            level = COULOMB + INCREASE * math.exp(-((now[1] / STRIBECK) ** 2))
            return [now[1], (-GRAVITY * math.sin(now[0]) - sense * level) / INERTIA]

        def turns(now_s: float, now: Samples, sense: float = sense, begin: float = begin) -> float:
            return float(now[1]) if now_s > begin + 1e-6 else sense

        turns.terminal = True  # type: ignore[attr-defined]
        found = solve_ivp(
            rates, (begin, time[-1]), state, "DOP853", events=turns, dense_output=True, rtol=1e-10,
            atol=1e-12, max_step=0.02,
        )  # fmt: skip
        inside = (time >= begin) & (time <= found.t[-1])
        angle[inside] = found.sol(time[inside])[0]
        if found.status != 1:
            return angle
        state, begin, sense = [float(found.y[0, -1]), 0.0], float(found.t[-1]), -sense


def test_friction_at_rest_does_not_hide_itself() -> None:
    """Beside it rows at turns are doubted so much that nothing shows without it either."""
    time, rng = 2e-3 * np.arange(4000), np.random.default_rng(31)
    shots = []
    for number, released in enumerate((0.75, 0.85, 0.95, 1.1, 1.25, 1.35), 1):
        read = swing(released, time) + rng.normal(0.0, NOISE, time.size)
        shots.append(Capture(number, math.nan, math.nan, None, Channel(time, read)))
    campaign = Campaign(Excitation.FREE_SLIDE, tuple(shots), coordinate=Coordinate.ROTATION)
    finding = investigate_machine(campaign, BASE)
    assert finding.established == ("stribeck_friction",)
    assert finding.fall.before > 2.0
    assert finding.is_at_floor
    assert finding.simulated[1].rmse < 0.7 * finding.simulated[0].rmse
