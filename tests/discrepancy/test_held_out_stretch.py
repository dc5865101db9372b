"""Simulation of held-out stretches: a constant force of their own, and forces averaged as in regression."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import BaseModel, NumberPrior, Response, TermChoice
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.records.held_out_stretch import constant_forces, drifts
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.block_sums import LinearFit
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.simulation.held_out import simulate_held_out
from impactcell.records import Capture
from tests.discrepancy import test_ramped_axis as ramped

FREE = NumberPrior(0.0, math.inf)
MASS, VISCOUS, FORCE, OFFSET = 2.0, 4.0, 3.0, 0.2
"""kg, N s/m, N, and how far the zero of the force is off [N]."""


def _error_m(base: BaseModel) -> float:
    """Simulation error of a true model on a record of a constant force that is told wrong by its zero."""
    time = 1e-2 * np.arange(400)
    decay = np.exp(-VISCOUS * time / MASS)
    position = FORCE / VISCOUS * (time - MASS / VISCOUS * (1.0 - decay))
    record = UniformRecord(
        shot=1, label="", time_s=time, position=position, force=np.full(time.size, FORCE - OFFSET),
        inertia=MASS, covariates={}, spikes=0, noise=(0.0, 0.0),
    )  # fmt: skip
    viscous = ChosenTerm(TermChoice("viscous_friction"), 0.0)
    values = np.array([VISCOUS])
    fit = LinearFit(viscous.columns, values, values, values, np.array([False]))
    model = FittedModel(base, (viscous,), fit, 0.0, 0.0)
    finding: Any = SimpleNamespace(
        held_spans=[(0, 0.0, 4.0)], records=[record], scale=SimpleNamespace(period_s=4.1)
    )
    return simulate_held_out(finding, model).rmse


def test_the_zero_of_a_force_carries_no_part_away_where_it_is_open() -> None:
    base = BaseModel(terms=(TermChoice("viscous_friction"),))
    # Held, it drives the part OFFSET / VISCOUS t away (a ramp's RMS is its end over sqrt(3)), some of it
    # taken up by the first state.
    assert 0.5 < _error_m(base) / (OFFSET / VISCOUS * 4.0 / math.sqrt(3.0)) < 1.0
    assert _error_m(replace(base, force_offset=FREE)) < 1e-4
    half = _error_m(replace(base, force_offset=NumberPrior(0.0, 0.25 * OFFSET)))
    assert half == pytest.approx(0.5 * _error_m(base), rel=0.1)


def test_the_constant_force_of_each_lane_is_found() -> None:
    time = np.linspace(0.0, 1.0, 50)
    drift = np.stack([time**2, 3.0 * time**2], axis=1)
    out = np.stack([time, -time], axis=1)
    truth = np.array([0.5, -2.0])
    measured = [out[:, 0] + truth[0] * drift[:, 0], (out[:, 1] + truth[1] * drift[:, 1])[:30]]

    def run(constant: np.ndarray) -> np.ndarray:
        return np.tile(out, 2) + constant * np.tile(drift, 2)

    lanes = ([np.ones(50), np.full(50, 9.0)], measured)
    assert constant_forces(run, lanes, np.zeros(2), math.inf) == pytest.approx(truth, abs=1e-9)
    assert constant_forces(run, lanes, np.zeros(2), 0.4) == pytest.approx([0.4, -0.4])
    assert constant_forces(run, lanes, np.zeros(2), 0.0) == pytest.approx([0.0, 0.0])
    resting = ([np.zeros(50), np.full(50, 9.0)], measured)
    assert constant_forces(run, resting, np.zeros(2), math.inf) == pytest.approx(truth, abs=1e-9)
    free = ([np.zeros(50), np.zeros(50)], measured)
    assert constant_forces(run, free, np.array([0.1, 0.2]), math.inf) == pytest.approx([0.1, 0.2])


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, True),
        ({"force_offset": NumberPrior()}, False),
        ({"gravity_torque": NumberPrior(0.5)}, False),
        ({"gravity_torque": FREE}, False),
        ({"gravity_torque": FREE, "force_offset": FREE, "force_offset_by_record": True}, True),
        ({"response": Response.FORCE, "force_offset": FREE, "force_offset_by_record": True}, False),
        ({"response": Response.FORCE}, False),
        ({"terms": (TermChoice("restoring_force"),)}, False),
    ],
)
def test_a_part_drifts_where_nothing_pulls_it_back(changed: dict[str, Any], expected: bool) -> None:
    assert drifts(replace(BaseModel(force_offset=FREE), **changed)) is expected


@pytest.mark.slow
def test_a_predicted_force_errs_by_no_more_than_the_model_where_the_part_is_ramped() -> None:
    """Beside noise of 0.3 N a wave of 0.5 N is all that the model lacks; ramps are of 76 N."""
    base = replace(ramped.BASE, response=Response.FORCE)
    shots = [Capture(place, math.nan, math.nan, *ramped._record(place)) for place in (1, 2)]
    finding = ramped.found(Campaign(Excitation.DRIVEN, tuple(shots)), base)
    assert finding.established == ("directional_viscous_friction",)
    assert simulate_held_out(finding, finding.final).rmse < 2.0
