"""Process: one hostile client of a role, or one that only reads and measures how long that takes."""

import asyncio
import contextlib
import itertools
import json
import os
import struct
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from asyncua import Client, ua
from asyncua.ua.ua_binary import struct_to_binary

from impactcell.quantities import HISTORY
from tests.benchmarks._hostile_feed import CELLS
from tests.benchmarks._opcua_clients import connected
from tests.opcua_wire import frame, hello, message, open_channel

READ_EVERY_S = 0.02
TRIES = 32
"""Connections that try something at a time."""

Attack = Callable[[Client, int], Awaitable[object]]


async def measure(site: dict[str, Any], seconds: float) -> dict[str, list[float]]:
    """Read ten values fifty times a second; how long each took, milliseconds."""
    client = await connected({**site, "user": "engineer", "password": site["passwords"]["engineer"]})
    index = await client.get_namespace_index("urn:impactcell:cells")
    nodes = [client.get_node(ua.NodeId(f"{cell}/Wear/Level", index)) for cell in CELLS[:10]]
    taken, until = [], time.monotonic() + seconds
    while time.monotonic() < until:
        begin = time.perf_counter()
        await client.read_attributes(nodes)
        taken.append(1e3 * (time.perf_counter() - begin))
        await asyncio.sleep(READ_EVERY_S)
    await client.disconnect()
    return {"ms": taken}


async def nobody(site: dict[str, Any], seconds: float) -> int:
    """Try what needs no login: half Hellos, messages without end, requests that take long, false keys."""
    host, port = "127.0.0.1", int(site["endpoint"].split(":")[2].split("/")[0])
    certificate = await asyncio.to_thread(Path(site["certificate"]).read_bytes)
    policy = b"http://opcfoundation.org/UA/SecurityPolicy#Basic256Sha256"
    encrypted = b"".join(struct.pack("<i", len(part)) + part for part in (policy, certificate, b"\0" * 20))
    strings = ua.GetEndpointsRequest()
    strings.Parameters.LocaleIds = [""] * 15_000
    endpoints = struct.pack("<BBH", 1, 0, 428) + struct_to_binary(strings)[4:]
    tries, until = 0, time.monotonic() + seconds

    async def attempt(number: int) -> None:
        reader, writer = await asyncio.open_connection(host, port)
        try:
            kind = number % 4
            writer.write(hello()[:20] if kind == 0 else hello())
            if kind == 1:
                writer.write(open_channel())
                await asyncio.sleep(0.1)
                for sequence in range(2, 60):
                    body = struct.pack("<IIII", number, 13, sequence, 2) + b"\0" * 60_000
                    writer.write(frame(b"MSG", body, b"C"))
                    await writer.drain()
            elif kind == 2:
                writer.write(open_channel())
                head = await asyncio.wait_for(reader.read(200), 2.0)
                channel = struct.unpack_from("<I", head, head.find(b"OPN") + 8)[0]
                for sequence in range(2, 12):
                    writer.write(message(channel, 13, endpoints, sequence))
                await writer.drain()
            elif kind == 3:
                writer.write(frame(b"OPN", struct.pack("<I", 0) + encrypted + os.urandom(2048)))
            await asyncio.wait_for(reader.read(2**16), 2.0)
        finally:
            writer.transport.abort()

    async def keep_trying(first: int) -> None:
        nonlocal tries
        for number in itertools.count(first, TRIES):
            if time.monotonic() > until:
                return
            with contextlib.suppress(OSError, TimeoutError, struct.error):
                await attempt(number)
            tries += 1

    await asyncio.gather(*(keep_trying(number) for number in range(TRIES)))
    return tries


async def somebody(site: dict[str, Any], role: str, seconds: float) -> int:
    """Ask for as much as a role may, over eight sessions."""
    until = time.monotonic() + seconds
    attacks: list[Attack] = [
        aggregates,
        raw_history,
        reads,
        browses,
        paths,
        filters,
        items,
        refreshes,
        logins,
    ]
    if role != "observer":
        attacks += [acknowledges, shelves]
    if role == "engineer":
        attacks += [batches, switches]

    async def session(first: int) -> int:
        client = await connected({**site, "user": role, "password": site["passwords"][role]})
        index = await client.get_namespace_index("urn:impactcell:cells")
        asked = 0
        for attack in itertools.islice(itertools.cycle(attacks), first, None):
            if time.monotonic() > until:
                break
            with contextlib.suppress(ua.UaError):
                await attack(client, index)
            asked += 1
        with contextlib.suppress(ua.UaError, ConnectionError, TimeoutError):
            await client.disconnect()
        return asked

    async def keep(first: int) -> int:
        asked = 0
        while time.monotonic() < until:
            try:
                asked += await session(first)
            except (ua.UaError, ConnectionError, TimeoutError):
                await asyncio.sleep(0.5)
        return asked

    return sum(await asyncio.gather(*(keep(number) for number in range(8))))


def _past(index: int) -> list[ua.HistoryReadValueId]:
    pairs = itertools.islice(itertools.product(CELLS, HISTORY), 98)
    return [ua.HistoryReadValueId(NodeId=ua.NodeId(f"{cell}/{path}", index)) for cell, path in pairs]


def _when(seconds: float) -> Any:
    return ua.win_epoch_to_datetime(116_444_736_000_000_000 + int((1_780_000_000 + seconds) * 10**7))


async def aggregates(client: Client, index: int) -> None:
    """Ask for a thousand intervals of 98 nodes."""
    nodes = _past(index)
    details = ua.ReadProcessedDetails(
        StartTime=_when(0), EndTime=_when(10_000), ProcessingInterval=1e4,
        AggregateType=[ua.NodeId(ua.ObjectIds.AggregateFunction_Maximum)] * len(nodes),
    )  # fmt: skip
    await _history(client, details, nodes)


async def raw_history(client: Client, index: int) -> None:
    """Ask for all values of 98 nodes."""
    details = ua.ReadRawModifiedDetails(
        IsReadModified=False, StartTime=_when(0), EndTime=_when(20_000), NumValuesPerNode=0, ReturnBounds=True
    )
    await _history(client, details, _past(index))


async def _history(client: Client, details: object, nodes: list[ua.HistoryReadValueId]) -> None:
    for _ in range(3):
        parameters = ua.HistoryReadParameters(
            HistoryReadDetails=details, TimestampsToReturn=ua.TimestampsToReturn.Both,
            ReleaseContinuationPoints=False, NodesToRead=nodes,
        )  # fmt: skip
        results = await client.uaclient.history_read(parameters)
        for node, result in zip(nodes, results, strict=True):
            node.ContinuationPoint = result.ContinuationPoint


async def _ask(client: Client, request: Any) -> None:
    """Send a request, and do not look at the answer: it would cost this process more than the server."""
    await client.uaclient.protocol.send_request(request, timeout=30)


async def reads(client: Client, index: int) -> None:
    """Read ten thousand values."""
    request = ua.ReadRequest()
    request.Parameters.NodesToRead = _TEN_THOUSAND.setdefault(
        index,
        [ua.ReadValueId(NodeId=ua.NodeId("press-1/Signature/Friction", index), AttributeId=13)] * 10_000,
    )
    await _ask(client, request)


_TEN_THOUSAND: dict[int, list[ua.ReadValueId]] = {}


async def browses(client: Client, index: int) -> None:
    """Browse a cell a thousand times in one request."""
    request = ua.BrowseRequest()
    request.Parameters.NodesToBrowse = [
        ua.BrowseDescription(
            NodeId=ua.NodeId("press-1", index), BrowseDirection=ua.BrowseDirection.Both, ResultMask=63
        )
    ] * 1_000
    await _ask(client, request)


async def paths(client: Client, index: int) -> None:
    """Follow a thousand paths of twenty elements."""
    element = ua.RelativePathElement(IncludeSubtypes=True, TargetName=ua.QualifiedName("Wear", 4))
    request = ua.TranslateBrowsePathsToNodeIdsRequest()
    request.Parameters.BrowsePaths = [
        ua.BrowsePath(ua.NodeId("press-1", index), ua.RelativePath([element] * 20))
    ] * 1_000
    await _ask(client, request)


async def filters(client: Client, index: int) -> None:
    """Listen to events with the dearest filter there is, as often as may be."""
    number = await _subscription(client)
    filter_ = ua.EventFilter()
    filter_.SelectClauses = [
        ua.SimpleAttributeOperand(
            ua.NodeId(ua.ObjectIds.BaseEventType), [ua.QualifiedName("Message", 0)], ua.AttributeIds.Value
        )
    ] * 50
    filter_.WhereClause.Elements = [
        ua.ContentFilterElement(
            FilterOperator=ua.FilterOperator.And,
            FilterOperands=[ua.ElementOperand(Index=i + 1), ua.ElementOperand(Index=i + 1)],
        )
        for i in range(199)
    ] + [ua.ContentFilterElement(ua.FilterOperator.IsNull, [filter_.SelectClauses[0]])]
    await _create(client, number, ua.NodeId("press-1", index), 12, 25, filter_)


async def items(client: Client, index: int) -> None:
    """Listen to a value two thousand times, with the longest queues."""
    number = await _subscription(client)
    await _create(client, number, ua.NodeId("press-1/Wear/Level", index), 13, 2_000, None)
    request = ua.PublishRequest()
    request.Parameters.SubscriptionAcknowledgements = [ua.SubscriptionAcknowledgement(number, 7)] * 1_000
    with contextlib.suppress(TimeoutError):
        await asyncio.wait_for(_ask(client, request), 1.0)
    request = ua.DeleteSubscriptionsRequest()
    request.Parameters.SubscriptionIds = [number]
    await _ask(client, request)


async def _subscription(client: Client) -> int:
    request = ua.CreateSubscriptionRequest()
    request.Parameters.RequestedPublishingInterval = 10.0
    request.Parameters.PublishingEnabled = True
    data = await client.uaclient.protocol.send_request(request)
    return ua.ua_binary.struct_from_binary(ua.CreateSubscriptionResponse, data).Parameters.SubscriptionId


async def _create(
    client: Client, number: int, node: ua.NodeId, attribute: int, times: int, filter_: Any
) -> None:
    request = ua.CreateMonitoredItemsRequest()
    request.Parameters.SubscriptionId = number
    request.Parameters.ItemsToCreate = [
        ua.MonitoredItemCreateRequest(
            ua.ReadValueId(NodeId=node, AttributeId=attribute), ua.MonitoringMode.Reporting,
            ua.MonitoringParameters(1, 0.0, filter_, 10_000, True),
        )
    ] * times  # fmt: skip
    await _ask(client, request)


async def _call(client: Client, owner: ua.NodeId, method: ua.NodeId, *arguments: ua.Variant) -> None:
    request = ua.CallRequest()
    request.Parameters.MethodsToCall = [ua.CallMethodRequest(owner, method, list(arguments))] * 100
    await _ask(client, request)


async def refreshes(client: Client, _index: int) -> None:
    """Have all alarms told again a hundred times in one request."""
    number = ua.Variant(await _subscription(client), ua.VariantType.UInt32)
    ids = ua.ObjectIds
    await _call(client, ua.NodeId(ids.ConditionType), ua.NodeId(ids.ConditionType_ConditionRefresh), number)


async def logins(client: Client, _index: int) -> None:
    """Open as many sessions as may be on the same channel."""
    for _ in range(20):
        request = ua.CreateSessionRequest()
        request.Parameters.SessionName = "x" * 10_000
        request.Parameters.ClientNonce = os.urandom(32)
        await _ask(client, request)


async def acknowledges(client: Client, index: int) -> None:
    """Comment an alarm a hundred times in one request."""
    node = ua.NodeId("press-1/WearLimit", index)
    comment = ua.Variant(ua.LocalizedText("x" * 1_000), ua.VariantType.LocalizedText)
    event = ua.Variant(b"x" * 16, ua.VariantType.ByteString)
    await _call(client, node, ua.NodeId("press-1/WearLimit/AddComment", index), event, comment)


async def shelves(client: Client, index: int) -> None:
    """Shelve and unshelve alarms."""
    for cell in CELLS:
        for name, arguments in (("TimedShelve", (ua.Variant(1e4, ua.VariantType.Double),)), ("Unshelve", ())):
            state = f"{cell}/WearLimit/ShelvingState"
            await _call(client, ua.NodeId(state, index), ua.NodeId(f"{state}/{name}", index), *arguments)


async def batches(client: Client, index: int) -> None:
    """Begin a hundred batches in one request."""
    name, expected = ua.Variant("x" * 64), ua.Variant(True)
    await _call(client, ua.NodeId("press-1", index), ua.NodeId("press-1/StartBatch", index), name, expected)


async def switches(client: Client, index: int) -> None:
    """Take an alarm out of use and into use again."""
    for name in ("Disable", "Enable"):
        node = ua.NodeId("press-2/WearLimit", index)
        await _call(client, node, ua.NodeId(f"press-2/WearLimit/{name}", index))


async def main(site: dict[str, Any], role: str, seconds: float) -> None:
    """Do it, and say what came of it."""
    if role == "measure":
        said: object = await measure(site, seconds)
    elif role == "nobody":
        said = {"asked": await nobody(site, seconds)}
    else:
        said = {"asked": await somebody(site, role, seconds)}
    sys.stdout.write(json.dumps(said) + "\n")


if __name__ == "__main__":
    given = json.loads(sys.argv[1])
    asyncio.run(main(given["site"], given["role"], given["seconds"]))
