"""Modules with one buffer, one rate, no sequence number or no waveform. Truth: what the device was given."""

import asyncio
import itertools
import math
from copy import deepcopy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from impactcell.errors import MapError, ModbusExceptionError
from impactcell.fieldbus.cycles.cycle_numbers import CycleNumbers
from impactcell.fieldbus.map_promises import not_promised
from impactcell.fieldbus.probe import probe
from impactcell.fieldbus.registers import RegisterMap
from impactcell.german.link_faults import german_link_fault
from impactcell.records import CycleId
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.conftest import MAP
from tests.unit.fieldbus.test_acquisition import running, take


@cache
def shipped(name: str) -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load((MAP.parent / f"{name}.yaml").read_text(encoding="utf-8"))
    return content


def declared(name: str) -> dict[str, Any]:
    """Give a map that may be changed."""
    return deepcopy(shipped(name))


ONE_BUFFER = RegisterMap.from_mapping(declared("one-buffer"))
SUMMARY = RegisterMap.from_mapping(declared("summary"))
SAMPLES = 700


def samples_of(cycle: int) -> dict[str, np.ndarray]:
    draw = np.random.default_rng(cycle)
    return {"force": draw.normal(0.0, 50.0, SAMPLES), "position": draw.normal(0.0, 1e-3, SAMPLES)}


def figures_of(cycle: int) -> dict[str, float]:
    """Figures that tell by themselves which cycle they are from."""
    return {"peak_force": 100.0 + 0.1 * (cycle % 1000), "sliding_distance": 1e-3 + 2e-6 * (cycle % 1000)}


def make_buffer(device: ScriptedDevice, cycles: int = 1) -> None:
    for _ in range(cycles):
        cycle = int(device.get("cycle_counter")) + 1
        header = {"velocity": 0.05, "peak_force": 120.0, "sliding_distance": 4e-3}
        device.complete(samples_of(cycle), sample_rate=5e4, sample_start=2e-5, **header)


def make_summary(device: ScriptedDevice, cycles: int = 1) -> None:
    for _ in range(cycles):
        cycle = (int(device.get("cycle_counter")) + 1) % 65_536
        device.complete({}, velocity=0.05, batch_id="B-17", **figures_of(cycle))


@pytest.mark.parametrize("newer", [1, 4, 100])
async def test_probe_looks_again_where_a_newer_tap_took_the_place_of_the_newest(newer: int) -> None:
    device = ScriptedDevice(ONE_BUFFER, session=9)
    make_buffer(device)

    def tap_meanwhile() -> None:
        make_buffer(device)
        if int(device.get("cycle_counter")) <= newer:
            device.on_read.append(at_header)

    at_header = (ONE_BUFFER["window_cycle"].address, tap_meanwhile)
    device.on_read.append(at_header)
    async with running(ONE_BUFFER, device) as (_, module, _receptions):
        result = await probe(module)
    if newer < 100:
        assert result.capture is not None
        assert result.capture.force is not None
        assert (result.capture.cycle, result.faults) == (result.status.cycle_counter, ()) == (1 + newer, ())
        np.testing.assert_allclose(result.capture.force.values, samples_of(1 + newer)["force"], atol=0.0126)
    else:  # it ends, and says why
        assert result.capture is None
        assert int(device.get("cycle_counter")) < 20
        (fault,) = result.faults
        assert fault == (
            f"cell-1: cycle {result.status.cycle_counter}: the module has put a newer cycle in its place"
        )


@pytest.mark.parametrize("max_registers", [125, 33])
async def test_one_buffer_with_one_rate_arrives_whole(max_registers: int) -> None:
    device = ScriptedDevice(ONE_BUFFER, session=9)
    make_buffer(device)
    async with running(ONE_BUFFER, device, max_registers=max_registers) as (_, module, receptions):
        for cycle in range(1, 4):
            (received,) = await take(receptions, 1)
            capture = received.capture
            assert (received.cycle_id, received.missed, received.faults) == (CycleId(9, cycle), 0, ())
            assert capture.force is not None
            assert capture.position is not None
            truth = samples_of(cycle)
            np.testing.assert_allclose(capture.force.values, truth["force"], atol=0.0126)
            np.testing.assert_allclose(capture.position.values, truth["position"], atol=0.6e-9)
            times = 2e-5 + np.arange(SAMPLES) / 5e4
            np.testing.assert_allclose(capture.force.time_s, times, atol=1e-12)
            np.testing.assert_allclose(capture.position.time_s, times, atol=1e-12)
            assert capture.velocity_m_s == pytest.approx(0.05)
            assert (capture.mass_kg, capture.direction, capture.stroke_m) == (18.9, 1, math.inf)
            assert capture.time_ns > 0  # no clock: when it was read
            await module.acknowledge(received.cycle_id)
            assert device.get("acknowledge_cycle") == cycle
            make_buffer(device)
        assert module.status_block is not None
        assert module.status_block.state == "ready"


async def test_what_one_buffer_has_lost_is_counted() -> None:
    device = ScriptedDevice(ONE_BUFFER)
    make_buffer(device)
    async with running(ONE_BUFFER, device) as (server, module, receptions):
        await take(receptions, 1)
        await server.close()
        make_buffer(device, 5)
        await server.start()
        (received,) = await take(receptions, 1)
        assert (received.cycle_id.cycle, received.missed) == (6, 4)
        assert module.status.missed == 4


@pytest.mark.parametrize("where", ["window_cycle", "force", "position"])
async def test_one_buffer_that_is_overwritten_while_it_is_read_is_never_mixed(where: str) -> None:
    """Nothing but a second reading tells: there is no CRC and no sequence number."""
    device = ScriptedDevice(ONE_BUFFER)
    make_buffer(device)
    address = ONE_BUFFER[where].address + (500 if where != "window_cycle" else 0)
    device.on_read.append((address, lambda: make_buffer(device)))
    async with running(ONE_BUFFER, device) as (_, module, receptions):
        seen = await take(receptions, 1)
        make_buffer(device)
        seen += await take(receptions, 1)
        for received in seen:
            assert received.capture.force is not None
            assert received.capture.position is not None
            truth = samples_of(received.cycle_id.cycle)
            np.testing.assert_allclose(received.capture.force.values, truth["force"], atol=0.0126)
            np.testing.assert_allclose(received.capture.position.values, truth["position"], atol=0.6e-9)
        assert sum(1 + received.missed for received in seen[1:]) + seen[0].cycle_id.cycle == 3
        assert module.status.unreadable == 0


async def test_a_buffer_that_says_it_is_being_filled_is_waited_for() -> None:
    device = ScriptedDevice(ONE_BUFFER)
    make_buffer(device)
    device.put("capture_ready", 0)
    async with running(ONE_BUFFER, device) as (server, module, receptions):
        coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        asked = server.requests
        while server.requests < asked + 12:
            await asyncio.sleep(0)
        assert not coming.done()
        device.put("capture_ready", 1)
        received = await coming
        assert (received.capture.force is not None, received.faults) == (True, ())
        assert module.status.discarded >= 1


async def test_a_summary_arrives_with_what_is_known_of_its_errors() -> None:
    device = ScriptedDevice(SUMMARY)
    make_summary(device)
    async with running(SUMMARY, device) as (_, module, receptions):
        for cycle in range(1, 20):
            (received,) = await take(receptions, 1)
            capture, truth = received.capture, figures_of(cycle)
            assert (received.cycle_id.cycle, received.missed, received.faults) == (cycle, 0, ())
            assert (capture.force, capture.position) == (None, None)
            assert capture.summary is not None
            assert capture.summary.peak_force_n == pytest.approx(truth["peak_force"], abs=0.051)
            assert capture.summary.sliding_distance_m == pytest.approx(truth["sliding_distance"], abs=1.01e-6)
            assert capture.summary.peak_force_std_n == pytest.approx(0.5)
            assert capture.summary.sliding_distance_std_m == pytest.approx(5e-6)
            assert capture.batch_id == "B-17"
            make_summary(device)
        assert module.status.unreadable == 0


async def test_a_counter_of_16_bits_goes_on_after_its_end() -> None:
    device = ScriptedDevice(SUMMARY, counter=65_533)
    async with running(SUMMARY, device, after=CycleId(0, 65_533)) as (_, module, receptions):
        for cycle in range(65_534, 65_540):
            make_summary(device)
            (received,) = await take(receptions, 1)
            assert (received.cycle_id.cycle, received.missed, received.restarted) == (cycle, 0, False)
            summary = received.capture.summary
            assert summary is not None
            assert summary.peak_force_n == pytest.approx(figures_of(cycle % 65_536)["peak_force"], abs=0.051)
        make_summary(device, 3)
        (received,) = await take(receptions, 1)
        assert (received.cycle_id.cycle, received.missed) == (65_542, 2)
        assert module.status.restarts == 0


async def test_what_an_unseen_start_would_look_like_too_is_told_as_both(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """By a counter alone nobody knows; while the link was up, no start was missed."""
    device = ScriptedDevice(SUMMARY, counter=65_009)
    make_summary(device)
    async with running(SUMMARY, device, after=CycleId(0, 10)) as (server, _module, receptions):
        (received,) = await take(receptions, 1)
        assert (received.cycle_id, received.missed) == (CycleId(0, 65_010), 64_999)
        asked = server.requests
        coming = asyncio.ensure_future(take(receptions, 1))
        while server.requests < asked + 3:
            await asyncio.sleep(0)
        make_summary(device, 3)
        (received,) = await coming
        assert (received.cycle_id, received.missed) == (CycleId(0, 65_013), 2)
    told = [record.getMessage() for record in caplog.records if "lost: " in record.getMessage()]
    certain = "are lost: the module had overwritten them"
    doubt = "; or it was started anew, and how many are lost is not known: no register session tells"
    assert [line.split(" before it ")[1] for line in told] == [certain + doubt, certain]


@pytest.mark.parametrize(
    ("ends", "code", "is_cut_off"),
    [
        ((0, 65_535), 65_535, True),
        ((0, 65_535), 65_534, False),
        ((0, 60_000), 60_001, True),
        ((0, 9), 0, False),
    ],
)
async def test_a_figure_at_full_scale_is_none_and_named(
    ends: tuple[int, int], code: int, is_cut_off: bool
) -> None:
    """A force beyond the amplifier's range shows its end; 0 N is no end of anything."""
    peak_force = replace(SUMMARY["peak_force"], kind="u16", scale=0.01, offset=0.0, saturation=ends)
    layout = replace(SUMMARY, registers=SUMMARY.registers | {"peak_force": peak_force})
    device = ScriptedDevice(layout)
    device.complete({}, velocity=0.05, peak_force=0.01 * code, sliding_distance=2e-3)
    async with running(layout, device) as (_, _module, receptions):
        (received,) = await take(receptions, 1)
    assert received.capture.summary is not None
    assert received.capture.summary.sliding_distance_m == pytest.approx(2e-3, rel=1e-2)
    if is_cut_off:
        (fault,) = received.faults
        assert math.isnan(received.capture.summary.peak_force_n)
        assert f"cell-1: cycle 1: register peak_force ({peak_force.address}): " in fault
        assert f"is at full scale (0 to {0.01 * ends[1]:g})" in fault
    else:
        assert received.faults == ()
        assert received.capture.summary.peak_force_n == pytest.approx(0.01 * code)


async def test_a_restart_that_only_the_counter_tells() -> None:
    device = ScriptedDevice(SUMMARY)
    make_summary(device, 40)
    async with running(SUMMARY, device, after=CycleId(0, 39)) as (server, module, receptions):
        await take(receptions, 1)
        device.start(session=1)
        make_summary(device, 2)
        coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        asked = server.requests
        while server.requests < asked + 20:
            await asyncio.sleep(0)
        assert not coming.done()  # it could be an old reply
        make_summary(device)
        received = await coming
        assert (received.cycle_id.cycle, received.restarted, received.missed) == (3, True, 2)
        assert module.status.restarts == 1


@pytest.mark.parametrize("age", [1, 30])
@pytest.mark.parametrize("after_start", [True, False])
async def test_what_a_gateway_shows_once_more_is_not_taken_twice(age: int, after_start: bool) -> None:
    """No session, no clock, no ring: only what was taken, and that a restarted module counts on."""
    device = ScriptedDevice(SUMMARY)
    images = []
    for _ in range(40):
        make_summary(device)
        images.append(device.image.copy())
    async with running(SUMMARY, device, after=CycleId(0, 40 if after_start else 0)) as (
        server,
        module,
        receptions,
    ):
        if not after_start:
            device.start(session=1)
            for cycle in range(1, 41):
                make_summary(device)
                (received,) = await take(receptions, 1)
                assert received.cycle_id.cycle == cycle
        real, old = device.read, images[-1 - age]
        polls = itertools.count()

        def stale(table: str, address: int, count: int) -> np.ndarray:
            return old[address : address + count] if next(polls) < 12 else real(table, address, count)

        device.read = stale  # type: ignore[method-assign]
        coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        asked = server.requests
        while server.requests < asked + 24:
            await asyncio.sleep(0)
        assert not coming.done()
        make_summary(device)
        received = await coming
        assert (received.cycle_id.cycle, received.missed, received.restarted) == (41, 0, False)
        assert module.status.restarts == 0


@pytest.mark.parametrize("kind", ["u16", "bcd16", "bcd32", "u32"])
def test_numbers_go_on_whatever_was_missed(kind: str) -> None:
    numbers = CycleNumbers.of(kind)
    period = {"u16": 65_536, "bcd16": 10_000, "bcd32": 10**8, "u32": 2**32}[kind]
    draw = np.random.default_rng(3)
    near = 0
    for step in draw.integers(1, period // 2 - 1 if kind != "u32" else 1000, 200).tolist():
        cycle = near + int(step)
        assert numbers.number(cycle % period, near) == cycle
        assert numbers.shown(cycle) == cycle % period
        near = cycle


@pytest.mark.parametrize("kind", ["u16", "bcd16"])
def test_a_number_is_the_nearest_that_the_counter_can_mean(kind: str) -> None:
    """Of a cycle before, or after, by less than half of all that the counter can count."""
    numbers = CycleNumbers.of(kind)
    period = {"u16": 65_536, "bcd16": 10_000}[kind]
    near = 5 * period + 17
    for apart in (-period // 2 + 1, -2 * period // 5, -1, 0, 1, 2 * period // 5, period // 2 - 1):
        assert numbers.number((near + apart) % period, near) == near + apart


SMALLEST = {
    "cycle_counter": {"address": 0, "type": "u16"},
    "velocity": {"value": 4000, "unit": "mm/min"},
    "peak_force": {"address": 1, "type": "f32", "unit": "N"},
}


def changed(name: str, entry: dict[str, Any] | None, base: dict[str, Any] | None = None) -> dict[str, Any]:
    content = {"format": 1, "name": "x", "registers": dict(SMALLEST)} if base is None else base
    content = {**content, "registers": {**content["registers"], name: entry}}
    if entry is None:
        del content["registers"][name]
    return content


def test_the_smallest_map_is_one_and_says_what_it_lacks() -> None:
    smallest = RegisterMap.from_mapping({"format": 1, "name": "x", "registers": SMALLEST})
    assert smallest.constants["velocity"] == pytest.approx(4.0 / 60.0)
    said = "\n".join(not_promised(smallest))
    for lack in (
        "whoever answers is taken for the module", "one cycle is held", "by a cycle counter that goes back",
        "each capture is read twice", "there is no waveform", "equation (5) cannot be used",
        "an error of 1 % is assumed", "the time of a cycle is when it was read",
    ):  # fmt: skip
        assert lack in said, lack


@pytest.mark.parametrize(("scale", "is_told"), [(0.01, False), (0.1, True)])
def test_a_velocity_in_coarse_steps_is_told(scale: float, is_told: bool) -> None:
    """In 0.1 mm/s steps 2500 mm/min is 2502: k was off by ten times its standard deviation."""
    registers = {**SMALLEST, "velocity": {"address": 40, "type": "u16", "unit": "mm/s", "scale": scale}}
    registers |= {"force": {"address": 100, "type": "i16", "unit": "N", "count": 8}}
    registers |= {"sample_rate": {"value": 10, "unit": "kHz"}}
    said = "\n".join(
        not_promised(RegisterMap.from_mapping({"format": 1, "name": "x", "registers": registers}))
    )
    assert ("register velocity goes in steps of 6 mm/min" in said) == is_told


@pytest.mark.parametrize("std", [None, 0.5])
def test_an_error_is_assumed_only_where_the_map_does_not_tell_it(std: float | None) -> None:
    force = SMALLEST["peak_force"] | ({} if std is None else {"std": std})
    said = not_promised(RegisterMap.from_mapping(changed("peak_force", force)))
    assert any("peak_force has no `std`" in sentence for sentence in said) == (std is None)


@pytest.mark.parametrize(
    ("name", "entry", "told"),
    [
        ("cycle_counter", None, "register cycle_counter is missing: it tells of a new cycle"),
        ("velocity", None, "register velocity is missing"),
        ("peak_force", None, "register force or position or peak_force or sliding_distance is missing"),
        ("velocity", {"address": 9, "type": "u16", "sclae": 2}, "unknown key sclae; did you mean scale?"),
        ("velocity", {"address": 400009, "type": "u16"}, "a reference 4nnnnn is holding register nnnnn - 1"),
        ("velocity", {"value": "fast"}, "velocity: value must be a number"),
        ("velocity", {"value": math.nan}, "velocity: value must be a number"),
        ("velocity", {"value": 1, "unit": "furlong"}, "velocity: unit 'furlong' is not known"),
        ("velocity", {"value": 1, "address": 3}, "velocity: unknown key address"),
        ("session", {"value": 1}, "session: cannot be a constant"),
        ("velocity", {"value": 0}, "velocity: value must be above 0"),
        ("direction", {"value": 2}, "direction: value must be 1 or -1"),
        ("cycle_counter", {"address": 0, "type": "u64"}, "cycle_counter must be u16, u32, bcd16 or bcd32"),
        ("cycle_counter", {"address": 3, "type": "u16", "count": 2}, "cycle_counter must be a single value"),
        ("mass", {"address": 9, "type": "string", "length": 2}, "mass must be a number"),
        ("acknowledge_cycle", {"address": 9, "type": "u16"}, "acknowledge_cycle must be writable"),
        (
            "acknowledge_cycle",
            {"address": 9, "type": "bcd16", "writable": True},
            "acknowledge_cycle must hold what cycle_counter can show",
        ),
        ("direction", {"address": 9, "type": "bit", "table": "discrete"}, "direction must be a whole number"),
        (
            "command_direction",
            {"address": 9, "type": "bit", "table": "coil", "writable": True},
            "command_direction must be a whole number, not a bit",
        ),
        (
            "command_direction",
            {"address": 9, "type": "u16", "writable": True},
            "command_direction must be i16, i32 or i64: it is +1 or -1",
        ),
        ("direction", {"address": 9, "type": "u16", "bit": 3}, "direction must be a whole number, not a bit"),
        ("cycle_counter", {"address": 0, "type": "i16"}, "cycle_counter must be u16, u32"),
        ("cycle_counter", {"address": 0, "type": "f32"}, "cycle_counter must be u16, u32"),
        ("cycle_counter", {"address": 0, "type": "u16", "scale": 2}, "cycle_counter must be"),
        ("ring_cycle", {"address": 9, "type": "u32", "count": 4}, "register slot_select is missing"),
        ("slot_select", {"address": 9, "type": "u16", "writable": True}, "register ring_cycle is missing"),
        ("force", {"address": 9, "type": "i16", "count": 4}, "register force_rate or sample_rate is missing"),
        ("force", {"address": 9, "type": "string", "length": 4}, "force must be an array of numbers"),
        ("window_sequence", {"address": 9, "type": "u16"}, "register window_sequence_after is missing"),
        ("capture_crc32", {"address": 9, "type": "u32"}, "register window_cycle is missing"),
        ("status_crc32", {"address": 9, "type": "u32"}, "register state is missing"),
        (
            "state",
            {"address": 9, "type": "u16", "table": "coil"},
            "state: coils and discrete inputs are of type",
        ),
        ("state", {"address": 9, "type": "bit"}, "state: coils and discrete inputs are of type"),
        (
            "state",
            {"address": 9, "type": "bit", "table": "discrete", "writable": True},
            "state: table discrete can only be read",
        ),
        ("mass", {"address": 9, "type": "u16", "table": "input", "writable": True}, "can only be read"),
        ("mass", {"address": 9, "type": "bit", "table": "coil", "scale": 2}, "has no order, scale or unit"),
        ("peak_force", {"address": 9, "type": "f32", "std": -1}, "peak_force: std must be a number above 0"),
        ("state", {"address": 9, "type": "u16", "bit": 1, "writable": True}, "function 22, which is not in"),
        (
            "peak_force",
            {"address": 0, "type": "f32", "unit": "N"},
            "registers cycle_counter and peak_force overlap",
        ),
    ],
)
def test_a_bad_map_of_a_poorer_module_is_refused(name: str, entry: dict[str, Any] | None, told: str) -> None:
    with pytest.raises(MapError) as caught:
        RegisterMap.from_mapping(changed(name, entry))
    assert told in str(caught.value)


@pytest.mark.parametrize("functions", [22, [24], ["22"], [True], {"22": 1}, [[22]]])
def test_functions_are_those_that_only_some_modules_have(functions: Any) -> None:
    with pytest.raises(MapError, match="functions must be a list of 22 and 23"):
        RegisterMap.from_mapping({"format": 1, "name": "x", "functions": functions, "registers": SMALLEST})


@pytest.mark.parametrize("gaps", [True, False])
async def test_a_module_that_refuses_what_lies_between_its_registers(gaps: bool) -> None:
    """As many do: reading over a gap is exception 2."""
    content = {**declared("fpga-v1"), "gaps": gaps}
    layout = RegisterMap.from_mapping(content)
    used = {a for r in layout.registers.values() for a in range(r.address, r.end)}

    class Strict(ScriptedDevice):
        def read(self, table: str, address: int, count: int) -> np.ndarray:
            if not used.issuperset(range(address, address + count)):
                raise LookupError(address)
            return super().read(table, address, count)

    device = Strict(layout)
    device.complete(samples_of(1), velocity=0.05, force_rate=1e6, position_rate=1e5)
    async with running(layout, device) as (_, module, receptions):
        if gaps:
            await module.register_client.modbus.connect()
            with pytest.raises(ModbusExceptionError, match=r"data address.*`gaps: false` in map") as told:
                await module.register_client.read_image(
                    ("window_sequence", "actuator_count", "capture_crc32")
                )
            assert german_link_fault(str(told.value)).endswith(
                "diese Adresse gibt es dort nicht (Ausnahme 2); falls das Modul Adressen zwischen seinen "
                "Registern ablehnt, in der Karte fpga-v1 `gaps: false` angeben"
            )
            used.remove(layout["session"].address)
            with pytest.raises(ModbusExceptionError, match=r"\(exception 2\)$"):  # there is no gap in it
                await module.register_client.read_image(("session",))
            return
        (received,) = await take(receptions, 1)
        assert received.capture.force is not None
        np.testing.assert_allclose(received.capture.force.values, samples_of(1)["force"], atol=0.0126)


@pytest.mark.parametrize("gaps", ["no", 1, None])
def test_gaps_are_there_or_not(gaps: Any) -> None:
    with pytest.raises(MapError, match="gaps must be true or false"):
        RegisterMap.from_mapping({"format": 1, "name": "x", "gaps": gaps, "registers": SMALLEST})


def test_what_a_crc_covers_lies_before_it() -> None:
    content = declared("fpga-v1")
    for wrong in ({"address": 60_000}, {"address": 40_000, "table": "input"}):
        entry = {**content["registers"]["mass"], **wrong}
        with pytest.raises(MapError, match="register mass must lie before capture_crc32"):
            RegisterMap.from_mapping(changed("mass", entry, content))


LEFT_OUT = (
    ("window_sequence", "window_sequence_after"), ("capture_crc32",), ("window_session", "session"),
    ("ring_cycle", "slot_select", "window_slot", "newest_slot"), ("cycle_time",),
    ("module_name", "map_version"),
    ("status_crc32", "state"), ("force_start", "position_start", "actuator_start"), ("acknowledge_session",),
    ("force", "force_rate", "force_count", "force_start"), ("position", "position_rate", "position_count"),
)  # fmt: skip
"""What is left out of the shipped map, alone and in pairs."""


@pytest.mark.parametrize(
    "without", [*itertools.combinations(LEFT_OUT, 1), *itertools.combinations(LEFT_OUT, 2)]
)
async def test_any_two_things_may_be_missing(without: tuple[tuple[str, ...], ...]) -> None:
    """Cycles come once, whole and in order, also over a loss of the link."""
    content = declared("fpga-v1")
    for name in itertools.chain.from_iterable(without):
        content["registers"].pop(name, None)
    layout = RegisterMap.from_mapping(content)
    device = ScriptedDevice(layout, session=5)
    header = {"velocity": 0.05, "stroke": 0.0015, "force_rate": 1e6, "position_rate": 1e5}

    def make() -> None:
        cycle = int(device.get("cycle_counter")) + 1
        samples = {name: each for name, each in samples_of(cycle).items() if name in layout}
        figures = {"peak_force": 150.0 + cycle, "sliding_distance": 3e-3, "mass": 18.9}
        device.complete(samples, **{k: v for k, v in (header | figures).items() if k in layout})

    make()
    async with running(layout, device) as (server, module, receptions):
        for cycle in range(1, 4):
            (received,) = await take(receptions, 1)
            capture = received.capture
            assert (received.cycle_id.cycle, received.missed, received.restarted) == (cycle, 0, False)
            assert capture.summary is not None
            assert capture.summary.peak_force_n == pytest.approx(150.0 + cycle)
            for name, atol in (("force", 0.0126), ("position", 0.6e-9)):
                channel = getattr(capture, name)
                assert (channel is not None) == (name in layout)
                if channel is not None:
                    np.testing.assert_allclose(channel.values, samples_of(cycle)[name], atol=atol)
            if cycle == 2:
                server.drop_clients()
            make()
        assert (module.status.unreadable, module.status.missed) == (0, 0)


def test_a_map_without_a_ring_keeps_it_with_another_word_order() -> None:
    swapped = ONE_BUFFER.with_word_order("big")
    assert (swapped.constants, swapped.functions) == (ONE_BUFFER.constants, ONE_BUFFER.functions)
    assert replace(swapped, registers=ONE_BUFFER.registers) == ONE_BUFFER


def test_the_shipped_maps_are_maps() -> None:
    for file in Path(MAP.parent).glob("*.yaml"):
        RegisterMap.from_mapping(yaml.safe_load(file.read_text(encoding="utf-8")))
