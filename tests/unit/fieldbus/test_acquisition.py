"""Cycles of one module over a real socket: each once, in order, whole, whatever happens on the way."""

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import numpy as np
import pytest

from impactcell.fieldbus.acquisition import ModuleAcquisition, ReceivedCycle
from impactcell.fieldbus.cycles.capture_ring import CYCLE_PERIOD
from impactcell.fieldbus.cycles.taken_cycles import TakenBefore
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import RegisterMap, Words
from impactcell.fieldbus.transports import transport_for
from impactcell.records import CycleId, ModuleStatus
from simulator.faults import Fault, FaultKind
from simulator.modbus_server import ModbusServer
from simulator.scripted import ScriptedDevice

HEADER = {
    "velocity": 0.05,
    "mass": 18.9,
    "stroke": 0.0015,
    "dwell": 1.5,
    "direction": -1,
    "start_position": 0.012,
    "force_rate": 1e6,
    "force_start": -2e-6,
    "position_rate": 1e5,
    "position_start": 0.0,
    "peak_force": 213.5,
    "sliding_distance": 0.0042,
    "batch_id": "B-17",
    "cycle_time": 1_795_255_128_123_456_789,
}
SAMPLES = 3000


def samples_of(cycle: int, count: int = SAMPLES) -> dict[str, np.ndarray]:
    """Samples that tell by themselves which cycle they are from."""
    draw = np.random.default_rng(cycle)
    return {"force": draw.normal(0.0, 50.0, count), "position": draw.normal(0.0, 1e-3, count // 4)}


def make(device: ScriptedDevice, cycles: int = 1, **header: Any) -> None:
    for _ in range(cycles):
        device.complete(samples_of(int(device.get("cycle_counter")) % CYCLE_PERIOD + 1), **(HEADER | header))


def assert_whole(received: ReceivedCycle) -> None:
    expected = samples_of(received.capture.cycle)
    force, position = received.capture.force, received.capture.position
    assert force is not None
    assert position is not None
    assert force.values.size == expected["force"].size
    np.testing.assert_allclose(force.values, expected["force"], atol=0.0126)
    np.testing.assert_allclose(position.values, expected["position"], atol=0.6e-9)


@asynccontextmanager
async def running(
    fpga: RegisterMap,
    device: ScriptedDevice,
    after: CycleId | tuple[CycleId, int] | tuple[CycleId, int, TakenBefore] | None = None,
    statuses: list[ModuleStatus] | None = None,
    **link: Any,
) -> AsyncIterator[tuple[ModbusServer, ModuleAcquisition, AsyncIterator[ReceivedCycle]]]:
    link = {"window": 16, "timeout_s": 10.0} | link
    async with (
        ModbusServer(device) as server,
        ModuleAcquisition(
            "cell-1",
            ModbusClient(transport_for(ModuleLink(port=server.port, **link))),
            fpga,
            statuses and statuses.append,
        ) as module,
        contextlib.aclosing(
            module.captures(*(after if isinstance(after, tuple) else (after,)))
        ) as receptions,
    ):
        yield server, module, receptions


async def take(receptions: AsyncIterator[ReceivedCycle], count: int) -> list[ReceivedCycle]:
    return [await anext(receptions) for _ in range(count)]


@pytest.mark.slow
@pytest.mark.parametrize(("window", "max_registers"), [(1, 125), (16, 125), (4, 33), (2, 1)])
async def test_a_cycle_arrives_whole_in_si(fpga: RegisterMap, window: int, max_registers: int) -> None:
    device = ScriptedDevice(fpga, session=9)
    make(device)
    async with running(fpga, device, window=window, max_registers=max_registers) as (_, module, receptions):
        [received] = await take(receptions, 1)
        assert_whole(received)
        assert received.cycle_id == CycleId(9, 1)
        assert received.faults == ()
        capture = received.capture
        assert capture.velocity_m_s == pytest.approx(0.05, rel=1e-6)
        assert capture.mass_kg == pytest.approx(18.9, rel=1e-6)
        assert (capture.direction, capture.batch_id, capture.time_ns) == (-1, "B-17", HEADER["cycle_time"])
        assert capture.stroke_m == pytest.approx(0.0015, rel=1e-6)
        assert (capture.dwell_s, capture.start_m) == (1.5, pytest.approx(0.012))
        assert capture.summary is not None
        assert capture.summary.sliding_distance_m == pytest.approx(0.0042, rel=1e-6)
        assert capture.force is not None
        np.testing.assert_allclose(capture.force.time_s[:3], [-2e-6, -1e-6, 0.0], atol=1e-15)
        assert capture.force.full_scale == pytest.approx((-819.175, 819.175))
        assert module.status.connected
        assert module.status.received == 1
        assert module.status.round_trip_s > 0.0


async def test_new_cycles_come_as_they_are_made(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga)
    async with running(fpga, device) as (_, module, receptions):
        for cycle in range(1, 6):
            next_one = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
            await asyncio.sleep(0)
            make(device)
            received = await next_one
            assert (received.capture.cycle, received.missed) == (cycle, 0)
            assert_whole(received)
        assert module.status.missed == 0


@pytest.mark.parametrize("away", [0, 1, 5, 16, 17, 40])
async def test_an_outage_loses_exactly_what_the_ring_lost(fpga: RegisterMap, away: int) -> None:
    """The ring has 16 slots."""
    device = ScriptedDevice(fpga)
    make(device, 3)
    async with running(fpga, device) as (server, module, receptions):
        await take(receptions, 3)
        await server.close()
        make(device, away)
        await server.start()
        make(device)
        lost = max(0, away + 1 - 16)
        received = await take(receptions, away + 1 - lost)
        assert [r.capture.cycle for r in received] == list(range(4 + lost, 5 + away))
        assert [r.missed for r in received] == [lost] + [0] * (len(received) - 1)
        for each in received:
            assert_whole(each)
        assert (module.status.missed, module.status.received) == (lost, 3 + len(received))


async def test_goes_on_after_the_last_durable_cycle(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga, session=4)
    make(device, 10)
    async with running(fpga, device, after=CycleId(4, 7)) as (_, _, receptions):
        assert [r.cycle_id for r in await take(receptions, 3)] == [
            CycleId(4, 8),
            CycleId(4, 9),
            CycleId(4, 10),
        ]


async def test_a_restart_of_the_module_is_told(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga, session=4)
    make(device, 10)
    async with running(fpga, device, after=CycleId(4, 9)) as (server, module, receptions):
        await take(receptions, 1)
        server.drop_clients()
        device.start(session=5)
        make(device, 2)
        received = await take(receptions, 2)
        assert [r.cycle_id for r in received] == [CycleId(5, 1), CycleId(5, 2)]
        assert [(r.restarted, r.missed) for r in received] == [(True, 0), (False, 0)]
        assert (module.status.restarts, module.status.reconnects) == (1, 1)


class RebootsAtSamples(ScriptedDevice):
    """Starts anew, with a cycle of its own, when the samples of one are read for the first time."""

    rebooted = False

    def read(self, table: str, address: int, count: int) -> Words:
        if address >= self.registers["force"].address and not self.rebooted:
            self.rebooted = True
            self.start(session=5)
            make(self)
        return super().read(table, address, count)


async def test_a_cycle_that_was_seen_and_not_taken_before_a_restart_is_missed(fpga: RegisterMap) -> None:
    device = RebootsAtSamples(fpga, session=4)
    make(device, 10)
    async with running(fpga, device, after=CycleId(4, 9)) as (_, module, receptions):
        (received,) = await take(receptions, 1)
        assert (received.cycle_id, received.missed, received.restarted) == (CycleId(5, 1), 1, True)
        assert module.status.missed == 1


async def test_the_counter_wraps_without_loss(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga, counter=CYCLE_PERIOD - 3)
    async with running(fpga, device, after=CycleId(1, CYCLE_PERIOD - 3)) as (_, module, receptions):
        make(device, 6)
        received = await take(receptions, 6)
        assert [r.capture.cycle for r in received] == [
            CYCLE_PERIOD - 2,
            CYCLE_PERIOD - 1,
            CYCLE_PERIOD,
            1,
            2,
            3,
        ]
        for each in received:
            assert_whole(each)
        assert module.status.missed == 0


@pytest.mark.parametrize("made", [1, 16])
@pytest.mark.parametrize("where", ["window_sequence", "force"])
async def test_a_capture_overwritten_while_it_is_read_is_never_mixed(
    fpga: RegisterMap, made: int, where: str
) -> None:
    """Cycles happen while the oldest is read: none is missed but those that they overwrite."""
    device = ScriptedDevice(fpga)
    make(device, 17)
    device.on_read.append((fpga[where].address, lambda: make(device, made)))
    async with running(fpga, device, after=CycleId(1, 1)) as (_, _, receptions):
        received = await take(receptions, 16)
        assert [r.capture.cycle for r in received] == list(range(2 + made, 18 + made))
        assert [r.missed for r in received] == [made] + [0] * 15
        for each in received:
            assert_whole(each)


async def test_another_client_that_selects_slots_does_not_mix_captures(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga)
    make(device, 3)
    select = fpga["slot_select"]

    def interfere() -> None:
        device.write(select.address, select.encode(15))

    device.on_read.append((fpga["force"].address + 500, interfere))
    device.on_read.append((fpga["position"].address + 100, interfere))
    async with running(fpga, device) as (_, module, receptions):
        for received in await take(receptions, 3):
            assert_whole(received)
        assert module.status.discarded >= 1


async def test_a_module_that_is_busy_for_the_selection_of_a_slot_is_asked_again(fpga: RegisterMap) -> None:
    """Meanwhile its window shows another slot."""
    device = ScriptedDevice(fpga)
    make(device, 3)
    write, refused = device.write, []

    def busy(address: int, words: Words) -> None:
        if len(refused) < 2:
            refused.append(address)
            raise BlockingIOError
        write(address, words)

    device.write = busy  # type: ignore[method-assign]
    async with running(fpga, device) as (_, module, receptions):
        for received in await take(receptions, 3):
            assert_whole(received)
        assert module.status.discarded == 0
    assert refused == [fpga["slot_select"].address] * 2


@pytest.mark.parametrize("code", [4, 5, 6, 10, 11])
@pytest.mark.parametrize("register", ["window_sequence", "position"])
async def test_a_module_that_cannot_answer_for_a_while_loses_nothing(
    fpga: RegisterMap, register: str, code: int
) -> None:
    """It, or the gateway before it, refuses everything, from within a capture on."""
    device = ScriptedDevice(fpga)
    make(device, 3)
    async with running(fpga, device, timeout_s=0.1) as (server, module, receptions):

        def refuse() -> None:
            server.faults.inject(Fault(FaultKind.EXCEPTION, code=code))
            asyncio.get_running_loop().call_later(0.7, server.faults.clear)

        device.on_read.append((fpga[register].address, refuse))
        for received in await take(receptions, 3):
            assert_whole(received)
        assert module.status.unreadable == 0


async def test_a_wrong_crc_is_read_again(fpga: RegisterMap) -> None:
    """One bit is wrong while the samples are read, and right again when they are read once more."""
    device = ScriptedDevice(fpga)
    make(device)
    address = fpga["force"].address + 7

    def flip() -> None:
        device.image[address] = int(device.image[address]) ^ 0x40

    device.on_read += [(address, flip), (fpga["window_sequence_after"].address, flip)]
    async with running(fpga, device) as (_, module, receptions):
        [received] = await take(receptions, 1)
        assert_whole(received)
        assert module.status.discarded == 1


async def test_a_window_that_changes_while_it_is_read_is_read_again_also_without_a_crc(
    fpga: RegisterMap,
) -> None:
    """The sequence number behind the samples is all that tells."""
    registers = {name: register for name, register in fpga.registers.items() if name != "capture_crc32"}
    layout = RegisterMap(fpga.name, registers)
    device = ScriptedDevice(layout)
    make(device)
    address = layout["force"].address + 2000

    def change() -> None:
        device.image[address : address + 500] = 0
        device.put("window_sequence_after", int(device.get("window_sequence")) + 2)
        device.on_read.append((layout["window_sequence"].address, device._show))

    device.on_read.append((address, change))
    async with running(layout, device) as (_, module, receptions):
        [received] = await take(receptions, 1)
        assert_whole(received)
        assert module.status.discarded == 1


async def test_a_window_that_is_being_changed_is_not_read(fpga: RegisterMap) -> None:
    """An odd sequence number, the same before and after, is all that tells."""
    registers = {name: register for name, register in fpga.registers.items() if name != "capture_crc32"}
    layout = RegisterMap(fpga.name, registers)
    device = ScriptedDevice(layout)
    make(device)
    first, looks = layout["window_sequence"].address, 0

    def look() -> None:
        nonlocal looks
        looks += 1
        device._show()
        if looks > 3:
            return
        odd = int(device.get("window_sequence")) | 1
        device.put("window_sequence", odd)
        device.put("window_sequence_after", odd)
        device.image[layout["force"].address + 100 :][:500] = 0
        device.on_read.append((first, look))

    device.on_read.append((first, look))
    async with running(layout, device) as (_, _module, receptions):
        [received] = await take(receptions, 1)
        assert_whole(received)
    assert looks == 4


async def test_a_capture_that_never_fits_its_crc_is_passed_on_empty_and_the_next_is_good(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    device = ScriptedDevice(fpga)
    make(device, capture_crc32=12345)
    make(device, fpga.slots // 2)
    async with running(fpga, device) as (_, module, receptions):
        bad, good = await take(receptions, 2)
        assert bad.capture.force is None
        assert math.isnan(bad.capture.velocity_m_s)
        assert "cell-1: cycle 1 could not be read: register capture_crc32 (314) does not fit" in bad.faults[0]
        assert_whole(good)
        assert (module.status.unreadable, module.status.received) == (1, 2)
        (told,) = [line for line in caplog.messages if "capture_crc32" in line]
        assert told.startswith("cell=cell-1 cycle=1 could not be read: register")


@pytest.mark.parametrize(
    ("header", "samples", "told"),
    [
        ({}, {"force": []}, "register force (320): no samples, force_count is 0"),
        ({}, {"position": []}, "register position (20320): no samples, position_count is 0"),
        ({}, {"force": np.full(100, 3.0)}, "register force (320): constant at 3"),
        ({}, {"force": np.linspace(0, 2000.0, 100)}, "at full scale (-819.175 to 819.175)"),
        (
            {},
            {"force": np.where(np.arange(100) % 5, 1.0 * np.arange(100), np.nan)},
            "20 of 100 samples are not a number",
        ),
        ({}, {"force": np.full(100, np.nan)}, "100 of 100 samples are not a number"),
        (
            {"force_count": 20_001},
            {},
            "register force_count (310): 20001 samples, but the map has room for 20000",
        ),
        ({"position_count": 65_535}, {}, "register position_count (311): 65535 samples"),
        ({"force_rate": 0.0}, {}, "register force (320): no time axis, force_rate is 0 Hz"),
        ({"velocity": math.nan}, {}, "register velocity (268): nan mm/min cannot be"),
        ({"velocity": -0.05}, {}, "register velocity (268): -3000 mm/min cannot be"),
        ({"mass": math.inf}, {}, "register mass (270): inf kg cannot be"),
        ({"stroke": 0.0}, {}, "register stroke (272): 0 mm cannot be"),
        ({"direction": 5}, {}, "register direction (259): 5 instead of 1 or -1"),
        ({"peak_force": math.nan}, {}, "register peak_force (278): not a number"),
    ],
)
async def test_bad_content_is_named_with_cell_cycle_and_register(
    fpga: RegisterMap, header: dict[str, Any], samples: dict[str, Any], told: str
) -> None:
    device = ScriptedDevice(fpga)
    device.complete(samples_of(1) | samples, **(HEADER | header))
    make(device, fpga.slots // 2)
    async with running(fpga, device) as (_, _, receptions):
        bad, good = await take(receptions, 2)
        begins = ("cell-1: cycle 1: ", "cell-1: cycle 1 could not be read: ")
        assert any(fault.startswith(begins) and told in fault for fault in bad.faults), bad.faults
        for channel in (bad.capture.force, bad.capture.position):
            assert channel is None or np.isfinite(channel.values).all()
        assert_whole(good)
        assert good.faults == ()


async def test_what_a_module_need_not_know_is_no_fault(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga)
    make(device, mass=math.nan, dwell=math.nan, stroke=math.inf, batch_id="", cycle_time=0)
    async with running(fpga, device) as (_, _, receptions):
        [received] = await take(receptions, 1)
    assert received.faults == ()
    assert math.isnan(received.capture.mass_kg)
    assert received.capture.stroke_m == math.inf
    assert received.capture.batch_id is None


@pytest.mark.parametrize(
    ("register", "shown", "told"),
    [
        ("map_version", 2, "register map_version (16) shows 2, map fpga-v1 expects 1"),
        (
            "module_name",
            "PUMP-9",
            "register module_name (0) shows 'PUMP-9', map fpga-v1 expects 'IMPACT-FPGA'",
        ),
    ],
)
async def test_the_wrong_module_is_named_and_the_right_one_taken_when_it_comes(
    fpga: RegisterMap, register: str, shown: Any, told: str
) -> None:
    device = ScriptedDevice(fpga)
    make(device)
    device.put(register, shown)
    statuses: list[ModuleStatus] = [ModuleStatus()]
    async with running(fpga, device, statuses=statuses) as (server, module, receptions):
        waiting = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        while told not in module.status.reason:
            await asyncio.sleep(0)
        assert module.status.reason.startswith(f"cell-1: 127.0.0.1:{server.port} device 1: ")
        assert (module.status.connected, module.status.answered) == (False, True)
        device.put(register, fpga[register].expect)
        assert_whole(await waiting)
        assert (module.status.connected, module.status.answered) == (True, False)
    assert [s.connected for s in statuses[1:]] == [False, True, False]


async def test_reasons_that_take_turns_are_logged_once_each(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    device = ScriptedDevice(fpga)
    make(device)
    async with running(fpga, device) as (_, module, receptions):
        waiting = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        for _ in range(3):
            for shown in ("PUMP-A", "PUMP-B"):
                device.put("module_name", shown)
                while f"shows '{shown}'" not in module.status.reason:
                    await asyncio.sleep(0)
        device.put("module_name", fpga["module_name"].expect)
        assert_whole(await waiting)
        for shown in ("PUMP-A", "PUMP-B"):
            assert sum(f"shows '{shown}'" in line for line in caplog.messages) == 1


async def test_a_wrong_device_id_is_named(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga)
    async with running(fpga, device, device_id=7) as (_, module, receptions):
        waiting = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        while "device_id 7 is wrong" not in module.status.reason:
            await asyncio.sleep(0)
        assert "gateway target device failed to respond" in module.status.reason
        waiting.cancel()
        await asyncio.gather(waiting, return_exceptions=True)


async def test_a_module_that_is_not_there_at_the_start_is_taken_when_it_comes(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga)
    make(device)
    async with running(fpga, device) as (server, module, receptions):
        await server.close()
        waiting = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        while "no connection" not in module.status.reason:
            await asyncio.sleep(0)
        await server.start()
        assert_whole(await waiting)


async def test_only_what_is_durable_is_acknowledged_also_after_an_outage(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga, session=3)
    make(device, 4)
    async with running(fpga, device) as (server, module, receptions):
        received = await take(receptions, 3)
        assert device.acknowledged == []
        await module.acknowledge(received[1].cycle_id)
        assert device.acknowledged == [(3, 2)]
        server.drop_clients()
        await asyncio.sleep(0.01)
        await module.acknowledge(received[2].cycle_id)
        await take(receptions, 1)
        assert device.acknowledged == [(3, 2), (3, 3)]


@pytest.mark.parametrize("kind", [kind for kind in FaultKind if kind != FaultKind.HALF_OPEN])
async def test_every_fault_ends_with_every_cycle_whole_and_in_order(
    fpga: RegisterMap, kind: FaultKind
) -> None:
    device = ScriptedDevice(fpga)
    make(device, 10)
    async with running(fpga, device, timeout_s=0.2) as (server, module, receptions):
        server.faults.inject(Fault(kind, probability=0.05, seconds=0.3, remaining=5))
        received = await take(receptions, 10)
        assert [r.capture.cycle for r in received] == list(range(1, 11))
        for each in received:
            assert_whole(each)
        assert (module.status.missed, module.status.unreadable) == (0, 0)


@pytest.mark.slow
async def test_a_module_that_makes_cycles_faster_than_they_can_be_read_is_followed(fpga: RegisterMap) -> None:
    """Every look at the force makes three more cycles: most are lost, counted, and none is mixed."""
    device = ScriptedDevice(fpga)
    make(device, 20)

    def flood() -> None:
        if device.get("cycle_counter") < 400:
            make(device, 3)
            device.on_read.append((fpga["force"].address + 2000, flood))

    flood()
    async with running(fpga, device) as (_, module, receptions):
        last = 0
        total = 0
        while last < device.get("cycle_counter"):
            received = await anext(receptions)
            assert_whole(received)
            assert received.capture.cycle > last
            total += 1 + received.missed
            last = received.capture.cycle
        first = last - total
        assert first >= 0
        assert module.status.received + module.status.missed == total
        assert module.status.unreadable == 0


async def test_the_report_has_batch_and_positioning(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga)
    make(device)
    device.put("batch_from_cycle", 5)
    device.put("batch_announced", "B-18")
    device.put("batch_sequence", 1)
    device.put("positioning_state", 1)
    device.put("target_position", -0.0123)
    device.put("target_sequence", 4)
    async with running(fpga, device) as (_, module, receptions):
        await take(receptions, 1)
        status_block = module.status_block
    assert status_block is not None
    assert status_block.batch is not None
    assert (status_block.batch.batch_id, status_block.batch.from_cycle, status_block.batch.sequence) == (
        "B-18",
        5,
        1,
    )
    assert status_block.positioning is not None
    assert (status_block.positioning.state, status_block.positioning.target_sequence) == ("ready", 4)
    assert status_block.positioning.target_m == pytest.approx(-0.0123)
    assert status_block.state == "ready"
