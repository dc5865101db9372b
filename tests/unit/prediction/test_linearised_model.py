"""The model of a capture at parameters that no plant has."""

import numpy as np
import pytest

from impactcell.errors import PhysicsError
from impactcell.features import extract
from impactcell.physics import Plant
from impactcell.prediction.capture_blocks import linearised_model
from impactcell.prediction.linearised_model import DAMPING, STIFFNESS, parameters_of
from tests.taps import Tap

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("place", [STIFFNESS, DAMPING])
def test_parameters_beyond_any_number_are_a_fault_and_no_warning(place: int) -> None:
    """A fit that goes astray asks for exp(800); what numpy says of it is for nobody at a terminal."""
    tap = Tap(0.05, 0.2, mass_kg=18.9, stroke_m=1.5e-3, effects={}).capture(np.random.default_rng(1), cycle=1)
    plant = Plant(6.5e5, 465.0, 0.2, 0.152, 9.81)
    theta = parameters_of(plant)
    theta[place] += 800.0
    with pytest.raises(PhysicsError, match="the motion is not finite with these parameters"):
        linearised_model(extract(tap), plant).linearise(theta)
