"""What one request costs in one piece: the longest step on the event loop in calls, against its size.

Calls are counted, not time: the figures are the same on any machine. By a clock that tells ten pieces for one
slice, whoever gives way does so every ten pieces; a step that grows with the request is one that does not.
"""

import asyncio
import contextlib
import itertools
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from types import SimpleNamespace

import pytest
import pytest_asyncio
from asyncua import Client, ua
from asyncua.ua.ua_binary import struct_from_binary

from impactcell.alarms import NAMES
from impactcell.opcua.loop_share import SLICE_S
from impactcell.quantities import HISTORY
from impactcell.scada import HistoryValue
from tests.opcua_server import CELL, START_NS, Site, site
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.asyncio(loop_scope="module")
ids, codes = ua.ObjectIds, ua.StatusCodes

PIECES = 10
"""Pieces in a slice."""
MOST_CALLS = 25_000
"""Calls in one step, of Python functions and of compiled ones: some 3 ms."""
GROWTH = 1.25
"""How much the longest step may grow with a request of four times the size."""
FEW_CALLS = 2_500
"""Steps up to here are as good as none: 0.3 ms."""

Ask = Callable[[Site, Client, int], Awaitable[object]]


def _is_of_the_server(callback: object) -> bool:
    owner = getattr(callback, "__self__", callback)
    owner = getattr(owner, "_protocol", owner)
    if isinstance(owner, asyncio.Task):
        return owner.get_name().startswith("opcua")
    module = getattr(owner, "__module__", None) or type(owner).__module__
    return str(module).startswith("impactcell.opcua")


class Steps:
    """The longest step of the server since it was asked last."""

    def __init__(self) -> None:
        self.longest = 0
        self._calls = 0

    def _count(self, _frame: object, event: str, _argument: object) -> None:
        self._calls += event in {"call", "c_call"}

    @contextlib.contextmanager
    def watched(self) -> Iterator[None]:
        run, self.longest = asyncio.events.Handle._run, 0

        def counted(handle: asyncio.Handle) -> None:
            if not _is_of_the_server(handle._callback):
                run(handle)
                return
            self._calls = 0
            sys.setprofile(self._count)
            try:
                run(handle)
            finally:
                sys.setprofile(None)
            self.longest = max(self.longest, self._calls)

        asyncio.events.Handle._run = counted  # type: ignore[method-assign]
        try:
            yield
        finally:
            asyncio.events.Handle._run = run  # type: ignore[method-assign]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def here() -> AsyncIterator[Site]:
    cells = [f"press-{number}" for number in range(1, 5)]
    async with site(cells=cells) as running:
        for path in HISTORY:
            running.history.stored[CELL, path] = [
                HistoryValue(START_NS + i * 10**9, float(i)) for i in range(2_000)
            ]
        for cell in cells:
            running.publish(cell=cell)
            for name in NAMES:
                running.raise_alarm(name, cell=cell)
        yield running


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock by which a slice is over after so many pieces."""
    counted = SimpleNamespace(perf_counter=itertools.count(0.0, SLICE_S / PIECES).__next__)
    monkeypatch.setattr("impactcell.opcua.loop_share.time", counted)
    monkeypatch.setattr("impactcell.opcua.fan_out.time", counted)


async def _send(client: Client, request: object) -> bytes:
    return await client.uaclient.protocol.send_request(request, timeout=PATIENCE_S)


async def _level(client: Client) -> ua.NodeId:
    return ua.NodeId(f"{CELL}/Wear/Level", await client.get_namespace_index("urn:impactcell:cells"))


async def _cell(client: Client) -> ua.NodeId:
    return ua.NodeId(CELL, await client.get_namespace_index("urn:impactcell:cells"))


async def _subscription(client: Client, *, enabled: bool = True) -> int:
    request = ua.CreateSubscriptionRequest()
    request.Parameters.RequestedPublishingInterval = 3.6e6
    request.Parameters.PublishingEnabled = enabled
    return struct_from_binary(
        ua.CreateSubscriptionResponse, await _send(client, request)
    ).Parameters.SubscriptionId


async def _items(client: Client, number: int, size: int, attribute: int = 13, filter_: object = None) -> None:
    """Listen; no queue is so short that it runs over, which would cost some step more."""
    request = ua.CreateMonitoredItemsRequest()
    request.Parameters.SubscriptionId = number
    node = await (_level if attribute == ua.AttributeIds.Value else _cell)(client)
    request.Parameters.ItemsToCreate = [
        ua.MonitoredItemCreateRequest(
            ua.ReadValueId(NodeId=node, AttributeId=attribute), ua.MonitoringMode.Reporting,
            ua.MonitoringParameters(1, 0.0, filter_, 1_000 if filter_ else 100, True),
        )
    ] * size  # fmt: skip
    await _send(client, request)


async def _subscribed(client: Client, size: int, *, enabled: bool = True) -> int:
    number = await _subscription(client, enabled=enabled)
    await _items(client, number, size)
    return number


async def _delete(client: Client, number: int) -> None:
    request = ua.DeleteSubscriptionsRequest()
    request.Parameters.SubscriptionIds = [number]
    await _send(client, request)


async def read(_here: Site, client: Client, size: int) -> None:
    request = ua.ReadRequest()
    request.Parameters.NodesToRead = [ua.ReadValueId(NodeId=await _level(client), AttributeId=13)] * size
    await _send(client, request)


async def write(_here: Site, client: Client, size: int) -> None:
    request = ua.WriteRequest()
    value = ua.WriteValue(await _level(client), 13, None, ua.DataValue(ua.Variant(1.0)))
    request.Parameters.NodesToWrite = [value] * size
    await _send(client, request)


async def browse(_here: Site, client: Client, size: int) -> None:
    request = ua.BrowseRequest()
    request.Parameters.NodesToBrowse = [
        ua.BrowseDescription(
            NodeId=await _cell(client), BrowseDirection=ua.BrowseDirection.Both, ResultMask=63
        )
    ] * size
    await _send(client, request)


async def translate(_here: Site, client: Client, size: int) -> None:
    request = ua.TranslateBrowsePathsToNodeIdsRequest()
    element = ua.RelativePathElement(IncludeSubtypes=True, TargetName=ua.QualifiedName("Wear", 4))
    path = ua.BrowsePath(await _cell(client), ua.RelativePath([element] * 20))
    request.Parameters.BrowsePaths = [path] * size
    await _send(client, request)


async def register(_here: Site, client: Client, size: int) -> None:
    request = ua.RegisterNodesRequest()
    request.Parameters.NodesToRegister = [await _level(client)] * size
    await _send(client, request)


async def create_items(_here: Site, client: Client, size: int) -> None:
    await _delete(client, await _subscribed(client, size))


async def change_items(_here: Site, client: Client, size: int) -> None:
    number = await _subscribed(client, size)
    modify, mode = ua.ModifyMonitoredItemsRequest(), ua.SetMonitoringModeRequest()
    modify.Parameters.SubscriptionId = mode.Parameters.SubscriptionId = number
    modify.Parameters.ItemsToModify = [
        ua.MonitoredItemModifyRequest(1 + item, ua.MonitoringParameters(1, 0.0, None, 10, True))
        for item in range(size)
    ]
    mode.Parameters.MonitoredItemIds = [1 + item for item in range(size)]
    await _send(client, modify)
    for mode.Parameters.MonitoringMode in (ua.MonitoringMode.Disabled, ua.MonitoringMode.Reporting):
        await _send(client, mode)
    delete = ua.DeleteMonitoredItemsRequest()
    delete.Parameters.SubscriptionId = number
    delete.Parameters.MonitoredItemIds = mode.Parameters.MonitoredItemIds
    await _send(client, delete)
    await _delete(client, number)


async def transfer(_here: Site, client: Client, size: int) -> None:
    """Take over the same subscription, and all its values, many times."""
    number = await _subscribed(client, size)
    request = ua.TransferSubscriptionsRequest()
    request.Parameters.SubscriptionIds = [number] * size
    request.Parameters.SendInitialValues = True
    await _send(client, request)
    await _delete(client, number)


async def publish(here: Site, client: Client, size: int) -> None:
    """Let values pile up, and then ask for all of them at once."""
    number = await _subscribed(client, size, enabled=False)
    for _ in range(10):
        here.publish()
        while here.server._host._values._fan_out._waiting:
            await asyncio.sleep(0)
    asked = [asyncio.ensure_future(_send(client, ua.PublishRequest())) for _ in range(20)]
    request = ua.SetPublishingModeRequest()
    request.Parameters.PublishingEnabled = True
    request.Parameters.SubscriptionIds = [number]
    await _send(client, request)
    subscription = here.server._host.subscription_service._subscriptions[number]
    asyncio.get_running_loop().call_soon(subscription._tick)
    while subscription._ready_items:
        await asyncio.sleep(0)
    await _delete(client, number)
    await asyncio.gather(*asked, return_exceptions=True)  # what is left over is answered with a fault


async def acknowledge(_here: Site, client: Client, size: int) -> None:
    number = await _subscription(client)
    request = ua.PublishRequest()
    request.Parameters.SubscriptionAcknowledgements = [ua.SubscriptionAcknowledgement(number, 7)] * size
    asked = asyncio.ensure_future(_send(client, request))
    await _delete(client, number)
    await asyncio.wait([asked])
    assert isinstance(asked.exception(), ua.uaerrors.BadNoSubscription)


async def refresh(_here: Site, client: Client, size: int) -> None:
    """Have all alarms told again, in one request many times, to as many as may listen."""
    number = await _subscription(client)
    filter_ = ua.EventFilter()
    filter_.SelectClauses = [
        ua.SimpleAttributeOperand(
            ua.NodeId(ids.BaseEventType), [ua.QualifiedName("Message", 0)], ua.AttributeIds.Value
        )
    ] * 5
    await _items(client, number, 5, ua.AttributeIds.EventNotifier, filter_)
    request = ua.CallRequest()
    request.Parameters.MethodsToCall = [
        ua.CallMethodRequest(
            ua.NodeId(ids.ConditionType), ua.NodeId(ids.ConditionType_ConditionRefresh),
            [ua.Variant(number, ua.VariantType.UInt32)],
        )
    ] * (size // 50)  # fmt: skip
    await _send(client, request)
    await _delete(client, number)


async def call(_here: Site, client: Client, size: int) -> None:
    node = await _cell(client)
    method = ua.NodeId(f"{CELL}/WearLimit/AddComment", node.NamespaceIndex)
    request = ua.CallRequest()
    request.Parameters.MethodsToCall = [
        ua.CallMethodRequest(
            ua.NodeId(f"{CELL}/WearLimit", node.NamespaceIndex), method,
            [ua.Variant(b"x" * 16), ua.Variant(ua.LocalizedText("x" * 100))],
        )
    ] * min(size // 10, 100)  # fmt: skip
    await _send(client, request)


async def _history(client: Client, details: object, size: int) -> None:
    index = await client.get_namespace_index("urn:impactcell:cells")
    nodes = [
        ua.HistoryReadValueId(NodeId=ua.NodeId(f"{CELL}/{path}", index))
        for path in itertools.islice(itertools.cycle(HISTORY), max(size // 10, 1))
    ]
    if isinstance(details, ua.ReadProcessedDetails):
        details.AggregateType = [ua.NodeId(ids.AggregateFunction_Maximum)] * len(nodes)
    request = ua.HistoryReadRequest()
    request.Parameters.HistoryReadDetails = details
    request.Parameters.TimestampsToReturn = ua.TimestampsToReturn.Both
    request.Parameters.NodesToRead = nodes
    await _send(client, request)


def _when(seconds: float) -> object:
    return ua.win_epoch_to_datetime(116_444_736_000_000_000 + START_NS // 100 + int(seconds * 10**7))


async def raw_history(_here: Site, client: Client, size: int) -> None:
    details = ua.ReadRawModifiedDetails(
        IsReadModified=False, StartTime=_when(0), EndTime=_when(4e3), NumValuesPerNode=0, ReturnBounds=True
    )
    await _history(client, details, size)


async def aggregates(_here: Site, client: Client, size: int) -> None:
    details = ua.ReadProcessedDetails(StartTime=_when(0), EndTime=_when(size), ProcessingInterval=1e3)
    await _history(client, details, size)


async def end_session(here: Site, _client: Client, size: int) -> None:
    """Leave at once, with all subscriptions."""
    async with await here.client("engineer") as other:
        for _ in range(3):
            await _subscribed(other, size)


@pytest.mark.slow
@pytest.mark.parametrize(
    "ask",
    [
        read, write, browse, translate, register, create_items, change_items, transfer, publish, acknowledge,
        refresh, call, raw_history, aggregates, end_session,
    ],
    ids=lambda ask: ask.__name__,
)  # fmt: skip
async def test_no_step_grows_with_the_request(here: Site, ask: Ask) -> None:
    steps = Steps()
    async with await here.client("operator") as client:
        longest = list[int]()
        for size in (200, 200, 800):  # the first time, what is made once is made
            with steps.watched():
                await ask(here, client, size)
            longest.append(steps.longest)
    print(longest)
    _, small, large = longest
    assert 0 < large < MOST_CALLS
    assert large <= max(GROWTH * small, FEW_CALLS), f"{small} calls with 200, {large} with 800"
