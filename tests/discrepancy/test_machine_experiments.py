"""Which records tell tied terms of a machine apart: proposed, then made by the true law, and told apart."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import (
    BaseModel,
    ChosenTerm,
    MachineFinding,
    NumberPrior,
    Response,
    TermChoice,
    investigate_machine,
)
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.machine.simulation import experiment_design
from impactcell.records import Capture, Channel
from tests.discrepancy.test_base_model import GRAVITY, INERTIA, pendulum, swings

pytestmark = pytest.mark.slow

FRICTION, VISCOUS, DRAG = 6.0, 40.0, 160.0
"""Of a slide: N, N s/m and N s²/m², so that either law has 10 N at 0.25 m/s."""
SPEED, STROKE = 0.25, 0.4
"""Of its strokes: m/s and m."""
BASE = BaseModel(
    response=Response.FORCE,
    inertia=NumberPrior(2.0),
    terms=(TermChoice("coulomb_friction"),),
    force_offset=NumberPrior(0.0, math.inf),
)


def strokes(number: int, pace: float, width: float, *, viscous: bool) -> Capture:
    """To and fro at one speed, round at the ends: the force is that of the equation of motion."""
    rng = np.random.default_rng(number)
    time = np.arange(0.0, 24.0 / pace, 4e-3 / pace)
    phase = 2.0 * math.pi * time * pace * SPEED / (2.0 * STROKE)
    turn = 0.98
    # asin(b sin(phase)) is a triangle with round corners; its derivatives follow from the chain rule.
    inner = turn * np.sin(phase)
    rate = 2.0 * math.pi * pace * SPEED / (2.0 * STROKE)
    slope = turn * np.cos(phase) / np.sqrt(1.0 - inner**2)
    bend = -(1.0 - turn**2) * inner / (1.0 - inner**2) ** 1.5
    size = width * STROKE / math.pi
    position, velocity, acceleration = (
        size * np.arcsin(inner),
        size * rate * slope,
        size * rate**2 * bend,
    )
    law = VISCOUS * velocity if viscous else DRAG * velocity * np.abs(velocity)
    force = 2.0 * acceleration + FRICTION * np.sign(velocity) + law
    return Capture(
        number,
        math.nan,
        math.nan,
        Channel(time, force + rng.normal(0.0, 0.3, time.size), 0.3),
        Channel(time, position + rng.normal(0.0, 2e-6, time.size), 2e-6),
    )


def slide(*records: Capture) -> MachineFinding:
    return investigate_machine(Campaign(Excitation.DRIVEN, records), BASE)


@pytest.mark.parametrize("viscous", [True, False])
def test_records_that_are_proposed_tell_the_terms_apart(viscous: bool) -> None:
    """At one speed either law is a constant beside friction; at three speeds it is not."""
    first = [strokes(number, 1.0, 1.0, viscous=viscous) for number in (1, 2, 3)]
    finding = slide(*first)
    true, other = ("viscous_friction", "quadratic_drag")[:: 1 if viscous else -1]
    assert finding.verdict == "tied"
    (proposal,) = finding.experiments
    assert set(proposal.effects) == {true, other}
    said = re.fullmatch(r"shot \d again, its motion (.*) times as fast, as often each", proposal.setting)
    assert said is not None
    assert proposal.shots == 3
    paces = [float(number) for number in re.findall(r"[\d.]+", said[1])]
    made = [strokes(4 + place, pace, 1.0, viscous=viscous) for place, pace in enumerate(paces)]
    told = slide(*first, *made)
    assert (told.verdict, told.established) == ("named", (true,))
    assert not told.experiments


def test_columns_that_went_together_are_to_be_set_apart() -> None:
    records = []
    for number in (1, 2, 3, 4):
        record = strokes(number, 1.0, 1.0, viscous=True)
        assert record.force is not None
        assert record.position is not None
        velocity = np.gradient(record.position.values)
        force = record.force.values - VISCOUS * velocity / np.gradient(record.position.time_s)
        force += 0.8 * number * np.sign(velocity)
        columns = {"load_n": float(number), "weight_kg": 0.1 * number}
        records.append(replace(record, force=Channel(record.position.time_s, force, 0.3), covariates=columns))
    campaign = Campaign(Excitation.DRIVEN, tuple(records), columns=("shot", "load_n", "weight_kg"))
    finding = investigate_machine(campaign, BASE)
    proposals = {proposal.effects: proposal for proposal in finding.experiments}
    names = ("covariate_friction(load_n)", "covariate_friction(weight_kg)")
    proposal = proposals.get(names) or proposals[names[::-1]]
    assert re.match(r"shot \d again, (load_n|weight_kg) at ", proposal.setting)
    assert proposal.shots > 0
    assert proposal.power >= 0.9


def test_a_tie_beside_another_term_is_told_apart_as_well() -> None:
    """Two laws of the speed are tied beside a third term that the base model does not have either."""
    finding = slide(*(strokes(number, 1.0, 1.0, viscous=True) for number in (1, 2, 3)))
    names = "viscous_friction", "quadratic_drag", "position_dependent_friction"
    fits = MachineFits(finding.records, BASE, [TermChoice(name) for name in names], None)
    beside = ChosenTerm(TermChoice(names[2]), fits.shapes[names[2]][0])
    final = fits.fit((*finding.final.terms, beside), settle=False)
    told = experiment_design.with_experiments(fits, replace(finding, final=final))
    (proposal,) = told.experiments
    assert set(proposal.effects) == {"viscous_friction", "quadratic_drag"}
    assert proposal.shots == finding.experiments[0].shots


@pytest.mark.parametrize(("widest", "shots"), [(2.5, 1), (0.0, 0)])
def test_a_machine_is_not_asked_to_go_where_it_does_not_reach(
    widest: float, shots: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Swings that tell two terms apart, said to be tied: once more is enough, if it may be done."""
    base = BaseModel(
        coordinate=Coordinate.ROTATION,
        inertia=NumberPrior(INERTIA),
        gravity_torque=NumberPrior(GRAVITY, math.inf),
    )
    campaign = pendulum(swings(4e-4))
    finding = investigate_machine(campaign, base)
    assert finding.established == ("quadratic_drag",)
    tied = replace(finding, steps=(replace(finding.steps[0], tied_with=("viscous_friction",)),))
    candidates = [TermChoice("quadratic_drag"), TermChoice("viscous_friction")]
    fits = MachineFits(uniform_records(campaign, base), base, candidates, None)
    monkeypatch.setattr(experiment_design, "MAX_RANGE", widest)
    (proposal,) = experiment_design.with_experiments(fits, tied).experiments
    assert proposal.effects == ("quadratic_drag", "viscous_friction")
    assert proposal.shots == shots
    assert proposal.setting.startswith("shot" if shots else "nothing")
