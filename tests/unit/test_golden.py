"""How results of two trees are compared: `tests/benchmarks/golden.py`."""

import math
from collections.abc import Mapping

import pytest

from tests.benchmarks import golden
from tests.benchmarks._golden_outputs import leaves

HELD: Mapping[str, golden.Leaf] = {"/level": 0.2, "/std": math.nan, "/quality": "good", "/limit": None}


def test_the_same_is_equal_and_so_are_two_numbers_that_are_none() -> None:
    found = golden.compare(HELD, dict(HELD))
    assert found.is_equal
    assert golden.row(found) == ("4", "equal", "", "", "")


def test_one_number_that_differs_in_its_last_bit_is_told_with_its_place() -> None:
    found = golden.compare(HELD, {**HELD, "/level": math.nextafter(0.2, 1.0)})
    assert not found.is_equal
    assert (found.values, found.differing) == (4, 1)
    assert found.largest == pytest.approx(1.4e-16, rel=0.1)
    assert found.place.startswith("/level: ")


@pytest.mark.parametrize(
    ("now", "largest"),
    [
        ({"/level": 0.25}, 0.2),
        ({"/std": 0.1}, math.inf),
        ({"/quality": "bad"}, 0.0),
        ({"/limit": 0.3}, 0.0),
        ({"/level": 0.25, "/quality": "bad"}, 0.2),
    ],
)
def test_the_largest_difference_is_of_numbers(now: dict[str, golden.Leaf], largest: float) -> None:
    found = golden.compare(HELD, {**HELD, **now})
    assert found.differing == len(now)
    assert found.largest == pytest.approx(largest)
    assert found.place.split(":")[0] == next(iter(now))


def test_a_zero_of_another_sign_is_another_number() -> None:
    found = golden.compare({"/offset": 0.0}, {"/offset": -0.0})
    assert (found.differing, found.largest) == (1, 0.0)


def test_what_only_one_tree_has_is_no_equality() -> None:
    old = {key: value for key, value in HELD.items() if key != "/limit"}
    for found, cell in (
        (golden.compare(HELD, old), "1 before: /limit"),
        (golden.compare(old, HELD), "1 now: /limit"),
    ):
        assert not found.is_equal
        assert golden.row(found) == ("3", "equal", "", "", cell)


def test_places_are_named_once_without_cycles_and_points() -> None:
    places = [f"/cycle {cycle}/signature/friction/{point}" for cycle in range(3) for point in range(4)]
    assert golden.patterns(places) == "/signature/friction"


def test_members_of_a_list_go_by_their_name_so_that_one_more_moves_no_other() -> None:
    raised = [{"alarm": "BatchShift", "cycle": 3}, {"alarm": "BatchShift", "cycle": 9}]
    before = dict(leaves(raised))
    now = dict(leaves([{"alarm": "WearWarning", "cycle": 1}, *raised]))
    found = golden.compare(before, now)
    assert (found.values, found.differing) == (4, 0)
    assert found.only_new == ("/WearWarning 1/alarm", "/WearWarning 1/cycle")
