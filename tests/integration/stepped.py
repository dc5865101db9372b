"""A simulated module in this process that strikes when the test says so: nothing hangs on speed."""

import contextlib
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simulator.device import Device
from simulator.modbus_server import ModbusServer
from simulator.scenario import Scenario
from simulator.serving import read_register_map
from tests.integration.processes import scenario_content


@dataclass
class SteppedModule:
    """A module that answers over Modbus TCP, and how to make it strike."""

    server: ModbusServer
    device: Device

    @property
    def port(self) -> int:
        return self.server.port

    def strike(self, cycles: int = 1) -> None:
        """Complete so many cycles; the ring holds the last sixteen."""
        self.device.overrun(cycles)

    def restart(self) -> None:
        """Switch it off and on."""
        self.server.drop_clients()
        self.device.restart()


@contextlib.asynccontextmanager
async def stepped(**changes: Any) -> AsyncIterator[SteppedModule]:
    """Serve the prototype's scenario with `changes`."""
    content = scenario_content("prototype", changes)
    registers = read_register_map(Path(content["register_map"]))
    device = Device(Scenario.model_validate(content), registers, session=3, epoch_ns=time.time_ns())
    async with ModbusServer(device) as server:
        yield SteppedModule(server, device)
