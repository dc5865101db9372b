"""A value that its type does not hold takes no other along: its node is Bad, and the log tells why."""

import asyncio
import logging
from dataclasses import replace

import pytest
from asyncua import Client, ua

from tests.opcua_server import CELL, START_NS, Site, site
from tests.patience import PATIENCE_S
from tests.snapshots import make_capture, make_snapshot

codes = ua.StatusCodes
UNSENDABLE = "Batch/LastShiftCycle"
PATHS = ("Batch/LastShift", UNSENDABLE, "Batch/Offset", "Friction/StaticFriction")


class Told:
    """Collects values and events."""

    def __init__(self) -> None:
        self.values: dict[str, list[ua.DataValue]] = {path: [] for path in PATHS}
        self.events: list[object] = []
        self._news = asyncio.Event()

    def datachange_notification(self, node: object, _: object, data: ua.DataChangeNotification) -> None:
        path = str(node.nodeid.Identifier).removeprefix(f"{CELL}/")  # type: ignore[attr-defined]
        self.values[path].append(data.monitored_item.Value)
        self._news.set()

    def event_notification(self, event: object) -> None:
        self.events.append(event)
        self._news.set()

    async def until(self, path: str, count: int) -> list[ua.DataValue]:
        async with asyncio.timeout(PATIENCE_S):
            while len(self.values[path]) < count:
                self._news.clear()
                await self._news.wait()
        return self.values[path]

    async def until_events(self, count: int) -> list[object]:
        async with asyncio.timeout(PATIENCE_S):
            while len(self.events) < count:
                self._news.clear()
                await self._news.wait()
        return self.events


def publish(here: Site, mu_s: float, shift_cycle: int) -> None:
    here.cycle += 1
    snapshot = make_snapshot(make_capture(here.cycle, time_ns=START_NS), mu_s)
    batch = replace(snapshot.batch, last_shift=mu_s, last_shift_cycle=shift_cycle, offset=mu_s)
    here.server.publish(CELL, replace(snapshot, batch=batch))


async def read(here: Site, client: Client) -> list[ua.DataValue]:
    """Read all in one request."""
    nodes = [await here.node(client, path) for path in PATHS]
    return await client.uaclient.read_attributes([node.nodeid for node in nodes], ua.AttributeIds.Value)


async def test_a_number_that_is_out_of_range_is_bad_and_costs_no_other_value(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A shift at cycle -30 of a UInt32: every value before it in the message was lost, and reads failed."""
    async with site() as here, await here.client() as client:
        publish(here, 0.2, 50)
        told = Told()
        subscription = await client.create_subscription(10, told)
        await subscription.subscribe_data_change([await here.node(client, path) for path in PATHS])
        for path in PATHS:
            await told.until(path, 1)
        with caplog.at_level(logging.ERROR, "impactcell.opcua"):
            for mu_s in (0.21, 0.22):
                publish(here, mu_s, -30)
        (logged,) = [text for record in caplog.records if UNSENDABLE in (text := record.getMessage())]
        assert logged.startswith(f"{CELL}/{UNSENDABLE}: ")
        assert "UInt32 with value -30" in logged
        assert logged.endswith("; the node is Bad until it has a value that can be sent")
        values = await read(here, client)
        assert [value.StatusCode.is_good() for value in values] == [True, False, True, True]
        assert values[1].StatusCode.value == codes.BadEncodingError
        assert values[1].Value.Value == 50, "the last value is kept"
        assert (values[0].Value.Value, values[3].Value.Value) == (0.22, 0.22)
        assert (await told.until(UNSENDABLE, 2))[1].StatusCode.value == codes.BadEncodingError
        for path in set(PATHS) - {UNSENDABLE}:
            while told.values[path][-1].Value.Value != 0.22:
                await told.until(path, len(told.values[path]) + 1)
        publish(here, 0.23, 60)
        again = (await read(here, client))[1]
        assert (again.StatusCode.is_good(), again.Value.Value) == (True, 60)


async def test_an_event_with_a_figure_that_cannot_be_sent_is_told_without_it(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Who listened after it heard of no event, and its alarm was shown nowhere."""
    async with site() as here, await here.client() as client:
        here.publish()
        listeners = [Told(), Told()]
        kind = ua.NodeId(1002, await client.get_namespace_index("urn:impactcell:ua"))
        for told in listeners:
            subscription = await client.create_subscription(10, told)
            await subscription.subscribe_events(
                await here.node(client, ""), client.get_node(kind), where_clause_generation=False
            )
        alarm = here.raise_alarm("BatchShift", message="a shift")
        odd = replace(alarm, time_ns=alarm.time_ns + 1, evidence=replace(alarm.evidence, change_cycle=-30))
        with caplog.at_level(logging.ERROR, "impactcell.scada"):
            here.actions.show(CELL, odd)
        assert any("press-1: BatchShift/ChangeCycle: " in record.getMessage() for record in caplog.records)
        for told in listeners:
            first, second = await told.until_events(2)
            assert first.ChangeCycle == 7  # type: ignore[attr-defined]
            assert second.Message.Text == "a shift"  # type: ignore[attr-defined]
            assert second.ChangeCycle.value == codes.BadEncodingError  # type: ignore[attr-defined]
        node = await here.node(client, "BatchShift/ChangeCycle")
        shown = await node.read_data_value(raise_on_bad_status=False)
        assert (shown.StatusCode.value, shown.Value.Value) == (codes.BadEncodingError, 7)
