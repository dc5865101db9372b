"""What one client can take: places, bytes, sessions and items are bounded for it, and others keep theirs."""

import asyncio
import contextlib
import gc
import struct
import threading
import weakref
from collections.abc import AsyncIterator, Awaitable, Callable
from datetime import UTC, datetime

import pytest
import pytest_asyncio
from asyncua import Client, ua
from asyncua.ua.ua_binary import struct_to_binary

from impactcell.opcua.services.view_service import MAX_BROWSE_POINTS
from impactcell.opcua.sessions.large_requests import LARGE_BYTES
from impactcell.opcua.transport.tcp_connection import TcpConnection
from impactcell.scada import ServerLimits, ValuePage
from impactcell.scada.users import Users
from tests.opcua_server import PASSWORDS, Site, site
from tests.opcua_wire import frame, hello, message, raw
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.asyncio(loop_scope="module")
codes = ua.StatusCodes
CREATE_SESSION = 461
"""Encoding of a CreateSessionRequest (OPC UA NodeIds)."""
SLOW = {"hello_s": 3600.0, "activation_s": 3600.0}
"""Nothing in these tests ends because the machine is slow."""


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def here() -> AsyncIterator[Site]:
    limits = ServerLimits(
        sessions_per_user=2, items_per_user=50, event_items_per_user=3, **SLOW
    )  # fmt: skip
    async with site(limits=limits) as running:
        running.publish()
        yield running


@pytest.mark.slow
async def test_half_hellos_give_way_to_newcomers() -> None:
    """All places are held by connections that never say who they are: who wants to log in can."""
    async with (
        site(limits=ServerLimits(connections=5, undisturbed_s=0.0, **SLOW)) as here,
        contextlib.AsyncExitStack() as stack,
    ):
        async with await here.client() as inside:
            for _ in range(12):
                wire = await stack.enter_async_context(raw(here))
                await wire.send(hello()[:20])
            async with await here.client("operator") as newcomer:
                for client in (inside, newcomer):
                    await (await here.node(client, "Module/Connected")).read_data_value(False)


@pytest.mark.slow
@pytest.mark.parametrize("bound", ["connections", "connections_per_address"])
async def test_who_has_logged_in_does_not_give_way(bound: str) -> None:
    async with site(limits=ServerLimits(**{bound: 2}, undisturbed_s=0.0, **SLOW)) as here:
        async with await here.client() as first, await here.client("operator") as second:
            async with raw(here) as wire:
                assert await wire.error() == codes.BadTcpServerTooBusy
            for client in (first, second):
                await (await here.node(client, "Module/Connected")).read_data_value(False)


@pytest.mark.slow
@pytest.mark.parametrize("undisturbed_s", [0.0, 3600.0])
async def test_sessions_that_nobody_logs_in_to_give_way(undisturbed_s: float) -> None:
    """All places are held by sessions without a user: who wants to log in can, but not at once."""
    async with (
        site(limits=ServerLimits(sessions=2, undisturbed_s=undisturbed_s, **SLOW)) as here,
        contextlib.AsyncExitStack() as stack,
    ):
        for _ in range(2):
            idle = await here.client()
            await idle.connect_socket()
            stack.callback(idle.disconnect_socket)
            await idle.send_hello()
            await idle.open_secure_channel()
            await idle.create_session()
        newcomer = await here.client("operator")
        if undisturbed_s:
            with pytest.raises(ua.UaStatusCodeError) as refused:
                await newcomer.connect()
            assert refused.value.code == codes.BadTooManySessions
        else:
            async with newcomer:
                await (await here.node(newcomer, "Module/Connected")).read_data_value(False)


@pytest.mark.slow
async def test_one_address_has_its_places_and_no_more() -> None:
    limits = ServerLimits(connections=10, connections_per_address=2, undisturbed_s=3600.0, **SLOW)
    async with site(limits=limits) as here, contextlib.AsyncExitStack() as stack:
        for _ in range(2):
            wire = await stack.enter_async_context(raw(here))
            await wire.send(hello())
            assert (await wire.receive())[0] == b"ACK"
        async with raw(here) as wire:
            assert await wire.error() == codes.BadTcpServerTooBusy


@pytest.mark.slow
async def test_a_long_message_is_for_those_who_have_logged_in(here: Site) -> None:
    async with raw(here) as wire:
        channel, _ = await wire.channel()
        with contextlib.suppress(ConnectionError):
            for sequence in (2, 3):
                body = struct.pack("<II", sequence, 2) + b"\0" * 60_000
                await wire.send(frame(b"MSG", struct.pack("<II", channel, 13) + body, b"C"))
        assert await wire.error() == codes.BadTcpMessageTooLarge


@pytest.mark.slow
async def test_an_address_that_holds_too_many_unfinished_bytes(
    here: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "impactcell.opcua.transport.connection_table.MAX_UNFINISHED_BYTES_PER_ADDRESS", 100_000
    )
    async with contextlib.AsyncExitStack() as stack:
        wires = [await stack.enter_async_context(raw(here)) for _ in range(3)]
        for wire in wires:
            channel, _ = await wire.channel()
            body = struct.pack("<II", 2, 2) + b"\0" * 50_000
            await wire.send(frame(b"MSG", struct.pack("<II", channel, 13) + body, b"C"))
            await wire.send(frame(b"MSG", b"", b"C", size=60_000)[:8] + b"\0" * 20_000)
        assert await wires[1].error() == codes.BadTcpNotEnoughResources


@pytest.mark.slow
async def test_an_open_request_of_many_encrypted_blocks(here: Site) -> None:
    """Each block would be decrypted with the server's key, for whoever knows a trusted certificate."""
    policy = b"http://opcfoundation.org/UA/SecurityPolicy#Basic256Sha256"
    certificate = here.certificate.read_bytes()
    security = b"".join(
        struct.pack("<i", len(part)) + part for part in (policy, certificate, b"\0" * 20)
    )  # fmt: skip
    async with raw(here) as wire:
        await wire.send(hello())
        assert (await wire.receive())[0] == b"ACK"
        await wire.send(frame(b"OPN", struct.pack("<I", 0) + security + b"\1" * 256 * 17))
        assert await wire.error() == codes.BadTcpMessageTooLarge


@pytest.mark.slow
async def test_a_connection_that_has_ended_is_freed_at_once(
    here: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It leaves no cycle for the garbage collector, whose rounds hold everybody: however it ended."""
    freed: list[asyncio.Event] = []
    made = TcpConnection.connection_made

    def watched(self: TcpConnection, transport: asyncio.BaseTransport) -> None:
        made(self, transport)
        freed.append(asyncio.Event())
        weakref.finalize(self, freed[-1].set)

    monkeypatch.setattr(TcpConnection, "connection_made", watched)
    gc.disable()
    try:
        async with raw(here) as wire:  # in the middle of a Hello
            await wire.send(hello()[:20])
        async with raw(here) as wire:  # in the middle of a message
            channel, token = await wire.channel()
            await wire.send(message(channel, token, b"\0" * 60_000, chunk=b"C"))
        async with raw(here) as wire:  # by the server
            await wire.send(hello() + frame(b"XYZ", b"12345678"))
            assert await wire.error() == codes.BadTcpMessageTypeInvalid
        async with await here.client() as client:  # as it should
            await (await here.node(client, "Module/Connected")).read_data_value(False)
        assert len(freed) >= 4
        for ended in freed:
            await asyncio.wait_for(ended.wait(), PATIENCE_S)
    finally:
        gc.enable()


@pytest.mark.slow
async def test_one_user_cannot_hold_all_sessions(here: Site) -> None:
    async with await here.client() as first, await here.client() as second:
        third = await here.client()
        with pytest.raises(ua.UaStatusCodeError) as refused:
            await third.connect()
        assert refused.value.code == codes.BadTooManySessions
        async with await here.client("operator") as other:
            for client in (first, second, other):
                await (await here.node(client, "Module/Connected")).read_data_value(False)


@pytest.mark.slow
async def test_a_session_without_a_client_gives_way_to_one_of_the_same_user(here: Site) -> None:
    async with contextlib.AsyncExitStack() as stack:
        for _ in range(2):
            lost = await here.client("engineer")
            await lost.connect()
            await lost.create_subscription(1000.0, _Silent())  # so that the session waits for its client
            stack.push_async_callback(_forget, lost)
        gone = next(iter(_connections(here, "engineer")))
        gone._transport.abort()
        await gone.wait_closed()
        async with await here.client("engineer") as newcomer:
            await (await here.node(newcomer, "Module/Connected")).read_data_value(False)


class _Silent:
    pass


async def _forget(client: Client) -> None:
    with contextlib.suppress(ConnectionError, TimeoutError, ua.UaError):
        await asyncio.wait_for(client.disconnect(), 5.0)


def _connections(here: Site, user: str) -> list[TcpConnection]:
    sessions = here.server._host._sessions.all()
    return [s.connection for s in sessions if s.actor is not None and s.actor.user == user]


@pytest.mark.slow
async def test_the_name_of_a_session_is_short(here: Site) -> None:
    client = await here.client()
    client.description = client.name = "x" * 20_000
    async with client:
        assert all(len(session.name) <= 128 for session in here.server._host._sessions.all())


@pytest.mark.slow
async def test_acknowledgements_are_bounded(here: Site) -> None:
    async with await here.client() as client:
        await client.create_subscription(1000.0, _Silent())
        request = ua.PublishRequest()
        request.Parameters.SubscriptionAcknowledgements = [ua.SubscriptionAcknowledgement()] * 1_001
        with pytest.raises(ua.UaStatusCodeError) as refused:
            await client.uaclient.protocol.send_request(request)
        assert refused.value.code == codes.BadTooManyOperations


@pytest.mark.slow
async def test_an_answer_to_browse_has_room_for_so_many_references(
    here: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rest comes by continuation points, and those that an answer gives hold until they are used."""
    monkeypatch.setattr("impactcell.opcua.services.view_service.MAX_REFERENCES_PER_ANSWER", 20)
    async with await here.client() as client:
        cell = (await here.node(client, "")).nodeid
        whole = (await browse(client, [cell]))[0]
        first = whole.References
        while whole.ContinuationPoint:
            (whole,) = await browse_next(client, [whole.ContinuationPoint])
            first += whole.References
        assert len(first) > 20
        assert len({str(reference.NodeId) + str(reference.ReferenceTypeId) for reference in first}) == len(
            first
        )
        results = await browse(client, [cell] * (MAX_BROWSE_POINTS + 5))
        assert sum(len(result.References) for result in results) == 20
        statuses = [result.StatusCode.value for result in results]
        assert statuses == [0] * MAX_BROWSE_POINTS + [codes.BadNoContinuationPoints] * 5
        again = await browse_next(client, [result.ContinuationPoint for result in results[:3]])
        assert [result.StatusCode.value for result in again] == [0, 0, 0]
        assert sum(len(result.References) for result in again) == 20


async def browse(client: Client, nodes: list[ua.NodeId]) -> list[ua.BrowseResult]:
    parameters = ua.BrowseParameters()
    parameters.NodesToBrowse = [
        ua.BrowseDescription(NodeId=node, BrowseDirection=ua.BrowseDirection.Forward, ResultMask=63)
        for node in nodes
    ]
    return await client.uaclient.browse(parameters)


async def browse_next(client: Client, points: list[bytes]) -> list[ua.BrowseResult]:
    parameters = ua.BrowseNextParameters()
    parameters.ContinuationPoints = points
    parameters.ReleaseContinuationPoints = False
    return await client.uaclient.browse_next(parameters)


@pytest.mark.slow
async def test_monitored_items_are_bounded_for_a_user(here: Site) -> None:
    async with await here.client() as client, await here.client() as second:
        counts = []
        for each in (client, second):
            subscription = await each.create_subscription(1000.0, _Silent())
            counts.append(await created(each, subscription.subscription_id, await items(here, each, 40)))
        assert counts == [40, 10]
        async with await here.client("operator") as other:
            subscription = await other.create_subscription(1000.0, _Silent())
            assert await created(other, subscription.subscription_id, await items(here, other, 40)) == 40


@pytest.mark.slow
async def test_event_items_are_bounded_for_a_user(here: Site) -> None:
    async with await here.client("engineer") as client:
        subscription = await client.create_subscription(1000.0, _Silent())
        wanted = await items(here, client, 5, path="", attribute=ua.AttributeIds.EventNotifier)
        assert await created(client, subscription.subscription_id, wanted) == 3


@pytest.mark.slow
async def test_queues_of_a_subscription_are_bounded_together(
    here: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impactcell.opcua.subscriptions.subscription.QUEUED_VALUES", 25)
    async with await here.client("engineer") as client:
        subscription = await client.create_subscription(1000.0, _Silent())
        parameters = ua.CreateMonitoredItemsParameters()
        parameters.SubscriptionId = subscription.subscription_id
        parameters.ItemsToCreate = await items(here, client, 4, queue=10)
        results = await client.uaclient.create_monitored_items(parameters)
        assert [result.RevisedQueueSize for result in results] == [10, 10, 5, 1]
        change = ua.ModifyMonitoredItemsParameters()
        change.SubscriptionId = subscription.subscription_id
        change.ItemsToModify = [
            ua.MonitoredItemModifyRequest(
                MonitoredItemId=results[3].MonitoredItemId,
                RequestedParameters=ua.MonitoringParameters(QueueSize=10),
            )
        ]
        assert (await client.uaclient.modify_monitored_items(change))[0].RevisedQueueSize == 1
        await client.uaclient.delete_monitored_items(
            ua.DeleteMonitoredItemsParameters(subscription.subscription_id, [results[0].MonitoredItemId])
        )
        assert (await client.uaclient.modify_monitored_items(change))[0].RevisedQueueSize == 10


async def items(
    here: Site, client: Client, number: int, path: str = "Wear/Level", *,
    attribute: ua.AttributeIds = ua.AttributeIds.Value, queue: int = 1,
) -> list[ua.MonitoredItemCreateRequest]:  # fmt: skip
    target = ua.ReadValueId(NodeId=(await here.node(client, path)).nodeid, AttributeId=attribute)
    filter_ = None if attribute == ua.AttributeIds.Value else ua.EventFilter()
    if filter_ is not None:
        filter_.SelectClauses = [
            ua.SimpleAttributeOperand(
                ua.NodeId(ua.ObjectIds.BaseEventType), [ua.QualifiedName("Message", 0)], ua.AttributeIds.Value
            )
        ]
    return [
        ua.MonitoredItemCreateRequest(
            target, ua.MonitoringMode.Reporting, ua.MonitoringParameters(i, 0.0, filter_, queue, True)
        )
        for i in range(number)
    ]


async def created(client: Client, number: int, wanted: list[ua.MonitoredItemCreateRequest]) -> int:
    parameters = ua.CreateMonitoredItemsParameters()
    parameters.SubscriptionId, parameters.ItemsToCreate = number, wanted
    results = await client.uaclient.create_monitored_items(parameters)
    refused = {result.StatusCode.value for result in results if not result.StatusCode.is_good()}
    assert refused <= {codes.BadTooManyMonitoredItems}
    return sum(result.StatusCode.is_good() for result in results)


@pytest.mark.slow
async def test_a_request_that_takes_long_to_decode_is_refused(here: Site) -> None:
    """Fifteen thousand empty strings: few bytes, and many of them to read."""
    request = ua.CreateSessionRequest()
    request.Parameters.ClientDescription.DiscoveryUrls = [""] * 15_000
    body = struct.pack("<BBH", 1, 0, CREATE_SESSION) + struct_to_binary(request)[4:]
    async with raw(here) as wire:
        channel, _ = await wire.channel()
        await wire.send(message(channel, 13, body))
        answer = (await wire.receive())[1]
        assert struct.unpack("<I", answer[16 + 4 + 8 + 4 : 16 + 4 + 8 + 8])[0] == codes.BadDecodingError


@pytest.mark.slow
async def test_an_answer_that_would_be_too_long_is_refused(
    here: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is encrypted keeps the loop: a curve that is asked for a thousand times in one request."""
    monkeypatch.setattr("impactcell.opcua.binary_codec.MAX_RESPONSE_BYTES", 10_000)
    async with await here.client() as client:
        node = (await here.node(client, "Wear/Level")).nodeid
        request = ua.ReadRequest()
        request.Parameters.NodesToRead = [ua.ReadValueId(NodeId=node, AttributeId=13)] * 1_000
        with pytest.raises(ua.UaStatusCodeError) as refused:
            await client.uaclient.protocol.send_request(request)
        assert refused.value.code == codes.BadResponseTooLarge
        await (await here.node(client, "Module/Connected")).read_data_value(False)


FILLING = "x" * LARGE_BYTES
"""Makes a request a long one."""


async def _reset_wear(here: Site, client: Client) -> ua.StatusCode:
    cell, reset = await here.node(client, ""), await here.node(client, "ResetWear")
    first = ua.CallMethodRequest(cell.nodeid, reset.nodeid, [ua.Variant(ua.LocalizedText("new surface"))])
    other = ua.CallMethodRequest(ua.NodeId(FILLING, 1), reset.nodeid)
    return (await client.uaclient.call([first, other]))[0].StatusCode


async def _read_history(here: Site, client: Client) -> ua.StatusCode:
    node = await here.node(client, "Wear/Level")
    details = ua.ReadRawModifiedDetails(
        IsReadModified=False,
        StartTime=datetime(2026, 1, 1, tzinfo=UTC),
        EndTime=datetime(2026, 1, 2, tzinfo=UTC),
        ReturnBounds=False,
    )
    parameters = ua.HistoryReadParameters(
        HistoryReadDetails=details,
        TimestampsToReturn=ua.TimestampsToReturn.Source,
        ReleaseContinuationPoints=False,
        NodesToRead=[
            ua.HistoryReadValueId(node.nodeid),
            ua.HistoryReadValueId(node.nodeid, ContinuationPoint=FILLING.encode()),
        ],
    )
    return (await client.uaclient.history_read(parameters))[0].StatusCode


async def _log_in_anew(here: Site, client: Client) -> ua.StatusCode:
    del here
    client._locale = [FILLING]
    await client.activate_session(username="engineer", password=PASSWORDS["engineer"])
    return ua.StatusCode(codes.Good)


@pytest.mark.slow
@pytest.mark.parametrize("request_of", [_reset_wear, _read_history, _log_in_anew])
async def test_a_long_request_that_waits_lets_those_of_others_pass(
    request_of: Callable[[Site, Client], Awaitable[ua.StatusCode]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It waits for the journal, for the history or for a password; another client reads much meanwhile."""
    begun, may_end = threading.Event(), threading.Event()

    def wait() -> None:
        begun.set()
        may_end.wait(PATIENCE_S)

    async def waiting(*_: object, **__: object) -> ValuePage:
        await asyncio.to_thread(wait)
        return ValuePage((), None)

    async with site(limits=ServerLimits(**SLOW)) as here:
        here.publish()
        async with await here.client("engineer") as first, await here.client("observer") as second:
            monkeypatch.setattr(here.actions, "reset_wear", waiting)
            monkeypatch.setattr(here.history, "values", waiting)
            monkeypatch.setattr(Users, "verify_password", lambda *_: wait() or True)
            state = ua.NodeId(ua.ObjectIds.Server_ServerStatus_State)
            values = [ua.ReadValueId(state, ua.AttributeIds.Value)] * (LARGE_BYTES // 16)
            task = asyncio.create_task(request_of(here, first))
            try:
                assert await asyncio.to_thread(begun.wait, PATIENCE_S)
                async with asyncio.timeout(PATIENCE_S):
                    read = await second.uaclient.read(ua.ReadParameters(NodesToRead=values))
                assert {value.StatusCode.is_good() for value in read} == {True}
                assert not task.done()
            finally:
                may_end.set()
            assert (await task).value in (codes.Good, codes.GoodNoData)
