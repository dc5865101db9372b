"""Parts of the model by themselves: phases, where a fit starts, a part at rest."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.discrepancy.data.phases import PHASES
from impactcell.discrepancy.model import initial_guess
from impactcell.discrepancy.model.parameters import NOMINAL_COORDINATES
from impactcell.discrepancy.model.phase_of_samples import phase_positions
from impactcell.discrepancy.model.shot_freedom import ShotFreedom
from impactcell.discrepancy.model.shot_parameters import ShotParameters
from impactcell.physics import Plant


def test_the_place_within_a_phase_goes_from_nought_to_one() -> None:
    times = np.array([0.0, 0.1, 0.4, 0.5, 1.0, 2.0, 7.0, 8.0, 10.0])
    phase = np.array([0, 0, 0, 2, 2, 2, 1, 1, 1])

    class Shots:
        bounds = np.array([0, 6, 9])

        def __len__(self) -> int:
            return 2

    problem: Any = SimpleNamespace(shots=Shots())
    place = phase_positions(problem, phase, times)
    assert place == pytest.approx([0.0, 0.25, 1.0, 0.0, 1.0 / 3.0, 1.0, 0.0, 1.0 / 3.0, 1.0])
    assert phase.max() < len(PHASES)


def test_a_plant_that_is_given_is_where_the_fit_starts() -> None:
    plant = Plant(mu_s=0.26, mu_k=0.2, stiffness_n_per_m=2e7, damping_n_s_per_m=3e3)
    problem: Any = SimpleNamespace(coordinates=NOMINAL_COORDINATES)
    theta = initial_guess._coordinates_of(problem, plant)
    for coordinate, number in zip(NOMINAL_COORDINATES, theta, strict=True):
        name = coordinate.parameter
        expected = 1.3 if name == "ratio" else getattr(plant, name)
        assert coordinate.value(float(number)) == pytest.approx(expected)


def test_a_shot_at_rest_stays_at_rest_whatever_the_step() -> None:
    names = ("log_factor", "speed_m_s", "shift_m")
    freedom = ShotFreedom(names, np.zeros(3, dtype=np.bool_), np.zeros(3), {})
    nothing = np.zeros((4, 3))
    at = ShotParameters(np.zeros(3), np.ones(3), np.array([0.0, 0.2, -0.1]), *nothing)
    moved = freedom.step(at, np.full((3, 3), 0.01))
    assert moved.speed_m_s == pytest.approx([0.0, 0.21, -0.09])
    assert moved.log_factor == pytest.approx([0.01] * 3)
    assert moved.shift_m == pytest.approx([0.01] * 3)
