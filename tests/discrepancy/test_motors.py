"""Motors that run at their speeds, by scipy's integrator: what damps them is named, and no column blamed.

At its final speed all of a motor's torque goes into friction: a torque of nearly nothing follows it too.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.laws import FittedFunction
from impactcell.discrepancy.machine import (
    BaseModel,
    FallOfGap,
    MachineFinding,
    MachineLaw,
    NumberPrior,
    OpenLoopError,
    TermChoice,
    establishing,
    investigate_machine,
)
from impactcell.discrepancy.machine.better_simulated import best_simulated
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.investigation import hold_what_cannot_be_seen
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.machine.search.look_alikes import machine_parts, parts_that_may_be_off
from impactcell.records import Capture, Channel
from tests.discrepancy.machine_study import establish_in
from tests.discrepancy.test_closing_notes import filmed
from tests.discrepancy.test_column_slips import joint

INERTIA, VISCOUS, COULOMB = 1e-4, 2e-3, 5e-3
MOTOR = BaseModel(coordinate=Coordinate.ROTATION, inertia=NumberPrior(INERTIA))


def motor(*, turns_back: bool) -> Campaign:
    """Four records of a motor whose torque comes on within 20 ms and stays."""
    time = np.arange(0.0, 4.0, 2e-3)
    rng = np.random.default_rng(11)
    shots = []
    for number, level in enumerate((0.05, 0.08, 0.12, 0.16), 1):
        size = -level if turns_back and number % 2 == 0 else level

        def rate(now: float, state: list[float], size: float = size) -> list[float]:
            torque = size * (1.0 - math.exp(-now / 0.02))
            friction = VISCOUS * state[1] + COULOMB * math.tanh(state[1] / 1e-2)
            return [state[1], (torque - friction) / INERTIA]

        run = solve_ivp(rate, (0.0, 4.0), (0.0, 0.0), "LSODA", time, rtol=1e-8, atol=1e-10, max_step=0.01)
        torque = size * (1.0 - np.exp(-time / 0.02)) + rng.normal(0.0, 1e-3, time.size)
        angle = run.y[0] + rng.normal(0.0, 1e-3, time.size)
        shots.append(Capture(number, math.nan, math.nan, Channel(time, torque), Channel(time, angle)))
    return Campaign(Excitation.DRIVEN, tuple(shots), coordinate=Coordinate.ROTATION)


def strength(finding: MachineFinding, name: str) -> tuple[float, float]:
    """Interval of a strength [SI]."""
    fit = finding.final.fit
    place = fit.columns.index((name, 0.0, 0))
    return float(fit.low[place]), float(fit.high[place])


@pytest.mark.slow
def test_viscous_friction_of_a_motor_is_named_and_no_unit_is_asked_for() -> None:
    """It was told that its time is in ms, since without any torque it goes on turning."""
    finding = investigate_machine(
        motor(turns_back=True), replace(MOTOR, terms=(TermChoice("coulomb_friction"),))
    )
    assert finding.established == ("viscous_friction",)
    assert finding.is_at_floor
    low, high = strength(finding, "viscous_friction")
    assert low <= VISCOUS <= high < 1.01 * low
    assert not any("Records follow the base model with" in note for note in finding.notes)


@pytest.mark.slow
def test_of_a_motor_without_any_friction_both_are_named() -> None:
    """Neither comes near a free function of speed by itself, and both together are all of it."""
    finding = investigate_machine(motor(turns_back=True), replace(MOTOR, terms=()))
    assert finding.established == ("viscous_friction", "coulomb_friction")
    assert finding.is_at_floor
    assert finding.law is None
    for name, value in (("viscous_friction", VISCOUS), ("coulomb_friction", COULOMB)):
        low, high = strength(finding, name)
        assert low <= value <= high, name


@pytest.mark.slow
def test_a_pair_that_leaves_something_by_its_own_weights_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is found then is what is found where no pair is looked for."""
    base = BaseModel(
        coordinate=Coordinate.ROTATION, inertia=NumberPrior(0.05), gravity_torque=NumberPrior(0.8), terms=()
    )
    records = joint()
    assert set(establish_in(records, base).established) == {"viscous_friction", "coulomb_friction"}
    with monkeypatch.context() as patch:
        patch.setattr(establishing, "MAX_EXPECTED_GAP", 0.0)
        refused = establish_in(records, base)
    monkeypatch.setattr(establishing, "select_pair", lambda *_: None)
    plain = establish_in(records, base)
    assert len(refused.established) < 2
    assert (refused.verdict, refused.established) == (plain.verdict, plain.established)
    assert refused.steps[0].reason == plain.steps[0].reason != ""
    assert refused.fall.after == pytest.approx(plain.fall.after, rel=1e-9)


@pytest.mark.slow
def test_of_a_motor_that_turns_one_way_friction_is_tied_and_no_unit_is_asked_for() -> None:
    finding = investigate_machine(motor(turns_back=False), replace(MOTOR, terms=()))
    (name,) = finding.established
    assert "viscous_friction" in (name, *finding.tied_with[name])
    assert not any("Records follow the base model with" in note for note in finding.notes)
    assert any("A constant force of -0.005 N m" in note for note in finding.notes)


def test_a_drive_that_would_have_to_be_nought_explains_nothing() -> None:
    base = replace(MOTOR, terms=(TermChoice("coulomb_friction"),))
    fits = MachineFits(uniform_records(motor(turns_back=True), base), base, [], None)
    training, _ = fits.blocks()
    columns, parts = fits.columns(fits.base_terms), machine_parts(base, is_driven=True)
    known = fits.priors, fits.nonnegative
    assert "drive" in parts
    assert "drive" not in parts_that_may_be_off(training, columns, parts, known, 0.0)


@pytest.mark.slow
def test_beside_a_law_a_term_is_told_that_leaves_half_of_what_the_law_leaves() -> None:
    finding = filmed(0.05, seconds=12.0)
    better = finding.better_simulated
    assert better is not None
    base, _ = hold_what_cannot_be_seen(finding.base, finding.records)
    damping = [TermChoice(name) for name in ("viscous_friction", "quadratic_drag")]
    fits = MachineFits(finding.records, base, damping, None)

    def beside_law(rmse: float) -> bool:
        law = MachineLaw(
            "law_of_force_over_position", {}, FittedFunction(*np.zeros((4, 2))), None, (), (),
            finding.final, finding.final, FallOfGap(2.0, 1.5, 0.99, 0.9, 1.0, 1e-3),
            (finding.simulated[-1], OpenLoopError(rmse, 90.0, math.nan)),
        )  # fmt: skip
        return best_simulated(fits, replace(finding, law=law)) is not None

    assert beside_law(2.1 * better.rmse)
    assert not beside_law(1.5 * better.rmse)
