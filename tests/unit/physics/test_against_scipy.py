"""One tap against scipy's integrator with events, written from equations (1)-(3) anew."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.physics import Plant, TapInput, simulate_tap


def reference(k: float, b: float, mu_s: float, mu_k: float, k_v: float, m: float, v: float, stroke: float):
    """Peak force and sliding distance of a tap that separates once, by DOP853 with steps of 20 µs at most."""
    g = 9.81
    weight = m * g
    t0 = max(0.0, (mu_s * weight - b * v) / (k * v))
    halt = stroke / v
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-15, "max_step": 2e-5}

    def run(t, z, speed, damper, until, stop):
        def motion(time, z):
            y = v * min(time, halt)
            force = k * (y - z[0]) + (b * (speed - z[1]) if damper else 0.0)
            return [z[1], (force - mu_k * weight - k_v * z[1]) / m]

        stop.terminal = True
        return solve_ivp(motion, (t, until), z, events=stop, **options)

    def turned(_, z):
        return v - z[1]

    def left(time, z):
        return v * min(time, halt) - z[0]

    loading = run(t0, [0.0, 0.0], v, True, halt, turned)
    pieces = [(loading, True)]
    t, z = loading.t[-1], loading.y[:, -1]
    pushed = run(t, z, v, False, halt, left)
    pieces.append((pushed, False))
    t, z = pushed.t[-1], pushed.y[:, -1]
    if pushed.status == 0:
        rest = run(t, z, 0.0, False, 1.0, left)
        pieces.append((rest, False))
        z = rest.y[:, -1]
    force = max(
        (k * (v * np.minimum(p.t, halt) - p.y[0]) + (b * (v - p.y[1]) if damper else 0.0)).max()
        for p, damper in pieces
    )
    speed, dry = z[1], mu_k * weight
    slide = m / k_v * speed - m * dry / k_v**2 * math.log1p(k_v * speed / dry)
    return force, slide


@pytest.mark.parametrize(
    ("velocity", "mass", "stroke"), [(0.05, 18.9, 1.5e-3), (0.1, 25.2, 1.5e-3), (0.08, 12.6, 2e-3)]
)
def test_a_tap_is_scipy_s(velocity: float, mass: float, stroke: float) -> None:
    plant = Plant(
        6.5e5, 465.0, 0.2, 0.152, effects={"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0}}
    )
    motion = simulate_tap(plant, TapInput(velocity, mass, stroke))
    force, distance = reference(6.5e5, 465.0, 0.2, 0.152, 85.0, mass, velocity, stroke)
    # The reference takes its peak from points 20 µs apart: 2e-6 of a half oscillation's top at most.
    assert motion.peak_force_n == pytest.approx(force, rel=2e-6)
    assert motion.peak_force_n >= force * (1.0 - 3e-9)
    assert motion.sliding_distance_m == pytest.approx(distance, rel=1e-8)
