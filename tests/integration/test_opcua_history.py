"""HistoryRead as Part 11, 6.5.3 has it: which values come in which answer, and when more are to come."""

import asyncio
import itertools
import math
from collections.abc import AsyncIterator
from dataclasses import replace
from types import SimpleNamespace

import pytest
from asyncua import Client, ua
from asyncua.ua import ua_binary

from impactcell.opcua.history.historical_variable import VALUES_PER_PAGE
from impactcell.opcua.history.read_budget import VALUES_PER_ANSWER
from impactcell.opcua.loop_share import SLICE_S
from impactcell.quantities import HISTORY
from impactcell.records import Alarm
from impactcell.scada import HistoryRequest, HistoryValue, ValuePage
from tests.opcua_server import CELL, START_NS, MemoryHistory, Site, site
from tests.snapshots import make_capture, make_snapshot

pytestmark = pytest.mark.slow

SECOND_NS = 10**9
COUNT = 25
VARIABLE = "Friction/StaticFriction"


def moment(second: float | None) -> object:
    """Time of a second after the first value; None where none is given."""
    ticks = 0 if second is None else 116_444_736_000_000_000 + (START_NS + round(second * SECOND_NS)) // 100
    return ua.win_epoch_to_datetime(ticks)


@pytest.fixture
async def here() -> AsyncIterator[Site]:
    """A server with a value a second, and a transition of an alarm a second."""
    async with site() as running:
        running.history.stored[CELL, VARIABLE] = [
            HistoryValue(START_NS + i * SECOND_NS, float(i)) for i in range(COUNT)
        ]
        running.history.transitions[CELL] = [
            Alarm("WearLimit", active=i % 2 == 0, cycle=i, time_ns=START_NS + i * SECOND_NS)
            for i in range(COUNT)
        ]
        yield running


async def answers(
    here: Site, client: Client, path: str, details: object, most: int = 40
) -> list[list[object]]:
    """What each answer holds, until there is no continuation point."""
    node = await here.node(client, path)
    wanted = ua.HistoryReadValueId(NodeId=node.nodeid)
    parts = []
    for _ in range(most):
        parameters = ua.HistoryReadParameters(
            HistoryReadDetails=details,
            TimestampsToReturn=ua.TimestampsToReturn.Both,
            ReleaseContinuationPoints=False,
            NodesToRead=[wanted],
        )
        result = (await client.uaclient.history_read(parameters))[0]
        result.StatusCode.check()
        data = result.HistoryData
        if isinstance(data, ua.HistoryEvent):
            parts.append([event.EventFields[0].Value for event in data.Events])
        else:
            parts.append([v.Value.Value if v.Value is not None else None for v in data.DataValues])
        if not result.ContinuationPoint:
            return parts
        wanted.ContinuationPoint = result.ContinuationPoint
    raise AssertionError("it never ends")


def raw(start: float | None, end: float | None, number: int, *, bounds: bool = False) -> object:
    return ua.ReadRawModifiedDetails(
        IsReadModified=False, StartTime=moment(start), EndTime=moment(end), NumValuesPerNode=number,
        ReturnBounds=bounds,
    )  # fmt: skip


def events(start: float | None, end: float | None, number: int) -> object:
    field = ua.SimpleAttributeOperand(
        TypeDefinitionId=ua.NodeId(ua.ObjectIds.ConditionType), AttributeId=ua.AttributeIds.Value,
        BrowsePath=[ua.QualifiedName("CycleNumber", 2)],
    )  # fmt: skip
    return ua.ReadEventDetails(
        NumValuesPerNode=number, StartTime=moment(start), EndTime=moment(end),
        Filter=ua.EventFilter(SelectClauses=[field]),
    )  # fmt: skip


SPANS = {
    "start, end and number": ((3, 10.5, 3), [[3, 4, 5], [6, 7, 8], [9, 10]]),
    "the same, newest first": ((10.5, 3, 3), [[10, 9, 8], [7, 6, 5], [4]]),
    "a number that is all there is": ((3, 6, 3), [[3, 4, 5]]),
    "no number: all of it": ((3, 10.5, 0), [[3, 4, 5, 6, 7, 8, 9, 10]]),
    "start and number: so many and no more": ((3, None, 4), [[3, 4, 5, 6]]),
    "end and number: backwards from the end": ((None, 10, 4), [[10, 9, 8, 7]]),
    "a number beyond what is kept": ((20, None, 40), [[20, 21, 22, 23, 24]]),
    "one moment": ((5, 5, 1), [[5]]),
}


@pytest.mark.parametrize("name", SPANS)
async def test_values(here: Site, name: str) -> None:
    (start, end, number), expected = SPANS[name]
    async with await here.client() as client:
        assert await answers(here, client, VARIABLE, raw(start, end, number)) == expected


@pytest.mark.parametrize("name", [name for name in SPANS if name != "one moment"])
async def test_events(here: Site, name: str) -> None:
    (start, end, number), expected = SPANS[name]
    async with await here.client() as client:
        assert await answers(here, client, "", events(start, end, number)) == expected


@pytest.mark.parametrize(
    ("span", "expected"),
    [
        ((3, 7, 0), [[3, 4, 5, 6, 7]]),
        ((3.5, 6.5, 0), [[3, 4, 5, 6, 7]]),
        ((3.5, 6.5, 2), [[3, 4], [5, 6], [7]]),
        ((6.5, 3.5, 2), [[7, 6], [5, 4], [3]]),
        ((3.5, 6.5, 1), [[3], [4], [5], [6], [7]]),
        ((3, 5, 1), [[3], [4], [5]]),
        ((-2, 0.5, 0), [[None, 0, 1]]),
        ((23.5, 30, 0), [[23, 24, None]]),
    ],
)
async def test_bounds_count_as_values(
    here: Site, span: tuple[float, float, int], expected: list[list[object]]
) -> None:
    async with await here.client() as client:
        assert await answers(here, client, VARIABLE, raw(*span, bounds=True)) == expected


async def test_a_continuation_point_holds_once(here: Site) -> None:
    async with await here.client() as client:
        node = ua.HistoryReadValueId(NodeId=(await here.node(client, VARIABLE)).nodeid)
        parameters = ua.HistoryReadParameters(
            HistoryReadDetails=raw(0, 20, 5), TimestampsToReturn=ua.TimestampsToReturn.Source,
            ReleaseContinuationPoints=False, NodesToRead=[node],
        )  # fmt: skip
        point = (await client.uaclient.history_read(parameters))[0].ContinuationPoint
        node.ContinuationPoint = point
        assert (await client.uaclient.history_read(parameters))[0].StatusCode.is_good()
        again = (await client.uaclient.history_read(parameters))[0]
        assert again.StatusCode.value == ua.StatusCodes.BadContinuationPointInvalid


NODES = 98
INTERVALS = 1_000
PIECES = 100


@pytest.fixture
async def plant() -> AsyncIterator[Site]:
    """A cell with a value a second of each variable that has a past."""
    async with site() as running:
        for path in HISTORY:
            running.history.stored[CELL, path] = [
                HistoryValue(START_NS + i * SECOND_NS, float(i)) for i in range(2 * INTERVALS)
            ]
        yield running


async def test_aggregates_of_many_nodes_come_page_by_page_while_others_are_answered(
    plant: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """98 nodes of 1000 intervals: each value is read once, and another client has its turn in between."""
    # By this clock a turn is over after so many pieces, however quick the machine is.
    clock = SimpleNamespace(perf_counter=itertools.count(0.0, SLICE_S / PIECES).__next__)
    monkeypatch.setattr("impactcell.opcua.loop_share.time", clock)
    monkeypatch.setattr("impactcell.opcua.history.read_budget.LONGEST_S", math.inf)
    read, longest = 0, 0

    async def values(cell: str, variable: str, request: HistoryRequest) -> ValuePage:
        nonlocal read, longest
        page = await MemoryHistory.values(plant.history, cell, variable, replace(request, limit=250))
        read += len(page.values)
        longest = max(longest, request.limit)
        return page

    monkeypatch.setattr(plant.history, "values", values)
    async with await plant.client() as client, await plant.client() as other:
        index = await client.get_namespace_index("urn:impactcell:cells")
        nodes = [
            ua.HistoryReadValueId(NodeId=ua.NodeId(f"{CELL}/{path}", index))
            for path in itertools.islice(itertools.cycle(HISTORY), NODES)
        ]
        asked, answered = asyncio.create_task(all_of(client, nodes)), 0
        value = await plant.node(other, "Wear/Level")
        while not asked.done():
            await value.read_data_value(raise_on_bad_status=False)
            answered += 1
        results, requests = await asked
    expected = [2.0 * i + 0.5 for i in range(INTERVALS)]
    assert all(means == expected for means in results)
    # Each value once, and those once more that came with a page which the answer had no room for.
    assert read <= NODES * 2 * INTERVALS + 250 * requests
    assert longest <= VALUES_PER_PAGE
    assert requests == NODES * INTERVALS // VALUES_PER_ANSWER + 1
    turns = NODES * INTERVALS / PIECES
    assert answered > turns / 20  # a read takes several turns, of both ends, which share this loop


async def all_of(client: Client, nodes: list[ua.HistoryReadValueId]) -> tuple[list[list[float]], int]:
    """Means of two seconds each, of all nodes; and how many requests it took."""
    details = ua.ReadProcessedDetails(
        StartTime=moment(0), EndTime=moment(2 * INTERVALS), ProcessingInterval=2e3,
        AggregateType=[ua.NodeId(ua.ObjectIds.AggregateFunction_Average)],
        AggregateConfiguration=ua.AggregateConfiguration(UseServerCapabilitiesDefaults=True),
    )  # fmt: skip
    results: dict[int, list[float]] = {id(node): [] for node in nodes}
    requests, unread = 0, nodes
    while unread:
        requests += 1
        details.AggregateType = details.AggregateType[:1] * len(unread)
        parameters = ua.HistoryReadParameters(
            HistoryReadDetails=details, TimestampsToReturn=ua.TimestampsToReturn.Source,
            ReleaseContinuationPoints=False, NodesToRead=unread,
        )  # fmt: skip
        answers = await client.uaclient.history_read(parameters)
        for node, answer in zip(unread, answers, strict=True):
            answer.StatusCode.check()
            if isinstance(answer.HistoryData, ua.HistoryData):
                results[id(node)] += [v.Value.Value for v in answer.HistoryData.DataValues]
            node.ContinuationPoint = answer.ContinuationPoint
        unread = [node for node in unread if node.ContinuationPoint]
    return list(results.values()), requests


async def test_an_answer_ends_when_its_time_is_over(here: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("impactcell.opcua.history.read_budget.LONGEST_S", 0.0)
    monkeypatch.setattr(here.history, "values", one_by_one(here))
    async with await here.client() as client:
        assert await answers(here, client, VARIABLE, raw(3, 6, 0)) == [[3], [4], [5]]


async def test_a_value_has_one_time_live_and_in_the_history(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the ticks on the wire: asyncua's client rounds both, and others merge by them."""
    ticks, decoded = set[int](), ua_binary.ua.win_epoch_to_datetime
    snapshot = make_snapshot(make_capture(1, time_ns=START_NS + 123_456_789), 0.2)
    time_ns = snapshot.time_ns
    monkeypatch.setattr(
        ua_binary.ua, "win_epoch_to_datetime", lambda epoch: ticks.add(epoch) or decoded(epoch)
    )
    async with site() as here, await here.client() as client:
        here.server.publish(CELL, snapshot)
        here.history.stored[CELL, VARIABLE] = [HistoryValue(time_ns, 0.2)]
        ticks.clear()
        await (await here.node(client, VARIABLE)).read_data_value()
        live = _near(ticks, time_ns)
        ticks.clear()
        assert await answers(here, client, VARIABLE, raw(0, None, 1)) == [[0.2]]
        assert _near(ticks, time_ns) == live
        assert len(live) == 1


def _near(ticks: set[int], time_ns: int) -> set[int]:
    expected = time_ns // 100 + 116_444_736_000_000_000
    return {tick for tick in ticks if abs(tick - expected) <= 10}


SPANS_OF_SHOWN_TIMES = {
    "forwards": ((1, 3, 0), [[1, 2]]),
    "backwards": ((3, 1, 0), [[3, 2]]),
    "backwards from the end": ((None, 3, 2), [[3, 2]]),
    "one moment": ((2, 2, 1), [[2]]),
}


@pytest.mark.parametrize("name", SPANS_OF_SHOWN_TIMES)
async def test_a_time_that_was_shown_is_found(name: str) -> None:
    """Stored times are of the nanosecond; who asks knows those that were told."""
    (start, end, number), expected = SPANS_OF_SHOWN_TIMES[name]
    async with site() as here, await here.client() as client:
        stored = [START_NS + i * SECOND_NS + 789 for i in range(5)]
        here.history.stored[CELL, VARIABLE] = [HistoryValue(t, float(i)) for i, t in enumerate(stored)]
        here.history.transitions[CELL] = [
            Alarm("WearLimit", active=True, cycle=i, time_ns=t) for i, t in enumerate(stored)
        ]
        assert await answers(here, client, VARIABLE, raw(start, end, number)) == expected
        if start != end:
            assert await answers(here, client, "", events(start, end, number)) == expected


async def test_a_value_at_a_bound_is_no_bound_of_its_own() -> None:
    async with site() as here, await here.client() as client:
        here.history.stored[CELL, VARIABLE] = [
            HistoryValue(START_NS + i * SECOND_NS + 789, float(i)) for i in range(5)
        ]
        assert await answers(here, client, VARIABLE, raw(1, 3, 0, bounds=True)) == [[1, 2, 3]]
        assert await answers(here, client, VARIABLE, raw(3, 1, 0, bounds=True)) == [[3, 2, 1]]


def one_by_one(here: Site) -> object:
    async def values(cell: str, variable: str, request: HistoryRequest) -> ValuePage:
        return await MemoryHistory.values(here.history, cell, variable, replace(request, limit=1))

    return values


@pytest.mark.parametrize("other", ["another node", "another kind of question"])
async def test_a_continuation_point_goes_on_with_its_own_question(here: Site, other: str) -> None:
    here.history.stored[CELL, "Wear/Level"] = [HistoryValue(START_NS, 1.0)]
    async with await here.client() as client:
        node = ua.HistoryReadValueId(NodeId=(await here.node(client, VARIABLE)).nodeid)
        parameters = ua.HistoryReadParameters(
            HistoryReadDetails=raw(0, 20, 5), TimestampsToReturn=ua.TimestampsToReturn.Source,
            ReleaseContinuationPoints=False, NodesToRead=[node],
        )  # fmt: skip
        node.ContinuationPoint = (await client.uaclient.history_read(parameters))[0].ContinuationPoint
        if other == "another node":
            node.NodeId = (await here.node(client, "Wear/Level")).nodeid
        else:
            parameters.HistoryReadDetails = ua.ReadProcessedDetails(
                StartTime=moment(0), EndTime=moment(9), ProcessingInterval=1e3,
                AggregateType=[ua.NodeId(ua.ObjectIds.AggregateFunction_Count)],
            )  # fmt: skip
        again = (await client.uaclient.history_read(parameters))[0]
        assert again.StatusCode.value == ua.StatusCodes.BadContinuationPointInvalid
