"""How a cell of the chaos studies reaches its module: over each transport, with its faults."""

import tempfile
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from typing import Final

from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.transports import transport_for
from simulator.faults import FaultInjector
from simulator.modbus_server import ModbusServer
from tests.benchmarks._chaos_faults import FaultPlan, FaultyDevice, FaultyWire
from tests.transports import link_to, server_for

WINDOWS: Final = (1, 4, 16, None)
"""Requests in flight over Modbus TCP, in turn; None: as found."""
TIMEOUT_S: Final = 0.15
"""Of a reply, s."""

Reached = Callable[
    [int, FaultyDevice, FaultPlan, FaultInjector],
    AbstractAsyncContextManager[tuple[ModbusServer, ModbusClient]],
]
"""Given seed, module, plan and faults of its server, serves the module and gives a client of it."""


@asynccontextmanager
async def over_faulty_tcp(
    seed: int, device: FaultyDevice, plan: FaultPlan, faults: FaultInjector
) -> AsyncIterator[tuple[ModbusServer, ModbusClient]]:
    """Reach it by the own client, through a relay that changes frames."""
    async with ModbusServer(device, faults=faults) as server:
        wire = FaultyWire(server.port, plan)
        await wire.start()
        link = ModuleLink(port=wire.port, window=WINDOWS[seed % len(WINDOWS)], timeout_s=TIMEOUT_S)
        try:
            yield server, ModbusClient(transport_for(link))
        finally:
            await wire.close()


def over(kind: str) -> Reached:
    """Reach it by pymodbus, over one of its transports."""

    @asynccontextmanager
    async def reached(
        seed: int,
        device: FaultyDevice,
        plan: FaultPlan,
        faults: FaultInjector,
    ) -> AsyncIterator[tuple[ModbusServer, ModbusClient]]:
        with tempfile.TemporaryDirectory() as directory:
            server, tls = server_for(kind, device, Path(directory), faults)
            async with server:
                yield server, ModbusClient(transport_for(link_to(kind, server, tls, TIMEOUT_S)))

    return reached
