"""One tap of the reference plant by scipy's `solve_ivp` with events, as one would write it."""

import math

import numpy as np
from scipy.integrate import solve_ivp

# Own fit of equations (1)-(3) to the paper's printed coefficients: k, b, mu_k/mu_s, k_v at 18.9 kg.
K, B, RATIO, K_V, MASS = 6.5e5, 465.0, 0.76, 85.0, 18.9
SAMPLES = np.arange(1, 1201) * 1e-4


def scipy_tap(
    mu_s: float, v: float, rtol: float, *, peak: bool = False, **options: object
) -> tuple[float, float, np.ndarray]:
    """Peak force where asked for, sliding distance and samples by `solve_ivp` with events."""
    weight = MASS * 9.81
    dry = RATIO * mu_s * weight
    begin = max(0.0, (mu_s * weight - B * v) / (K * v))

    def contact(t: float, z: np.ndarray) -> list[float]:
        return [z[1], (K * (v * t - z[0]) + B * max(v - z[1], 0.0) - dry - K_V * z[1]) / MASS]

    def free(_t: float, z: np.ndarray) -> list[float]:
        return [z[1], (-dry - K_V * z[1]) / MASS]

    def left(t: float, z: np.ndarray) -> float:
        return v * t - z[0]

    def stopped(_t: float, z: np.ndarray) -> float:
        return float(z[1])

    left.terminal = stopped.terminal = True  # type: ignore[attr-defined]
    left.direction = stopped.direction = -1.0  # type: ignore[attr-defined]
    common = {"rtol": rtol, "atol": 1e-6 * rtol, "dense_output": True} | options
    pushed = solve_ivp(contact, (begin, 1.0), [0.0, 0.0], events=left, **common)
    end = pushed.t[-1]
    slid = solve_ivp(free, (end, 5.0), pushed.y[:, -1], events=stopped, **common)
    out = np.zeros((2, SAMPLES.size))
    early = begin > SAMPLES
    touching = (begin <= SAMPLES) & (end > SAMPLES)
    sliding = (end <= SAMPLES) & (slid.t[-1] > SAMPLES)
    x, w = pushed.sol(SAMPLES[touching])
    out[0, early] = K * v * SAMPLES[early] + B * v
    out[0, touching] = K * (v * SAMPLES[touching] - x) + B * np.maximum(v - w, 0.0)
    out[1, touching] = x
    out[1, sliding] = slid.sol(SAMPLES[sliding])[0]
    out[1, slid.t[-1] <= SAMPLES] = slid.y[0, -1]
    highest = math.nan
    if peak:
        fine = np.linspace(begin, end, 100_000)
        x, w = pushed.sol(fine)
        highest = float((K * (v * fine - x) + B * np.maximum(v - w, 0.0)).max())
    return highest, float(slid.y[0, -1] - pushed.y[0, -1]), out
