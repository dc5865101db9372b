"""Our client against servers of others: pymodbus's and libmodbus's."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import numpy as np
import pytest
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from impactcell.errors import LinkError, ModbusExceptionError
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import WIRE
from impactcell.fieldbus.transports import transport_for

pytestmark = pytest.mark.interop
TIMEOUT_S = 10.0


@asynccontextmanager
async def pymodbus_server() -> AsyncIterator[int]:
    """65 000 holding registers with their own address in them."""
    data = [SimData(0, values=list(range(65_000)), datatype=DataType.REGISTERS)]
    server = ModbusTcpServer(SimDevice(1, simdata=data), address=("127.0.0.1", 0))
    await server.serve_forever(background=True)
    try:
        yield server.transport.sockets[0].getsockname()[1]
    finally:
        await server.shutdown()


@asynccontextmanager
async def connected(port: int, window: int = 1, device_id: int = 1) -> AsyncIterator[ModbusClient]:
    client = ModbusClient(
        transport_for(ModuleLink(port=port, window=window, device_id=device_id, timeout_s=TIMEOUT_S))
    )
    await client.connect()
    try:
        yield client
    finally:
        await client.close()


async def test_pymodbus_server_one_at_a_time() -> None:
    async with pymodbus_server() as port, connected(port) as client:
        assert np.array_equal(await client.read(100, 20_000), np.arange(100, 20_100))
        await client.write(7, np.array([1], dtype=WIRE))
        await client.write(8, np.array([2, 3], dtype=WIRE))
        assert (await client.read(6, 5)).tolist() == [6, 1, 2, 3, 10]
        with pytest.raises(ModbusExceptionError, match="illegal data address"):
            await client.read(64_990, 20)


async def test_pymodbus_server_that_goes_away() -> None:
    async with contextlib.AsyncExitStack() as stack:
        async with pymodbus_server() as port:
            client = await stack.enter_async_context(connected(port))
            await client.read(0, 10)
        with pytest.raises(LinkError):
            await client.read(0, 10)


@pytest.mark.parametrize("window", [1, 16])
async def test_libmodbus_server(libmodbus_port: int, window: int) -> None:
    async with connected(libmodbus_port, window) as client:
        for _ in range(3):
            assert np.array_equal(await client.read(100, 20_000), np.arange(100, 20_100))
        assert np.array_equal(await client.read(0, 500, "input"), 65_535 - np.arange(500))
        await client.write(7, np.array([1], dtype=WIRE))
        await client.write(8, np.array([2, 3], dtype=WIRE))
        assert (await client.read(6, 5)).tolist() == [6, 1, 2, 3, 10]


async def test_libmodbus_server_with_any_device_id(libmodbus_port: int) -> None:
    async with connected(libmodbus_port, device_id=17) as client:
        assert (await client.read(5, 2)).tolist() == [5, 6]


async def test_libmodbus_server_is_found_again_after_a_disconnect(libmodbus_port: int) -> None:
    for _ in range(3):
        async with connected(libmodbus_port, 16) as client:
            assert np.array_equal(await client.read(0, 2000), np.arange(2000))
        await asyncio.sleep(0)
