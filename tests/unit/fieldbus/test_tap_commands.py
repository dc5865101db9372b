"""Positioning commands: made once, refused in words, and safe across a lost connection."""

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from impactcell.errors import PositioningError
from impactcell.fieldbus.acquisition import ModuleAcquisition
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import RegisterMap, Words
from impactcell.fieldbus.tap_commands import ObjectionError, TapCommand, TapCommander
from impactcell.fieldbus.transports import transport_for
from simulator.faults import Fault, FaultKind
from simulator.modbus_server import ModbusServer
from simulator.scripted import ScriptedDevice

COMMAND = TapCommand(velocity_m_s=0.05, stroke_m=0.0012, direction=-1)


class PositioningDevice(ScriptedDevice):
    """Acts on a change of `command_sequence`, as the map says."""

    def __init__(self, registers: RegisterMap) -> None:
        super().__init__(registers, session=5)
        self.put("positioning_state", 1)
        self.taps: list[tuple[float, float, int]] = []
        self.result = 2
        self.on_command: Callable[[], None] = lambda: None

    def write(self, address: int, words: Words) -> None:
        before = self.get("command_sequence")
        super().write(address, words)
        if self.get("command_sequence") not in (0, before):
            self.taps.append(
                (self.get("command_velocity"), self.get("command_stroke"), self.get("command_direction"))
            )
            self.put("command_accepted", self.get("command_sequence"))
            self.put("command_result", self.result)
            if self.result == 2:
                cycle = self.complete({"force": np.zeros(3), "position": np.zeros(3)}, velocity=0.05)
                self.put("command_cycle", cycle)
            self.on_command()
        if self.get("command_abort"):
            self.put("command_result", 5)
            self.put("command_abort", 0)


@asynccontextmanager
async def ready(
    fpga: RegisterMap, device: ScriptedDevice, patience_s: float = 20.0
) -> AsyncIterator[tuple[ModbusServer, ModuleAcquisition, TapCommander]]:
    """A module whose captures are being taken, as the service does."""
    async with (
        ModbusServer(device) as server,
        ModuleAcquisition(
            "cell-1", ModbusClient(transport_for(ModuleLink(port=server.port, timeout_s=5.0))), fpga
        ) as module,
    ):

        async def follow() -> None:
            async with contextlib.aclosing(module.captures()) as receptions:
                async for _ in receptions:
                    pass

        following = asyncio.create_task(follow())
        await module.wait_connected()
        try:
            yield server, module, TapCommander(module, patience_s)
        finally:
            following.cancel()
            await asyncio.gather(following, return_exceptions=True)


async def test_a_tap_is_made_once_and_tells_its_cycle(fpga: RegisterMap) -> None:
    device = PositioningDevice(fpga)
    async with ready(fpga, device) as (_, _, positioner):
        assert (await positioner.tap(COMMAND)).cycle == 1
        assert (await positioner.tap(COMMAND)).cycle == 2
    assert len(device.taps) == 2
    assert device.taps[0] == pytest.approx((0.05, 0.0012, -1), rel=1e-6)


async def test_a_tap_that_is_aborted_before_its_command_is_never_made(fpga: RegisterMap) -> None:
    """Its parameters are in the module already, or the link is down meanwhile: nothing may come after it."""
    device, wanted = PositioningDevice(fpga), [True]
    take, velocity = device.write, fpga["command_velocity"].address

    def write(address: int, words: Words) -> None:
        take(address, words)
        if address <= velocity < address + len(words):
            wanted[0] = False

    device.write = write  # type: ignore[method-assign]
    async with ready(fpga, device) as (_, _, positioner):
        with pytest.raises(ObjectionError, match="aborted; nothing has been commanded"):
            await positioner.tap(COMMAND, lambda _: "" if wanted[0] else "aborted")
        assert device.taps == []
        assert (await positioner.tap(COMMAND)).cycle == 1


async def test_an_objection_sees_what_the_module_shows_after_the_parameters(fpga: RegisterMap) -> None:
    """The part was moved while they were being written; what is struck is judged by what is shown then."""
    device = PositioningDevice(fpga)
    velocity = fpga["command_velocity"].address
    device.on_read.append((velocity, lambda: device.put("part_position", 0.004)))
    async with ready(fpga, device) as (_, _, positioner):
        with pytest.raises(ObjectionError, match="moved; nothing has been commanded") as objected:
            await positioner.tap(COMMAND, lambda report: "moved" if report.position_m > 0.001 else "")
        assert objected.value.report.position_m == pytest.approx(0.004)
        assert device.taps == []
        device.on_command = lambda: device.put("part_position", 0.009)
        done = await positioner.tap(COMMAND)
    assert (done.accepted_command, done.cycle) == (1, 1)
    assert done.position_m == pytest.approx(0.009)


async def test_a_report_at_rest_is_one_of_a_module_that_is_ready(fpga: RegisterMap) -> None:
    device = PositioningDevice(fpga)
    device.put("positioning_state", 2)
    async with ready(fpga, device) as (_, module, positioner):
        reading = asyncio.create_task(positioner.read_report_at_rest())
        while module.status_block is None or module.status_block.positioning is None:
            await module.read_status()
        assert not reading.done()
        device.put("part_position", 0.004)
        device.put("positioning_state", 1)
        assert (await reading).position_m == pytest.approx(0.004)
    device.put("positioning_state", 2)
    async with ready(fpga, device, patience_s=0.2) as (_, _, positioner):
        with pytest.raises(PositioningError, match="has not been ready for"):
            await positioner.read_report_at_rest()


async def test_the_command_after_the_last_number_is_the_first_and_never_none(fpga: RegisterMap) -> None:
    """0 stands for no command: a module would never act on it."""
    device = PositioningDevice(fpga)
    device.put("command_accepted", 2**32 - 2)
    numbers = []
    device.on_command = lambda: numbers.append(int(device.get("command_accepted")))
    async with ready(fpga, device) as (_, _, positioner):
        for cycle in (1, 2):
            assert (await positioner.tap(COMMAND)).cycle == cycle
    assert numbers == [2**32 - 1, 1]


@pytest.mark.parametrize(
    ("written", "shown", "last"),
    [
        ("u16", "u16", 65_535),
        ("bcd16", "bcd16", 9999),
        ("i16", "i16", 32_767),
        ("u32", "u16", 65_535),
        ("u32", "bcd16", 9999),
        ("u64", "u64", 2**32 - 1),
    ],
)
async def test_numbers_of_commands_begin_anew_where_the_narrower_register_ends(
    fpga: RegisterMap, written: str, shown: str, last: int
) -> None:
    """Each task ended with a value outside of the register, or waited for a number that cannot be shown."""
    kinds = {"command_sequence": written, "command_accepted": shown}
    moved = {name: replace(fpga[name], kind=kind, address=60_000) for name, kind in kinds.items()}
    moved["command_accepted"] = replace(moved["command_accepted"], address=60_010)
    narrow = replace(fpga, registers={**fpga.registers, **moved})
    device, numbers = PositioningDevice(narrow), []
    device.put("command_accepted", last - 1)
    device.on_command = lambda: numbers.append(int(device.get("command_accepted")))
    async with ready(narrow, device) as (_, _, positioner):
        for cycle in (1, 2, 3):
            assert (await positioner.tap(COMMAND)).cycle == cycle
    assert numbers == [last, 1, 2]


@pytest.mark.parametrize(
    ("accepted", "written", "next_one"),
    [
        (4, 5, 6),
        (4, 4, 5),
        (4, 0, 5),
        (0, 1, 2),
        (0, 7, 8),
        (8, 7, 9),
        (9999, 1, 2),
        (5, 9999, 6),
        (1, 9999, 2),
        (9, 3, 10),
        (9998, 1, 2),
    ],
)
async def test_a_command_that_was_never_taken_does_not_keep_the_next_from_being_a_change(
    fpga: RegisterMap, accepted: int, written: int, next_one: int
) -> None:
    """A module acts on a change of the number: one that stands there already would never be carried out."""
    kinds = {"command_sequence": "bcd16", "command_accepted": "bcd16"}
    narrow = replace(
        fpga, registers={**fpga.registers, **{n: replace(fpga[n], kind=kind) for n, kind in kinds.items()}}
    )
    device = PositioningDevice(narrow)
    device.put("command_accepted", accepted)
    device.put("command_sequence", written)
    async with ready(narrow, device) as (_, _, positioner):
        assert (await positioner.tap(COMMAND)).cycle == 1
    assert (device.get("command_accepted"), len(device.taps)) == (next_one, 1)


async def test_a_command_whose_register_shows_no_number_is_counted_on_from_what_was_taken(
    fpga: RegisterMap,
) -> None:
    narrow = replace(
        fpga,
        registers={**fpga.registers, "command_sequence": replace(fpga["command_sequence"], kind="bcd16")},
    )
    device = PositioningDevice(narrow)
    number = narrow["command_sequence"]
    device.image[number.address : number.end] = 0xFFFF
    device.put("command_accepted", 4)
    got = device.get
    device.get = lambda name: got(name) if device.image[number.address] != 0xFFFF else 0  # type: ignore[method-assign]
    async with ready(narrow, device) as (_, _, positioner):
        assert (await positioner.tap(COMMAND)).cycle == 1
    assert (got("command_accepted"), len(device.taps)) == (5, 1)


async def test_a_module_that_takes_no_command_is_told_and_the_next_one_is_another(fpga: RegisterMap) -> None:
    """It did not look at the first, for it was busy; nothing was struck, and nothing is struck twice."""
    device = PositioningDevice(fpga)
    take, deaf = device.write, ScriptedDevice.write
    device.write = lambda address, words: deaf(device, address, words)  # type: ignore[method-assign]
    async with ready(fpga, device, patience_s=2.0) as (_, _, positioner):
        with pytest.raises(PositioningError, match=r"has not taken command 1, register .* \(104\) shows 0$"):
            await positioner.tap(COMMAND)
    device.write = take  # type: ignore[method-assign]
    async with ready(fpga, device) as (_, _, positioner):
        assert (await positioner.tap(COMMAND)).cycle == 1
    assert (device.get("command_accepted"), len(device.taps)) == (2, 1)


async def test_a_command_that_is_taken_late_is_not_followed_by_another_tap(fpga: RegisterMap) -> None:
    """The module looks at the one that was given up while the parameters of the next are written."""
    device = PositioningDevice(fpga)
    device.put("command_sequence", 1)
    take, velocity = device.write, fpga["command_velocity"].address

    def write(address: int, words: Words) -> None:
        take(address, words)
        if address <= velocity < address + len(words):
            device.put("command_accepted", 1)

    device.write = write  # type: ignore[method-assign]
    async with ready(fpga, device) as (_, _, positioner):
        with pytest.raises(PositioningError, match="from 0 to 1 before command 2 was written"):
            await positioner.tap(COMMAND)
    assert (device.get("command_sequence"), device.taps) == (1, [])


async def test_an_answer_lost_with_the_connection_does_not_repeat_the_tap(fpga: RegisterMap) -> None:
    device = PositioningDevice(fpga)
    async with ready(fpga, device) as (server, _, positioner):
        device.on_command = server.drop_clients
        assert (await positioner.tap(COMMAND)).cycle == 1
    assert len(device.taps) == 1


@pytest.mark.parametrize("refused", [False, True])
async def test_a_request_to_strike_that_was_not_answered_may_have_struck(
    fpga: RegisterMap, *, refused: bool
) -> None:
    """It is on its way still, or was carried out and is not shown yet: nobody can say that it was not."""
    device, number, requests = PositioningDevice(fpga), fpga["command_sequence"], []
    take = device.write
    async with ready(fpga, device) as (server, _, positioner):

        def lose(address: int, words: Words) -> None:
            if not address <= number.address < address + len(words):
                take(address, words)
                return
            requests.append(address)
            if len(requests) > 1:
                raise LookupError
            server.drop_clients()

        device.write = lose  # type: ignore[method-assign]
        with pytest.raises(PositioningError, match="; the part may have been struck") as told:
            await positioner.tap(COMMAND, lambda _: "aborted" if requests and not refused else "")
    assert isinstance(told.value, ObjectionError) is not refused
    assert len(requests) == 1 + refused
    assert device.taps == []


@pytest.mark.parametrize("code", [4, 6, 11])
async def test_a_module_in_trouble_for_a_moment_makes_the_tap_once(fpga: RegisterMap, code: int) -> None:
    """The reply says exception; whether the request was carried out, nobody knows."""
    device = PositioningDevice(fpga)
    async with ready(fpga, device) as (server, _, positioner):
        for _ in range(3):
            server.faults.inject(Fault(FaultKind.EXCEPTION, 0.5, remaining=4, code=code))
        assert (await positioner.tap(COMMAND)).cycle == 1
        assert (await positioner.read_report_at_rest()).accepted_command == 1
    assert len(device.taps) == 1


@pytest.mark.parametrize("code", [1, 2, 3])
async def test_a_request_that_will_never_do_is_not_tried_again(fpga: RegisterMap, code: int) -> None:
    device = PositioningDevice(fpga)
    written = fpga["command_stroke"].address

    def refuse(address: int, words: Words) -> None:
        if address <= written < address + len(words):
            raise {1: NotImplementedError, 2: LookupError, 3: ValueError}[code]

    device.write = refuse  # type: ignore[method-assign]
    async with ready(fpga, device) as (_, _, positioner):
        with pytest.raises(PositioningError, match="nothing has been commanded"):
            await positioner.tap(COMMAND)
    assert device.taps == []


async def test_a_module_that_cannot_be_read_is_given_up(fpga: RegisterMap) -> None:
    device = PositioningDevice(fpga)
    async with ready(fpga, device, patience_s=0.5) as (server, _, positioner):
        server.faults.inject(Fault(FaultKind.EXCEPTION, code=4))
        with pytest.raises(PositioningError, match="has not been read for"):
            await positioner.read_report_at_rest()


@pytest.mark.parametrize(
    ("result", "told"),
    [(3, "refused value"), (4, "refused state"), (5, "aborted"), (6, "fault"), (77, r"unknown \(77\)")],
)
async def test_a_refusal_is_told_in_words(fpga: RegisterMap, result: int, told: str) -> None:
    device = PositioningDevice(fpga)
    device.result = result
    async with ready(fpga, device) as (_, _, positioner):
        with pytest.raises(PositioningError, match=f"cell-1: tap 1: {told}"):
            await positioner.tap(COMMAND)


async def test_a_module_that_is_not_ready_gets_no_command(fpga: RegisterMap) -> None:
    device = PositioningDevice(fpga)
    device.put("positioning_state", 3)
    async with ready(fpga, device) as (_, _, positioner):
        with pytest.raises(PositioningError, match="module takes no command, it is fault"):
            await positioner.tap(COMMAND)
    assert device.taps == []


async def test_what_does_not_read_back_is_not_commanded(fpga: RegisterMap) -> None:
    device = PositioningDevice(fpga)
    stroke = fpga["command_stroke"]
    device.on_read.append((stroke.address, lambda: device.put("command_stroke", 0.9)))
    async with ready(fpga, device) as (_, _, positioner):
        with pytest.raises(
            PositioningError, match=r"register command_stroke \(142\) does not show what was written"
        ):
            await positioner.tap(COMMAND)
    assert device.taps == []


async def test_a_restart_in_the_middle_ends_the_command(fpga: RegisterMap) -> None:
    device = PositioningDevice(fpga)
    device.result = 1

    def restart() -> None:
        device.start(session=6)
        device.put("command_accepted", 0)

    device.on_command = restart
    async with ready(fpga, device) as (_, _, positioner):
        with pytest.raises(PositioningError, match="started anew during tap 1"):
            await positioner.tap(COMMAND)


async def test_an_abort_ends_what_is_being_executed(fpga: RegisterMap) -> None:
    device = PositioningDevice(fpga)
    device.result = 1
    commanded = asyncio.Event()
    device.on_command = commanded.set
    async with ready(fpga, device) as (_, _, positioner):
        tap = asyncio.create_task(positioner.tap(COMMAND))
        await commanded.wait()
        await positioner.abort()
        with pytest.raises(PositioningError, match="aborted"):
            await tap


async def test_a_tap_without_an_end_is_given_up(fpga: RegisterMap) -> None:
    device = PositioningDevice(fpga)
    device.result = 1
    async with ready(fpga, device, patience_s=1.0) as (_, _, positioner):
        with pytest.raises(PositioningError, match="may have been struck"):
            await positioner.tap(COMMAND)


@pytest.mark.parametrize(
    "command",
    [
        TapCommand(0.0, 0.001, 1),
        TapCommand(math.nan, 0.001, 1),
        TapCommand(0.05, math.inf, 1),
        TapCommand(0.05, -0.001, 1),
        TapCommand(0.05, 0.001, 0),
    ],
)
async def test_impossible_taps_are_refused_before_anything_is_written(
    fpga: RegisterMap, command: TapCommand
) -> None:
    device = PositioningDevice(fpga)
    async with ready(fpga, device) as (_, _, positioner):
        with pytest.raises(PositioningError, match="cell-1: tap"):
            await positioner.tap(command)
    assert device.taps == []


def coarse(fpga: RegisterMap, **changed: Any) -> RegisterMap:
    """Commands through whole numbers, as a PLC may have them: 1 mm/s and 0.1 mm."""
    velocity = replace(fpga["command_velocity"], kind="u16", unit="mm/s")
    stroke = replace(fpga["command_stroke"], kind="u16", scale=0.1)
    moved = {"command_velocity": replace(velocity, **changed), "command_stroke": stroke}
    return replace(fpga, registers={**fpga.registers, **moved})


@pytest.mark.parametrize(
    ("command", "told"),
    [
        (
            TapCommand(0.0996, 0.0014, 1),
            r"command_velocity \(140\) cannot express 0\.0996, it would show 0\.1;",
        ),
        (TapCommand(0.0124, 0.0014, 1), r"cannot express 0\.0124, it would show 0\.012;"),
        (TapCommand(0.0004, 0.0014, 1), r"cannot express 0\.0004, it would show 0;"),
        (TapCommand(70.0, 0.0014, 1), r"cannot express 70, it would show 65\.535;"),
        (
            TapCommand(0.1, 0.00146, 1),
            r"command_stroke \(142\) cannot express 0\.00146, it would show 0\.0015;",
        ),
        (TapCommand(0.1, 0.00004, 1), r"command_stroke \(142\) cannot express 4e-05, it would show 0;"),
    ],
)
async def test_a_tap_that_its_registers_round_or_clip_is_not_commanded(
    fpga: RegisterMap, command: TapCommand, told: str
) -> None:
    """It was struck faster and farther than the limits of the cell allow, and the read-back agreed."""
    registers = coarse(fpga)
    device = PositioningDevice(registers)
    async with ready(registers, device) as (_, _, positioner):
        with pytest.raises(PositioningError, match=told + " nothing has been commanded"):
            await positioner.tap(command)
        assert device.get("command_velocity") == 0.0
        assert (await positioner.tap(TapCommand(0.1, 0.0015, 1))).cycle == 1
    assert device.taps == [(pytest.approx(0.1), pytest.approx(0.0015), 1)]


async def test_a_tap_beyond_the_saturation_of_its_register_is_not_commanded(fpga: RegisterMap) -> None:
    registers = coarse(fpga, saturation=(0, 90))
    async with ready(registers, PositioningDevice(registers)) as (_, _, positioner):
        with pytest.raises(PositioningError, match=r"cannot express 0\.1, it would show 0\.09"):
            await positioner.tap(TapCommand(0.1, 0.0014, 1))


async def test_a_map_without_positioning_is_said(fpga: RegisterMap) -> None:
    kept = {name: register for name, register in fpga.registers.items() if not name.startswith("command")}
    bare = RegisterMap("bare", kept)
    async with ready(bare, ScriptedDevice(bare)) as (_, _, positioner):
        assert not positioner.available
        with pytest.raises(PositioningError, match="map bare has no positioning registers"):
            await positioner.tap(COMMAND)
