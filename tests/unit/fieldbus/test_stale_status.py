"""A status block that is old or has a wrong bit: each cycle still comes once. Truth: what the device made."""

import asyncio
import contextlib
from typing import TYPE_CHECKING

import numpy as np
import pytest

from impactcell.errors import ProtocolError
from impactcell.fieldbus.registers import RegisterMap, Words
from impactcell.records import CycleId
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import HEADER, assert_whole, make, running

if TYPE_CHECKING:
    from collections.abc import Callable

POLLS = 600


@pytest.fixture(params=["with a CRC", "without"])
def layout(request: pytest.FixtureRequest, fpga: RegisterMap) -> RegisterMap:
    """The map of a module that proves its status block, and of one that does not."""
    left_out = "status_crc32" if request.param == "without" else ""
    registers = {name: register for name, register in fpga.registers.items() if name != left_out}
    return RegisterMap(fpga.name, registers)


def last_of(device: ScriptedDevice) -> str:
    """Name of the last register of the status block."""
    return "status_crc32" if "status_crc32" in device.registers else "command_cycle"


class Mangler:
    """Stands between a device and its server and changes what is read of some registers."""

    def __init__(self, device: ScriptedDevice, first: str, last: str) -> None:
        self.device = device
        self.first, self.end = device.registers[first].address, device.registers[last].end
        self.polls = 0
        self.change: Callable[[Words, int], Words] = lambda words, _: words
        self._read = device.read
        device.read = self.read  # type: ignore[method-assign]

    def read(self, table: str, address: int, count: int) -> Words:
        words = self._read(table, address, count)
        if self.first <= address < self.end:
            self.polls += 1
            return self.change(words.copy(), self.polls)
        return words


async def received_of(
    fpga: RegisterMap, device: ScriptedDevice, mangler: Mangler, cycles: int
) -> list[CycleId]:
    """Let the device make a cycle at every fifth poll, until all of `cycles` have come or nothing comes."""
    received: list[CycleId] = []
    async with running(fpga, device) as (_, module, receptions):

        async def collect() -> None:
            async for each in receptions:
                assert_whole(each)
                received.append(each.cycle_id)
                assert each.missed == 0

        collecting = asyncio.create_task(collect())
        made = mangler.polls
        while int(device.get("cycle_counter")) < cycles and not collecting.done():
            if mangler.polls >= made + 5:
                made = mangler.polls
                make(device)
            await asyncio.sleep(0)
        enough = mangler.polls + POLLS
        while len(received) < cycles and mangler.polls < enough and not collecting.done():
            await asyncio.sleep(0)
        quiet = mangler.polls + 40
        while mangler.polls < quiet and not collecting.done():
            await asyncio.sleep(0)
        assert (module.status.missed, module.status.restarts, module.status.unreadable) == (0, 0, 0)
        collecting.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await collecting
    return received


@pytest.fixture(autouse=True)
def _polls_follow_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """No wait between polls: what is tried here does not depend on when they come."""
    monkeypatch.setattr("impactcell.fieldbus.cycles.poll_schedule.PollSchedule.delay_s", lambda *_: 0.0)


@pytest.mark.parametrize("age", [1, 2, 5])
async def test_status_replies_that_are_old_make_no_cycle_come_twice(layout: RegisterMap, age: int) -> None:
    """Three polls running show the status block as it was `age` cycles ago, again and again."""
    device = ScriptedDevice(layout, session=7)
    mangler = Mangler(device, "state", last_of(device))
    past: dict[int, Words] = {}

    def stale(words: Words, poll: int) -> Words:
        counter = int(device.get("cycle_counter"))
        past.setdefault(counter, words)
        return past.get(counter - age, words) if poll % 7 < 3 else words

    mangler.change = stale
    received = await received_of(layout, device, mangler, 60)
    assert received == [CycleId(7, cycle) for cycle in range(1, 61)]


@pytest.mark.parametrize("seed", range(4))
async def test_a_wrong_bit_in_a_status_block_makes_no_cycle_come_twice_or_missing(
    layout: RegisterMap, seed: int
) -> None:
    device = ScriptedDevice(layout, session=7)
    mangler = Mangler(device, "state", last_of(device))
    draw = np.random.default_rng(seed)

    def flip(words: Words, _: int) -> Words:
        if draw.random() < 0.3:
            words[draw.integers(2, 42)] ^= np.uint16(1 << draw.integers(16))  # session, counter or ring
        return words

    mangler.change = flip
    received = await received_of(layout, device, mangler, 60)
    assert received == [CycleId(7, cycle) for cycle in range(1, 61)]


@pytest.mark.slow
@pytest.mark.parametrize("register", ["session", "cycle_counter"])
async def test_a_status_register_with_a_bit_that_stays_wrong_makes_up_no_cycle(
    layout: RegisterMap, register: str
) -> None:
    """So long that every retry sees it, and no longer than the ring: nothing is made up, nothing lost."""
    device = ScriptedDevice(layout, session=7)
    mangler = Mangler(device, "state", last_of(device))
    make(device, 3)
    at = layout[register].address + 1 - mangler.first

    def flip(words: Words, poll: int) -> Words:
        if 20 < poll < 80:
            words[at] ^= np.uint16(1 << 4)
        return words

    mangler.change = flip
    received = await received_of(layout, device, mangler, 40)
    assert received == [CycleId(7, cycle) for cycle in range(1, 41)]


async def test_a_restart_within_one_session_is_still_seen(fpga: RegisterMap) -> None:
    """The counter goes back, and the captures are others: that is no old status block."""
    device = ScriptedDevice(fpga, session=7)
    make(device, 10)
    async with running(fpga, device) as (_, module, receptions):
        before = [(await anext(receptions)).cycle_id.cycle for _ in range(10)]
        device.start(session=7)
        make(device, 9, velocity=0.06)
        again = [await anext(receptions) for _ in range(9)]
        assert before == list(range(1, 11))
        assert [each.cycle_id.cycle for each in again] == list(range(1, 10))
        assert [each.restarted for each in again] == [True] + [False] * 8
        assert module.status.restarts == 1


@pytest.mark.parametrize("clock_ns", [0, 10**18])
async def test_an_old_status_block_after_a_start_of_the_service_is_no_restart(
    layout: RegisterMap, clock_ns: int
) -> None:
    """The service knows the last cycle from its journal, and no more of it than its time."""
    device = ScriptedDevice(layout, session=7)
    for cycle in range(1, 11):
        make(device, cycle_time=clock_ns and clock_ns + cycle)
    old = device.image.copy()
    make(device, 2, cycle_time=clock_ns and clock_ns + 11)
    mangler = Mangler(device, "state", last_of(device))
    mangler.change = lambda words, poll: old[mangler.first :][: words.size] if poll < 20 else words
    after = (CycleId(7, 12), clock_ns and clock_ns + 12)
    async with running(layout, device, after=after) as (_, module, receptions):
        coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        while mangler.polls < 40:
            await asyncio.sleep(0)
        assert not coming.done()
        make(device)
        assert ((await coming).cycle_id, module.status.restarts) == (CycleId(7, 13), 0)


async def test_a_restart_that_no_clock_and_no_memory_proves_is_seen_before_the_ring_is_full(
    fpga: RegisterMap,
) -> None:
    """The same session, cycles without a time, and a service that has just been started."""
    device = ScriptedDevice(fpga, session=7)
    mangler = Mangler(device, "state", last_of(device))
    make(device, 2, cycle_time=0)
    async with running(fpga, device, after=(CycleId(7, 1000), 0)) as (_, module, receptions):
        coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        while not coming.done():
            polls = mangler.polls
            while mangler.polls < polls + 3 and not coming.done():
                await asyncio.sleep(0)
            make(device, cycle_time=0)
        assert int(device.get("cycle_counter")) < 16
        assert ((await coming).cycle_id, module.status.restarts) == (CycleId(7, 1), 1)
        assert (await anext(receptions)).cycle_id == CycleId(7, 2)


async def test_a_target_of_the_plc_with_a_wrong_bit_is_not_believed(layout: RegisterMap) -> None:
    """Every register of the status block, not only those that lead to a cycle."""
    device = ScriptedDevice(layout, session=7)
    make(device)
    device.put("target_position", 0.0123)
    device.put("part_position", 0.001)
    mangler = Mangler(device, "state", last_of(device))
    at, draw = layout["target_position"].address - mangler.first, np.random.default_rng(3)

    def flip(words: Words, _: int) -> Words:
        if draw.random() < 0.1:
            words[at + draw.integers(4)] ^= np.uint16(1 << draw.integers(16))  # target, or its sequence
        return words

    async with running(layout, device) as (_, module, receptions):
        await anext(receptions)
        mangler.change = flip
        believed = 0
        for _ in range(200):
            with contextlib.suppress(ProtocolError):
                positioning = (await module.read_status()).positioning
                assert positioning is not None
                assert (positioning.target_sequence, positioning.target_m) == (0, pytest.approx(0.0123))
                believed += 1
        assert believed > 100


async def test_a_part_that_moves_does_not_keep_the_status_block_from_being_read(fpga: RegisterMap) -> None:
    registers = {name: register for name, register in fpga.registers.items() if name != "status_crc32"}
    device = ScriptedDevice(RegisterMap(fpga.name, registers), session=7)
    make(device)
    mangler = Mangler(device, "state", "command_cycle")
    at = fpga["part_position"].address + 1 - mangler.first

    def moving(words: Words, poll: int) -> Words:
        words[at] = poll
        return words

    mangler.change = moving
    async with running(device.registers, device) as (_, module, receptions):
        await anext(receptions)
        positioning = (await module.read_status()).positioning
        assert positioning is not None
        assert positioning.position_m == pytest.approx(1e-9 * mangler.polls)


@pytest.mark.slow
async def test_an_old_status_block_after_a_restart_is_no_restart_back(layout: RegisterMap) -> None:
    """It is of the session before, and what it tells of has gone: the slots that it names are empty now."""
    device = ScriptedDevice(layout, session=7)
    make(device, 24)
    old = device.image.copy()
    async with running(layout, device, after=CycleId(7, 23)) as (_, module, receptions):
        await anext(receptions)
        device.start(session=8)
        make(device, 2)
        for cycle in (1, 2):
            assert (await anext(receptions)).cycle_id == CycleId(8, cycle)
        mangler = Mangler(device, "state", last_of(device))
        mangler.change = lambda words, poll: old[mangler.first :][: words.size] if poll < 20 else words
        coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        while mangler.polls < 40 and not coming.done():
            await asyncio.sleep(0)
        assert not coming.done()
        make(device)
        received = await coming
        assert_whole(received)
        assert (received.cycle_id, received.missed, received.restarted) == (CycleId(8, 3), 0, False)
        assert (module.status.restarts, module.status.unreadable, module.status.missed) == (1, 0, 0)


async def test_a_session_of_before_that_is_one_again_is_taken(fpga: RegisterMap) -> None:
    """A module whose sessions begin anew after a few: header and clock decide."""
    device = ScriptedDevice(fpga, session=1)
    make(device)
    async with running(fpga, device) as (_, module, receptions):
        for life in range(6):
            received = await anext(receptions)
            assert_whole(received)
            assert received.cycle_id == CycleId(1 + life % 2, 1)
            device.start(session=1 + (life + 1) % 2)
            make(device, cycle_time=HEADER["cycle_time"] + 10**9 * (life + 1))
        assert (module.status.restarts, module.status.missed) == (5, 0)
