"""Contact and slide fitted apart: only the one in which the simulator hides something stays off the floor."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.discrepancy.data import noise_floor
from impactcell.discrepancy.data.prepared_campaign import prepare, shot_set
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.model.split_fits import SplitFits, fit_split
from tests.discrepancy.study import Job, campaign

pytestmark = pytest.mark.slow

ON_THE_FLOOR = 1.05


def apart(hidden: str, multiple: float, *, blind: bool = False) -> SplitFits:
    given = campaign(Job("outside", (hidden,), 5, target=3.0, shots=24), [multiple])
    if blind:
        given = replace(given, shots=tuple(replace(shot, position=None) for shot in given.shots))
    prepared = prepare(given)
    shots = shot_set(prepared, np.arange(len(prepared.shots)), noise_floor.sensor_noise(prepared).noise_std)
    problem = Problem(shots, len(prepared.batches))
    return fit_split(problem, fit_nominal(problem))


@pytest.mark.parametrize("law", ["bilinear_contact", "relaxing_contact", "actuator_vibration"])
def test_a_law_of_the_contact_leaves_the_slide_on_the_floor(law: str) -> None:
    found = apart(law, 0.3)
    assert found.contact > 1.5
    assert found.slide < ON_THE_FLOOR


@pytest.mark.parametrize(
    ("law", "multiple"), [("late_friction", 0.3), ("gap_suction", 1.0), ("magnetic_pull", 0.3)]
)
def test_a_law_of_the_slide_leaves_the_contact_on_the_floor(law: str, multiple: float) -> None:
    found = apart(law, multiple)
    assert found.slide > 1.5
    assert found.contact < ON_THE_FLOOR


def test_without_positions_there_is_no_slide_to_fit() -> None:
    found = apart("bilinear_contact", 0.3, blind=True)
    assert found.contact > 1.5
    assert math.isnan(found.slide)
