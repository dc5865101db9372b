"""A swing that a hand lifts to its release within the record: what lies before is no free motion."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine import BaseModel, NumberPrior, investigate_machine
from impactcell.discrepancy.machine.records.release import from_release
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.report import german_sentences
from impactcell.errors import CampaignError
from impactcell.records import Capture, Channel
from tests.discrepancy.test_base_model import GRAVITY, INERTIA, pendulum, swings

STEP_S, REST_S, LIFT_S = 2e-3, 3.0, 0.8
BASE = BaseModel(
    coordinate=Coordinate.ROTATION,
    inertia=NumberPrior(INERTIA),
    gravity_torque=NumberPrior(0.9 * GRAVITY, math.inf),
    position_offset=NumberPrior(0.0, 0.05),
    force_offset=NumberPrior(0.0, 0.01),
)


def lifted(shot: Capture) -> Capture:
    """Rest, and an arm that a hand lifts within 0.8 s, before the free swing."""
    assert shot.position is not None
    free = shot.position.values
    rest = np.zeros(round(REST_S / STEP_S))
    share = np.linspace(0.0, 1.0, round(LIFT_S / STEP_S), endpoint=False)
    lift = free[0] * share**2 * (3.0 - 2.0 * share)
    angle = np.concatenate([rest, lift, free])
    angle[: rest.size + lift.size] += np.random.default_rng(1).normal(0.0, 2e-5, rest.size + lift.size)
    time = STEP_S * np.arange(angle.size)
    return replace(shot, position=Channel(time, angle, shot.position.noise_std))


@pytest.mark.slow
def test_drag_is_named_of_swings_that_a_hand_lifted() -> None:
    shots = swings(0.004)
    by_hand = investigate_machine(pendulum(tuple(map(lifted, shots))), BASE)
    freely = investigate_machine(pendulum(shots), BASE)
    assert by_hand.established == freely.established == ("quadratic_drag",)
    assert by_hand.fall.after < 1.3
    note = (
        "Shot 1: what lies before 3.8 s is left out, since the swing grows until then: something drives it."
    )
    assert note in by_hand.notes
    assert not any("left out" in note for note in freely.notes)
    language, said = german_sentences.note(note)
    assert language == "de"
    assert said.startswith("Messung 1: Was vor 3,8 s liegt, ist ausgelassen")


def test_free_swings_stay_as_they_are() -> None:
    records = uniform_records(pendulum(swings(0.004)), BASE)
    same, notes = from_release(records)
    assert not notes
    assert all(one is other for one, other in zip(records, same, strict=True))


@pytest.mark.parametrize("ends_at_its_largest", [False, True])
def test_a_swing_that_grows_to_its_end_is_refused(ends_at_its_largest: bool) -> None:
    time = STEP_S * np.arange(4000)
    angle = 0.1 * np.exp(0.3 * time) * np.sin(5.5 * time)
    if ends_at_its_largest:
        time, angle = (values[: int(np.abs(angle).argmax()) + 1] for values in (time, angle))
    shot = replace(swings(0.004)[0], position=Channel(time, angle, 2e-5))
    with pytest.raises(CampaignError, match=r"shot 1: its swing grows until \S+ s, so"):
        investigate_machine(pendulum((shot,)), BASE)
