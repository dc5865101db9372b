"""Numbers that a base model holds and that are off: they are told, and are no law and no term.

Slides on paths in closed form, and a pendulum that scipy's integrator swings; what a sensor does wrong is
done to the samples, what a base model has wrong is written into it.
"""

import math
import re
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import (
    ECCENTRICITY,
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
from impactcell.discrepancy.machine.search.explained_by_numbers import Explained, held_number_notes
from impactcell.discrepancy.machine.search.held_numbers import HeldNumber, held_numbers, told_from_number
from impactcell.discrepancy.machine.search.selection import select_terms
from impactcell.discrepancy.machine.terms.rival_forms import FREE_FORMS, KNOTS
from impactcell.discrepancy.report import german_machine_sentences, german_sentences, machine_sentences
from impactcell.records import Capture, Channel, Samples
from tests.benchmarks._machine_held import FAULTS, investigated
from tests.discrepancy import stick_slip
from tests.discrepancy.test_base_model import GRAVITY, pendulum, swings

COULOMB_N, MASS_KG, NOISE_N, STEP_S = 3.0, 2.0, 0.2, 4e-3
SLIDE = BaseModel(
    response=Response.FORCE, inertia=NumberPrior(MASS_KG, 0.1), force_offset=NumberPrior(0.0, math.inf)
)
PENDULUM = BaseModel(
    coordinate=Coordinate.ROTATION,
    inertia=NumberPrior(0.02),
    gravity_torque=NumberPrior(0.55, math.inf),
    position_offset=NumberPrior(0.0, 0.05),
    force_offset=NumberPrior(0.0, 0.01),
)
EVERY = BaseModel(
    coordinate=Coordinate.ROTATION,
    response=Response.FORCE,
    inertia=NumberPrior(0.02),
    gravity_torque=NumberPrior(0.55),
)
ONE_SCALE = tuple(
    number
    for coordinate in Coordinate
    for number in held_numbers(BaseModel(coordinate=coordinate, inertia=NumberPrior(2.0)), 1e-3)
    if number.name == "force_gain"
)
"""Gains of a force that are a mass, or an inertia, as well."""
OF_NONE = tuple(
    number
    for coordinate in Coordinate
    for number in held_numbers(BaseModel(coordinate, Response.FORCE, NumberPrior()), 1e-3)
    if number.name == "inertia"
)
"""Mass and inertia where none was taken."""
GAIN_OR_MASS = (
    r" gain of the force (\S+) % (larger|smaller), or a mass (\S+) % (larger|smaller) "
    r"\(these records do not tell which\) would explain (\d+) %"
)


@lru_cache
def paths() -> tuple[Samples, Samples, Samples]:
    """Time, position and force of six paths, shapes (n,), (6, n), (6, n)."""
    rng = np.random.default_rng(11)
    time = np.arange(0.0, 12.0, STEP_S)
    positions, forces = [], []
    for _ in range(6):
        rates = 2.0 * np.pi * rng.uniform(0.3, 1.2, 3)
        angles = rates[:, None] * time + rng.uniform(0.0, 2.0 * np.pi, (3, 1))
        sizes = 0.08 * rng.uniform(0.5, 1.0, 3)
        speed = (sizes * rates) @ np.cos(angles)
        positions.append(sizes @ np.sin(angles))
        force = -MASS_KG * (sizes * rates**2) @ np.sin(angles) + COULOMB_N * np.tanh(speed / 1e-3)
        forces.append(force + NOISE_N * rng.standard_normal(time.size))
    return time, np.array(positions), np.array(forces)


def slide(late_s: float = 0.0, zero_n: float = 0.0) -> Campaign:
    time, positions, forces = paths()
    shots = [
        Capture(
            number,
            math.nan,
            math.nan,
            Channel(time, np.interp(time - late_s, time, force) + zero_n, NOISE_N),
            Channel(time, position, 1e-7),
        )
        for number, (position, force) in enumerate(zip(positions, forces, strict=True), 1)
    ]
    return Campaign(Excitation.DRIVEN, tuple(shots))


@lru_cache
def turned() -> MachineFinding:
    """A pendulum whose angle counts from 20 mrad beside the vertical, and a base model that does not know."""
    base = replace(PENDULUM, position_offset=NumberPrior())
    return investigate_machine(pendulum(swings(0.0, offset=0.02)), base)


@pytest.mark.slow
def test_a_zero_of_the_angle_that_is_held_is_told_and_is_no_law() -> None:
    finding = turned()
    assert (finding.verdict, finding.established) == ("unknown", ())
    said = machine_sentences.headline(finding)
    assert "a zero of the angle 20 mrad off would explain 100 % of it" in said
    assert finding.law is None
    assert finding.law_refused == (
        "a zero of the angle that is off does as well as any function of speed, load or position; "
        "position_offset among the nuisances of the base model would tell"
    )
    assert "ein um 20 mrad verschobener Nullpunkt des Winkels erklärte 100 %" in (
        german_machine_sentences.headline(finding)
    )


@pytest.mark.slow
def test_a_torque_of_gravity_that_is_held_wrong_is_told_with_its_size() -> None:
    base = replace(PENDULUM, gravity_torque=NumberPrior(0.95 * GRAVITY))
    finding = investigate_machine(pendulum(swings(0.0)), base)
    off = f"a torque of gravity {0.05 * GRAVITY:.2g} N m larger would explain"
    assert off in machine_sentences.headline(finding)
    assert finding.law is None
    assert "a free gravity_torque_n_m in the base model would tell" in finding.law_refused


@pytest.mark.slow
@pytest.mark.parametrize("mass_kg", [1.05 * MASS_KG, 0.9 * MASS_KG])
def test_a_mass_that_is_held_wrong_is_told_and_is_no_spring(mass_kg: float) -> None:
    """Where nothing but the mass takes force it is its product with the gain that is off; both are told."""
    finding = investigate_machine(slide(), replace(SLIDE, inertia=NumberPrior(mass_kg)))
    assert finding.established == ()
    said = " ".join(finding.notes)
    told = re.search(f"A{GAIN_OR_MASS} of what remains", said)
    assert told, said
    for size, sense in (told.groups()[:2], told.groups()[2:4]):
        assert float(size) == pytest.approx(100.0 * abs(MASS_KG / mass_kg - 1.0), rel=0.05)
        assert sense == ("smaller" if mass_kg > MASS_KG else "larger")
    assert int(told[5]) >= 95
    assert "late" not in said
    assert "early" not in said
    assert finding.law is None
    assert finding.law_refused.startswith("another gain of the force or another mass does as well")
    assert finding.law_refused.endswith(
        "force_gain among the nuisances of the base model or a free mass_kg would tell"
    )


@pytest.mark.slow
@pytest.mark.parametrize("off", [1.1, 0.92])
def test_a_mass_that_is_held_wrong_is_told_beside_the_gain_from_a_given_force(off: float) -> None:
    """A force that is larger by a share and a mass that is smaller by as much make the same motion."""
    held = NumberPrior(off * stick_slip.MASS_KG)
    campaign = stick_slip.slides(lambda rng: stick_slip.sines(4.0, rng), (0.02, 1e-5))
    finding = investigate_machine(campaign, replace(stick_slip.SLIDE, inertia=held))
    assert (finding.verdict, finding.law) == ("unknown", None)
    told = re.search(f"a{GAIN_OR_MASS} of it", machine_sentences.headline(finding))
    assert told, machine_sentences.headline(finding)
    assert (told[2], told[4]) == (("larger", "smaller") if off > 1.0 else ("smaller", "larger"))
    assert float(told[1]) == pytest.approx(100.0 * abs(off - 1.0), rel=0.05)
    assert float(told[3]) == pytest.approx(100.0 * abs(1.0 / off - 1.0), rel=0.05)
    assert int(told[5]) >= 95
    ways_out = (
        "force_gain among the nuisances of the base model or a free mass_kg finds it with everything else."
    )
    assert any(note.startswith(f"A{told[0][1:-3]}") and note.endswith(ways_out) for note in finding.notes)
    german = f"% {'kleinere' if off > 1.0 else 'größere'} Masse (diese Messungen sagen nicht, welche)"
    assert german in german_machine_sentences.headline(finding)


@pytest.mark.slow
def test_a_zero_of_the_force_that_is_held_is_told_and_is_no_law() -> None:
    finding = investigate_machine(slide(zero_n=0.5), replace(SLIDE, force_offset=NumberPrior()))
    assert finding.established == ()
    assert any(note.startswith("A constant force of -0.5 N would explain") for note in finding.notes)
    assert finding.law is None


@pytest.mark.slow
def test_a_late_force_is_told_and_is_no_law_of_the_speed() -> None:
    finding = investigate_machine(slide(late_s=6e-3), SLIDE)
    assert finding.established == ()
    [late_ms] = [
        float(told[1])
        for note in finding.notes
        if (told := re.match(r"A force recorded (\S+) ms late would explain", note))
    ]
    assert late_ms == pytest.approx(6.0, rel=0.03)
    assert finding.law is None
    way_out = "delay_s: {std: SECONDS} among the nuisances of the base model would tell"
    assert way_out in finding.law_refused
    language, said = german_sentences.reason(finding.law_refused)
    assert language == "de"
    assert said.endswith("delay_s: {std: SEKUNDEN} unter den nuisances des Grundmodells zeigte es")


def test_what_is_left_free_is_not_told_as_held() -> None:
    assert [number.name for number in held_numbers(EVERY, 1e-3)] == [
        "delay_s",
        "force_offset",
        "force_gain",
        ECCENTRICITY,
        "position_offset",
        "gravity_torque",
        "inertia",
    ]
    free = NumberPrior(0.02, math.inf)
    names = [number.name for number in held_numbers(EVERY, 1e-3)]
    for name in names:
        base = replace(EVERY, **{name: free})  # type: ignore[arg-type]
        assert name not in [number.name for number in held_numbers(base, 1e-3)]
    by_record = replace(EVERY, force_offset_by_record=True)
    assert "force_offset" not in [number.name for number in held_numbers(by_record, 1e-3)]


def test_a_translation_has_no_angle_and_a_free_motion_no_inertia_to_tell() -> None:
    slides = BaseModel(response=Response.FORCE, inertia=NumberPrior(2.0))
    assert [number.name for number in held_numbers(slides, 1e-3)] == ["delay_s", "force_offset", "force_gain"]
    assert "inertia" not in [number.name for number in held_numbers(PENDULUM, 1e-3)]
    pushed = BaseModel(inertia=NumberPrior(2.0, math.inf))
    assert [number.name for number in held_numbers(pushed, 1e-3)] == ["delay_s", "force_offset"]
    by_shot = replace(slides, inertia=NumberPrior(math.nan))
    assert "inertia" not in [number.name for number in held_numbers(by_shot, 1e-3)]


@pytest.mark.parametrize(
    ("gravity", "inertia", "is_one"),
    [
        (NumberPrior(), NumberPrior(2.0), True),
        (NumberPrior(0.5, math.inf), NumberPrior(2.0), True),
        (NumberPrior(0.5), NumberPrior(2.0), False),
        (NumberPrior(0.5, 0.1), NumberPrior(2.0), False),
        (NumberPrior(), NumberPrior(math.nan), False),
    ],
)
def test_gain_and_inertia_are_one_number_where_no_force_has_a_known_size(
    gravity: NumberPrior, inertia: NumberPrior, *, is_one: bool
) -> None:
    base = BaseModel(coordinate=Coordinate.ROTATION, inertia=inertia, gravity_torque=gravity)
    (gain,) = [number for number in held_numbers(base, 1e-3) if number.name == "force_gain"]
    assert ("or another inertia" in gain.phrase) is is_one
    assert gain.key == "force_gain among the nuisances of the base model"
    assert ("a free inertia_kg_m2" in gain.as_a_law) is is_one


@pytest.mark.parametrize(("stated", "farthest"), [(0.6, 0.3), (-0.6, 0.3), (0.0, math.inf)])
def test_a_torque_of_gravity_is_off_by_half_of_what_is_stated_at_most(stated: float, farthest: float) -> None:
    base = replace(EVERY, gravity_torque=NumberPrior(stated))
    (gravity,) = [number for number in held_numbers(base, 1e-3) if number.name == "gravity_torque"]
    assert gravity.farthest == pytest.approx(farthest)


@pytest.mark.parametrize(
    "number", [*held_numbers(EVERY, 1e-3), *ONE_SCALE, *OF_NONE], ids=lambda number: number.name
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_each_is_said_in_german(number: HeldNumber, sign: float) -> None:
    (english,) = held_number_notes([Explained(number, (sign * 0.004, 0.003)[: len(number.columns)], 0.6)])
    for text, said in (
        (english, german_sentences.note),
        (number.beside_a_law, german_sentences.note),
        (number.as_well, german_sentences.reason),
        (number.better, german_sentences.reason),
        (number.as_a_law, german_sentences.reason),
        (f"{Explained(number, (sign * 0.004, 0.003)[: len(number.columns)], 0.6).words} of it",
         german_sentences.reason),
    ):  # fmt: skip
        language, german = said(text)
        assert language == "de", text
        assert german.strip()
        assert "  " not in german


@pytest.mark.parametrize(("off", "is_refused"), [(0.04, True), (0.06, False)])
def test_an_angle_off_by_more_than_three_degrees_is_no_sensor_s(off: float, *, is_refused: bool) -> None:
    rng = np.random.default_rng(4)
    wave = rng.normal(size=600)
    speed = wave + 0.3 * rng.normal(size=600)
    one = np.ones(600)
    columns = {
        (ECCENTRICITY, 0.0, 0): wave / 0.02,
        (ECCENTRICITY, 0.0, 1): 0.0 * one,
        ("viscous_friction", 0.0, 0): speed,
    }
    columns |= {(form, 0.0, number): 0.0 * one for form in FREE_FORMS for number in range(KNOTS)}
    target = 0.5 * off * (wave + speed) / 0.02 + rng.normal(size=600)
    rows = Rows(target, columns, 0.0 * one, np.arange(600.0), one, 0.0 * one)
    number = np.arange(600) // 20
    blocks = blocks_of(rows, number, {block: block % 5 for block in range(30)})
    choice = TermChoice("viscous_friction")
    search = TermSearch(blocks, [choice], {choice.name: (0.0,)}, {}, frozenset())
    steps = select_terms(search, [])
    assert steps[0].accepted is not None
    bent = next(number for number in held_numbers(EVERY, 1e-3) if number.name == ECCENTRICITY)
    refused = told_from_number(search, [], steps, bent)
    if is_refused:
        assert [(step.accepted, step.reason) for step in refused] == [(None, bent.as_well)]
    else:
        assert refused is steps


@pytest.mark.slow
def test_an_encoder_is_told_from_swings_that_die_away() -> None:
    """Its gains scatter with the amplitude from block to block, their shares of what is left do not."""
    finding = investigated(FAULTS["an encoder 1 mrad off its centre"], 970_007)
    assert finding.established == ()
    assert any("An encoder that turns 1 mrad off its centre would explain" in note for note in finding.notes)
