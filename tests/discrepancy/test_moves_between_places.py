"""An axis that moves from place to place and rests there: position in, force out, exact by closed form."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import (
    BaseModel,
    MachineFinding,
    NumberPrior,
    Response,
    TermChoice,
    investigate_machine,
)
from impactcell.discrepancy.machine.regression.block_sums import blocks_of
from impactcell.discrepancy.machine.regression.trials import TermSearch
from impactcell.discrepancy.machine.regression.weak_form import Rows
from impactcell.discrepancy.machine.search.held_numbers import (
    DELAY,
    HeldNumber,
    held_numbers,
    told_from_number,
)
from impactcell.discrepancy.machine.search.selection import SelectionStep, select_terms
from impactcell.discrepancy.machine.terms.rival_forms import FREE_FORMS, KNOTS
from impactcell.records import Capture, Channel, Samples

MASS_KG, COULOMB_N, VISCOUS_N_S_PER_M = 2.0, 1.5, 4.0
RATE_HZ, DURATION_S = 500.0, 20.0
AXIS = BaseModel(
    response=Response.FORCE,
    inertia=NumberPrior(MASS_KG, math.inf),
    terms=(TermChoice("coulomb_friction"), TermChoice("viscous_friction")),
    force_offset=NumberPrior(0.0, 1.0),
)
NOTHING: Callable[[Samples, Samples], Samples] = lambda place, _speed: 0.0 * place  # noqa: E731


def moves(rng: np.random.Generator, time: Samples) -> tuple[Samples, Samples, Samples]:
    """Position, speed and acceleration of moves over 0.5 m, ramped up and down, with rests between them."""
    place, speed, acceleration = np.zeros((3, time.size))
    begin, here, ramp_s = 0.0, 0.0, 0.07
    while begin < time[-1]:
        begin += rng.uniform(0.1, 0.5)
        there, cruise_s = rng.uniform(0.0, 0.5), rng.uniform(0.3, 2.0)
        top = (there - here) / (ramp_s + cruise_s)
        for sign, onset in ((1.0, begin), (-1.0, begin + ramp_s + cruise_s)):
            share = (time - onset) / ramp_s
            inside = np.clip(share, 0.0, 1.0)
            turn = 2.0 * math.pi * inside
            acceleration += sign * top / ramp_s * (1.0 - np.cos(turn))
            speed += sign * top * (inside - np.sin(turn) / (2.0 * math.pi))
            gone = 0.5 * inside**2 + (np.cos(turn) - 1.0) / (2.0 * math.pi) ** 2
            place += sign * top * ramp_s * (gone + np.maximum(share - 1.0, 0.0))
        speed[time >= begin + 2.0 * ramp_s + cruise_s] = 0.0
        begin, here = begin + 2.0 * ramp_s + cruise_s, there
    return place, speed, acceleration


def axis(
    beside: Callable[[Samples, Samples], Samples] = NOTHING,
    viscous: float = VISCOUS_N_S_PER_M,
    late_s: float = 0.0,
) -> Campaign:
    """Nine records; at rest friction holds any share of itself."""
    shots = []
    for number in range(1, 10):
        rng = np.random.default_rng([5, number])
        time = np.arange(0.0, DURATION_S, 1.0 / RATE_HZ)
        place, speed, acceleration = moves(rng, time)
        held = np.repeat(rng.uniform(-1.0, 1.0, time.size // 50 + 1), 50)[: time.size]
        friction = COULOMB_N * np.where(speed == 0.0, held, np.sign(speed))
        force = MASS_KG * acceleration + friction + viscous * speed + beside(place, speed)
        channels = (
            Channel(time, force + rng.normal(0.0, 0.02, time.size), None),
            Channel(time, place + rng.normal(0.0, 1e-6, time.size), None),
        )
        shots.append(Capture(number, math.nan, math.nan, *channels))
    return Campaign(Excitation.DRIVEN, tuple(shots))


def strength(finding: MachineFinding, name: str) -> float:
    """First strength of a term of the final model."""
    term = next(term for term in finding.final.terms if term.choice.name == name)
    return finding.final.value(term.columns[0])


@pytest.mark.slow
def test_nothing_is_hidden_in_an_axis_that_rests_between_its_moves() -> None:
    finding = investigate_machine(axis(), AXIS)
    assert finding.verdict == "no_gap"
    assert strength(finding, "coulomb_friction") == pytest.approx(COULOMB_N, rel=2e-3)
    assert strength(finding, "viscous_friction") == pytest.approx(VISCOUS_N_S_PER_M, rel=2e-3)


def search_of(delayed: float, viscous: float) -> tuple[TermSearch, list[SelectionStep]]:
    """Blocks in which a force's derivative and a speed go nearly together, and what is selected of them."""
    rng = np.random.default_rng(2)
    derivative = rng.normal(size=600)
    speed = derivative + 0.3 * rng.normal(size=600)
    one = np.ones(600)
    columns = {DELAY: derivative, ("viscous_friction", 0.0, 0): speed}
    columns |= {(form, 0.0, number): 0.0 * one for form in FREE_FORMS for number in range(KNOTS)}
    target = delayed * derivative + viscous * speed + rng.normal(size=600)
    rows = Rows(target, columns, 0.0 * one, np.arange(600.0), one, 0.0 * one)
    number = np.arange(600) // 20
    blocks = blocks_of(rows, number, {block: block % 5 for block in range(30)})
    choice = TermChoice("viscous_friction")
    search = TermSearch(blocks, [choice], {choice.name: (0.0,)}, {}, frozenset())
    return search, select_terms(search, [])


def late_by(sample_s: float) -> HeldNumber:
    """A force that is late or early by up to a sample."""
    late, *_ = held_numbers(AXIS, sample_s)
    assert late.columns == (DELAY,)
    return late


def test_a_search_of_one_term_and_of_none_ends() -> None:
    search, steps = search_of(delayed=0.0, viscous=2.0)
    assert [step.accepted is not None for step in steps] == [True]
    assert select_terms(replace(search, candidates=()), []) == []


def test_no_term_is_named_that_a_delay_of_less_than_a_sample_explains_as_well() -> None:
    search, steps = search_of(delayed=1.0, viscous=1.0)
    assert steps[0].accepted is not None
    refused = told_from_number(search, [], steps, late_by(2.5))
    assert [(step.accepted, step.reason) for step in refused] == [(None, late_by(2.5).as_well)]


def test_no_term_is_named_that_any_delay_explains_better() -> None:
    search, steps = search_of(delayed=2.0, viscous=0.0)
    assert steps[0].accepted is not None
    for sample_s in (1.5, 2.5):
        refused = told_from_number(search, [], steps, late_by(sample_s))
        assert [(step.accepted, step.reason) for step in refused] == [(None, late_by(sample_s).better)]


def test_a_delay_of_more_than_a_sample_or_that_explains_less_is_no_rival() -> None:
    for (delayed, viscous), sample_s in (((1.0, 1.0), 1.5), ((0.0, 2.0), 2.5)):
        search, steps = search_of(delayed, viscous)
        assert told_from_number(search, [], steps, late_by(sample_s)) is steps


@pytest.mark.slow
def test_what_leaves_a_gap_is_not_tied_with_what_leaves_none() -> None:
    """Quadratic drag closes nine tenths of it, and leaves a gap that viscous friction does not."""
    knows_less = replace(AXIS, terms=AXIS.terms[:1])
    finding = investigate_machine(axis(), knows_less)
    assert finding.verdict == "named"
    assert finding.established == ("viscous_friction",)
    assert finding.fall.before > 30.0
    assert finding.fall.after < finding.expected[1]


@pytest.mark.slow
def test_a_period_is_found_between_the_points_of_its_grid() -> None:
    finding = investigate_machine(axis(lambda place, _: 0.2 * np.sin(2.0 * math.pi * place / 0.06)), AXIS)
    assert finding.established == ("periodic_force",)
    assert finding.fall.after < finding.expected[1]
    assert finding.final.terms[-1].shape == pytest.approx(0.06, rel=1e-3)
    assert finding.law is None
