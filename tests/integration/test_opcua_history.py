"""HistoryRead as Part 11, 6.5.3 has it: which values come in which answer, and when more are to come."""

from collections.abc import AsyncIterator

import pytest
from asyncua import Client, ua

from impactcell.records import Alarm
from impactcell.scada import HistoryValue
from tests.opcua_server import CELL, START_NS, Site, site

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
