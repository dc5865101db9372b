"""Our client against servers of others: pymodbus's and libmodbus's."""

import asyncio
import contextlib
import os
import tty
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

import numpy as np
import pytest
from pymodbus import FramerType, ModbusDeviceIdentification
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from impactcell.errors import LinkError, ModbusExceptionError
from impactcell.fieldbus.link import ModuleLink, SerialLine
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import WIRE
from impactcell.fieldbus.transports import transport_for
from tests.interop.conftest import LibmodbusServer

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
async def connected(port: int, window: int | None = 1, device_id: int = 1) -> AsyncIterator[ModbusClient]:
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


BITS = [bool(bit) for bit in np.random.default_rng(4).integers(0, 2, 4_000)]


TABLES = (
    [SimData(0, values=BITS, datatype=DataType.BITS)],
    [SimData(0, values=BITS[::-1], datatype=DataType.BITS)],
    [SimData(0, values=list(range(1000)), datatype=DataType.REGISTERS)],
    [SimData(0, values=list(range(1000, 2000)), datatype=DataType.REGISTERS)],
)
"""Coils, discrete inputs, holding and input registers, each with values of its own."""
IDENTITY = ModbusDeviceIdentification(info={0x00: "Others", 0x01: "PM", 0x02: "3", 0x04: "Server"})


@asynccontextmanager
async def pymodbus_server_with_bits() -> AsyncIterator[int]:
    server = ModbusTcpServer(SimDevice(1, simdata=TABLES), address=("127.0.0.1", 0), identity=IDENTITY)
    await server.serve_forever(background=True)
    try:
        yield server.transport.sockets[0].getsockname()[1]
    finally:
        await server.shutdown()


async def test_bits_and_other_functions_of_pymodbus_server() -> None:
    async with pymodbus_server_with_bits() as port, connected(port) as client:
        await bits_and_other_functions(client)
        identification = await client.identification()
        assert (identification["vendor"], identification["product"]) == ("Others", "Server")


async def bits_and_other_functions(client: ModbusClient) -> None:
    assert (await client.read(3, 3_500, "coil")).tolist() == BITS[3:3503]
    assert (await client.read(3, 3_500, "discrete")).tolist() == BITS[::-1][3:3503]
    await client.write(5, np.array([not BITS[5]], dtype=WIRE), "coil")
    await client.write(11, np.array([1, 0, 1, 1, 0, 0, 0, 1, 1, 1], dtype=WIRE), "coil")
    assert (await client.read(4, 18, "coil")).tolist() == [
        BITS[4], not BITS[5], *BITS[6:11], 1, 0, 1, 1, 0, 0, 0, 1, 1, 1, BITS[21]
    ]  # fmt: skip
    await client.write_bits(0x0034, keep=0xFFFF ^ 0x0830, put=0x0820)
    assert (await client.read(0x33, 3)).tolist() == [0x33, 0x0824, 0x35]
    block = client.block(100, 10)
    await client.complete(block, write=(102, np.array([7, 8], dtype=WIRE)), at_once=True)
    assert block.words().tolist() == [100, 101, 7, 8, *range(104, 110)]


async def test_pymodbus_server_that_goes_away() -> None:
    async with contextlib.AsyncExitStack() as stack:
        async with pymodbus_server() as port:
            client = await stack.enter_async_context(connected(port))
            await client.read(0, 10)
        with pytest.raises(LinkError):
            await client.read(0, 10)


@pytest.mark.slow
async def test_what_pymodbus_server_can_have_in_flight_is_found_and_its_registers_are_right() -> None:
    async with pymodbus_server() as port, connected(port, None) as client:
        await client.find_window(100, 20_000)
        await client.connect()
        assert np.array_equal(await client.read(100, 20_000), np.arange(100, 20_100))
        assert bool(client.window.given_up) is (client.window.size == 1)


@pytest.mark.parametrize("window", [1, 16, None])
async def test_libmodbus_server(libmodbus_port: int, window: int | None) -> None:
    async with connected(libmodbus_port, window) as client:
        await client.find_window(100, 20_000)
        assert client.window.size == (window or 64)
        for _ in range(3):
            assert np.array_equal(await client.read(100, 20_000), np.arange(100, 20_100))
        assert np.array_equal(await client.read(0, 500, "input"), 65_535 - np.arange(500))
        await client.write(7, np.array([1], dtype=WIRE))
        await client.write(8, np.array([2, 3], dtype=WIRE))
        assert (await client.read(6, 5)).tolist() == [6, 1, 2, 3, 10]


@pytest.mark.parametrize("window", [1, 16])
async def test_bits_and_other_functions_of_libmodbus_server(libmodbus_port: int, window: int) -> None:
    async with connected(libmodbus_port, window) as client:
        await bits_and_other_functions_of_libmodbus(client)
        with pytest.raises(ModbusExceptionError, match="illegal function"):
            await client.identification()  # on a serial line it does not answer: it cannot know its length
        assert (await client.read(2, 2)).tolist() == [2, 3]


async def bits_and_other_functions_of_libmodbus(client: ModbusClient) -> None:
    coils = [address % 3 == 0 or address % 7 == 0 for address in range(30_000)]
    assert (await client.read(3, 20_000, "coil")).tolist() == coils[3:20_003]
    assert (await client.read(1, 2_500, "discrete")).tolist() == [not i % 5 for i in range(1, 2_501)]
    await client.write(5, np.array([1], dtype=WIRE), "coil")
    await client.write(11, np.array([1, 1, 0, 0, 1, 0, 1, 0, 1], dtype=WIRE), "coil")
    coils[5], coils[11:20] = True, [bool(int(digit)) for digit in "110010101"]
    assert (await client.read(0, 40, "coil")).tolist() == coils[:40]
    await client.write_bits(0x0034, keep=0xFFFF ^ 0x0830, put=0x0820)
    assert (await client.read(0x33, 3)).tolist() == [0x33, 0x0824, 0x35]
    block = client.block(100, 10)
    await client.complete(block, write=(102, np.array([7, 8], dtype=WIRE)), at_once=True)
    assert block.words().tolist() == [100, 101, 7, 8, *range(104, 110)]


@contextlib.contextmanager
def null_modem() -> Iterator[tuple[str, str]]:
    """Both ends of a serial line: what goes into one comes out of the other."""
    loop, pairs = asyncio.get_running_loop(), [os.openpty(), os.openpty()]
    for _, end in pairs:
        tty.setraw(end)
    masters = [master for master, _ in pairs]
    for here, there in (masters, reversed(masters)):
        loop.add_reader(here, lambda here=here, there=there: os.write(there, os.read(here, 4096)))
    try:
        yield os.ttyname(pairs[0][1]), os.ttyname(pairs[1][1])
    finally:
        for master, end in pairs:
            loop.remove_reader(master)
            os.close(master)
            os.close(end)


@asynccontextmanager
async def on_line(device: str) -> AsyncIterator[ModbusClient]:
    line = SerialLine(device, 115_200, parity="N", stop_bits=2)
    client = ModbusClient(transport_for(ModuleLink(transport="rtu", serial=line, timeout_s=TIMEOUT_S)))
    await client.connect()
    try:
        yield client
    finally:
        await client.close()


async def test_bits_and_other_functions_of_pymodbus_server_on_a_serial_line() -> None:
    with null_modem() as (ours, theirs):
        device = SimDevice(1, simdata=TABLES)
        server = ModbusSerialServer(
            device, framer=FramerType.RTU, port=theirs, baudrate=115_200, stopbits=2, identity=IDENTITY
        )
        await server.serve_forever(background=True)
        try:
            async with on_line(ours) as client:
                await bits_and_other_functions(client)
                assert (await client.identification())["vendor"] == "Others"
                with pytest.raises(ModbusExceptionError, match="illegal data address"):
                    await client.read(990, 20)
                assert (await client.read(0, 3, "input")).tolist() == [1000, 1001, 1002]
        finally:
            await server.shutdown()


async def test_bits_and_other_functions_of_libmodbus_server_on_a_serial_line(
    libmodbus_server: LibmodbusServer,
) -> None:
    with null_modem() as (ours, theirs), libmodbus_server(theirs) as device:
        assert device == theirs
        async with on_line(ours) as client:
            await bits_and_other_functions_of_libmodbus(client)
            assert np.array_equal(await client.read(0, 500, "input"), 65_535 - np.arange(500))


async def test_libmodbus_server_with_any_device_id(libmodbus_port: int) -> None:
    async with connected(libmodbus_port, device_id=17) as client:
        assert (await client.read(5, 2)).tolist() == [5, 6]


async def test_libmodbus_server_is_found_again_after_a_disconnect(libmodbus_port: int) -> None:
    for _ in range(3):
        async with connected(libmodbus_port, 16) as client:
            assert np.array_equal(await client.read(0, 2000), np.arange(2000))
        await asyncio.sleep(0)
