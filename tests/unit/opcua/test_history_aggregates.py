"""Aggregates against their definitions in Part 13, written out apart, and against its own example values."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.opcua.history_aggregates import (
    BAD,
    CALCULATED,
    MULTIPLE,
    NO_DATA,
    PARTIAL,
    RAW,
    SUB_NORMAL,
    Aggregate,
    Interval,
    Treatment,
    intervals,
    process,
)
from impactcell.opcua.host_interface import HistoricalValue

G, U, B = 0x0000_0000, 0x4000_0000, 0x8000_0000  # Good, Uncertain, Bad (Part 4, 7.39)
WHOLE = Interval(0, 100)


def series(*entries: tuple[int, float, int]) -> list[HistoricalValue]:
    return [HistoricalValue(*entry) for entry in entries]


@pytest.mark.parametrize(
    ("aggregate", "values", "expected", "status"),
    [
        (Aggregate.AVERAGE, series((0, 1.0, G), (10, 2.0, G), (20, 6.0, G)), 3.0, CALCULATED),
        (Aggregate.AVERAGE, series((0, 1.0, G), (10, 9.0, U), (20, 3.0, G)), 2.0, SUB_NORMAL | CALCULATED),
        (Aggregate.AVERAGE, series((0, 1.0, G), (10, 9.0, B)), 1.0, SUB_NORMAL | CALCULATED),
        (Aggregate.AVERAGE, series((0, 9.0, B), (10, 9.0, U)), None, BAD),
        (Aggregate.AVERAGE, [], None, NO_DATA),
        (Aggregate.MINIMUM, series((0, 1.0, G), (10, 2.0, G)), 1.0, RAW),
        (Aggregate.MINIMUM, series((0, 2.0, G), (10, 1.0, G)), 1.0, CALCULATED),
        (Aggregate.MINIMUM, series((0, 2.0, G), (10, 1.0, G), (20, 1.0, G)), 1.0, MULTIPLE | CALCULATED),
        (Aggregate.MAXIMUM, series((5, 2.0, G), (10, 7.0, U)), 2.0, SUB_NORMAL | CALCULATED),
        (Aggregate.COUNT, series((0, 1.0, G), (10, 2.0, G)), 2, CALCULATED),
        (Aggregate.COUNT, series((0, 1.0, G), (10, 2.0, B)), 1, SUB_NORMAL | CALCULATED),
        (Aggregate.COUNT, series((0, 1.0, B)), 0, BAD | CALCULATED),
        (Aggregate.COUNT, [], 0, CALCULATED),
    ],
)
def test_by_definition(
    aggregate: Aggregate, values: list[HistoricalValue], expected: object, status: int
) -> None:
    found = process(aggregate, WHOLE, values, Treatment(), within=True)
    assert (found.time_ns, found.value, found.status) == (0, expected, status)


def test_uncertain_as_good_and_percentages() -> None:
    values = series((0, 1.0, G), (10, 3.0, U), (20, 8.0, B), (30, 8.0, B))
    as_good = Treatment(uncertain_as_bad=False, percent_good=50)
    assert process(Aggregate.AVERAGE, WHOLE, values, as_good, within=True).value == 2.0
    assert process(Aggregate.AVERAGE, WHOLE, values, as_good, within=True).status == CALCULATED
    strict = Treatment(percent_bad=50, percent_good=100)
    assert process(Aggregate.AVERAGE, WHOLE, values, strict, within=True).status == BAD | CALCULATED


def test_outside_of_what_is_stored_there_is_no_count() -> None:
    assert process(Aggregate.COUNT, WHOLE, [], Treatment(), within=False).status == NO_DATA


def test_a_partial_interval_says_so() -> None:
    partial = Interval(90, 100, partial=True)
    found = process(Aggregate.COUNT, partial, series((95, 1.0, G)), Treatment(), within=True)
    assert found.status == CALCULATED | PARTIAL


@given(
    st.lists(st.tuples(st.integers(0, 999), st.floats(-1e6, 1e6)), unique_by=lambda e: e[0], max_size=60),
    st.integers(1, 400),
    st.booleans(),
)
def test_every_value_lies_in_one_interval(
    entries: list[tuple[int, float]], step: int, backwards: bool
) -> None:
    start, end = (999, -1) if backwards else (0, 1000)
    cut = list(intervals(start, end, step))
    for time_ns, _ in entries:
        assert sum(time_ns in interval for interval in cut) == 1
    values = [HistoricalValue(*entry) for entry in entries]
    counted = sum(
        process(Aggregate.COUNT, i, [v for v in values if v.time_ns in i], Treatment(), within=True).value  # type: ignore[misc]
        for i in cut
    )
    assert counted == len(entries)
    total = math.fsum(value for _, value in entries)
    means = [
        (process(Aggregate.AVERAGE, i, inside, Treatment(), within=True).value or 0.0) * len(inside)
        for i in cut
        if (inside := [v for v in values if v.time_ns in i])
    ]
    assert math.fsum(means) == pytest.approx(total, rel=1e-9, abs=1e-6)
