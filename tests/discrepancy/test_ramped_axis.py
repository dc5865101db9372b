"""An axis that is ramped up fast and then runs: a ramp is not averaged away, nor is half a lap one block."""

import math

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import CATALOGUE, BaseModel, MachineFinding, NumberPrior, TermChoice
from impactcell.discrepancy.machine.establishing import establish
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.records.motion_scale import motion_scale
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.records import Capture, Channel

MASS, COULOMB, VISCOUS, DIFFERS = 95.0, 20.0, 200.0, -37.0
"""kg, N, and N s/m: both ways, and the part that differs by direction."""
STEP_S, RAMP_S, ACCELERATION = 1e-3, 0.12, 0.8
NOISE_M = 2e-7


def _record(seed: int) -> tuple[Channel, Channel]:
    """25 s to and fro, ramps of 0.12 s and seconds between them; force by the law, motion in closed form."""
    rng = np.random.default_rng(seed)
    acceleration = []
    for sign in (1.0, -1.0) * 8:
        run = round(rng.uniform(0.5, 1.7) / STEP_S)
        ramp = round(RAMP_S * rng.uniform(0.4, 1.0) / STEP_S)
        pause = round(0.15 / STEP_S)
        acceleration += [sign] * ramp + [0.0] * run + [-sign] * ramp + [0.0] * pause
    a = ACCELERATION * np.array(acceleration)
    v = np.concatenate([[0.0], np.cumsum(a[:-1])]) * STEP_S
    q = np.concatenate([[0.0], np.cumsum(v[:-1] + 0.5 * STEP_S * a[:-1])]) * STEP_S
    v[np.abs(v) < 1e-9] = 0.0
    # Model error that no term has: a wave over the position, a hundredth of the force.
    force = MASS * a + COULOMB * np.sign(v) + VISCOUS * v + DIFFERS * np.abs(v) + 0.5 * np.sin(q / 4e-3)
    force = force - COULOMB * np.sign(v) * (v == 0.0)
    time = STEP_S * np.arange(q.size)
    q = q + NOISE_M * rng.standard_normal(q.size)
    force = force + 0.3 * rng.standard_normal(q.size)
    return Channel(time, force, None), Channel(time, q, None)


BASE = BaseModel(
    inertia=NumberPrior(1.1 * MASS, 0.1 * MASS), force_offset=NumberPrior(0.0, math.inf),
    terms=(TermChoice("coulomb_friction"), TermChoice("viscous_friction")),
)  # fmt: skip


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    shots = [Capture(place, math.nan, math.nan, *_record(place)) for place in (1, 2)]
    return Campaign(Excitation.DRIVEN, tuple(shots))


def found(campaign: Campaign, base: BaseModel) -> MachineFinding:
    """What is named where the second record is held out; no law is looked for."""
    others = [
        TermChoice(name)
        for name, term in CATALOGUE.items()
        if not (term.needs_covariate or term.has_memory or TermChoice(name) in base.terms)
    ]
    return establish(MachineFits(uniform_records(campaign, base), base, others, {1}), [], 0)


@pytest.fixture(scope="module")
def finding(campaign: Campaign) -> MachineFinding:
    return found(campaign, BASE)


@pytest.mark.slow
def test_two_records_of_a_ramped_axis_are_enough(finding: MachineFinding) -> None:
    assert finding.verdict == "named"
    assert finding.established == ("directional_viscous_friction",)


@pytest.mark.slow
def test_mass_and_friction_are_those_that_went_in(finding: MachineFinding) -> None:
    mass = 1.1 * MASS * (1.0 + finding.final.nuisance("inertia"))
    assert mass == pytest.approx(MASS, rel=0.02)
    expected = {
        "coulomb_friction": COULOMB,
        "viscous_friction": VISCOUS,
        "directional_viscous_friction": DIFFERS,
    }
    for name, value in expected.items():
        assert finding.final.value((name, 0.0, 0)) == pytest.approx(value, rel=0.05)


def _period_s(*channels: Channel) -> float:
    campaign = Campaign(Excitation.DRIVEN, (Capture(1, math.nan, 2.0, *channels),))
    return motion_scale(uniform_records(campaign, BASE), BASE.response, 0.0).period_s


def test_a_sine_is_averaged_by_its_own_period() -> None:
    time = 2e-3 * np.arange(6000)
    position = 0.1 * np.sin(2.0 * np.pi * time / 1.5)
    position += 1e-5 * np.random.default_rng(5).standard_normal(time.size)
    period = _period_s(Channel(time, np.zeros(time.size), None), Channel(time, position, None))
    assert period == pytest.approx(1.5, rel=0.02)


def test_what_is_left_where_faulty_samples_were_replaced_is_no_ramp() -> None:
    rng = np.random.default_rng(6)
    force, position = _record(1)
    values = position.values.copy()
    values[rng.choice(values.size, values.size // 200, replace=False)] += 0.05
    faulty = Channel(position.time_s, values, None)
    assert _period_s(force, faulty) == pytest.approx(_period_s(force, position), rel=0.5)
