"""A drive that is spun up by steps of its torque and never comes back, as of motors on a test bench.

scipy's integrator spins it, and an encoder of 10 000 lines reads it. Friction takes nearly all of the drive.
"""

import math
from dataclasses import replace
from functools import lru_cache

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
    TermChoice,
    investigate_machine,
)
from impactcell.discrepancy.machine.laws.law_refusal import refusal_of
from impactcell.discrepancy.machine.search.look_alikes import one_way_note
from impactcell.discrepancy.report import german_sentences
from impactcell.records import Capture, Channel, Samples
from tests.discrepancy.machine_study import establish_in

INERTIA, COULOMB, VISCOUS, ZERO = 1.2e-4, 0.012, 1.2e-4, -0.009
"""kg m², N m, N m s/rad, and the zero of the torque [N m]."""
STEP_S, LINE = 8e-3, 2.0 * math.pi / 1e4
TORQUES = ((0.05, 0.06), (0.05, 0.065), (0.052, 0.062), (-0.03, -0.04), (-0.03, -0.045), (-0.032, -0.042))
"""Before and after 10 s, of one record each [N m]."""


@lru_cache
def campaign(saturating: float) -> Campaign:
    """Twelve records of 20 s; `saturating` is a friction that speed brings up to so many newton metres."""
    time = np.arange(0.0, 20.0, STEP_S)
    levels = np.array(TORQUES * 2).T
    numbers = range(1, levels.shape[1] + 1)
    warm = np.array([1.0 + 0.02 * np.random.default_rng(number).standard_normal() for number in numbers])

    def rates(seconds: float, state: np.ndarray) -> np.ndarray:
        _, speed = state.reshape(2, -1)
        friction = warm * (COULOMB * np.tanh(speed / 0.1) + VISCOUS * speed)
        friction += saturating * np.tanh(speed / 80.0)
        return np.concatenate([speed, (levels[int(seconds >= 10.0)] + ZERO - friction) / INERTIA])

    rest = np.zeros(2 * warm.size)
    paths = solve_ivp(rates, (0.0, 20.0), rest, t_eval=time, rtol=1e-8, atol=1e-8, max_step=0.05).y
    shots = []
    for number, torques, path in zip(numbers, levels.T, paths[: warm.size], strict=True):
        command, read = np.where(time < 10.0, *torques), LINE * np.round(path / LINE)
        shots.append(
            Capture(number, math.nan, math.nan, Channel(time, command, None), Channel(time, read, None))
        )
    return Campaign(Excitation.DRIVEN, tuple(shots), coordinate=Coordinate.ROTATION)


BASE = BaseModel(
    coordinate=Coordinate.ROTATION,
    inertia=NumberPrior(INERTIA, math.inf),
    terms=(TermChoice("coulomb_friction"), TermChoice("viscous_friction")),
    force_offset=NumberPrior(0.0, math.inf),
)


@lru_cache
def established() -> MachineFinding:
    """What is established with one record of each drive, before a law is looked for."""
    whole = campaign(0.0)
    return establish_in(replace(whole, shots=whole.shots[: len(TORQUES)]), BASE)


@pytest.mark.slow
def test_what_never_comes_back_has_blocks_enough_and_shows_its_inertia_and_no_law() -> None:
    finding = investigate_machine(campaign(0.0), BASE)
    assert finding.law is None
    assert len(finding.training) > 5 * 8  # of eight records
    assert finding.final.nuisance("inertia") == pytest.approx(0.0, abs=0.1)
    assert finding.final.nuisance("force_offset") == pytest.approx(ZERO, rel=0.05)


def test_a_law_that_cancels_the_drive_is_none() -> None:
    """The level of friction, another by 2 % in each record, is no function of the drive."""
    finding = established()
    final = finding.final
    place = final.fit.columns.index(("inertia", 0.0, 0))

    def law_with(inertia: float) -> MachineLaw:
        """Make one whose inertia is so many times that without it."""
        coefficients = final.fit.coefficients.copy()
        coefficients[place] = inertia * (1.0 + coefficients[place]) - 1.0
        model = replace(final, fit=replace(final.fit, coefficients=coefficients))
        curve = FittedFunction(*np.zeros((4, 2)))
        fall = FallOfGap(5.0, 1.0, 0.99, 0.9, 1.0, 1e-3)
        name = "law_of_friction_over_load"
        return MachineLaw(name, {"load": (0.0, 1.0)}, curve, None, (), (), final, model, fall, None)

    assert refusal_of(finding, law_with(0.5), 1) == ""
    refused = refusal_of(finding, law_with(0.01), 1)
    assert refused == (
        "the law that fits best stands in for the drive: with it the inertia would be 0.01 times what it is "
        "without"
    )
    assert german_sentences.reason(refused) == (
        "de",
        "das beste Gesetz steht für den Antrieb: Mit ihm wäre die Trägheit das 0,01-fache von der ohne",
    )


@pytest.mark.slow
@pytest.mark.parametrize("zero_is_free", [True, False])
def test_friction_that_saturates_is_found_over_the_speed(zero_is_free: bool) -> None:
    """Also where the zero of the torque is held, which is 99 % of what remains then."""
    zero = NumberPrior(0.0, math.inf if zero_is_free else 0.0)
    finding = investigate_machine(campaign(0.02), replace(BASE, force_offset=zero))
    law = finding.law
    assert law is not None
    assert law.place == "law_of_friction_over_speed"
    assert "law_of_friction_over_load" not in law.rival_places
    assert law.beside == (() if zero_is_free else ("a constant force",))
    assert law.simulated is not None
    without, with_it = law.simulated
    assert with_it.rmse < 0.5 * without.rmse
    assert any("explains nearly all that any function" in note for note in finding.notes) is not zero_is_free
    assert law.choice is not None
    assert law.choice.law is not None
    speed = np.linspace(20.0, 0.95 * law.tested["speed"][1], 60)
    sizes = [law.model.value(column) for column in law.model.terms[-1].columns]
    parts = [item.values(speed, law.choice.law.reference) for item in law.choice.law.terms]
    found = sum((size * part for size, part in zip(sizes, parts, strict=True)), np.zeros(60))
    beside = np.stack([np.ones(60), speed], axis=1)  # which friction of the base model takes up

    def bent(curve: Samples) -> Samples:
        return curve - beside @ np.linalg.lstsq(beside, curve, rcond=None)[0]

    truth = bent(0.02 * np.tanh(speed / 80.0))
    assert np.sqrt(np.mean((bent(found) - truth) ** 2)) < 0.2 * np.sqrt(np.mean(truth**2))


def test_a_function_of_position_may_be_one_of_time_where_every_record_goes_one_way() -> None:
    records = established().records
    (note,) = one_way_note(records)
    assert german_sentences.note(note)[0] == "de"
    there = records[0]
    and_back = replace(there, position=there.position * (there.time_s[-1] - there.time_s))
    assert not one_way_note([*records, and_back])
