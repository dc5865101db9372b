"""Simulator, service and OPC UA client in three processes: hardware words in, friction out."""

import asyncio
from pathlib import Path

import pytest
from asyncua import Client, Node, ua

from impactcell.scada import Role
from impactcell.scada.users import User, with_password, write_users
from tests.integration.forked import forked
from tests.integration.processes import simulator, started, truths, write_cell
from tests.opcua_server import PatientClient
from tests.patience import COMPILING_S, PATIENCE_S

pytestmark = pytest.mark.slow

CYCLES = 12


class Changes:
    """Collects what a subscription reports."""

    def __init__(self) -> None:
        self.values: list[tuple[Node, ua.DataValue]] = []
        self.news = asyncio.Event()

    def datachange_notification(self, node: Node, _: object, data: ua.DataChangeNotification) -> None:
        self.values.append((node, data.monitored_item.Value))
        self.news.set()


@pytest.fixture
def users(tmp_path: Path) -> str:
    password = "integration"
    write_users(tmp_path / "users.yaml", {"eve": with_password(User("eve", Role.ENGINEER), password)})
    return password


def engineer(endpoint: str, password: str) -> Client:
    """Client of an engineer, not connected yet."""
    client = PatientClient(endpoint)
    client.set_user("eve")
    client.set_password(password)
    return client


async def node(client: Client, cell: str, path: str) -> Node:
    index = await client.get_namespace_index("urn:impactcell:cells")
    return client.get_node(ua.NodeId(f"{cell}/{path}", index))


async def test_every_cycle_once_and_right(tmp_path: Path, users: str) -> None:
    strikes = {"period_s": 0.3, "cycles": CYCLES}
    async with simulator(tmp_path, strikes=strikes, batches=[{"from_cycle": 1, "id": "A"}]) as module:
        path = write_cell(tmp_path, module["port"])
        async with started("impactcell", "run", str(path)) as service:
            endpoint = (await service.line(r"cell=press-1 at (\S+)"))[1]
            async with engineer(endpoint, users) as client:
                changes = Changes()
                subscription = await client.create_subscription(50, changes)
                static = await node(client, "press-1", "Friction/StaticFriction")
                number = await node(client, "press-1", "Friction/CycleNumber")
                await subscription.subscribe_data_change([static, number], queuesize=100)
                async with asyncio.timeout(COMPILING_S):
                    while not any(v.Value.Value == CYCLES for n, v in changes.values if n == number):
                        changes.news.clear()
                        await changes.news.wait()
                await subscription.delete()
    cycles = {v.SourceTimestamp: v.Value.Value for n, v in changes.values if n == number and v.Value.Value}
    friction = {v.SourceTimestamp: v for n, v in changes.values if n == static and v.StatusCode.is_good()}
    told = truths(module["truth"])
    seen = sorted(cycles.values())
    assert seen == list(range(seen[0], CYCLES + 1))
    assert seen[0] <= 3
    for time, cycle in cycles.items():
        assert friction[time].Value.Value == pytest.approx(told[cycle]["mu_s"], rel=0.06)


async def test_a_module_that_is_not_there_is_said_and_the_service_ends_cleanly(tmp_path: Path) -> None:
    path = write_cell(tmp_path, 1)
    async with forked("impactcell", "run", str(path)) as service:
        await service.line(r"cell=press-1 127\.0\.0\.1:1.*no connection")
        await service.line(r"cell=press-1 at (\S+)")
        service.process.terminate()
        async with asyncio.timeout(PATIENCE_S):
            assert await service.process.wait() == 0
    assert not any("Traceback" in line for line in service.lines)
