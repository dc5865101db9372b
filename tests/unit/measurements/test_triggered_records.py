"""Recorders that a tap starts: nothing is recorded before contact, and several taps stand in one file."""

from collections.abc import Sequence

import numpy as np
import pytest

from impactcell.campaign import Excitation
from impactcell.measurements import Given, Imported, MeasuredColumn, Table, guess, make_campaign
from impactcell.web.texts.import_notes import page_note
from tests.taps import Tap
from tests.unit.measurements.records import RATE_HZ, taps

BURST_S, EVERY_S = 0.3, 5.0
TAPS = taps((3000, 3500, 4000), (18.9,))
GIVEN = Given(constants={"mass": 18.9, "velocity": 0.05, "stroke": 1.5e-3})


def bursts(struck: Sequence[Tap], before_s: Sequence[float], first_s: float = 0.0) -> list[np.ndarray]:
    """Time, force and position of bursts of 0.3 s every 5 s, with contact `before_s` after each begins.

    Below 0 the burst begins after contact.
    """
    rng = np.random.default_rng(3)
    parts = []
    for number, (tap, before) in enumerate(zip(struck, before_s, strict=True)):
        motion = tap.motion()
        time = np.arange(round(BURST_S * RATE_HZ)) / RATE_HZ
        since = time - before + 1e-12
        force = np.where(since >= 0.0, motion.force_n(np.maximum(since, 0.0)), 0.0)
        place = np.where(since >= 0.0, motion.position_m(np.maximum(since, 0.0)), 0.0)
        noise = rng.normal(size=(2, time.size))
        start_s = first_s + EVERY_S * number
        parts.append((start_s + time, force + 0.4 * noise[0], 0.012 + place + 1.5e-6 * noise[1]))
    return [np.concatenate([part[i] for part in parts]) for i in range(3)]


def imported(columns: Sequence[np.ndarray]) -> Imported:
    names = (("Time", "s"), ("Force", "N"), ("Position", "m"))
    of = tuple(MeasuredColumn(*name, values) for name, values in zip(names, columns, strict=True))
    tables = [Table("data/a.csv", of)]
    return make_campaign(tables, guess(tables, GIVEN))


def check(found: Imported, struck: Sequence[Tap]) -> None:
    assert found.campaign.excitation is Excitation.TAP
    assert [shot.direction for shot in found.campaign.shots] == [tap.direction for tap in struck]
    for shot, tap in zip(found.campaign.shots, struck, strict=True):
        motion = tap.motion()
        assert shot.force is not None
        assert shot.position is not None
        # Contact may lie anywhere in a step, and so it does not have to be exact.
        time, force = shot.force.time_s, shot.force.values
        truth = np.where(time >= 0.0, motion.force_n(np.maximum(time, 0.0)), 0.0)
        pushed = truth > 5.0
        assert pushed.sum() > 100
        assert float(np.median(np.abs(force - truth)[pushed])) < 1.5
        moved = shot.position.values[-50:].mean() - shot.position.values[:1].mean()
        assert moved == pytest.approx(motion.position_m(np.array([1.0]))[0], rel=0.05)


def test_every_tap_of_a_triggered_recorder_begins_at_its_first_sample() -> None:
    """Contact was put half the record after it began, without any force, and the first tap was not there."""
    found = imported(bursts(TAPS, [0.0] * 6))
    check(found, TAPS)
    for shot in found.campaign.shots:
        assert shot.force is not None
        assert shot.force.time_s[0] == 0.0
    told = "contact is there from the first sample on in 6 taps: that is taken for t = 0"
    assert told in found.notes
    german = "Kontakt ab dem ersten Messwert (Stöße: 6): dieser gilt als t = 0"
    assert page_note(told, "de") == ("de", german)


def test_a_record_that_begins_at_contact_on_a_clock_of_its_own_does_so_at_its_first_sample() -> None:
    found = imported(bursts(TAPS[:1], [0.0], first_s=17.0))
    check(found, TAPS[:1])
    own = imported(bursts(TAPS[:1], [0.0], first_s=0.0))
    check(own, TAPS[:1])
    assert "no samples before contact: the records' own t = 0 is taken" in own.notes


def test_a_tap_that_was_cut_off_beside_whole_ones_is_left_out_with_a_word() -> None:
    found = imported(bursts(TAPS, [-0.002, *[0.03] * 5]))
    check(found, TAPS[1:])
    told = "taps left out whose beginning was not recorded: 1, in a.csv"
    assert told in found.notes
    german = "weggelassene Stöße, deren Beginn nicht aufgezeichnet wurde: 1, in a.csv"
    assert page_note(told, "de") == ("de", german)
    german = "weggelassene Stöße, deren Beginn nicht aufgezeichnet wurde: 2, zuerst in a.csv"
    assert page_note(told.replace("1, in", "2, the first in"), "de") == ("de", german)
    check(imported(bursts(TAPS, [0.03] * 6)), TAPS)
