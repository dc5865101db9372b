"""Free slides over a friction profile that is known exactly, integrated to 1e-10 apart from the product."""

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from impactcell.records import Capture, Channel

GRAVITY = 9.81
FRICTION = 0.2


def slide(
    friction: Callable[[float], float],
    speed: float,
    rate: float,
    noise: float,
    seed: int,
    rest_s: float = 0.02,
    viscous_per_mass: float = 0.0,
) -> tuple[Capture, float]:
    """Capture of a slide from `speed` to rest, and the distance slid."""

    def motion(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -GRAVITY * friction(y[0]) - viscous_per_mass * y[1]]

    def stopped(_: float, y: np.ndarray) -> float:
        return y[1]

    stopped.terminal, stopped.direction = True, -1  # type: ignore[attr-defined]
    path = solve_ivp(
        motion,
        (0.0, 2.0),
        [0.0, speed],
        events=stopped,
        rtol=1e-9,
        atol=1e-12,
        dense_output=True,
        max_step=3e-3,
    )
    stop = path.t[-1]
    t = np.arange(0.0, stop + rest_s, 1.0 / rate)
    x = np.where(t < stop, path.sol(np.minimum(t, stop))[0], path.y[0, -1])
    x = x + noise * np.random.default_rng([6, seed]).normal(size=len(t))
    capture = Capture(seed, math.nan, 18.9, None, Channel(t, x, noise))
    return capture, float(path.y[0, -1])
