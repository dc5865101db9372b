"""Shots of the benchmarks of prediction: made by the simulator's own plant, with their Fisher information."""

from dataclasses import dataclass

import numpy as np

from impactcell.physics import Plant
from impactcell.prediction import Prior
from impactcell.records import Capture, Channel
from simulator import plant as simulated

K, B, RATIO, VISCOUS = 6.5e5, 465.0, 0.76, 85.0
EFFECTS = {"viscous_friction": {"viscous_coefficient_n_s_per_m": VISCOUS}}
PLANT = Plant(K, B, 0.2, RATIO * 0.2, effects=EFFECTS)
PRIOR = Prior(0.01 * K, 0.02 * B, 0.03 * RATIO)
FORCE_STD_N, POSITION_STD_M, RATE_HZ = 0.4, 1.5e-6, 10e3
MASS_KG = 18.9
FRICTIONS = np.linspace(0.15, 0.25, 17)
VELOCITIES_MM_PER_MIN = (2000, 3000, 4000, 5000, 6000)


@dataclass(frozen=True, slots=True)
class Truth:
    """One shot as it was made."""

    velocity_m_s: float
    mu_s: float
    ratio: float
    stiffness: float = K
    damping: float = B

    @property
    def mu_k(self) -> float:
        return self.ratio * self.mu_s

    @property
    def theta(self) -> np.ndarray:
        return np.log([self.mu_k, self.ratio, self.stiffness, self.damping])


def motion(truth: Truth) -> simulated.Motion:
    plant = simulated.Plant(truth.stiffness, truth.damping, truth.mu_s, truth.mu_k, effects=EFFECTS)
    return simulated.simulate_tap(
        plant, simulated.TapInput(truth.velocity_m_s, MASS_KG, halts_at_separation=True)
    )


def shot(
    truth: Truth,
    rng: np.random.Generator,
    force_hz: float = RATE_HZ,
    position_hz: float = RATE_HZ,
    late_s: float = 0.0,
) -> Capture:
    """Sample a shot; its t = 0 comes `late_s` after first contact."""
    moved = motion(truth)
    force_times = np.arange(1, round((moved.separation_s + 2e-3) * force_hz)) / force_hz
    position_times = np.arange(1, round((moved.stop_s + 2e-2) * position_hz)) / position_hz
    force = moved.force_n(force_times + late_s) + rng.normal(0.0, FORCE_STD_N, len(force_times))
    position = moved.position_m(position_times + late_s) + rng.normal(
        0.0, POSITION_STD_M, len(position_times)
    )
    return Capture(
        1, truth.velocity_m_s, MASS_KG,
        Channel(force_times, force, FORCE_STD_N), Channel(position_times, position, POSITION_STD_M),
    )  # fmt: skip


def information(truth: Truth) -> np.ndarray:
    """Fisher information of a shot in ln(mu_k, mu_k/mu_s, k, b), by differences of the simulator's plant."""
    end = motion(truth)
    times = np.arange(1, round((end.stop_s + 2e-2) * RATE_HZ)) / RATE_HZ
    contact = times[times < end.separation_s + 2e-3]

    def channels(theta: np.ndarray) -> np.ndarray:
        mu_k, ratio, stiffness, damping = np.exp(theta)
        moved = motion(Truth(truth.velocity_m_s, mu_k / ratio, ratio, stiffness, damping))
        return np.concatenate(
            [moved.force_n(contact) / FORCE_STD_N, moved.position_m(times) / POSITION_STD_M]
        )

    at, step = channels(truth.theta), 1e-5
    slope = np.column_stack(
        [
            (channels(truth.theta + sign * step * np.eye(4)[i]) - at) / (sign * step)
            for i, sign in enumerate((1.0, -1.0, 1.0, -1.0))
        ]
    )
    return slope.T @ slope


PRIOR_INFORMATION = np.diag([0.0, 0.03**-2, 0.01**-2, 0.02**-2])
OF = {"mu_s": np.array([1.0, -1.0, 0.0, 0.0]), "mu_k": np.array([1.0, 0.0, 0.0, 0.0])}
