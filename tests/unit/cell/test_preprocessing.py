"""Which batch a cycle belongs to, and which of its changes were announced."""

from dataclasses import replace

import pytest

from impactcell.cell.preprocessing import BatchNaming, OperatorBatch, assign_batch
from impactcell.records import BatchAnnouncement
from tests.snapshots import make_capture


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
