"""What a module is told of cycles that are stored: of its present life only, and at no cycle's expense."""

import asyncio

import pytest

from impactcell.fieldbus.registers import RegisterMap, Words
from impactcell.records import CycleId
from simulator.modbus_server import ModbusServer
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import assert_whole, make, running, take
from tests.unit.fieldbus.test_no_decimals import with_kind
from tests.unit.fieldbus.test_poorer_modules import ONE_BUFFER, make_buffer, samples_of

POLLED_S = 2.0
"""Many polls, on a clock that is turned on."""


def make_of(device: ScriptedDevice, life: int) -> None:
    """Make a cycle that is not like the one with its number in another life."""
    samples = samples_of(int(device.get("cycle_counter")) + 100 * life)
    device.complete(samples, velocity=0.05, peak_force=120.0 + life, sliding_distance=4e-3, sample_rate=5e4)


def without(layout: RegisterMap, *names: str) -> RegisterMap:
    registers = {name: register for name, register in layout.registers.items() if name not in names}
    return RegisterMap(layout.name, registers, layout.constants, layout.functions, gaps=layout.gaps)


@pytest.mark.parametrize("dropped", [True, False])
@pytest.mark.parametrize("counter", ["u32", "u16"])
@pytest.mark.parametrize("tells", [True, False], ids=["with a session", "without"])
async def test_a_module_that_was_started_anew_is_not_told_of_cycles_of_its_life_before(
    counter: str, *, tells: bool, dropped: bool
) -> None:
    """Without `acknowledge_session` it would take them for its own, and a ring would give them up unread."""
    layout = with_kind(ONE_BUFFER, "cycle_counter", counter)
    layout = layout if tells else without(layout, "session")
    device = ScriptedDevice(layout, session=7)
    async with running(layout, device) as (server, module, receptions):
        for _ in range(5):
            make_of(device, 7)
            (received,) = await take(receptions, 1)
            await module.acknowledge(received.cycle_id)
        assert [cycle for _, cycle in device.acknowledged] == [1, 2, 3, 4, 5]
        device.acknowledged.clear()
        device.start(session=8)
        if dropped:
            server.drop_clients()
        coming = asyncio.ensure_future(take(receptions, 1))
        await asyncio.sleep(POLLED_S)
        assert device.acknowledged == []
        while not coming.done():  # without a session, and a clock, it has to count on before that is believed
            make_of(device, 8)
            await asyncio.sleep(POLLED_S)
        (received,) = await coming
        assert received.restarted
        assert device.acknowledged == []
        await module.acknowledge(received.cycle_id)
        assert [cycle for _, cycle in device.acknowledged] == [received.cycle_id.cycle]


async def test_an_acknowledgement_that_comes_after_a_start_of_the_module_was_seen_is_kept_back() -> None:
    """Storing takes its time."""
    device = ScriptedDevice(ONE_BUFFER, session=7)
    make_buffer(device)
    async with running(ONE_BUFFER, device) as (_, module, receptions):
        (before,) = await take(receptions, 1)
        device.start(session=8)
        make_buffer(device)
        (received,) = await take(receptions, 1)
        assert received.restarted
        await module.acknowledge(before.cycle_id)
        assert device.acknowledged == []


async def test_a_counter_that_was_set_back_in_the_same_session_is_not_told_of_what_is_ahead_of_it(
    fpga: RegisterMap,
) -> None:
    """`acknowledge_session` does not help where the module shows the same session in each of its lives."""
    device = ScriptedDevice(fpga, session=3)
    make(device, 5)
    async with running(fpga, device) as (server, module, receptions):
        received = await take(receptions, 5)
        await module.acknowledge(received[-1].cycle_id)
        assert device.acknowledged == [(3, 5)]
        device.start(session=3)
        server.drop_clients()
        make_of(device, 4)
        coming = asyncio.ensure_future(take(receptions, 1))
        await asyncio.sleep(POLLED_S)
        assert device.acknowledged == [(3, 5)]
        coming.cancel()
        await asyncio.gather(coming, return_exceptions=True)


class Refusing(ScriptedDevice):
    """Refuses the acknowledgement, or closes the connection for it, as long as it is told to."""

    refuses: type[Exception] | None = LookupError
    refused = 0
    server: ModbusServer

    def write(self, address: int, words: Words, table: str = "holding") -> None:
        if self.refuses is not None and address != self.registers["slot_select"].address:
            self.refused += 1
            if self.refuses is ConnectionError:
                self.server.drop_clients()
            raise self.refuses if self.refuses is not ConnectionError else LookupError
        super().write(address, words, table)


@pytest.mark.slow
@pytest.mark.parametrize(
    "refuses", [NotImplementedError, LookupError, ValueError, BlockingIOError, ConnectionError]
)
async def test_a_module_that_refuses_the_acknowledgement_is_read_all_the_same(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture, refuses: type[Exception]
) -> None:
    """Once it takes it, it is told."""
    device = Refusing(fpga, session=3)
    device.refuses = refuses
    async with running(fpga, device, timeout_s=0.1) as (server, module, receptions):
        device.server = server
        for cycle in range(1, 41):
            make(device)
            (received,) = await take(receptions, 1)
            assert_whole(received)
            assert (received.cycle_id, received.missed) == (CycleId(3, cycle), 0)
            await module.acknowledge(received.cycle_id)
            await asyncio.sleep(0.5)
        busy = 20 if refuses is BlockingIOError else 1  # it is asked again until the timeout
        assert device.refused <= 7 * busy, "farther and farther apart"
        (told,) = [line for line in caplog.messages if "acknowledge_cycle" in line]
        assert "register acknowledge_cycle (132) cannot be written: " in told
        assert "if there is no such register, leave it out of map fpga-v1" in told
        device.refuses = None
        coming = asyncio.ensure_future(take(receptions, 1))
        await asyncio.sleep(60.0)
        assert device.acknowledged == [(3, 40)]
        make(device)
        await coming
        await module.acknowledge(CycleId(3, 41))
        assert device.acknowledged == [(3, 40), (3, 41)]


async def test_one_refusal_is_made_up_for_at_once_and_no_warning(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    device = Refusing(fpga, session=3)
    make(device)
    async with running(fpga, device) as (_, module, receptions):
        (received,) = await take(receptions, 1)
        await module.acknowledge(received.cycle_id)
        device.refuses = None
        make(device)
        await take(receptions, 1)
        assert device.acknowledged == [(3, 1)]
        assert not [record for record in caplog.records if record.levelname == "WARNING"]
