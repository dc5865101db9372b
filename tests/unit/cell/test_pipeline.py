"""One cycle of a cell as a whole: what its parts are told of each other."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from impactcell import cell as core
from impactcell.records import PositioningState
from impactcell.service.factory import cell_design
from impactcell.settings import read_cell
from tests.integration.processes import CONFIG
from tests.taps import VISCOUS, Tap

STRIBECK: dict[str, Any] = {
    "stribeck_friction": {"friction_increase": 0.03, "stribeck_velocity_m_s": 0.04},
}


@pytest.mark.parametrize("known", [True, False])
def test_an_effect_of_every_cycle_makes_none_deviant(known: bool) -> None:
    """Friction rises towards standstill from cycle 26 on, at velocities that vary, in both directions.

    Whether the model has taken it over or not: what cycles have in common is no deviance. Taps of the faster
    velocities slide beyond the grid, where nothing is learned of friction.
    """
    design = cell_design(read_cell(CONFIG / "cells" / "new-effect.yaml"))
    if known:
        plant = replace(design.model.plant, effects=VISCOUS | STRIBECK)
        design = replace(design, model=replace(design.model, plant=plant))
    state, draw, deviant = core.initial_state(design), np.random.default_rng(1), 0
    for cycle in range(1, 91):
        tap = Tap(
            float(draw.choice([2000, 3000, 4000, 5000, 6000])) / 6e4,
            0.2 * (1.0 + 0.012 * draw.standard_normal()),
            stroke_m=1.5e-3,
            direction=int(draw.choice([1, -1])),
            effects=VISCOUS | STRIBECK if cycle > 25 else VISCOUS,
        )
        stepped = core.step(design, state, tap.capture(draw, cycle=cycle), PositioningState(), None, ())
        state = stepped.state
        deviant += bool(np.isfinite(stepped.snapshot.signature.deviates_at_m))
    assert deviant == 0
