"""Aggregates against their definitions in Part 13, written out apart, and against its own example values."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.opcua.history.history_aggregates import (
    BAD,
    CALCULATED,
    MULTIPLE,
    NO_DATA,
    PARTIAL,
    RAW,
    SUB_NORMAL,
    AggregateConfiguration,
    AggregateValue,
    IntervalAggregate,
    ProcessingInterval,
    processing_intervals,
)
from impactcell.opcua.history.history_aggregates import AggregateFunction as Function
from impactcell.opcua.host_interface import HistoricalValue

G, U, B = 0x0000_0000, 0x4000_0000, 0x8000_0000  # Good, Uncertain, Bad (Part 4, 7.39)
WHOLE = ProcessingInterval(0, 100)
DEFAULT = AggregateConfiguration()


def aggregate_interval(
    function: Function,
    interval: ProcessingInterval,
    values: list[HistoricalValue],
    configuration: AggregateConfiguration,
    *,
    within: bool,
) -> AggregateValue:
    aggregate = IntervalAggregate(function, interval, configuration)
    for value in values:
        aggregate.add(value)
    return aggregate.result(within=within)


def series(*entries: tuple[int, float, int]) -> list[HistoricalValue]:
    return [HistoricalValue(*entry) for entry in entries]


@pytest.mark.parametrize(
    ("aggregate", "values", "expected", "status"),
    [
        (Function.AVERAGE, series((0, 1.0, G), (10, 2.0, G), (20, 6.0, G)), 3.0, CALCULATED),
        (
            Function.AVERAGE,
            series((0, 1.0, G), (10, 9.0, U), (20, 3.0, G)),
            2.0,
            SUB_NORMAL | CALCULATED,
        ),
        (Function.AVERAGE, series((0, 1.0, G), (10, 9.0, B)), 1.0, SUB_NORMAL | CALCULATED),
        (Function.AVERAGE, series((0, 9.0, B), (10, 9.0, U)), None, BAD),
        (Function.AVERAGE, [], None, NO_DATA),
        (Function.MINIMUM, series((0, 1.0, G), (10, 2.0, G)), 1.0, RAW),
        (Function.MINIMUM, series((0, 2.0, G), (10, 1.0, G)), 1.0, CALCULATED),
        (
            Function.MINIMUM,
            series((0, 2.0, G), (10, 1.0, G), (20, 1.0, G)),
            1.0,
            MULTIPLE | CALCULATED,
        ),
        (Function.MAXIMUM, series((5, 2.0, G), (10, 7.0, U)), 2.0, SUB_NORMAL | CALCULATED),
        (Function.COUNT, series((0, 1.0, G), (10, 2.0, G)), 2, CALCULATED),
        (Function.COUNT, series((0, 1.0, G), (10, 2.0, B)), 1, SUB_NORMAL | CALCULATED),
        (Function.COUNT, series((0, 1.0, B)), 0, BAD | CALCULATED),
        (Function.COUNT, [], 0, CALCULATED),
    ],
)
def test_by_definition(
    aggregate: Function, values: list[HistoricalValue], expected: object, status: int
) -> None:
    found = aggregate_interval(aggregate, WHOLE, values, DEFAULT, within=True)
    assert (found.time_ns, found.value, found.status) == (0, expected, status)


def test_uncertain_as_good_and_percentages() -> None:
    values = series((0, 1.0, G), (10, 3.0, U), (20, 8.0, B), (30, 8.0, B))
    as_good = AggregateConfiguration(uncertain_as_bad=False, percent_good=50)
    assert aggregate_interval(Function.AVERAGE, WHOLE, values, as_good, within=True).value == 2.0
    assert aggregate_interval(Function.AVERAGE, WHOLE, values, as_good, within=True).status == CALCULATED
    strict = AggregateConfiguration(percent_bad=50, percent_good=100)
    assert aggregate_interval(Function.AVERAGE, WHOLE, values, strict, within=True).status == BAD | CALCULATED


def test_outside_of_what_is_stored_there_is_no_count() -> None:
    assert aggregate_interval(Function.COUNT, WHOLE, [], DEFAULT, within=False).status == NO_DATA


def test_a_partial_interval_says_so() -> None:
    partial = ProcessingInterval(90, 100, partial=True)
    found = aggregate_interval(Function.COUNT, partial, series((95, 1.0, G)), DEFAULT, within=True)
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
    cut = list(processing_intervals(start, end, step))
    for time_ns, _ in entries:
        assert sum(time_ns in interval for interval in cut) == 1
    values = [HistoricalValue(*entry) for entry in entries]
    counted = sum(
        aggregate_interval(
            Function.COUNT,
            i,
            [v for v in values if v.time_ns in i],
            DEFAULT,
            within=True,
        ).value  # type: ignore[misc]
        for i in cut
    )
    assert counted == len(entries)
    total = math.fsum(value for _, value in entries)
    means = [
        (aggregate_interval(Function.AVERAGE, i, inside, DEFAULT, within=True).value or 0.0) * len(inside)
        for i in cut
        if (inside := [v for v in values if v.time_ns in i])
    ]
    assert math.fsum(means) == pytest.approx(total, rel=1e-9, abs=1e-6)
