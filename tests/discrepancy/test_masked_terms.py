"""Friction by a column, hidden by the speed that falls where the column rises."""

import math

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import MachineFinding, investigate_machine
from impactcell.records import Capture, Channel
from tests.discrepancy.test_base_model import SEAL

pytestmark = pytest.mark.slow

COLUMN = "covariate_friction(pressure_bar)"
SPEEDS = ((10.6e-3, 12.5e-3), (8.3e-3, 12.2e-3), (5.6e-3, 11.7e-3), (7.0e-3, 14.1e-3))
"""Out and back under 1, 3, 5 and 7 bar, as those of a real drive that is pressed against [m/s]."""
STROKE = 0.036
"""[m]."""


def investigate(viscous: float, per_bar: float) -> MachineFinding:
    """A piston with friction of 2 N, so much a bar and so much by speed, and a wave that no term has."""
    rng = np.random.default_rng(5)
    shots = []
    for number, (pressure, (out, back)) in enumerate(zip((1.0, 3.0, 5.0, 7.0), SPEEDS, strict=True), 1):
        time = np.arange(0.0, 60.0, 1e-2)
        phase = np.mod(time, STROKE / out + STROKE / back)
        position = np.where(phase < STROKE / out, out * phase, STROKE - back * (phase - STROKE / out))
        window = np.hanning(25) / np.hanning(25).sum()
        position = np.convolve(np.pad(position, 12, mode="reflect", reflect_type="odd"), window, "valid")
        velocity = np.gradient(position, time)
        force = -50.0 * pressure + (2.0 + per_bar * pressure) * np.tanh(velocity / 2e-4)
        force += viscous * velocity + 0.3 * np.sin(2.0 * np.pi * position / 0.03 + number)
        channels = (
            Channel(time, force + rng.normal(0.0, 0.03, time.size), 0.03),
            Channel(time, position + rng.normal(0.0, 1e-6, time.size), 1e-6),
        )
        shots.append(Capture(number, math.nan, math.nan, *channels, covariates={"pressure_bar": pressure}))
    campaign = Campaign(Excitation.DRIVEN, tuple(shots), columns=("shot", "pressure_bar"))
    return investigate_machine(campaign, SEAL)


@pytest.mark.parametrize(("viscous", "per_bar"), [(300.0, 0.3), (500.0, 0.5)])
def test_friction_by_a_column_shows_beside_the_speed_that_hides_it(viscous: float, per_bar: float) -> None:
    finding = investigate(viscous, per_bar)
    assert finding.steps[0].beside == "viscous_friction"
    assert finding.steps[0].trials[0].z < 3.0
    assert finding.established == (COLUMN,)
    assert finding.falls[COLUMN].low > 0.0
    assert any(f"{COLUMN} shows only beside viscous_friction" in note for note in finding.notes)
    place = [column[0] for column in finding.final.fit.columns].index(COLUMN)
    assert finding.final.fit.coefficients[place] == pytest.approx(per_bar, rel=0.35)


def test_what_shows_by_itself_is_not_said_to_be_hidden() -> None:
    finding = investigate(300.0, 0.8)
    assert finding.established == (COLUMN,)
    assert finding.steps[0].beside == ""
    assert not any("shows only beside" in note for note in finding.notes)


def test_where_nothing_goes_by_the_column_it_is_not_named_beside_anything() -> None:
    for viscous in (0.0, 300.0, 1000.0):
        finding = investigate(viscous, 0.0)
        assert COLUMN not in {name for one in finding.established for name in (one, *finding.tied_with[one])}
