"""Angles of a sensor that begins anew after a turn: they go on. Truth: the angle that was wrapped."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from impactcell.campaign import Campaign, Coordinate, Excitation
from impactcell.discrepancy.machine import BaseModel, NumberPrior, investigate_machine
from impactcell.discrepancy.machine.records.whole_turns import refuse_saw_teeth, without_wraps
from impactcell.discrepancy.report.german_notes import note as german_note
from impactcell.errors import CampaignError
from impactcell.records import Capture, Channel, Samples
from tests.discrepancy.test_base_model import INERTIA, pendulum, swings

PENDULUM = BaseModel(
    coordinate=Coordinate.ROTATION,
    inertia=NumberPrior(INERTIA),
    gravity_torque=NumberPrior(0.55, math.inf),
    position_offset=NumberPrior(0.0, 0.05),
    force_offset=NumberPrior(0.0, 0.01),
)
TURN = 2.0 * math.pi


def wrapped(shots: tuple[Capture, ...], least: float) -> tuple[Capture, ...]:
    """The same by a sensor that shows angles from `least` to a turn more."""
    return tuple(
        replace(shot, position=replace(shot.position, values=(shot.position.values - least) % TURN + least))
        for shot in shots
        if shot.position is not None
    )


@pytest.mark.slow
@pytest.mark.parametrize("drag", [0.0, 4e-4])
def test_a_swing_about_the_zero_of_a_wrapping_sensor_is_the_swing_it_was(drag: float) -> None:
    """It had a gap of 50 000 noise floors, and a law that nobody had listed."""
    plain = investigate_machine(pendulum(swings(drag)), PENDULUM)
    finding = investigate_machine(pendulum(wrapped(swings(drag), 0.0)), PENDULUM)
    assert (finding.verdict, finding.established) == (plain.verdict, plain.established)
    assert finding.fall.after == pytest.approx(plain.fall.after, rel=1e-3)
    [note] = [note for note in finding.notes if "whole turn" in note]
    assert note.startswith("The angle jumps by a whole turn in 6 of 6 records: ")
    language, said = german_note(note)
    assert (language, said[:46]) == ("de", "Der Winkel springt in 6 von 6 Messungen um ein")
    assert [one for one in finding.notes if one != note] == list(plain.notes)


TIME = 1e-3 * np.arange(5000)


def gone_on(angle: Samples, time: Samples = TIME, coordinate: Coordinate = Coordinate.ROTATION) -> Samples:
    shot = Capture(1, math.nan, 1.0, None, Channel(time[: len(angle)], angle, None))
    campaign, notes = without_wraps(Campaign(Excitation.FREE_SLIDE, (shot,), coordinate=coordinate))
    [after] = campaign.shots
    assert after.position is not None
    assert bool(notes) is (after is not shot)
    return after.position.values


@pytest.mark.parametrize("least", [0.0, -math.pi])
@pytest.mark.parametrize("turns_per_s", [1.3, -30.0, 140.0])
def test_a_shaft_turns_on(turns_per_s: float, least: float) -> None:
    """With up to six samples a turn; the record begins within half a turn of 0."""
    angle = 2.0 + TURN * turns_per_s * (TIME + 0.014 * TIME**2)
    assert gone_on((angle - least) % TURN + least) == pytest.approx(angle, abs=1e-6)


@pytest.mark.parametrize("noise", [1e-4, 0.02, 0.05])
def test_a_part_at_rest_where_its_sensor_begins_anew_rests(noise: float) -> None:
    angle = noise * np.random.default_rng(1).standard_normal(5000)
    assert gone_on(angle % TURN) == pytest.approx(angle, abs=1e-9)


@pytest.mark.parametrize(
    "angle",
    [
        TURN * 30.0 * TIME,  # what has counted its turns
        TURN * np.arange(200.0),  # one turn from sample to sample
        np.interp(TIME, [1.0, 1.01], [0.0, TURN]),  # a whole turn within ten samples, and rest
        math.pi * np.sin(TURN * np.arange(400) / 2.6),  # about a turn to and fro
        math.pi * np.sin(TURN * np.arange(400) / 2.03),
        np.where(TIME < 2.0, 0.1, 0.1 + 0.8 * TURN),  # a jump, but not of a turn
    ],
)
def test_what_a_motion_could_do_is_left_as_it_is(angle: Samples) -> None:
    assert (gone_on(angle) == angle).all()


def test_a_translation_is_left_as_it_is() -> None:
    position = (TURN * TIME) % TURN
    assert (gone_on(position, coordinate=Coordinate.TRANSLATION) == position).all()


def test_a_gap_in_time_is_no_wrap_but_within_a_record_that_wraps_the_shorter_way_is_taken() -> None:
    rests = np.where(np.arange(400) < 200, 0.1, 0.1 + 0.99 * TURN)
    time = 1e-3 * np.arange(400) + np.where(np.arange(400) < 200, 0.0, 1.0)
    assert (gone_on(rests, time) == rests).all()
    angle = TURN * 3.0 * time[:400]
    steps = [abs(after - before) for before, after in pairwise(gone_on(angle % TURN, time))]
    assert max(steps) < 0.5 * TURN


def held(position: Samples, coordinate: Coordinate) -> Campaign:
    shot = Capture(1, math.nan, 1.0, None, Channel(TIME[: len(position)], position, None))
    campaign, _ = without_wraps(Campaign(Excitation.FREE_SLIDE, (shot,), coordinate=coordinate))
    return campaign


@pytest.mark.parametrize(
    ("coordinate", "after"), [(Coordinate.ROTATION, 4.02), (Coordinate.TRANSLATION, 0.1)]
)
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_what_begins_anew_after_something_else_than_a_turn_is_refused(
    coordinate: Coordinate, after: float, direction: float
) -> None:
    """It was simulated for minutes, tooth by tooth."""
    noise = 1e-3 * after * np.random.default_rng(3).standard_normal(TIME.size)
    position = (direction * after * (0.7 * TIME + 0.05 * TIME**2)) % after + noise
    with pytest.raises(
        CampaignError, match=rf"shot 1: \w+ jumps back by {after:.2g} (rad|m) again and again"
    ):
        refuse_saw_teeth(held(position, coordinate))


@pytest.mark.parametrize(
    "position",
    [
        0.1 * np.sin(9.0 * TIME),
        0.1 * np.sign(np.sin(9.0 * TIME)),  # from end to end between two samples
        TURN * 3.0 * TIME % TURN,  # goes on after each turn
        0.1 * TIME + np.where(np.arange(5000) % 1000 == 7, 1.0, 0.0),  # spikes
        np.where(TIME < 2.0, 0.0, 0.3),
    ],
    ids=["sine", "ends", "turns", "spikes", "once"],
)
def test_other_positions_are_no_saw_teeth(position: Samples) -> None:
    refuse_saw_teeth(held(position, Coordinate.ROTATION))
