"""Acquisition against the simulated module and its plant: what happened is what arrives, once, in order."""

import contextlib
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from impactcell.fieldbus.acquisition import ModuleAcquisition, ReceivedCycle
from impactcell.fieldbus.cycles.capture_ring import CYCLE_PERIOD
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import RegisterMap
from impactcell.fieldbus.transports import transport_for
from simulator.device import Device
from simulator.faults import Fault, FaultKind
from simulator.modbus_server import ModbusServer
from simulator.scenario import Scenario

MAP = Path(__file__).resolve().parents[2] / "config" / "maps" / "fpga-v1.yaml"


@dataclass
class Cell:
    """A module that strikes when the test says so, and what it says it did."""

    server: ModbusServer
    device: Device
    module: ModuleAcquisition
    receptions: AsyncGenerator[ReceivedCycle, None]
    truths: list[dict[str, Any]]

    async def take(self, count: int) -> list[ReceivedCycle]:
        return [await anext(self.receptions) for _ in range(count)]

    def assert_true(self, received: list[ReceivedCycle]) -> None:
        by_mark = {(truth["session"], truth["cycle"]): truth for truth in self.truths}
        for each in received:
            truth = by_mark[each.cycle_id.session, each.cycle_id.cycle]
            capture = each.capture
            assert each.faults == ()
            assert capture.time_ns == truth["time_ns"]
            assert capture.summary is not None
            assert capture.summary.peak_force_n == pytest.approx(truth["peak_force_n"], rel=1e-6)
            assert capture.summary.sliding_distance_m == pytest.approx(truth["sliding_distance_m"], rel=1e-6)
            assert capture.force is not None
            assert capture.position is not None
            # The samples are this cycle's too: noise is 0.4 N and 1.5 µm.
            assert capture.force.values.max() == pytest.approx(truth["peak_force_n"], abs=3.0)
            assert capture.position.values[-1] == pytest.approx(truth["displacement_m"], abs=1e-5)


@asynccontextmanager
async def running(window: int = 16, timeout_s: float = 10.0) -> AsyncIterator[Cell]:
    """The module's time passes only by `overrun`, so that nothing hangs on speed."""
    registers = RegisterMap.from_mapping(yaml.safe_load(MAP.read_text(encoding="utf-8")))
    scenario = Scenario.model_validate(
        {
            "format": 1,
            "register_map": "",
            "strikes": {"period_s": 1e6, "velocities_mm_per_min": [3000.0, 4500.0, 6000.0]},
            "sensors": {
                "force": {"rate_hz": 100_000, "noise_std": 0.4, "longest_s": 0.02},
                "position": {"rate_hz": 10_000, "noise_std": 1.5e-6, "longest_s": 0.2},
            },
        }
    )
    truths: list[dict[str, Any]] = []
    device = Device(
        scenario, registers, session=3, epoch_ns=10**18, on_truth=lambda truth: truths.append(dict(truth))
    )
    async with (
        ModbusServer(device) as server,
        ModuleAcquisition(
            "cell-1",
            ModbusClient(transport_for(ModuleLink(port=server.port, window=window, timeout_s=timeout_s))),
            registers,
        ) as module,
        contextlib.aclosing(module.captures()) as receptions,
    ):
        yield Cell(server, device, module, receptions, truths)


@pytest.mark.slow
@pytest.mark.parametrize("window", [1, 16])
async def test_every_cycle_arrives_once_and_true(window: int) -> None:
    async with running(window) as cell:
        received = []
        for _ in range(12):
            cell.device.overrun(1)
            received += await cell.take(1)
        assert [r.cycle_id.cycle for r in received] == list(range(1, 13))
        cell.assert_true(received)
        assert cell.module.status.missed == 0


@pytest.mark.slow
async def test_every_cycle_arrives_once_and_true_whatever_befalls_the_link() -> None:
    async with running(timeout_s=0.1) as cell:
        for kind in FaultKind:
            cell.server.faults.inject(Fault(kind, probability=0.002, seconds=0.15))
        received = []
        for _ in range(4):
            cell.device.overrun(10)
            received += await cell.take(10)
        assert [r.cycle_id.cycle for r in received] == list(range(1, 41))
        assert sum(cell.server.faults.happened.values()) > 10
        assert cell.module.status.missed == 0
        cell.assert_true(received)


async def test_a_restart_begins_a_session_at_cycle_one() -> None:
    async with running() as cell:
        cell.device.overrun(3)
        await cell.take(3)
        cell.server.drop_clients()
        session = cell.device.restart()
        cell.device.overrun(3)
        received = await cell.take(3)
        assert [(r.cycle_id.session, r.cycle_id.cycle) for r in received] == [
            (session, 1),
            (session, 2),
            (session, 3),
        ]
        assert [r.restarted for r in received] == [True, False, False]
        cell.assert_true(received)


async def test_an_overrun_of_the_ring_is_counted_exactly() -> None:
    async with running() as cell:
        cell.device.overrun(3)
        await cell.take(3)
        cell.device.overrun(40)
        received = await cell.take(16)
        assert [r.cycle_id.cycle for r in received] == list(range(28, 44))
        assert [r.missed for r in received] == [24] + [0] * 15
        cell.assert_true(received)


async def test_the_counter_wraps_without_loss() -> None:
    async with running() as cell:
        cell.device.overrun(2)
        await cell.take(2)
        cell.device.set_counter(CYCLE_PERIOD - 2)
        cell.device.overrun(1)
        received = await cell.take(1)
        cell.device.overrun(5)
        received += await cell.take(5)
        assert [r.cycle_id.cycle for r in received] == [CYCLE_PERIOD - 1, CYCLE_PERIOD, 1, 2, 3, 4]
        assert cell.module.status.missed == 0
        cell.assert_true(received)
