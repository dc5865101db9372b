"""Several devices on one line, in virtual time: everybody in turn, and nobody pays for another's faults."""

import asyncio
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from impactcell.errors import FieldbusError, LinkError, ModbusExceptionError
from impactcell.fieldbus.codec import BUSY, Request
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.transports.shared_line import SharedLine
from tests.patience import PATIENCE_S
from tests.virtual_time import run_virtually

REPLY_S = 0.02
"""What a gateway takes for one reply."""


class Gateway:
    """Answers after `REPLY_S`; device `dead` never does, device `busy` says so once a request."""

    def __init__(self, on_lost: Callable[[], None]) -> None:
        self.on_lost = on_lost
        self.connected = False
        self.connections = 0
        self.asked: list[int] = []
        self.addresses: list[int] = []
        self.dead = self.busy = 0
        self.most_in_flight = self._in_flight = 0
        self._told_busy: set[Request] = set()

    async def connect(self) -> None:
        await asyncio.sleep(0.001)
        self.connected = True
        self.connections += 1

    async def close(self) -> None:
        self.connected = False

    async def exchange(self, device_id: int, request: Request) -> bytes:
        self._in_flight += 1
        self.most_in_flight = max(self.most_in_flight, self._in_flight)
        self.asked.append(device_id)
        try:
            await asyncio.sleep(REPLY_S)
        finally:
            self._in_flight -= 1
        if device_id == self.dead:
            raise LinkError("no answer")
        if device_id == self.busy and request not in self._told_busy:
            self._told_busy.add(request)
            raise ModbusExceptionError("busy", BUSY)
        address, count = int.from_bytes(request.pdu[1:3], "big"), int.from_bytes(request.pdu[3:5], "big")
        self.addresses.append(address)
        return np.arange(address, address + count).astype(">u2").tobytes()


def line_of(devices: int) -> tuple[Gateway, list[ModbusClient]]:
    gateways: list[Gateway] = []

    def made(on_lost: Callable[[], None]) -> Gateway:
        gateways.append(Gateway(on_lost))
        return gateways[0]

    line = SharedLine(made)
    links = [ModuleLink(device_id=unit) for unit in range(1, devices + 1)]
    return gateways[0], [ModbusClient(line.transport(link)) for link in links]


async def read_for(client: ModbusClient, seconds: float, registers: int) -> int:
    """Count the requests that are answered in so long."""
    loop = asyncio.get_running_loop()
    end_s, blocks = loop.time() + seconds, 0
    while loop.time() < end_s:
        await client.connect()
        assert (await client.read(3, registers)).tolist() == list(range(3, 3 + registers))
        blocks += 1
    return blocks * -(-registers // 125)


def test_eight_devices_get_the_same_share_though_some_ask_for_much_more() -> None:
    gateway, clients = line_of(8)

    async def share() -> list[int]:
        sizes = [10, 125, 1000, 20_000, 10, 125, 1000, 1]
        tasks = [read_for(client, 60.0, size) for client, size in zip(clients, sizes, strict=True)]
        await asyncio.gather(*tasks)
        asked = Counter(gateway.asked[: int(60.0 / REPLY_S)])
        for client in clients:
            await client.close()
        return [asked[unit] for unit in range(1, 9)]

    shares = run_virtually(share())
    fair = sum(shares) / 8
    assert fair > 300
    assert max(abs(share / fair - 1.0) for share in shares) < 0.1
    assert gateway.most_in_flight == 1


def test_a_dead_device_costs_the_others_its_turns_and_nothing_else() -> None:
    gateway, clients = line_of(3)

    async def share() -> tuple[int, int]:
        gateway.dead = 2

        async def insist(client: ModbusClient) -> int:
            failures = 0
            while asyncio.get_running_loop().time() < 30.0:
                try:
                    await client.connect()
                    await client.read(0, 10)
                except LinkError:
                    failures += 1
            return failures

        first, failures, third = await asyncio.gather(
            read_for(clients[0], 30.0, 10), insist(clients[1]), read_for(clients[2], 30.0, 10)
        )
        assert abs(first - third) <= 1
        for client in clients:
            await client.close()
        return first, failures

    good, failures = run_virtually(share())
    assert good > 300
    assert failures > 300


def test_what_waits_when_a_device_leaves_the_line_fails_at_once() -> None:
    gateway, clients = line_of(2)

    async def leave() -> float:
        loop = asyncio.get_running_loop()
        for client in clients:
            await client.connect()
        waiting = [asyncio.ensure_future(clients[0].read(0, 1000)) for _ in range(2)]
        await asyncio.sleep(REPLY_S / 2)
        begin_s = loop.time()
        await clients[0].close()
        for each in waiting:
            with pytest.raises(LinkError, match="closed"):
                await asyncio.wait_for(each, PATIENCE_S)
        assert (await clients[1].read(3, 1)).tolist() == [3]
        await clients[1].close()
        return loop.time() - begin_s

    assert run_virtually(leave()) < 10 * REPLY_S
    assert gateway.asked.count(1) < 3


def test_requests_are_sent_in_the_order_in_which_they_are_made() -> None:
    gateway, (client,) = line_of(1)

    async def read() -> None:
        await client.connect()
        blocks = [client.block(address, 1) for address in (30, 10, 20)]
        await client.complete(*blocks)
        await client.close()

    run_virtually(read())
    assert gateway.addresses == [30, 10, 20]


def test_a_busy_device_is_asked_again_while_the_others_go_on() -> None:
    gateway, clients = line_of(2)

    async def share() -> list[int]:
        gateway.busy = 1
        counts = await asyncio.gather(*(read_for(client, 5.0, 1) for client in clients))
        for client in clients:
            await client.close()
        return counts

    assert min(run_virtually(share())) > 50


def test_a_lost_line_is_told_to_everyone_and_opened_once() -> None:
    gateway, clients = line_of(3)

    async def lose() -> None:
        for client in clients:
            await client.connect()
        gateway.connected = False
        gateway.on_lost()
        assert not any(client.connected for client in clients)
        for client in clients:
            with pytest.raises(FieldbusError, match="not connected"):
                await client.read(0, 1)
        await asyncio.gather(*(client.connect() for client in clients))
        assert (await clients[2].read(7, 1)).tolist() == [7]
        for client in clients:
            await client.close()

    run_virtually(lose())
    assert gateway.connections == 2
    assert not gateway.connected
