"""A module whose clock is not set, as without a battery after power-up: its cycles have dates anyway."""

import logging
import time

import pytest

from impactcell.fieldbus.registers import RegisterMap
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import HEADER, make, running

SECOND = 10**9


@pytest.mark.parametrize("shown_ns", [0, 90 * SECOND], ids=["not set", "counting from power-up"])
async def test_a_cycle_of_a_clock_that_is_not_set_was_made_when_it_was_read(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture, shown_ns: int
) -> None:
    device = ScriptedDevice(fpga)
    async with running(fpga, device) as (_, _module, receptions):
        for cycle in range(3):
            before_ns = time.time_ns()
            make(device, cycle_time=shown_ns and shown_ns + cycle * SECOND)
            received = await anext(receptions)
            assert received.faults == ()
            assert before_ns <= received.capture.time_ns <= time.time_ns()
    (told,) = [record for record in caplog.records if "clock" in record.getMessage()]
    assert told.levelno == logging.WARNING
    assert told.getMessage() == (
        "cell=cell-1 cycle=1 register cycle_time (264) shows no date, as of a clock that is not set. Until "
        "it does, a cycle has the time at which it was read; set the module's clock"
    )


async def test_a_clock_that_is_set_later_counts_from_then_on_and_only_then(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    device = ScriptedDevice(fpga)
    set_ns = HEADER["cycle_time"]
    times_ns, began_ns = [], time.time_ns()
    async with running(fpga, device) as (_, _module, receptions):
        for shown_ns in (0, set_ns, set_ns + SECOND, 0):
            make(device, cycle_time=shown_ns)
            times_ns.append((await anext(receptions)).capture.time_ns)
    assert times_ns[1:3] == [set_ns, set_ns + SECOND]
    assert began_ns <= times_ns[0] <= times_ns[3] <= time.time_ns()
    assert sum("clock" in record.getMessage() for record in caplog.records) == 1


async def test_a_cycle_that_cannot_be_read_says_nothing_of_the_clock(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    device = ScriptedDevice(fpga)
    make(device, capture_crc32=12345)
    make(device, fpga.slots // 2)
    began_ns = time.time_ns()
    async with running(fpga, device) as (_, module, receptions):
        received = await anext(receptions)
        assert module.status.unreadable == 1
    assert received.faults
    assert began_ns <= received.capture.time_ns <= time.time_ns()
    assert not any("clock" in record.getMessage() for record in caplog.records)
