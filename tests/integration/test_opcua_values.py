"""What a client sees of a cell, against the table of the interface: names, units, status, time, restarts."""

import asyncio
import math
import time
from dataclasses import replace
from pathlib import Path

import pytest
from asyncua import Client, ua

from impactcell.alarms import NAMES
from impactcell.quantities import CYCLE, FOLDERS, MODULE
from impactcell.records import ModuleStatus, PositioningState, Quality
from tests.opcua_server import CELL, START_NS, Site, site
from tests.patience import PATIENCE_S

codes = ua.StatusCodes

# What is promised to those outside, whatever comes to it: folder, variable, type, unit.
ONE, N, UM, MM_MIN, MM, MS = "C62", "NEW", "4H", "H81", "MMT", "C26"
INTERFACE = {
    "Friction": {
        **dict.fromkeys(
            (
                "StaticFriction",
                "StaticFrictionStdDev",
                "StaticFrictionByForce",
                "StaticFrictionByDistance",
                "KineticFriction",
            ),
            ("Double", ONE),
        ),
        "PeakForce": ("Double", N),
        "SlidingDistance": ("Double", UM),
        "ActuationVelocity": ("Double", MM_MIN),
        "CycleNumber": ("UInt32", None),
    },
    "Wear": dict.fromkeys(
        (
            "Level",
            "LevelStdDev",
            "Limit",
            "RatePer1000Cycles",
            "CyclesToLimit",
            "CyclesToLimitLow",
            "CyclesToLimitHigh",
        ),
        ("Double", ONE),
    ),
    "Batch": {
        "BatchId": ("String", None),
        **dict.fromkeys(("Offset", "OffsetStdDev", "LastShift"), ("Double", ONE)),
        "LastShiftCycle": ("UInt32", None),
    },
    "Signature": {
        "Position": ("Double", MM),
        "Friction": ("Double", ONE),
        "TSquared": ("Double", ONE),
        "Spe": ("Double", ONE),
    },
    "Positioning": {
        "Target": ("Double", MM),
        "Remaining": ("Double", MM),
        "NextVelocity": ("Double", MM_MIN),
        "NextStroke": ("Double", MM),
    },
    "Module": {
        "Connected": ("Boolean", None),
        "CyclesReceived": ("UInt32", None),
        "CyclesMissed": ("UInt32", None),
        "RoundTripTime": ("Double", MS),
    },
    "Model": {"Name": ("String", None), "Gap": ("Double", ONE)},
}


def unit_id(code: str) -> int:
    """UNECE code as OPC UA numbers it (Part 8, 5.6.4.3)."""
    return int.from_bytes(code.encode(), "big")


class Changes:
    def __init__(self) -> None:
        self.queue: asyncio.Queue[ua.DataValue] = asyncio.Queue()

    def datachange_notification(self, node: object, value: object, data: object) -> None:
        self.queue.put_nowait(data.monitored_item.Value)

    async def next(self) -> ua.DataValue:
        return await asyncio.wait_for(self.queue.get(), PATIENCE_S)


@pytest.mark.slow
async def test_the_interface_is_there_with_units_and_descriptions() -> None:
    published = {folder: set[str]() for folder in FOLDERS}
    for quantity in (*CYCLE, *MODULE):
        folder, _, name = quantity.path.partition("/")
        published[folder].add(name)
    assert set(published) == set(INTERFACE)
    async with site() as here, await here.client() as client:
        for folder, variables in INTERFACE.items():
            children = await (await here.node(client, folder)).get_children()
            found = {(await child.read_browse_name()).Name: child for child in children}
            assert set(found) == published[folder] >= set(variables), folder
            for name, (kind, unit) in variables.items():
                node = found[name]
                assert (await node.read_data_type()).Identifier == ua.VariantType[kind].value, name
                definition = (await node.read_type_definition()).Identifier
                assert definition == (ua.ObjectIds.AnalogUnitRangeType if unit else 63), name
                assert (await node.read_description()).Text, name
                if unit:
                    units = await (await node.get_child("0:EngineeringUnits")).read_value()
                    assert units.UnitId == unit_id(unit), name
                    assert units.NamespaceUri == "http://www.opcfoundation.org/UA/units/un/cefact"
                    eu_range = await (await node.get_child("0:EURange")).read_value()
                    assert eu_range.Low < eu_range.High
        names = {
            (await c.read_browse_name()).Name for c in await (await here.node(client, "")).get_children()
        }
        assert names >= set(NAMES)
        assert names >= {"StartBatch", "ResetWear", "SetTarget", "AbortPositioning", "Identification"}
        await _every_node_is_described(client, await here.node(client, ""))


async def _every_node_is_described(client: Client, root) -> None:
    queue = [root]
    while queue:
        node = queue.pop()
        assert (await node.read_description()).Text, node
        queue += await node.get_children()


async def test_identification_and_machines_folder() -> None:
    async with site() as here, await here.client() as client:
        machinery = await client.get_namespace_index("http://opcfoundation.org/UA/Machinery/")
        machines = client.get_node(ua.NodeId(1001, machinery))
        cell = await here.node(client, "")
        assert cell in await machines.get_children()
        expected = {
            "Manufacturer": ua.LocalizedText("Example Works"),
            "SerialNumber": f"SN-{CELL}",
            "ProductInstanceUri": f"urn:example:{CELL}",
            "Model": ua.LocalizedText("IC-1"),
            "Location": "Hall 3",
        }
        identification = await here.node(client, "Identification")
        found = {
            (await child.read_browse_name()).Name: await child.read_value()
            for child in await identification.get_children()
        }
        assert found == expected


async def _read(here: Site, client: Client, path: str) -> ua.DataValue:
    return await (await here.node(client, path)).read_data_value(raise_on_bad_status=False)


async def test_status_value_and_time() -> None:
    async with site() as here, await here.client() as client:
        first = await _read(here, client, "Friction/StaticFriction")
        assert first.StatusCode.value == codes.BadWaitingForInitialData
        snapshot = here.publish(0.2)
        good = await _read(here, client, "Friction/StaticFriction")
        assert good.StatusCode.is_good()
        assert good.Value.Value == 0.2
        assert good.SourceTimestamp.timestamp() == pytest.approx(snapshot.time_ns / 1e9, abs=2e-6)
        velocity = await _read(here, client, "Friction/ActuationVelocity")
        assert velocity.Value.Value == pytest.approx(0.05 * 60_000), "m/s as mm/min"
        distance = await _read(here, client, "Friction/SlidingDistance")
        assert distance.Value.Value == pytest.approx(4e-4 * 1e6), "m as µm"
        missing = await _read(here, client, "Friction/StaticFrictionByDistance")
        assert missing.StatusCode.value == codes.BadWaitingForInitialData, "never had a value"
        here.publish(0.21, quality=Quality.UNCERTAIN)
        doubtful = await _read(here, client, "Friction/StaticFriction")
        assert doubtful.StatusCode.value == codes.Uncertain
        assert doubtful.Value.Value == 0.21
        here.publish(math.nan, quality=Quality.BAD)
        bad = await _read(here, client, "Friction/StaticFriction")
        assert bad.StatusCode.value == codes.Bad
        assert bad.Value.Value == 0.21, "the last value is kept"
        snapshot = here.publish(0.22)
        here.server.mark_stale(CELL, time.time_ns())
        assert (await _read(here, client, "Wear/Level")).StatusCode.value == (
            codes.UncertainNoCommunicationLastUsableValue
        )
        here.server.mark_bad(CELL, time.time_ns())
        lost = await _read(here, client, "Friction/StaticFriction")
        assert (lost.StatusCode.value, lost.Value.Value) == (codes.BadNoCommunication, 0.22)
        task = PositioningState(target_m=0.008, remaining_m=0.002)
        here.server.positioning(CELL, replace(snapshot, positioning=task), time.time_ns())
        target = await _read(here, client, "Positioning/Target")
        assert (target.StatusCode.is_good(), target.Value.Value) == (True, pytest.approx(8.0))
        lost = await _read(here, client, "Friction/StaticFriction")
        assert lost.StatusCode.value == codes.BadNoCommunication, "a task says nothing of the last cycle"
        here.server.module(CELL, ModuleStatus(connected=False, received=5, missed=1), time.time_ns())
        assert (await _read(here, client, "Module/Connected")).Value.Value is False
        assert (await _read(here, client, "Module/RoundTripTime")).StatusCode.is_bad()
        here.server.module(CELL, ModuleStatus(connected=True, round_trip_s=0.003), time.time_ns())
        here.server.module(CELL, ModuleStatus(connected=False), time.time_ns())
        trip = await _read(here, client, "Module/RoundTripTime")
        assert (trip.StatusCode.value, trip.Value.Value) == (codes.BadNoCommunication, pytest.approx(3.0))
        here.server.module(
            CELL, ModuleStatus(connected=True, received=5, missed=1, round_trip_s=0.002), time.time_ns()
        )
        assert (await _read(here, client, "Module/RoundTripTime")).Value.Value == pytest.approx(2.0)
        here.publish(0.22)
        assert (await _read(here, client, "Friction/StaticFriction")).StatusCode.is_good()


async def test_waiting_makes_no_figure_usable_that_the_last_cycle_did_not_give() -> None:
    """OPC UA Part 8, 6.3.3: the last usable value is of what was usable when its source fell silent."""
    async with site() as here, await here.client() as client:
        here.publish(0.2)
        here.publish(math.nan, quality=Quality.BAD)
        for mark, given, missing in (
            (here.server.mark_stale, codes.UncertainNoCommunicationLastUsableValue, codes.Bad),
            (here.server.mark_bad, codes.BadNoCommunication, codes.BadNoCommunication),
            (here.server.mark_stale, codes.UncertainNoCommunicationLastUsableValue, codes.Bad),
        ):
            mark(CELL, time.time_ns())
            friction = await _read(here, client, "Friction/StaticFriction")
            assert (friction.StatusCode.value, friction.Value.Value) == (missing, 0.2)
            number = await _read(here, client, "Friction/CycleNumber")
            assert number.StatusCode.value == given
        here.publish(0.22)
        here.server.mark_stale(CELL, time.time_ns())
        friction = await _read(here, client, "Friction/StaticFriction")
        assert friction.StatusCode.value == codes.UncertainNoCommunicationLastUsableValue
        assert friction.Value.Value == 0.22


async def test_the_link_is_as_it_is_while_no_cycle_comes() -> None:
    """A module that answers and has nothing to strike made the state of its own link uncertain."""
    paths = [f"Module/{name}" for name in ("Connected", "CyclesReceived", "CyclesMissed", "RoundTripTime")]
    async with site() as here, await here.client() as client:
        here.publish(0.2)
        status = ModuleStatus(connected=True, received=5, missed=1, round_trip_s=0.002)
        here.server.module(CELL, status, time.time_ns())
        before = [await _read(here, client, path) for path in paths]
        here.server.mark_stale(CELL, time.time_ns())
        friction = await _read(here, client, "Friction/StaticFriction")
        assert friction.StatusCode.value == codes.UncertainNoCommunicationLastUsableValue
        after = [await _read(here, client, path) for path in paths]
        assert all(data.StatusCode.is_good() for data in after)
        seen = [[(d.Value.Value, d.SourceTimestamp) for d in read] for read in (before, after)]
        assert seen[0] == seen[1]


@pytest.mark.slow
async def test_only_changes_are_told() -> None:
    async with site() as here, await here.client() as client:
        here.publish(0.2)
        changes = Changes()
        subscription = await client.create_subscription(20, changes)
        await subscription.subscribe_data_change(
            await here.node(client, "Friction/StaticFriction"), queuesize=50
        )
        assert (await changes.next()).Value.Value == 0.2
        for mu in (0.2, 0.2, 0.2, 0.25):
            here.publish(mu)
        changed = await changes.next()
        assert changed.Value.Value == 0.25
        assert changes.queue.empty()


async def test_the_server_tells_the_limits_that_hold() -> None:
    """They are those of docs/how-to/scada.md; a client plans its subscriptions by them (Part 5, 6.3.2)."""
    limits = {
        "MaxSessions": 100,
        "MaxSubscriptions": 500,
        "MaxSubscriptionsPerSession": 20,
        "MaxMonitoredItems": 10_000,
        "MaxMonitoredItemsPerSubscription": 2_000,
        "MaxMonitoredItemsQueueSize": 10_000,
        "ServerProfileArray": [],
    }
    async with site() as here, await here.client() as client:
        told = {
            name: await client.get_node(
                getattr(ua.ObjectIds, f"Server_ServerCapabilities_{name}")
            ).read_value()
            for name in limits
        }
        assert told == limits
        build = await client.get_node(ua.ObjectIds.Server_ServerStatus_BuildInfo).read_value()
        assert build.BuildDate == ua.get_win_epoch(), "not when the server was started"


async def test_a_deadband_that_cannot_be_is_refused() -> None:
    """OPC UA Part 4, 7.22.2 knows types 0, 1 and 2; Part 8, 7.2 wants 0 to 100 % of an EURange."""
    asked = {
        "no such type": (7, 0.1, "Friction/StaticFriction"),
        "nothing is ever beyond it": (1, math.inf, "Friction/StaticFriction"),
        "no number": (1, math.nan, "Friction/StaticFriction"),
        "more than all": (2, 101.0, "Friction/StaticFriction"),
        "of no range": (2, 1.0, "Friction/CycleNumber"),
    }
    async with site() as here, await here.client() as client:
        here.publish(0.2)
        number = (await client.create_subscription(1000, None)).subscription_id

        async def outcome(kind: int, value: float, path: str) -> int:
            node = (await here.node(client, path)).nodeid
            band = ua.DataChangeFilter(ua.DataChangeTrigger.StatusValue, kind, value)
            item = ua.MonitoredItemCreateRequest(
                ua.ReadValueId(node, ua.AttributeIds.Value),
                ua.MonitoringMode.Reporting,
                ua.MonitoringParameters(1, 0.0, band, 1, True),
            )
            wanted = ua.CreateMonitoredItemsParameters(number, ua.TimestampsToReturn.Both, [item])
            return (await client.uaclient.create_monitored_items(wanted))[0].StatusCode.value

        codes_of = {why: await outcome(*band) for why, band in asked.items()}
        assert codes_of == dict.fromkeys(asked, codes.BadDeadbandFilterInvalid)
        for kind, value in ((0, math.inf), (1, 0.0), (1, 0.1), (2, 100.0)):
            assert await outcome(kind, value, "Friction/StaticFriction") == 0


@pytest.mark.slow
@pytest.mark.parametrize("whole_subscription", [False, True])
async def test_an_item_on_an_object_ends_like_any_other(
    caplog: pytest.LogCaptureFixture, *, whole_subscription: bool
) -> None:
    """An object has no value to watch: whoever watched its name left all items after it running."""
    async with site() as here, await here.client() as client:
        subscription = await client.create_subscription(1000, None)
        number = subscription.subscription_id
        watched = [
            (CELL, ua.AttributeIds.DisplayName),
            (f"{CELL}/Friction/StaticFriction", ua.AttributeIds.Value),
        ]
        made = await client.uaclient.create_monitored_items(
            ua.CreateMonitoredItemsParameters(
                number,
                ua.TimestampsToReturn.Both,
                [
                    ua.MonitoredItemCreateRequest(
                        ua.ReadValueId(
                            ua.NodeId(path, (await here.node(client, "")).nodeid.NamespaceIndex), attribute
                        ),
                        ua.MonitoringMode.Reporting,
                        ua.MonitoringParameters(ClientHandle=1, SamplingInterval=0.0, QueueSize=1),
                    )
                    for path, attribute in watched
                ],
            )
        )
        assert [result.StatusCode.value for result in made] == [0, 0]
        if whole_subscription:
            await client.uaclient.delete_subscriptions([number])
        else:
            gone = ua.DeleteMonitoredItemsParameters(number, [item.MonitoredItemId for item in made])
            ended = await client.uaclient.delete_monitored_items(gone)
            assert [result.value for result in ended] == [0, 0]
        await client.nodes.server_state.read_value()
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == []


async def test_deadband_is_measured_from_what_was_reported() -> None:
    """A drift in steps smaller than the deadband is reported each time it has added up to it."""
    async with site() as here, await here.client() as client:
        here.publish(0.2)
        changes = Changes()
        subscription = await client.create_subscription(20, changes)
        node = await here.node(client, "Friction/StaticFriction")
        await subscription.deadband_monitor(node, 0.0105, queuesize=50)
        assert (await changes.next()).Value.Value == 0.2
        for step in range(1, 24):
            here.publish(0.2 + 0.001 * step)
        assert (await changes.next()).Value.Value == pytest.approx(0.211)
        assert (await changes.next()).Value.Value == pytest.approx(0.222)
        assert changes.queue.empty()
        percent = Changes()
        other = await client.create_subscription(20, percent)
        # 5 % of the EURange of 0 to 1.
        await other.deadband_monitor(node, 5.0, deadbandtype=2, queuesize=50)
        first = (await percent.next()).Value.Value
        here.publish(first + 0.04)
        here.publish(first + 0.06)
        assert (await percent.next()).Value.Value == pytest.approx(first + 0.06)


async def test_a_full_queue_says_so() -> None:
    async with site() as here, await here.client() as client:
        here.publish(0.2)
        changes = Changes()
        subscription = await client.create_subscription(200, changes)
        await subscription.subscribe_data_change(
            await here.node(client, "Friction/StaticFriction"), queuesize=3
        )
        await changes.next()
        for mu in (0.3, 0.31, 0.32, 0.33, 0.34):
            here.publish(mu)
        told = [await changes.next() for _ in range(3)]
        assert [value.Value.Value for value in told] == [0.32, 0.33, 0.34]
        assert told[0].StatusCode.value & 0x480 == 0x480
        assert told[1].StatusCode.value == 0


@pytest.mark.slow
async def test_node_ids_stay_over_restarts_and_new_cells(tmp_path: Path) -> None:
    async def ids(cells: tuple[str, ...]) -> dict[str, str]:
        async with site(cells=cells, directory=tmp_path) as here, await here.client() as client:
            found: dict[str, str] = {}
            queue = [(await here.node(client, ""), "")]
            while queue:
                node, path = queue.pop()
                found[path] = node.nodeid.to_string()
                queue += [
                    (c, f"{path}/{(await c.read_browse_name()).Name}") for c in await node.get_children()
                ]
            return found

    before = await ids((CELL,))
    assert len(before) > 400
    assert await ids(("another", CELL)) == before


@pytest.mark.slow
async def test_conditions_stay_over_a_restart(tmp_path: Path) -> None:
    async with site(directory=tmp_path) as here:
        stored = here.raise_alarm()
        async with await here.client("operator") as client:
            known = await (await here.node(client, "WearLimit/EventId")).read_value()
    async with site(directory=tmp_path) as here:
        here.actions.alarms[CELL, "WearLimit"] = stored
        here.server.alarm(CELL, stored)
        async with await here.client("operator") as client:
            assert await (await here.node(client, "WearLimit/ActiveState/Id")).read_value() is True
            assert await (await here.node(client, "WearLimit/Retain")).read_value() is True
            condition = await here.node(client, "WearLimit")
            method = await here.node(client, "WearLimit/Acknowledge")
            # The EventId a client noted before the restart still stands for the alarm.
            await condition.call_method(method, known, ua.LocalizedText("seen"))
            assert await (await here.node(client, "WearLimit/AckedState/Id")).read_value() is True
            size = await (await here.node(client, "WearLimit/Size")).read_value()
            assert size == stored.evidence.size
    assert START_NS > 0
