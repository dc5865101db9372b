"""Decimal codes with a digit above 9: told by register and code, and never taken for a number."""

import asyncio
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from impactcell.fieldbus.registers import WIRE, RegisterMap
from impactcell.records import ModuleStatus
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import make, running, take
from tests.unit.fieldbus.test_poorer_modules import SUMMARY, figures_of, make_summary

DIRECTION = {"name": "direction", "address": 30, "kind": "bcd16", "length": 0}
"""A register of a small controller's header."""


def with_kind(registers: RegisterMap, name: str, kind: str, **more: Any) -> RegisterMap:
    register = replace(registers[name], kind=kind, **more)
    return replace(registers, registers={**registers.registers, name: register})


async def test_a_header_without_a_number_costs_its_cycle_and_not_the_connection() -> None:
    """The counter goes on, so the cycle was made; what was in it nobody knows."""
    module_map = replace(
        SUMMARY, registers={**SUMMARY.registers, "direction": replace(SUMMARY["batch_id"], **DIRECTION)}
    )
    device = ScriptedDevice(module_map)
    device.put("direction", 1)
    make_summary(device)
    async with running(module_map, device) as (_, module, receptions):
        await take(receptions, 1)
        make_summary(device)
        device.image[DIRECTION["address"]] = 0xFFFF
        (unreadable,) = await take(receptions, 1)
        assert unreadable.cycle_id.cycle == 2
        assert unreadable.capture.summary is None
        (fault,) = unreadable.faults
        assert fault.startswith("cell-1: cycle 2 could not be read: register direction (30) shows 0xffff")
        make_summary(device)
        device.put("direction", 1)
        (received,) = await take(receptions, 1)
        assert received.cycle_id.cycle == 3
        assert received.capture.summary is not None
        assert received.capture.summary.peak_force_n == pytest.approx(figures_of(3)["peak_force"])
        assert (module.status.unreadable, module.status.missed, module.status.reconnects) == (1, 0, 0)


@pytest.mark.parametrize("counter", ["u32", "bcd32"])
async def test_a_slot_that_shows_no_number_is_empty(fpga: RegisterMap, counter: str) -> None:
    """As the memory of a controller shows it that was never written: 0xFFFFFFFF."""
    module_map = with_kind(with_kind(fpga, "ring_cycle", "bcd32"), "cycle_counter", counter)
    device = ScriptedDevice(module_map, session=9)
    ring = module_map["ring_cycle"]

    def leave_empty_slots() -> None:
        words = device.image[ring.address : ring.end].reshape(-1, 2)
        words[(words == 0).all(axis=1)] = np.array([0xFFFF, 0xFFFF], dtype=WIRE)
        device.put("status_crc32", 0)  # it is not filled: two readings prove each other

    make(device)
    leave_empty_slots()
    async with running(module_map, device) as (_, module, receptions):
        seen = await take(receptions, 1)
        words = device.image[ring.address : ring.end].reshape(-1, 2)
        words[(words == 0xFFFF).all(axis=1)] = 0
        make(device)
        leave_empty_slots()
        seen += await take(receptions, 1)
        assert [received.cycle_id.cycle for received in seen] == [1, 2]
        assert (module.status.missed, module.status.unreadable, module.status.reconnects) == (0, 0, 0)


async def test_a_counter_that_shows_no_number_is_told_as_why_there_is_no_connection() -> None:
    module_map = with_kind(SUMMARY, "cycle_counter", "bcd16")
    device = ScriptedDevice(module_map)
    make_summary(device)
    statuses = [ModuleStatus()]
    async with running(module_map, device, statuses=statuses) as (_, module, receptions):
        await take(receptions, 1)
        device.image[module_map["cycle_counter"].address] = 0x2A
        coming = asyncio.ensure_future(take(receptions, 1))
        while module.status.connected:
            await asyncio.sleep(0)
        assert module.status.reason == "cell-1: register cycle_counter (8) shows 0x2a, which is no bcd16"
        device.put("cycle_counter", 1)
        make_summary(device)
        (received,) = await coming
        assert (received.cycle_id.cycle, received.missed) == (2, 0)
