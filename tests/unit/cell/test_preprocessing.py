"""What is settled about a cycle before anything is computed: defaults, doubts, batch, mean period."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.cell.preprocessing import (
    BatchNaming,
    CaptureDefaults,
    OperatorBatch,
    assign_batch,
    degrade_quality,
    fill_defaults,
    update_period,
)
from impactcell.records import BatchAnnouncement, Channel, Coefficient, Quality
from tests.snapshots import make_capture, make_snapshot


def follow(
    said: BatchNaming, cycles: dict[int, str | None], announcement: BatchAnnouncement | None
) -> list[int]:
    """Cycles at which a change was expected; every cycle must have the batch that the module gave it."""
    expected = []
    for cycle, batch_id in cycles.items():
        named = assign_batch(said, replace(make_capture(cycle), batch_id=batch_id), announcement)
        assert named.batch_id == batch_id
        said = named.naming
        if named.expected:
            expected.append(cycle)
    return expected


OUTAGE: dict[int, str | None] = {5: "A", 6: "B", 7: "B", 8: "C", 9: "C", 10: "D", 11: "D"}


@pytest.mark.parametrize(
    ("seen", "newest", "expected"),
    [
        (4, BatchAnnouncement(7, 10), [6, 8, 10]),
        (5, BatchAnnouncement(7, 10), [6, 10]),
        (6, BatchAnnouncement(7, 10), [10]),
        (7, BatchAnnouncement(7, 10), []),
        (0, BatchAnnouncement(7, 10), [10]),
        (1, BatchAnnouncement(3, 10), [6, 10]),
        (9, BatchAnnouncement(1, 10), [10]),
    ],
)
def test_announcements_that_an_outage_hid_are_told_by_their_count(
    seen: int, newest: BatchAnnouncement, expected: list[int]
) -> None:
    assert follow(BatchNaming(None, "A", seen), OUTAGE, newest) == expected


def test_without_announcements_no_change_is_expected() -> None:
    assert follow(BatchNaming(None, "A", 4), OUTAGE, None) == []


def test_a_person_s_batch_holds_until_the_module_names_another() -> None:
    said = BatchNaming(OperatorBatch("by hand", "A", expected=True), "A", 0)
    first = assign_batch(said, replace(make_capture(5), batch_id="A"), None)
    assert (first.batch_id, first.expected) == ("by hand", True)
    second = assign_batch(first.naming, replace(make_capture(6), batch_id="A"), None)
    assert (second.batch_id, second.expected) == ("by hand", False)
    third = assign_batch(second.naming, replace(make_capture(7), batch_id="B"), None)
    assert (third.batch_id, third.expected) == ("B", False)


def test_a_person_s_batch_does_not_come_back_with_the_module_s_old_one() -> None:
    naming = BatchNaming(OperatorBatch("by hand", "A", expected=False), "A", 0)
    other = assign_batch(naming, replace(make_capture(5), batch_id="B"), None)
    assert other.naming == BatchNaming(None, "B", 0)
    back = assign_batch(other.naming, replace(make_capture(6), batch_id="A"), None)
    assert (back.batch_id, back.expected) == ("A", False)


def test_a_person_s_batch_where_the_module_names_none() -> None:
    naming = BatchNaming(OperatorBatch("by hand", None, expected=False))
    named = assign_batch(naming, replace(make_capture(5), batch_id=None), None)
    assert (named.batch_id, named.naming.by_module) == ("by hand", None)


@pytest.mark.parametrize(("cycle", "expected"), [(9, False), (10, True), (11, True)])
def test_an_announcement_holds_from_its_cycle_on_and_once(cycle: int, *, expected: bool) -> None:
    capture = replace(make_capture(cycle), batch_id="A")
    named = assign_batch(BatchNaming(None, "A", 1), capture, BatchAnnouncement(2, 10))
    assert named.expected is expected
    assert named.naming.last_announcement == (2 if expected else 1)
    again = assign_batch(named.naming, replace(capture, cycle=12), BatchAnnouncement(2, 10))
    assert again.expected is not expected


def test_an_outage_without_a_batch_before_or_now_says_nothing_of_hidden_announcements() -> None:
    for before, now in ((None, "B"), ("A", None), ("A", "A")):
        capture = replace(make_capture(5), batch_id=now)
        assert not assign_batch(BatchNaming(None, before, 4), capture, BatchAnnouncement(7, 10)).expected


def test_what_the_module_leaves_out_is_filled_in_and_what_it_says_stays() -> None:
    defaults = CaptureDefaults(12.6, 1.5e-3, 0.3, 2e-6)
    bare = Channel(np.arange(3.0), np.zeros(3))
    silent = replace(
        make_capture(), mass_kg=math.nan, stroke_m=math.inf, force=bare, position=bare, actuator=bare
    )
    filled = fill_defaults(defaults, silent)
    assert (filled.mass_kg, filled.stroke_m) == (12.6, 1.5e-3)
    assert filled.force is not None
    assert filled.position is not None
    assert filled.actuator is not None
    assert (filled.force.noise_std, filled.position.noise_std) == (0.3, 2e-6)
    assert filled.actuator.noise_std is None
    assert filled.onset_std_s == 0.5  # half of the force's sampling step
    assert (filled.mass_std, filled.velocity_std) == (0.01, 0.005)
    assert (filled.force_scale_std, filled.position_scale_std) == (0.01, 0.003)
    exact = fill_defaults(replace(defaults, recorder_std=(0.0, 0.001, 0.02, 0.004)), silent)
    assert (exact.mass_std, exact.velocity_std) == (0.0, 0.001)
    assert (exact.force_scale_std, exact.position_scale_std) == (0.02, 0.004)
    said = replace(
        silent,
        mass_kg=18.9,
        stroke_m=2e-3,
        force=replace(bare, noise_std=0.4),
        position=replace(bare, noise_std=1e-6),
    )
    filled = fill_defaults(defaults, said)
    assert (filled.mass_kg, filled.stroke_m) == (18.9, 2e-3)
    assert filled.force is said.force
    assert filled.position is said.position
    nothing = fill_defaults(CaptureDefaults(), replace(silent, force=None, position=None))
    assert math.isnan(nothing.mass_kg)
    assert (nothing.stroke_m, nothing.force, nothing.position) == (math.inf, None, None)
    unsampled = replace(silent, force=None, position=None, actuator=None)
    assert fill_defaults(CaptureDefaults(), unsampled).onset_std_s == 0.0


def test_faults_make_an_estimate_uncertain_and_say_why() -> None:
    friction = make_snapshot(make_capture()).friction
    assert degrade_quality(friction, ()) is friction
    doubtful = degrade_quality(friction, ("short", "late"))
    assert (doubtful.mu_s.quality, doubtful.mu_s.reason) == (Quality.UNCERTAIN, "short; late")
    assert (doubtful.mu_k.quality, doubtful.mu_k.reason) == (Quality.UNCERTAIN, "short; late")
    assert (doubtful.mu_s.value, doubtful.mu_s.std) == (friction.mu_s.value, friction.mu_s.std)
    for coefficient in (doubtful.by_force, doubtful.by_distance, doubtful.combined):
        assert coefficient.quality is not Quality.GOOD


@pytest.mark.parametrize("quality", [Quality.UNCERTAIN, Quality.BAD])
def test_faults_reach_each_coefficient_by_itself_and_the_worse_keeps_its_reason(quality: Quality) -> None:
    """What is doubtful of one says nothing of another: mu_k was left good where mu_s was in doubt before."""
    good = Coefficient(0.2, 0.01, Quality.GOOD)
    doubtful = replace(good, quality=quality, reason="its own")
    names = ("mu_s", "mu_k", "by_force", "by_distance", "combined")
    friction = make_snapshot(make_capture()).friction
    for name in names:
        given = replace(friction, **dict.fromkeys(names, good) | {name: doubtful})
        degraded = degrade_quality(given, ("short",))
        assert getattr(degraded, name) == doubtful
        for other in set(names) - {name}:
            assert getattr(degraded, other) == replace(good, quality=Quality.UNCERTAIN, reason="short")


def test_the_mean_period_follows_slowly_and_pauses_count_little() -> None:
    second = 10**9
    capture = replace(make_capture(13), time_ns=100 * second)
    assert update_period(0.0, (10, 94 * second), capture) == 2.0
    assert update_period(1.0, (10, 94 * second), capture) == pytest.approx(1.05)
    assert update_period(1.0, (12, 10 * second), capture) == pytest.approx(1.0 + 0.05 * 9.0)
    for unknown in ((10, 0), (13, 94 * second), (14, 94 * second), (10, 100 * second), (10, 101 * second)):
        assert update_period(1.5, unknown, capture) == 1.5


def test_where_nothing_is_said_the_defaults_hold() -> None:
    assert CaptureDefaults() == CaptureDefaults(None, None, 0.4, 1.5e-6)
    assert BatchNaming() == BatchNaming(None, None, 0)
