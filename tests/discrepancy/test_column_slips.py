"""Columns that are turned or in another unit, and delays beyond all records: told, and nothing is named.

Paths in closed form and the forces that they need, and a pendulum that scipy's integrator swings; what is
wrong is done to the columns.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.laws import FittedFunction
from impactcell.discrepancy.machine import (
    BaseModel,
    ChosenTerm,
    FallOfGap,
    MachineFinding,
    MachineLaw,
    NumberPrior,
    OpenLoopError,
    Response,
    TermChoice,
    investigate_machine,
)
from impactcell.discrepancy.machine.column_slips import (
    ROTATION,
    TRANSLATION,
    ColumnSlip,
    with_degrees_asked_for,
)
from impactcell.discrepancy.machine.laws.law_refusal import refusal_of
from impactcell.discrepancy.machine.search.held_numbers import held_numbers
from impactcell.discrepancy.report import german_machine_sentences, german_sentences, machine_sentences
from impactcell.errors import CampaignError
from impactcell.records import Capture, Channel, Samples
from tests.discrepancy.test_base_model import pendulum, swings

MASS_KG, COULOMB_N, VISCOUS_N_S_PER_M, SPRING_N_PER_M = 2.0, 1.5, 4.0, 60.0
AXIS = BaseModel(
    inertia=NumberPrior(MASS_KG),
    terms=tuple(map(TermChoice, ("coulomb_friction", "viscous_friction", "restoring_force"))),
)
PULLED = replace(AXIS, response=Response.FORCE)
PENDULUM = BaseModel(
    coordinate=Coordinate.ROTATION,
    inertia=NumberPrior(0.02),
    gravity_torque=NumberPrior(0.55, math.inf),
    position_offset=NumberPrior(0.0, 0.05),
)
Change = Callable[[int, Samples, Samples, Samples], tuple[Samples, Samples, Samples]]


def axis(change: Change = lambda _number, *columns: columns, count: int = 4) -> Campaign:
    """Records of a path in closed form and of the force that it needs; time, force and position changed."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 10.0, 4e-3)
    shots = []
    for number in range(1, count + 1):
        rates = 2.0 * np.pi * rng.uniform(0.3, 1.2, 3)
        angles = rates[:, None] * time + rng.uniform(0.0, 2.0 * np.pi, (3, 1))
        sizes = 0.08 * rng.uniform(0.5, 1.0, 3)
        position, speed = sizes @ np.sin(angles), (sizes * rates) @ np.cos(angles)
        force = -MASS_KG * (sizes * rates**2) @ np.sin(angles) + VISCOUS_N_S_PER_M * speed
        force += SPRING_N_PER_M * position + COULOMB_N * np.tanh(speed / 1e-3)
        read = force + 0.02 * rng.standard_normal(time.size), position + 1e-6 * rng.standard_normal(time.size)
        when, pushed, moved = change(number, time, *read)
        channels = Channel(when, pushed, None), Channel(when, moved, None)
        shots.append(Capture(number, math.nan, math.nan, *channels))
    return Campaign(Excitation.DRIVEN, tuple(shots))


def joint() -> Campaign:
    """Records of a joint that is not balanced: paths in closed form and the torques that they need."""
    whole = axis()
    shots = []
    for shot in whole.shots:
        assert shot.position is not None
        time = shot.position.time_s
        rng = np.random.default_rng([6, shot.cycle])
        rates = 2.0 * np.pi * rng.uniform(0.3, 1.2, 3)
        angles = rates[:, None] * time + rng.uniform(0.0, 2.0 * np.pi, (3, 1))
        sizes = 0.4 * rng.uniform(0.5, 1.0, 3)
        angle, speed = sizes @ np.sin(angles), (sizes * rates) @ np.cos(angles)
        torque = -0.05 * (sizes * rates**2) @ np.sin(angles) + 0.8 * np.sin(angle)
        torque += 0.03 * speed + 0.03 * np.tanh(speed / 1e-3) + 2e-3 * rng.standard_normal(time.size)
        read = angle + 5e-5 * rng.standard_normal(time.size)
        channels = Channel(time, torque, None), Channel(time, read, None)
        shots.append(Capture(shot.cycle, math.nan, math.nan, *channels))
    return Campaign(Excitation.DRIVEN, tuple(shots), coordinate=Coordinate.ROTATION)


def is_told(finding: MachineFinding, words: str) -> bool:
    """Whether a slip is told in both languages, and nothing named beside it."""
    assert (finding.verdict, finding.established, finding.unconfirmed, finding.law) == (
        "unknown",
        (),
        (),
        None,
    )
    english, german = machine_sentences.headline(finding), german_machine_sentences.headline(finding)
    assert "irrt das Grundmodell, ohne Rückführung simuliert," in german
    assert german_sentences.note(finding.notes[-1])[0] == "de"
    assert f"Records follow the base model with {words}: " in finding.notes[-1]
    assert not any("would explain" in note for note in finding.notes)
    return f": with {words} the base model, simulated open loop, errs " in english


def turned(numbers: set[int]) -> Change:
    return lambda number, time, force, position: (time, -force if number in numbers else force, position)


@pytest.mark.slow
@pytest.mark.parametrize("base", [AXIS, PULLED], ids=["position", "force"])
def test_a_turned_force_is_told_and_nothing_is_named(base: BaseModel) -> None:
    assert is_told(investigate_machine(axis(turned({1, 2, 3, 4})), base), "force_n or position_m turned")


@pytest.mark.slow
def test_a_force_that_is_turned_in_one_shot_is_told_with_the_shot() -> None:
    assert is_told(investigate_machine(axis(turned({2})), AXIS), "force_n or position_m turned in shot 2")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "mass_kg", "words"),
    [
        (lambda _, t, f, q: (t, f, 1e3 * q), MASS_KG, "mass_kg in g, position_m in mm or force_n in kN"),
        (lambda _, t, f, q: (t, 1e-3 * f, q), MASS_KG, "mass_kg in g, position_m in mm or force_n in kN"),
        (lambda _, t, f, q: (1e3 * t, f, q), MASS_KG, "time_s in ms"),
        (lambda _, *columns: columns, 1e-3 * MASS_KG, "mass_kg in t or force_n in mN"),
    ],
    ids=["mm", "kN", "ms", "t"],
)
def test_another_unit_is_told_and_nothing_is_named(change: Change, mass_kg: float, words: str) -> None:
    finding = investigate_machine(axis(change), replace(AXIS, inertia=NumberPrior(mass_kg)))
    assert is_told(finding, words)


@pytest.mark.slow
def test_degrees_of_a_pendulum_are_told_and_are_no_law() -> None:
    shots = []
    for shot in swings(4e-4):
        assert shot.position is not None
        degrees = Channel(shot.position.time_s, np.degrees(shot.position.values), None)
        shots.append(replace(shot, position=degrees))
    assert is_told(investigate_machine(pendulum(tuple(shots)), PENDULUM), "angle_rad in degrees")


def test_nothing_is_asked_for_where_records_follow_the_base_model() -> None:
    finding = investigate_machine(axis(), AXIS)
    assert finding.verdict == "no_gap"
    assert not any("Records follow" in note for note in finding.notes)


@pytest.mark.slow
def test_a_name_with_which_records_are_followed_less_than_a_constant_is_not_given() -> None:
    """A mass of next to nothing, which is none of a unit: friction by the load takes the drive away."""
    finding = investigate_machine(axis(), replace(AXIS, inertia=NumberPrior(1e-9)))
    assert (finding.verdict, finding.established, finding.law) == ("unknown", (), None)
    assert finding.unconfirmed == ("load_dependent_friction",)
    note = next(note for note in finding.notes if "a constant" in note)
    language, said = german_sentences.note(note)
    assert (language, "eine Konstante um" in said) == ("de", True)


@pytest.mark.slow
def test_no_law_is_proposed_with_which_records_are_followed_less_than_a_constant() -> None:
    found = investigate_machine(axis(), AXIS)

    def refused(gap: float, fit_percent: float) -> str:
        law = MachineLaw(
            "law_of_force_over_position", (0.0, 1.0), FittedFunction(*np.zeros((4, 2))), None, (), (),
            found.final, found.final, FallOfGap(50.0, gap, 0.99, 0.9, 1.0, 1e-3),
            (OpenLoopError(0.5, -40.0, math.nan), OpenLoopError(0.4, fit_percent, math.nan)),
        )  # fmt: skip
        return refusal_of(found, law, 1)

    assert refused(5.0, 20.0) == refused(1.1, -10.0) == ""
    assert "errs more on held-out records than a constant" in refused(5.0, -10.0)


def test_a_wave_of_a_turn_in_degrees_is_asked_about() -> None:
    found = investigate_machine(pendulum(swings(0.0)[:3]), PENDULUM)

    def said_of(period: float) -> tuple[str, ...]:
        wave = ChosenTerm(TermChoice("periodic_force"), period)
        final = replace(found.final, terms=(*found.final.terms, wave))
        return with_degrees_asked_for(replace(found, final=final)).notes[len(found.notes) :]

    assert said_of(300.0) == said_of(2.0 * math.pi) == ()
    (asked,) = said_of(359.2)
    assert asked == "A period of 359 rad is a turn in degrees: see whether angle_rad is in degrees."
    assert german_sentences.note(asked) == (
        "de", "Eine Periode von 359 rad ist eine Umdrehung in Grad: nachsehen, ob angle_rad in Grad ist."
    )  # fmt: skip


@pytest.mark.parametrize("slip", [*TRANSLATION, *ROTATION], ids=lambda slip: slip.words)
def test_every_unit_is_said_in_german(slip: ColumnSlip) -> None:
    told = replace(slip, error=0.0123)
    language, said = german_sentences.reason(told.reason)
    assert (language, said.endswith("simuliert, 0,012-mal so viel")) == ("de", True)
    assert " or " not in said
    assert german_sentences.note(told.note)[0] == "de"


@pytest.mark.parametrize("delay_s", [30.0, -3.0])
def test_a_delay_of_the_size_of_a_record_is_refused(delay_s: float) -> None:
    base = replace(AXIS, delay_s=NumberPrior(delay_s))
    with pytest.raises(CampaignError, match=r"delay_s is .* s, and shot 1 lasts 10 s: .*0\.003 for 3 ms"):
        investigate_machine(axis(count=1), base)


def test_no_delay_is_told_beyond_a_quarter_of_a_period() -> None:
    delay = next(one for one in held_numbers(AXIS, 4e-3, period_s=1.2) if one.is_delay)
    assert delay.is_possible([-0.29])
    assert not delay.is_possible([46.0])


def test_an_encoder_is_told_up_to_three_degrees_and_an_inertia_beside_known_gravity() -> None:
    base = replace(PENDULUM, gravity_torque=NumberPrior(0.55))
    numbers = {one.name: one for one in held_numbers(base, 1e-3)}
    assert not numbers["position_eccentricity"].is_possible([0.05, 0.03])
    assert numbers["position_eccentricity"].is_possible([0.03, 0.02])
    assert numbers["inertia"].is_possible([-0.048])
    swinging = held_numbers(base, 1e-3, is_driven=False)
    assert "inertia" not in [one.name for one in swinging], "of a free swing only gravity over inertia shows"


@pytest.mark.slow
def test_an_inertia_that_is_held_wrong_beside_known_gravity_is_told_and_no_encoder() -> None:
    base = BaseModel(
        coordinate=Coordinate.ROTATION,
        inertia=NumberPrior(0.0525),
        gravity_torque=NumberPrior(0.8),
        terms=(TermChoice("coulomb_friction"), TermChoice("viscous_friction")),
    )
    finding = investigate_machine(joint(), base)
    assert finding.established == ()
    assert "an inertia 4.8 % smaller would explain 100 % of it" in machine_sentences.headline(finding)
    assert "eine um 4,8 % kleinere Trägheit erklärte 100 %" in german_machine_sentences.headline(finding)
    assert not any("encoder" in note or "gravity would" in note for note in finding.notes)


@pytest.mark.slow
def test_a_mass_where_none_was_taken_is_told_by_its_size() -> None:
    finding = investigate_machine(axis(), replace(PULLED, inertia=NumberPrior(0.0)))
    assert (finding.verdict, finding.established, finding.law) == ("unknown", (), None)
    assert "a mass of 2 kg would explain 100 % of it" in machine_sentences.headline(finding)
    assert "eine Masse von 2 kg erklärte 100 % davon" in german_machine_sentences.headline(finding)
    assert finding.notes[-1].endswith(
        ": a free mass_kg above 0 in the base model finds it with everything else."
    )
    language, said = german_sentences.note(finding.notes[-1])
    assert (language, "ein freies mass_kg über 0 im Grundmodell" in said) == ("de", True)


def test_no_mass_below_nought_is_told() -> None:
    (mass,) = [one for one in held_numbers(replace(PULLED, inertia=NumberPrior()), 1e-3) if one.is_positive]
    assert mass.is_possible([2.0])
    assert not mass.is_possible([-2.0])
