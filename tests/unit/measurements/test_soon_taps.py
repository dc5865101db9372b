"""Taps of one file with little rest between them; truth: the taps that were put behind each other."""

import numpy as np
import pytest

from impactcell.measurements import Given, Imported, guess, make_campaign
from impactcell.web.texts.import_notes import page_note
from tests.unit.measurements.records import recorded, sampled, taps

STATED = {"mass": 18.9, "velocity": 0.05, "stroke": 1.5e-3}


def two_taps(rest_s: float) -> list[np.ndarray]:
    """Struck twice along +1, from where the first tap left the part; it lies still that long between."""
    rng = np.random.default_rng(6)
    tap = taps((3000,), (18.9,))[0]
    (_, force, position), (_, second, further) = (sampled(tap, rng, tail_s=rest_s - 0.03) for _ in range(2))
    force, position = np.concatenate([force, second]), np.concatenate([position, further])
    position[-len(further) :] += float(position[-len(further) - 50 : -len(further)].mean()) - 0.012
    return [np.arange(len(force)) * 1e-4, force, position]


def imported(columns: list[np.ndarray], **constants: float) -> Imported:
    tables = [recorded("two.csv", columns)]
    return make_campaign(tables, guess(tables, Given(constants=constants)))


@pytest.mark.parametrize("rest_s", [0.05, 0.08, 0.15, 0.4])
def test_a_contact_after_the_actuator_has_halted_is_another_tap(rest_s: float) -> None:
    found = imported(two_taps(rest_s), **STATED)
    first, second = found.campaign.shots
    assert "1 record cut into 2 taps where the force begins anew" in found.notes
    for shot in (first, second):
        assert shot.position is not None
        assert shot.force is not None
        before = shot.position.time_s < 0.0
        assert shot.position.time_s[0] < -0.015
        assert np.ptp(shot.position.values[before]) < 2e-5, "nothing of the slide before"
        assert np.ptp(shot.position.values[-100:]) < 2e-5, "to its rest"
    travels = [float(np.ptp(shot.position.values)) for shot in (first, second) if shot.position is not None]
    assert travels[0] == pytest.approx(travels[1], rel=0.01)


def test_without_the_stroke_the_second_contact_is_told_with_the_way_out() -> None:
    found = imported(two_taps(0.08), mass=18.9, velocity=0.05)
    assert len(found.campaign.shots) == 1
    (note,) = (note for note in found.notes if "taken for one tap" in note)
    assert note.startswith("two.csv: contact at 0.03")
    assert note.endswith("had halted (--set stroke=1.5mm)")
    assert page_note(note, "de")[0] == "de"
    slow = imported(two_taps(0.08), mass=18.9, velocity=0.05, stroke=6e-3)
    assert len(slow.campaign.shots) == 1
    (note,) = (note for note in slow.notes if "taken for one tap" in note)
    assert note.endswith("if these are two taps, cut the file between them")
    assert page_note(note, "de")[0] == "de"


def test_a_part_that_is_caught_up_with_at_rest_is_struck_by_one_tap() -> None:
    """The actuator is still under way, on a stroke of 20 mm, as it meets the part again."""
    found = imported(two_taps(0.08), mass=18.9, velocity=0.05, stroke=20e-3)
    assert len(found.campaign.shots) == 1
    assert not any("taken for one tap" in note for note in found.notes)


def test_bounces_of_one_tap_are_no_taps() -> None:
    for tap in taps():
        columns = list(sampled(tap, np.random.default_rng(3)))
        found = imported(columns, mass=tap.mass_kg, velocity=tap.velocity_m_s, stroke=1.5e-3)
        assert len(found.campaign.shots) == 1
        assert not any("taken for one tap" in note for note in found.notes)
