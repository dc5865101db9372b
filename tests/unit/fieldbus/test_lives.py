"""Another module, a session that comes again, a start that no session tells: each cycle still comes once.

Truth: what the devices made.
"""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator
from dataclasses import replace

import pytest

from impactcell.fieldbus.acquisition import ReceivedCycle
from impactcell.fieldbus.cycles.cycle_choice import PATIENCE_S, CycleChoice
from impactcell.fieldbus.cycles.fetched_capture import NotFetched
from impactcell.fieldbus.cycles.status_block import StatusBlock
from impactcell.fieldbus.cycles.taken_cycles import TakenBefore
from impactcell.fieldbus.registers import RegisterMap
from impactcell.process.cell_logger import CellLogger
from impactcell.records import CycleId
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import HEADER, make, running, take

BEGIN = HEADER["cycle_time"]
SECOND = 10**9


def tap(device: ScriptedDevice, first_ns: int, cycles: int = 1) -> None:
    """Make cycles, one a second from `first_ns` on by the module's clock; 0: by one that is not set."""
    for _ in range(cycles):
        second = int(device.get("cycle_counter")) + 1
        make(device, cycle_time=first_ns and first_ns + second * SECOND, peak_force=100.0 + second % 50)


def ids(received: list[ReceivedCycle]) -> list[tuple[int, int]]:
    return [(each.cycle_id.session, each.cycle_id.cycle) for each in received]


async def assert_nothing_waits(receptions: AsyncIterator[ReceivedCycle]) -> None:
    coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
    await asyncio.sleep(30.0)
    assert not coming.done()
    coming.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await coming


@pytest.fixture
def without_session(fpga: RegisterMap) -> RegisterMap:
    left_out = ("session", "window_session", "acknowledge_session")
    kept = {name: register for name, register in fpga.registers.items() if name not in left_out}
    return replace(fpga, registers=kept)


@pytest.mark.slow
@pytest.mark.parametrize("serial", ["", "SN2"], ids=["no serial number", "another serial number"])
@pytest.mark.parametrize("clock_ns", [BEGIN, 0], ids=["a clock", "no clock"])
@pytest.mark.parametrize("away", [1, 15, 20])
async def test_a_module_that_is_back_after_another_is_read_on_where_it_was(
    fpga: RegisterMap, away: int, clock_ns: int, serial: str
) -> None:
    """As behind a gateway that answers for another one for a second; the ring holds 16 cycles."""
    device, other = ScriptedDevice(fpga, session=7), ScriptedDevice(fpga, session=99)
    if serial:
        device.put("serial_number", "SN1")
        other.put("serial_number", serial)
    tap(device, clock_ns, 8)
    tap(other, clock_ns and clock_ns + 60 * SECOND, 5)
    async with running(fpga, device) as (server, module, receptions):
        await take(receptions, 8)
        server.devices[1] = other
        assert ids(await take(receptions, 5)) == [(99, cycle) for cycle in range(1, 6)]
        tap(device, clock_ns, away)
        server.devices[1] = device
        lost = max(0, away - fpga.slots)
        received = await take(receptions, away - lost)
        assert ids(received) == [(7, cycle) for cycle in range(9 + lost, 9 + away)]
        assert [each.restarted for each in received] == [True] + [False] * (away - lost - 1)
        assert module.status.missed == lost
        await assert_nothing_waits(receptions)


@pytest.mark.parametrize("clock_ns", [BEGIN, 0], ids=["a clock", "no clock"])
async def test_a_session_that_comes_again_in_another_life_is_read_from_its_oldest(
    fpga: RegisterMap, clock_ns: int
) -> None:
    device = ScriptedDevice(fpga, session=7)
    tap(device, clock_ns, 8)
    async with running(fpga, device) as (_, module, receptions):
        await take(receptions, 8)
        device.start(session=8)
        tap(device, clock_ns and clock_ns + 60 * SECOND, 5)
        await take(receptions, 5)
        device.start(session=7)
        if clock_ns:
            tap(device, clock_ns + 90 * SECOND, 12)
        else:
            make(device, 12, cycle_time=0, peak_force=10.0)
        assert ids(await take(receptions, 12)) == [(7, cycle) for cycle in range(1, 13)]
        assert module.status.missed == 0


@pytest.mark.slow
async def test_a_session_of_before_a_restart_of_the_service_is_known(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga, session=7)
    tap(device, BEGIN, 10)
    lives = [(CycleId(7, 8), BEGIN + 8 * SECOND)]
    after = CycleId(99, 5), BEGIN + 60 * SECOND, TakenBefore(lives, "SN2")
    device.put("serial_number", "SN1")
    async with running(fpga, device, after=after) as (_, module, receptions):
        assert ids(await take(receptions, 2)) == [(7, 9), (7, 10)]
        assert (module.status.missed, module.serial_number) == (0, "SN1")
        await assert_nothing_waits(receptions)


@pytest.mark.parametrize("clock_ns", [BEGIN, 0], ids=["a clock", "no clock"])
@pytest.mark.parametrize("made", [3, 8, 12, 16])
async def test_a_start_over_an_outage_that_no_session_tells_loses_nothing_that_the_ring_holds(
    without_session: RegisterMap, made: int, clock_ns: int, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    device = ScriptedDevice(without_session)
    tap(device, clock_ns, 8)
    async with running(without_session, device) as (server, module, receptions):
        *_, last = await take(receptions, 8)
        await module.acknowledge(last.cycle_id)
        await server.close()
        device.start(session=0)
        if clock_ns:
            tap(device, clock_ns + 60 * SECOND, made)
        else:
            make(device, made, cycle_time=0, peak_force=10.0)
        device.acknowledged.clear()
        await server.start()
        if made == 3 and not clock_ns:
            make(device, 9, cycle_time=0, peak_force=10.0)  # else it might be an old reply
            made = 12
        received = await take(receptions, made)
        assert ids(received) == [(0, cycle) for cycle in range(1, made + 1)]
        assert [each.restarted for each in received] == [True] + [False] * (made - 1)
        assert (module.status.missed, module.status.restarts) == (0, 1)
        assert not device.acknowledged  # of the life before
        await module.acknowledge(received[0].cycle_id)
        assert device.get("acknowledge_cycle") == 1
    assert "nothing tells" not in caplog.text


@pytest.mark.parametrize("away", [3, 16])
async def test_an_outage_over_which_nothing_tells_of_a_start_is_told(
    without_session: RegisterMap, away: int, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    device = ScriptedDevice(without_session)
    tap(device, BEGIN, 8)
    async with running(without_session, device) as (server, module, receptions):
        await take(receptions, 8)
        await server.close()
        tap(device, BEGIN, away)
        await server.start()
        assert ids(await take(receptions, away)) == [(0, cycle) for cycle in range(9, 9 + away)]
        assert (module.status.missed, module.status.restarts) == (0, 0)
    told = [record.getMessage() for record in caplog.records if "nothing tells" in record.getMessage()]
    assert len(told) == (away == 16)  # else the ring still holds the last one


async def test_another_module_in_the_same_session_is_told_and_nothing_of_it_is_missed(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    device, other = ScriptedDevice(fpga, session=7), ScriptedDevice(fpga, session=7, counter=500)
    device.put("serial_number", "SN1")
    other.put("serial_number", "SN2")
    tap(device, BEGIN, 8)
    tap(other, BEGIN, 12)
    async with running(fpga, device) as (server, module, receptions):
        *_, last = await take(receptions, 8)
        await module.acknowledge(last.cycle_id)
        server.devices[1] = other
        received = await take(receptions, 12)
        assert ids(received) == [(7, cycle) for cycle in range(501, 513)]
        assert (received[0].restarted, module.status.missed, module.serial_number) == (True, 0, "SN2")
        assert other.acknowledged == []
        await module.acknowledge(received[-1].cycle_id)
        assert other.get("acknowledge_cycle") == 512
        tap(device, BEGIN)
        server.devices[1] = device
        assert ids(await take(receptions, 1)) == [(7, 9)]
    (first, second) = [record.getMessage() for record in caplog.records if "another" in record.getMessage()]
    assert "another module answers (serial number SN2 instead of SN1)" in first
    assert "another module answers (serial number SN1 instead of SN2)" in second


async def test_a_module_that_refuses_its_serial_number_is_read_all_the_same(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga)
    absent = replace(fpga["serial_number"], address=60_000)
    layout = replace(fpga, registers=fpga.registers | {"serial_number": absent})
    make(device, 2)
    async with running(layout, device) as (_, module, receptions):
        assert ids(await take(receptions, 2)) == [(1, 1), (1, 2)]
        assert (module.serial_number, module.status.reconnects) == ("", 0)


def test_a_ring_of_which_all_has_been_taken_is_told(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    choice = CycleChoice(fpga, CellLogger(logging.getLogger(__name__), "cell-1"))
    status = StatusBlock("ready", 2, 16, tuple(range(1, 17)), None, None)
    for now_s in (0.0, PATIENCE_S + 1.0):
        target = choice.target(CycleId(1, 3), status, now_s)
        assert target is not None
        choice.record_failure(target, NotFetched.TAKEN, now_s)
    assert (
        "no cycle can be read for 11 s: cycle_counter shows 16, but it has been taken before" in caplog.text
    )
