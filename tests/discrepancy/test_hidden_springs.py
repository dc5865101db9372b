"""Springs that a base model lacks: named on a translation, and not told from gravity in small angles.

An axis on paths in closed form, slides by Moreau's steps, and oscillations that die away in closed form.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import (
    BaseModel,
    MachineFinding,
    NumberPrior,
    TermChoice,
    investigate_machine,
)
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.search.look_alikes import (
    like_the_machine,
    machine_parts,
    parts_that_may_be_off,
)
from impactcell.discrepancy.report import german_machine_sentences, german_sentences, machine_sentences
from impactcell.records import Capture, Channel, Samples
from tests.discrepancy.stick_slip import SLIDE, VISCOUS_N_S_PER_M, sines, slides
from tests.discrepancy.test_base_model import GRAVITY, pendulum, swings
from tests.discrepancy.test_moves_between_places import AXIS, axis, strength

pytestmark = pytest.mark.slow

INERTIA, STIFFNESS, VISCOUS = 0.02, 0.5, 0.004
"""Of what oscillates [kg m², N m/rad and N m s/rad; the same in kg and N/m]."""
WIDE, NARROW = (2.0, 1.8, 1.5, 1.9), (0.1, 0.08, 0.12, 0.09)
"""Amplitudes [rad or m]."""
SPRING = TermChoice("restoring_force")


def decays(amplitudes: Sequence[float], coordinate: Coordinate) -> Campaign:
    """Free oscillations, one a record."""
    time = np.arange(0.0, 20.0, 0.01)
    decay = 0.5 * VISCOUS / INERTIA
    rate = math.sqrt(STIFFNESS / INERTIA - decay**2)
    wave = np.exp(-decay * time) * (np.cos(rate * time) + decay / rate * np.sin(rate * time))
    shots = []
    for number, amplitude in enumerate(amplitudes, 1):
        read = amplitude * wave + np.random.default_rng([7, number]).normal(0.0, 1e-4, time.size)
        shots.append(Capture(number, math.nan, math.nan, None, Channel(time, read, None)))
    return Campaign(Excitation.FREE_SLIDE, tuple(shots), coordinate=coordinate)


def oscillates(coordinate: Coordinate) -> BaseModel:
    """Everything that oscillations have but the spring."""
    terms = (TermChoice("viscous_friction"),)
    return BaseModel(coordinate=coordinate, inertia=NumberPrior(INERTIA), terms=terms)


def is_said(finding: MachineFinding) -> None:
    """See that every note and the headline are there in German."""
    assert all(german_sentences.note(note)[0] == "de" for note in finding.notes)
    assert "Rückstellkraft" in german_machine_sentences.headline(finding)


def test_a_spring_on_an_axis_is_named_where_the_force_is_predicted() -> None:
    finding = investigate_machine(axis(lambda q, _: 40.0 * q), AXIS)
    assert (finding.verdict, finding.established) == ("named", ("restoring_force",))
    assert finding.is_at_floor
    assert strength(finding, "restoring_force") == pytest.approx(40.0, rel=1e-3)
    assert not any("not looked for" in note for note in finding.notes)


@pytest.mark.slow
def test_a_spring_on_a_slide_is_named_where_the_position_is_predicted() -> None:
    campaign = slides(lambda rng: sines(4.0, rng), (0.02, 1e-5), spring_n_per_m=20.0)
    finding = investigate_machine(campaign, SLIDE)
    assert (finding.verdict, finding.established) == ("named", ("restoring_force",))
    assert finding.is_at_floor
    assert strength(finding, "restoring_force") == pytest.approx(20.0, rel=5e-3)
    assert strength(finding, "viscous_friction") == pytest.approx(VISCOUS_N_S_PER_M, rel=5e-3)
    assert not any("of what remains" in note for note in finding.notes)


def test_a_spring_is_named_of_free_oscillations() -> None:
    finding = investigate_machine(decays(NARROW, Coordinate.TRANSLATION), oscillates(Coordinate.TRANSLATION))
    assert (finding.verdict, finding.established) == ("named", ("restoring_force",))
    assert strength(finding, "restoring_force") == pytest.approx(STIFFNESS, rel=1e-3)


def test_a_spring_and_gravity_are_tied_in_small_angles_and_told_in_wide_ones() -> None:
    base = oscillates(Coordinate.ROTATION)
    small, wide = (investigate_machine(decays(sizes, Coordinate.ROTATION), base) for sizes in (NARROW, WIDE))
    assert small.verdict == "tied"
    assert small.tied_with == {"restoring_force": ("gravity_torque",)}
    assert "restoring force or gravity torque, which these records cannot tell apart" in (
        machine_sentences.headline(small)
    )
    assert "Rückstellkraft oder Schweremoment" in german_machine_sentences.headline(small)
    assert any(note.startswith("Where gravity acts, gravity_torque_n_m is free") for note in small.notes)
    is_said(small)
    assert not small.experiments
    assert (wide.verdict, wide.established) == ("named", ("restoring_force",))
    assert strength(wide, "restoring_force") == pytest.approx(STIFFNESS, rel=1e-3)


def swings_of(spring: float, amplitudes: Sequence[float]) -> Campaign:
    """Free swings of a pendulum with a linear spring, one a record."""
    time, shots = np.arange(0.0, 12.0, 2e-3), []
    for number, amplitude in enumerate(amplitudes, 1):

        def rates(_t: float, state: np.ndarray) -> tuple[float, float]:
            angle, speed = state
            held = GRAVITY * math.sin(angle) + spring * angle + 0.002 * math.tanh(speed / 1e-3)
            return speed, -held / INERTIA

        run = solve_ivp(rates, (0.0, 12.0), (amplitude, 0.0), "LSODA", time, rtol=1e-8, atol=1e-9)
        read = run.y[0] + np.random.default_rng([8, number]).normal(0.0, 1e-4, time.size)
        shots.append(Capture(number, math.nan, math.nan, None, Channel(time, read, None)))
    return pendulum(tuple(shots))


@pytest.mark.parametrize(
    ("spring", "amplitudes", "established", "tied"),
    [
        (0.03, (1.2, 0.9, 1.3, 0.8, 1.1), ("restoring_force",), ("hardening_spring",)),
        (0.03, (2.6, 1.5, 2.0, 1.0, 2.3), ("restoring_force",), ()),
        (0.0, (1.2, 0.9, 1.3, 0.8, 1.1), (), ()),
    ],
)
def test_a_spring_beside_gravity_that_is_free_is_no_harder_one(
    spring: float, amplitudes: tuple[float, ...], established: tuple[str, ...], tied: tuple[str, ...]
) -> None:
    """Gravity takes of k q what is like a sine of it, and what is left looks like a cube."""
    base = BaseModel(
        coordinate=Coordinate.ROTATION,
        inertia=NumberPrior(INERTIA),
        gravity_torque=NumberPrior(0.9 * GRAVITY, math.inf),
    )
    finding = investigate_machine(swings_of(spring, amplitudes), base)
    assert finding.established == established
    assert finding.tied_with.get("restoring_force", ()) == tied
    assert finding.is_at_floor
    found = finding.final.value(("restoring_force", 0.0, 0))
    assert found == pytest.approx(spring, rel=0.02)
    gravity = 0.9 * GRAVITY + finding.final.nuisance("gravity_torque")
    assert gravity == pytest.approx(GRAVITY, rel=2e-3)


def test_gravity_that_a_base_model_forgot_is_no_spring() -> None:
    base = BaseModel(coordinate=Coordinate.ROTATION, inertia=NumberPrior(INERTIA))
    finding = investigate_machine(pendulum(swings(0.0)), base)
    assert finding.established == ()
    assert f"a torque of gravity {GRAVITY:g} N m larger would explain 100 % of it" in (
        machine_sentences.headline(finding)
    )


@pytest.mark.parametrize(("free", "is_alike"), [(math.inf, False), (1.0, True)])
def test_a_position_that_counts_from_afar_is_a_constant_force_only_where_none_is_free(
    free: float, *, is_alike: bool
) -> None:
    base = replace(AXIS, force_offset=NumberPrior(0.0, free))
    shots = [
        replace(shot, position=replace(shot.position, values=shot.position.values + 5.0))
        for shot in axis().shots
        if shot.position is not None
    ]
    records = uniform_records(replace(axis(), shots=tuple(shots)), base)
    fits = MachineFits(records, base, [SPRING, TermChoice("hardening_spring")], None)
    training, _ = fits.blocks()
    parts = machine_parts(base, is_driven=True)
    for choice in fits.candidates:
        term = ChosenTerm(choice, 0.0)
        assert like_the_machine(training, term, parts.values(), base) is is_alike


@pytest.mark.parametrize(
    ("base", "is_driven", "names"),
    [
        (oscillates(Coordinate.TRANSLATION), False, ["drive", "a constant force"]),
        (oscillates(Coordinate.TRANSLATION), True, ["inertia", "drive", "a constant force"]),
        (BaseModel(gravity_torque=NumberPrior(0.5)), False,
         ["inertia", "gravity", "drive", "a constant force"]),
        (BaseModel(gravity_torque=NumberPrior(0.5, 0.1)), False,
         ["inertia", "gravity", "drive", "a constant force"]),
        (BaseModel(gravity_torque=NumberPrior(0.5, math.inf)), False, ["drive", "a constant force"]),
        (BaseModel(gravity_torque=NumberPrior(0.0, math.inf), force_offset_by_record=True), True,
         ["inertia", "drive"]),
        (BaseModel(inertia=NumberPrior(2.0, math.inf)), True, ["drive", "a constant force"]),
        (BaseModel(force_gain=NumberPrior(0.0, math.inf)), True, ["inertia", "a constant force"]),
    ],
)  # fmt: skip
def test_a_term_is_held_against_what_a_machine_has(
    base: BaseModel, names: list[str], *, is_driven: bool
) -> None:
    assert [*machine_parts(base, is_driven=is_driven)] == names


CUBIC = 3000.0
"""Stiffness of a spring without a linear part [N/m³]."""


def duffing(records: int) -> Campaign:
    """Records of 1 kg on a cubic spring under four sines each, by an eighth-order scheme."""
    time, shots = np.arange(0.0, 12.0, 5e-3), []
    for number in range(1, records + 1):
        rng = np.random.default_rng([29, number])
        rates, phases = rng.uniform(3.0, 12.0, 4), rng.uniform(0.0, 2.0 * math.pi, 4)

        def drive(now: Samples, rates: Samples = rates, phases: Samples = phases) -> Samples:
            force: Samples = 0.35 * np.sin(np.multiply.outer(now, rates) + phases).sum(axis=-1)
            return force

        def moves(now: float, state: Samples, drive: Callable[..., Samples] = drive) -> list[float]:
            return [state[1], float(drive(now)) - 0.1 * state[1] - CUBIC * state[0] ** 3]

        path = solve_ivp(moves, (0.0, 12.0), (0.0, 0.0), "DOP853", time, rtol=1e-9, atol=1e-11).y[0]
        read = path + rng.normal(0.0, 3e-5, time.size)
        force = Channel(time, drive(time) + rng.normal(0.0, 2e-3, time.size))
        shots.append(Capture(number, math.nan, math.nan, force, Channel(time, read)))
    return Campaign(Excitation.DRIVEN, tuple(shots))


def test_a_spring_that_only_bends_as_a_cube_is_no_error_of_the_mass() -> None:
    """Lightly damped, it is what moves the part: a mass that explained it would have to be near nought."""
    base = BaseModel(
        inertia=NumberPrior(1.0), terms=(TermChoice("restoring_force"), TermChoice("viscous_friction"))
    )
    finding = investigate_machine(duffing(4), base)
    assert finding.established == ("hardening_spring",)
    assert finding.tied_with["hardening_spring"] == ()
    assert finding.is_at_floor
    place = finding.final.fit.columns.index(("hardening_spring", 0.0, 0))
    assert finding.final.fit.low[place] <= CUBIC <= finding.final.fit.high[place]


@pytest.mark.parametrize(
    ("off", "names"), [(0.1, ["inertia", "drive", "a constant force"]), (2.0, ["a constant force"])]
)
def test_a_mass_that_is_absurdly_off_explains_nothing(off: float, names: list[str]) -> None:
    base = replace(AXIS, inertia=NumberPrior(AXIS.inertia.value * (1.0 + off)))
    fits = MachineFits(uniform_records(axis(), base), base, [], None)
    training, _ = fits.blocks()
    parts = machine_parts(base, is_driven=True)
    known = fits.priors, fits.nonnegative
    columns = fits.columns(fits.base_terms)
    assert [*parts_that_may_be_off(training, columns, parts, known, 0.0)] == names
