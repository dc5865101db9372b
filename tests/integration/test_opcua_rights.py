"""Every cell of the rights matrix, tried by a client: what is allowed works, what is not is refused."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

import pytest
from asyncua import Client, ua

from impactcell.quantities import CYCLE
from impactcell.scada import HistoryValue, Permission, Role
from impactcell.scada.rights import MATRIX, Area, allowed
from tests.opcua_server import CELL, START_NS, Site, site
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.slow

REFUSED = {ua.StatusCodes.BadUserAccessDenied}


@dataclass
class Hand:
    """A client's hand on the server."""

    here: Site
    client: Client
    events: "Events"

    async def call(self, owner: str, method: ua.NodeId | str, *arguments: ua.Variant) -> int:
        owner_id = (await self.here.node(self.client, owner)).nodeid
        if isinstance(method, str):
            method = (await self.here.node(self.client, method)).nodeid
        request = ua.CallMethodRequest()
        request.ObjectId, request.MethodId, request.InputArguments = owner_id, method, list(arguments)
        return (await self.client.uaclient.call([request]))[0].StatusCode.value

    async def condition(self, name: str, *arguments: ua.Variant) -> int:
        return await self.call("WearLimit", f"WearLimit/{name}", *arguments)


class Events:
    """Collects events, and tells when one has come."""

    def __init__(self) -> None:
        self.queue: asyncio.Queue[object] = asyncio.Queue()

    def event_notification(self, event: object) -> None:
        self.queue.put_nowait(event)

    def datachange_notification(self, node: object, value: object, data: object) -> None:
        self.queue.put_nowait(value)


def _id(alarm_id: bytes) -> tuple[ua.Variant, ua.Variant]:
    return ua.Variant(alarm_id, ua.VariantType.ByteString), ua.Variant(ua.LocalizedText("test"))


async def _event_id(hand: Hand) -> bytes:
    node = await hand.here.node(hand.client, "WearLimit/EventId")
    return await node.read_value()


def _fresh(hand: Hand) -> None:
    hand.here.actions.alarms.clear()
    hand.here.raise_alarm()


async def browse(hand: Hand) -> int:
    node = await hand.here.node(hand.client, "Friction")
    assert len(await node.get_children()) == sum(q.path.startswith("Friction/") for q in CYCLE)
    return 0


async def read(hand: Hand) -> int:
    node = await hand.here.node(hand.client, "Wear/Level")
    return (await node.read_data_value(raise_on_bad_status=False)).StatusCode.value


async def write(hand: Hand) -> int:
    node = await hand.here.node(hand.client, "Wear/Limit")
    value = ua.WriteValue()
    value.NodeId, value.AttributeId = node.nodeid, ua.AttributeIds.Value
    value.Value = ua.DataValue(ua.Variant(0.5))
    parameters = ua.WriteParameters()
    parameters.NodesToWrite = [value]
    return (await hand.client.uaclient.write(parameters))[0].value


async def subscribe(hand: Hand) -> int:
    subscription = await hand.client.create_subscription(20, hand.events)
    await subscription.subscribe_data_change(await hand.here.node(hand.client, "Wear/Level"))
    await asyncio.wait_for(hand.events.queue.get(), PATIENCE_S)
    await subscription.delete()
    return 0


async def history(hand: Hand) -> int:
    node = await hand.here.node(hand.client, "Friction/StaticFriction")
    assert len(await node.read_raw_history(numvalues=5, starttime=ua.win_epoch_to_datetime(1 << 56))) == 1
    return 0


async def events(hand: Hand) -> int:
    subscription = await hand.client.create_subscription(20, hand.events)
    node = await hand.here.node(hand.client, "")
    await subscription.subscribe_events(node, ua.ObjectIds.ConditionType, where_clause_generation=False)
    _fresh(hand)
    await asyncio.wait_for(hand.events.queue.get(), PATIENCE_S)
    await subscription.delete()
    return 0


async def event_history(hand: Hand) -> int:
    hand.here.history.transitions[CELL] = [hand.here.actions.of(CELL, "WearLimit")]
    node = await hand.here.node(hand.client, "")
    condition = hand.client.get_node(ua.ObjectIds.ConditionType)
    found = await node.read_event_history(
        starttime=ua.win_epoch_to_datetime(1 << 56), numvalues=5, evtypes=condition
    )
    assert isinstance(found, list)
    return 0


async def refresh(hand: Hand) -> int:
    subscription = await hand.client.create_subscription(20, hand.events)
    request = ua.CallMethodRequest()
    request.ObjectId = ua.NodeId(ua.ObjectIds.ConditionType)
    request.MethodId = ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh)
    request.InputArguments = [ua.Variant(subscription.subscription_id, ua.VariantType.UInt32)]
    result = await hand.client.uaclient.call([request])
    await subscription.delete()
    return result[0].StatusCode.value


async def acknowledge(hand: Hand) -> int:
    _fresh(hand)
    return await hand.condition("Acknowledge", *_id(await _event_id(hand)))


async def confirm(hand: Hand) -> int:
    await _acknowledged(hand)
    return await hand.condition("Confirm", *_id(await _event_id(hand)))


async def _acknowledged(hand: Hand) -> None:
    from impactcell.alarms import AlarmEvent, EventKind

    _fresh(hand)
    alarm = hand.here.actions.apply(CELL, "WearLimit", AlarmEvent(EventKind.ACKNOWLEDGE, time_ns=START_NS))
    hand.here.server.alarm(CELL, alarm)


async def comment(hand: Hand) -> int:
    _fresh(hand)
    return await hand.condition("AddComment", *_id(await _event_id(hand)))


async def shelve(hand: Hand) -> int:
    _fresh(hand)
    codes = {
        await hand.condition("ShelvingState/TimedShelve", ua.Variant(60_000.0, ua.VariantType.Double)),
        await hand.condition("ShelvingState/OneShotShelve"),
        await hand.condition("ShelvingState/Unshelve"),
    }
    assert len(codes) == 1
    return codes.pop()


async def enable(hand: Hand) -> int:
    _fresh(hand)
    codes = {await hand.condition("Disable"), await hand.condition("Enable")}
    assert len(codes) == 1
    return codes.pop()


async def start_batch(hand: Hand) -> int:
    return await hand.call("", "StartBatch", ua.Variant("B-2"), ua.Variant(True))


async def abort(hand: Hand) -> int:
    return await hand.call("", "AbortPositioning")


async def set_target(hand: Hand) -> int:
    return await hand.call("", "SetTarget", ua.Variant(1.5, ua.VariantType.Double))


async def reset_wear(hand: Hand) -> int:
    return await hand.call("", "ResetWear", ua.Variant(ua.LocalizedText("new plate")))


TRIES: dict[tuple[Area, Permission], Callable[[Hand], Awaitable[int]]] = {
    (Area.NODES, Permission.BROWSE): browse,
    (Area.NODES, Permission.READ): read,
    (Area.NODES, Permission.WRITE): write,
    (Area.VALUES, Permission.SUBSCRIBE): subscribe,
    (Area.VALUES, Permission.READ_HISTORY): history,
    (Area.EVENTS, Permission.SUBSCRIBE): events,
    (Area.EVENTS, Permission.READ_HISTORY): event_history,
    (Area.REFRESH, Permission.CALL): refresh,
    (Area.ACKNOWLEDGE, Permission.CALL): acknowledge,
    (Area.CONFIRM, Permission.CALL): confirm,
    (Area.COMMENT, Permission.CALL): comment,
    (Area.SHELVE, Permission.CALL): shelve,
    (Area.ENABLE, Permission.CALL): enable,
    (Area.START_BATCH, Permission.CALL): start_batch,
    (Area.ABORT_POSITIONING, Permission.CALL): abort,
    (Area.SET_TARGET, Permission.CALL): set_target,
    (Area.RESET_WEAR, Permission.CALL): reset_wear,
}


def test_every_cell_of_the_matrix_is_tried() -> None:
    assert set(TRIES) == set(MATRIX)


@pytest.mark.parametrize("role", list(Role))
async def test_rights(role: Role) -> None:
    async with site() as here:
        here.publish()
        here.history.stored[CELL, "Friction/StaticFriction"] = [HistoryValue(START_NS, 0.2)]
        async with await here.client(role.name.lower()) as client:
            hand = Hand(here, client, Events())
            for (area, right), attempt in TRIES.items():
                calls = len(here.actions.calls)
                code = await attempt(hand)
                where = f"{role.name}: {area.value}: {right.value}"
                if allowed(role, area, right):
                    assert code == 0, f"{where}: {ua.StatusCode(code)}"
                else:
                    assert code in REFUSED, f"{where}: {ua.StatusCode(code)}"
                    assert len(here.actions.calls) == calls, f"{where}: refused, but it reached the service"


@pytest.mark.parametrize("role", list(Role))
async def test_user_executable_tells_the_same(role: Role) -> None:
    async with site() as here, await here.client(role.name.lower()) as client:
        for name, area in (("StartBatch", Area.START_BATCH), ("SetTarget", Area.SET_TARGET)):
            node = await here.node(client, name)
            value = await node.read_attribute(ua.AttributeIds.UserExecutable)
            assert value.Value.Value is allowed(role, area, Permission.CALL)
