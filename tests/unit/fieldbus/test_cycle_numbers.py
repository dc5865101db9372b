"""Numbers of cycles from counters of few digits. Truth: a plain simulation that counts lives and cycles."""

import asyncio
import contextlib
from dataclasses import replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from impactcell.cell.preprocessing import BatchNaming, assign_batch
from impactcell.fieldbus.cycles.capture_ring import next_capture
from impactcell.fieldbus.cycles.cycle_numbers import CycleNumbers
from impactcell.fieldbus.cycles.status_block import StatusBlock
from impactcell.fieldbus.registers import RegisterMap
from impactcell.records import CycleId
from simulator.modbus_server import ModbusServer
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import HEADER, make, running, take
from tests.unit.fieldbus.test_no_decimals import with_kind
from tests.unit.fieldbus.test_poorer_modules import ONE_BUFFER, SUMMARY, make_buffer, make_summary

PERIODS = {"u16": 65_536, "bcd16": 10_000, "bcd32": 10**8}
SLOTS = 8


class Counted:
    """A module that counts with few digits: what its status block shows, and what it made in truth."""

    def __init__(self, kind: str, slots: int, *, tells: bool) -> None:
        self.numbers, self.period, self.slots, self.tells = CycleNumbers.of(kind), PERIODS[kind], slots, tells
        self.life = 1
        self.made = 0

    def start(self) -> None:
        self.life, self.made = self.life + 1, 0

    def status(self) -> StatusBlock:
        ring = [0] * self.slots
        for cycle in range(max(1, self.made - self.slots + 1), self.made + 1):
            ring[cycle % self.slots] = cycle % self.period
        shown = self.made % self.period
        session = self.life if self.tells else 0
        return StatusBlock("ready", session, shown, tuple(ring) if self.slots > 1 else (shown,), None, None)


def followed(module: Counted, last: CycleId | None) -> tuple[CycleId | None, list[int], int, int]:
    """Take all that is new; the last cycle, the numbers, and how many were told missed and started anew."""
    taken, missed, restarts = [], 0, 0
    while True:
        status = module.numbers.status(module.status(), last)
        want = next_capture(
            last, status.session, status.cycle_counter, status.ring, period=module.numbers.period
        )
        if want is None:
            return last, taken, missed, restarts
        assert module.status().ring[want.slot] == module.numbers.shown(want.cycle_id.cycle)
        last = (module.numbers.of_new_life(want) if want.restarted else want).cycle_id
        taken.append(last.cycle)
        missed += want.missed
        restarts += want.restarted


@given(
    kind=st.sampled_from(list(PERIODS)),
    slots=st.sampled_from([1, SLOTS]),
    before=st.integers(1, 3 * 65_536),
    made=st.lists(st.integers(0, 9_000), min_size=1, max_size=12),
)
def test_cycles_of_one_session_are_numbered_on_whatever_an_outage_hides(
    kind: str, slots: int, before: int, made: list[int]
) -> None:
    """None is made up, none comes twice, each is taken or told, and nothing was started anew."""
    module = Counted(kind, slots, tells=True)
    module.made = before
    last: CycleId | None = CycleId(1, before)
    for burst in made:
        module.made += burst
        last, taken, missed, restarts = followed(module, last)
        assert last == CycleId(1, module.made)
        assert taken == list(range(module.made - min(burst, slots) + 1, module.made + 1))
        assert (missed, restarts) == (burst - len(taken), 0)


@given(
    kind=st.sampled_from(list(PERIODS)),
    slots=st.sampled_from([1, SLOTS]),
    tells=st.booleans(),
    before=st.integers(1, 3 * 65_536),
    lives=st.lists(st.integers(1, 40), min_size=1, max_size=5),
)
def test_a_start_of_the_module_is_told_and_makes_up_no_loss(
    kind: str, slots: int, before: int, lives: list[int], *, tells: bool
) -> None:
    """It begins with 1 again, also where only its counter tells."""
    module = Counted(kind, slots, tells=tells)
    module.made = before
    last: CycleId | None = CycleId(1 if tells else 0, before)
    for made in lives:
        shows_less = made < module.made % module.period and made < module.made
        goes_round = (made - module.made) % module.period <= 8 * made
        assume(tells or (shows_less and not goes_round))  # else no counter can tell
        module.start()
        module.made = made
        last, taken, missed, restarts = followed(module, last)
        assert last is not None
        assert taken == list(range(max(1, made - slots + 1), made + 1))
        assert missed <= made - len(taken)  # fewer where it may have gone on counting instead
        assert restarts == 1


@given(
    kind=st.sampled_from(list(PERIODS)),
    slots=st.sampled_from([1, SLOTS]),
    before=st.integers(1, 3 * 65_536),
    made=st.lists(st.integers(1, 8), min_size=1, max_size=40),
)
def test_a_counter_that_goes_round_is_no_start_also_where_there_is_no_session(
    kind: str, slots: int, before: int, made: list[int]
) -> None:
    module = Counted(kind, slots, tells=False)
    module.made = before
    last: CycleId | None = CycleId(0, before)
    for burst in made:
        module.made += burst
        last, taken, missed, restarts = followed(module, last)
        assert last == CycleId(0, module.made)
        assert (len(taken) + missed, restarts) == (burst, 0)


@given(
    kind=st.sampled_from(["u16", "bcd16"]),
    last=st.integers(0, 3 * 65_536),
    counter=st.integers(0, 9_999),
    ring=st.lists(st.integers(0, 9_999), min_size=1, max_size=SLOTS),
    tells=st.booleans(),
)
def test_whatever_a_status_block_shows_an_empty_slot_is_no_cycle(
    kind: str, last: int, counter: int, ring: list[int], *, tells: bool
) -> None:
    """And each number is one that its slot can mean."""
    numbers, session = CycleNumbers.of(kind), int(tells)
    status = numbers.status(
        StatusBlock("", session, counter, tuple(ring), None, None), CycleId(session, last)
    )
    assert numbers.shown(status.cycle_counter) == counter
    for number, shown in zip(status.ring, ring, strict=True):
        assert numbers.shown(number) == shown
        assert number >= 0
    for slot, number in enumerate(status.ring):
        if number and not ring[slot]:
            age, last_slot = status.cycle_counter - number, len(ring) - 1
            assert 0 <= age <= last_slot
            assert age == last_slot or ring[slot - 1] == PERIODS[kind] - 1
            assert age == 0 or ring[slot + 1 if slot < last_slot else 0] == 1


@pytest.mark.parametrize(
    ("kind", "before", "numbers"),
    [("u16", 65_536, [65_534, 65_535, 65_536, 65_537]), ("bcd16", 20_001, [19_999, 20_000, 20_001, 20_002])],
)
def test_the_cycle_for_which_a_counter_shows_0_is_one(kind: str, before: int, numbers: list[int]) -> None:
    module = Counted(kind, SLOTS, tells=False)
    module.made = before + 1
    assert followed(module, CycleId(0, numbers[0] - 1))[1] == numbers


@pytest.mark.parametrize(("shown", "number"), [(0, 65_536), (1, 65_537), (7, 65_543), (8, 65_544)])
@pytest.mark.parametrize("held", [3, SLOTS])
def test_the_cycle_for_which_a_counter_shows_0_has_its_neighbours_beside_it(
    shown: int, number: int, held: int
) -> None:
    """Also in a ring that is not full: the module was started not long before."""
    ring = [0] * SLOTS
    for cycle in range(number - held + 1, number + 1):
        ring[cycle % SLOTS] = cycle % 65_536
    status = CycleNumbers.of("u16").status(
        StatusBlock("", 7, shown, tuple(ring), None, None), CycleId(7, number - 1)
    )
    assert status.cycle_counter == number
    assert sorted(cycle for cycle in status.ring if cycle) == list(range(number - held + 1, number + 1))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "before"), [("u16", 40_000), ("u16", 70_000), ("bcd16", 6_000)])
async def test_a_small_controller_that_was_started_anew_has_lost_no_thousands(kind: str, before: int) -> None:
    layout = with_kind(SUMMARY, "cycle_counter", kind)
    device = ScriptedDevice(layout, counter=(before - 1) % PERIODS[kind])
    make_summary(device)
    async with running(layout, device, after=CycleId(0, before - 1)) as (server, module, receptions):
        (received,) = await take(receptions, 1)
        assert received.cycle_id == CycleId(0, before)
        device.start(session=1)
        coming = asyncio.ensure_future(take(receptions, 1))
        for _ in range(2):  # the first could be an old reply
            asked = server.requests
            while server.requests < asked + 20:
                await asyncio.sleep(0)
            assert not coming.done()
            make_summary(device)
        (received,) = await coming
        assert (received.cycle_id, received.restarted, received.missed) == (CycleId(0, 2), True, 1)
        assert (module.status.restarts, module.status.missed) == (1, 1)


def peak(device: ScriptedDevice, peak_n: float) -> None:
    """Make a cycle that no figure of those before is like."""
    device.complete({}, velocity=0.05, peak_force=peak_n, sliding_distance=3e-3, batch_id="B-17")


async def cancelled(task: asyncio.Future[object]) -> None:
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task


async def polled(server: ModbusServer, requests: int = 20) -> None:
    asked = server.requests
    while server.requests < asked + requests:
        await asyncio.sleep(0)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "made"), [("u16", 20), ("u16", 3), ("bcd16", 20), ("bcd16", 60)])
async def test_a_start_soon_after_the_counter_went_round_begins_with_1(kind: str, made: int) -> None:
    """No cycle is made up of an empty buffer, and none of the new life has the number of one before."""
    layout, period = with_kind(SUMMARY, "cycle_counter", kind), PERIODS[kind]
    device = ScriptedDevice(layout, counter=period - 1)
    async with running(layout, device, after=CycleId(0, period - 1)) as (server, module, receptions):
        for cycle in range(period, period + made):
            peak(device, 100.0 + 0.1 * (cycle - period))
            assert [each.cycle_id for each in await take(receptions, 1)] == [CycleId(0, cycle)]
        last = device.image.copy()
        device.start(session=1)
        coming = asyncio.ensure_future(take(receptions, 1))
        await polled(server)
        assert not coming.done()
        for cycle in range(1, made + 5):
            peak(device, 200.0 + 0.1 * cycle)
            (received,) = await coming
            assert (received.cycle_id, received.missed) == (CycleId(0, cycle), 0)
            assert (received.restarted, received.faults) == (cycle == 1, ())
            assert received.capture.cycle == cycle
            assert module.status_block is not None
            assert module.status_block.cycle_counter == cycle
            coming = asyncio.ensure_future(take(receptions, 1))
            if cycle == 1:  # what a gateway shows once more of the life before is not taken again
                now, device.image[:] = device.image.copy(), last
                await polled(server)
                device.image[:] = now
                await polled(server)
                assert not coming.done()
        await cancelled(coming)
        assert (module.status.restarts, module.status.missed, module.status.unreadable) == (1, 0, 0)


@pytest.mark.parametrize("before", [65_530, 65_535, 65_536, 65_551])
@pytest.mark.parametrize("smallest", [True, False])
async def test_a_counter_of_0_without_a_tap_is_no_cycle(before: int, *, smallest: bool) -> None:
    """Of a module that was started anew; whether it has gone round instead, its buffer tells."""
    layout = with_kind(SUMMARY, "cycle_counter", "u16")
    if smallest:
        registers = {name: each for name, each in layout.registers.items() if name != "sliding_distance"}
        layout = replace(layout, registers=registers)
    device = ScriptedDevice(layout, counter=(before - 1) % 65_536)
    async with running(layout, device, after=CycleId(0, before - 1)) as (server, module, receptions):
        figures = {"velocity": 0.05, "peak_force": 130.0}
        device.complete({}, **figures)
        assert [each.cycle_id.cycle for each in await take(receptions, 1)] == [before]
        device.start(session=1)
        device.put("velocity", 0.05)  # commanded, before any tap
        coming = asyncio.ensure_future(take(receptions, 1))
        await polled(server)
        assert not coming.done()
        await cancelled(coming)
        assert (module.status.received, module.status.connected) == (1, True)


@pytest.mark.slow
async def test_a_counter_of_0_with_a_buffer_that_is_not_ready_is_no_cycle() -> None:
    """However long that lasts; the first tap comes when it is made."""
    layout = with_kind(with_kind(ONE_BUFFER, "cycle_counter", "u16"), "window_cycle", "u16")
    layout = replace(layout, registers={n: each for n, each in layout.registers.items() if n != "session"})
    device = ScriptedDevice(layout, counter=65_534)
    make_buffer(device)
    async with running(layout, device, after=CycleId(0, 65_534)) as (server, module, receptions):
        assert [each.cycle_id.cycle for each in await take(receptions, 1)] == [65_535]
        device.start(session=1)
        coming = asyncio.ensure_future(take(receptions, 1))
        await polled(server, 200)
        assert not coming.done()
        make_buffer(device)
        (received,) = await coming
        assert (received.cycle_id.cycle % 65_536, received.faults) == (1, ())
        assert module.status.unreadable == 0


async def test_a_ring_that_was_emptied_soon_after_the_counter_went_round_holds_no_cycle_0() -> None:
    """Also where slot 0 lies beside the first cycle: a ring of four with three of them."""
    module = Counted("u16", 4, tells=False)
    for before in (65_541, 65_551, 65_700):
        for made in range(5):
            module.made = before
            module.start()
            module.made = made
            last, taken, missed, restarts = followed(module, CycleId(0, before))
            assert taken == list(range(1, made + 1))
            assert (missed, restarts) == (0, int(made > 0))
            assert last == CycleId(0, made or before)


async def test_thousands_of_cycles_in_an_outage_are_no_start_where_the_session_is_the_same() -> None:
    layout = with_kind(with_kind(ONE_BUFFER, "cycle_counter", "bcd16"), "window_cycle", "bcd16")
    device = ScriptedDevice(layout, session=7, counter=6_000)
    async with running(layout, device, after=CycleId(7, 5_999)) as (server, module, receptions):
        device.put("cycle_counter", 5_999)
        make_buffer(device)
        await take(receptions, 1)
        await server.close()
        device.put("cycle_counter", (6_000 + 5_499) % 10_000)
        make_buffer(device)
        await server.start()
        (received,) = await take(receptions, 1)
        assert (received.cycle_id, received.restarted) == (CycleId(7, 11_500), False)
        assert (received.missed, module.status.restarts) == (5_499, 0)


def short_ring(fpga: RegisterMap) -> RegisterMap:
    """A ring of eight slots, counted in 16 bits, of a module that does not tell its starts."""
    layout = fpga
    for name in ("cycle_counter", "window_cycle"):
        layout = with_kind(layout, name, "u16")
    layout = with_kind(layout, "ring_cycle", "u16", count=SLOTS)
    without = ("session", "window_session", "acknowledge_session", "batch_sequence")
    return replace(layout, registers={n: r for n, r in layout.registers.items() if n not in without})


@pytest.mark.parametrize(
    ("before", "announced", "from_cycle"),
    [(70_000, 4_480, 70_016), (65_530, 10, 65_546), (70_000, 4_460, 69_996)],
)
async def test_a_batch_is_announced_from_a_cycle_of_the_module_s_own_counter_on(
    fpga: RegisterMap, before: int, announced: int, from_cycle: int
) -> None:
    layout = with_kind(
        with_kind(with_kind(fpga, "cycle_counter", "u16"), "window_cycle", "u16"), "ring_cycle", "u16"
    )
    device = ScriptedDevice(layout, session=7, counter=before % 65_536)
    device.put("batch_from_cycle", announced)
    device.put("batch_announced", "B-18")
    device.put("batch_sequence", 2)
    async with running(layout, device, after=CycleId(7, before)) as (_, module, receptions):
        naming, expected = BatchNaming(None, "B-17", 1), []
        for _ in range(20):
            make(device, batch_id="B-17")
            (received,) = await take(receptions, 1)
            assert module.status_block is not None
            batch = assign_batch(naming, received.capture, module.status_block.batch)
            naming = batch.naming
            expected += [received.cycle_id.cycle] if batch.expected else []
        assert expected == [max(from_cycle, before + 1)]


async def test_an_empty_slot_of_a_ring_is_no_cycle_after_a_start_that_only_the_counter_tells(
    fpga: RegisterMap,
) -> None:
    layout = short_ring(fpga)
    device = ScriptedDevice(layout, counter=69_998 % 65_536)
    clock_ns = HEADER["cycle_time"]

    def make_later(cycles: int) -> None:
        nonlocal clock_ns
        for _ in range(cycles):
            clock_ns += 10**9
            make(device, cycle_time=clock_ns)

    make_later(2)
    async with running(layout, device, after=(CycleId(0, 69_998), clock_ns - 10**9)) as (
        _,
        module,
        receptions,
    ):
        assert [each.cycle_id.cycle for each in await take(receptions, 2)] == [69_999, 70_000]
        device.start(session=1)
        make_later(3)
        received = await take(receptions, 3)
        assert [each.cycle_id for each in received] == [CycleId(0, cycle) for cycle in (1, 2, 3)]
        assert [(each.restarted, each.missed) for each in received] == [(True, 0), (False, 0), (False, 0)]
        assert all(each.capture.force is not None for each in received)
        assert (module.status.restarts, module.status.missed, module.status.unreadable) == (1, 0, 0)
