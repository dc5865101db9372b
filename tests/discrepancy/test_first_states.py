"""First state and constant force of a stretch of a cart that rolls back, which closed form gives."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.discrepancy.machine import BaseModel, NumberPrior, TermChoice
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.block_sums import LinearFit
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.simulation.held_out import positions_from, simulate_held_out
from impactcell.records import Samples

MASS, PUSH, COULOMB, UPHILL, NOISE = 0.6, 0.3, 0.06, 0.15, 5e-4
"""kg, N, N, m/s against the push at first, and noise of the position [m]."""


def path(time: Samples) -> Samples:
    """Places of the cart: up to a standstill, and down again."""
    up, down = (PUSH + COULOMB) / MASS, (PUSH - COULOMB) / MASS
    turns = UPHILL / up
    rising = -UPHILL * time + 0.5 * up * time**2
    falling = -0.5 * UPHILL * turns + 0.5 * down * (time - turns) ** 2
    return np.where(time < turns, rising, falling)


def rolls_back(seed: int) -> UniformRecord:
    """Positions at 200 Hz over 0.7 s."""
    time = 5e-3 * np.arange(140)
    position = path(time) + np.random.default_rng([17, seed]).normal(0.0, NOISE, time.size)
    return UniformRecord(
        shot=1, label="", time_s=time, position=position, force=np.full(time.size, PUSH), inertia=MASS,
        covariates={}, spikes=0, noise=(NOISE, 0.0),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(20))
def test_a_true_model_follows_a_stretch_to_its_noise(seed: int) -> None:
    """A speed of 21 samples errs by 5 cm/s here, and a constant force that makes up for it kept it so."""
    base = BaseModel(inertia=NumberPrior(MASS), force_offset=NumberPrior(0.0, math.inf))
    coulomb = ChosenTerm(TermChoice("coulomb_friction"), 0.0)
    values = np.array([COULOMB])
    fit = LinearFit(coulomb.columns, values, values, values, np.array([False]))
    model = FittedModel(base, (coulomb,), fit, 0.0, 0.0)
    finding: Any = SimpleNamespace(
        held_spans=[(0, 0.0, 1.0)], records=[rolls_back(seed)], scale=SimpleNamespace(period_s=2.8)
    )
    assert simulate_held_out(finding, model).rmse < 2.0 * NOISE


def test_a_part_turns_amid_a_step() -> None:
    """Friction that is against the end of a step all along it errs by the millimetre a second here."""
    record = rolls_back(0)
    coulomb = ChosenTerm(TermChoice("coulomb_friction"), 0.0)
    values = np.array([COULOMB])
    fit = LinearFit(coulomb.columns, values, values, values, np.array([False]))
    model = FittedModel(BaseModel(inertia=NumberPrior(MASS)), (coulomb,), fit, 0.0, 0.0)
    (position,) = positions_from(model, [record], np.array([[0.0], [-UPHILL]]), 2.8)
    assert np.abs(position - path(record.time_s)).max() < 1e-9
