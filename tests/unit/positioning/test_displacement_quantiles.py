"""The predictive distribution of a displacement, against the simulator's plant."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.positioning.displacement_quantiles import displacement_quantiles, parameter_scenarios
from impactcell.positioning.planner_posterior import FRICTION, RATIO, prior_of_plant, with_single_gaussian
from impactcell.positioning.scatter_hypotheses import GRID
from simulator.plant_nominal import nominal_taps

STIFFNESS, DAMPING, MU_K, MASS = 5.85e5, 418.5, 0.1725, 32.8
VELOCITY, STROKE = 6.5e-3, 1.224e-3
"""A slow push that sticks once less where static friction is a little higher: it jumps by 18 µm there."""
Z = np.linspace(-3.29, 3.29, 67)


def moved(ratio: float) -> float:
    """Displacement (m) of the simulator's plant, static over kinetic friction given."""
    return float(
        nominal_taps(
            STIFFNESS, DAMPING, MU_K * ratio, MU_K, MASS, VELOCITY, STROKE
        ).displacement_m[0]
    )  # fmt: skip


def jump() -> float:
    """Logarithm of the ratio of frictions at which the displacement jumps."""
    logarithms = np.linspace(math.log(1.2), math.log(1.4), 201)
    displacements = np.array([moved(math.exp(each)) for each in logarithms])
    n = int(np.argmax(np.abs(np.diff(displacements))))
    assert abs(displacements[n + 1] - displacements[n]) > 12e-6
    return float(logarithms[n : n + 2].mean())


@pytest.mark.parametrize("deviations", [-2.5, 2.5])
def test_a_jump_within_three_standard_deviations_is_within_the_band(deviations: float) -> None:
    """Of the ratio of frictions, which is known to half a per cent; friction itself hardly scatters."""
    std = 0.005
    mean_ratio = jump() - deviations * std
    posterior = prior_of_plant(STIFFNESS, DAMPING, MU_K * math.exp(mean_ratio), MU_K, 0.0)
    stds = np.full(posterior.mean.size, 1e-6)
    stds[RATIO], stds[FRICTION] = std, 1e-4
    quiet = np.zeros((1, len(GRID)))
    quiet[0, int(GRID.sum(axis=1).argmin())] = 1.0
    posterior = with_single_gaussian(posterior, posterior.mean, np.diag(stds**2))
    posterior = replace(posterior, scatter_weights=quiet)
    scenarios = parameter_scenarios(posterior, Z, np.array([MASS, 9.81]), np.array([0.0, 1.0]))
    band = np.empty((1, Z.size))
    displacement_quantiles(VELOCITY, np.array([STROKE]), scenarios, Z, band)
    beyond = moved(math.exp(jump() + math.copysign(0.1 * std, deviations)))
    assert abs(moved(math.exp(mean_ratio)) - beyond) > 12e-6
    assert band.min() - 1e-6 < beyond < band.max() + 1e-6
