"""Poorer modules that lie: a wrong bit, odd layouts, replies too short. Truth: what the device was given."""

import copy
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from impactcell.errors import MapError
from impactcell.fieldbus.map_promises import not_promised
from impactcell.fieldbus.registers import RegisterMap, Words
from simulator.faults import Fault, FaultInjector, FaultKind
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import running, take
from tests.unit.fieldbus.test_poorer_modules import (
    ONE_BUFFER,
    SUMMARY,
    declared,
    figures_of,
    make_buffer,
    make_summary,
    samples_of,
)
from tests.unit.fieldbus.test_wrong_header import flipping
from tests.virtual_time import run_virtually

SHIPPED = declared("fpga-v1")


async def test_every_bit_of_a_summary_wrong_once() -> None:
    """There is neither CRC nor sequence number: the second reading tells."""
    device = ScriptedDevice(SUMMARY)
    registers = [SUMMARY[name] for name in ("cycle_counter", "velocity", "peak_force", "sliding_distance")]
    bits = [(address, bit) for r in registers for address in range(r.address, r.end) for bit in range(16)]
    async with running(SUMMARY, device) as (_, module, receptions):
        for cycle, (address, bit) in enumerate(bits, 1):
            make_summary(device)
            seen = flipping(device, address, bit, times=1)
            (received,) = await take(receptions, 1)
            del device.read  # type: ignore[method-assign]
            assert seen, (address, bit)
            assert (received.cycle_id.cycle, received.missed, received.faults) == (cycle, 0, ())
            summary = received.capture.summary
            assert summary is not None
            assert summary.peak_force_n == pytest.approx(figures_of(cycle)["peak_force"], abs=0.051)
            assert summary.sliding_distance_m == pytest.approx(
                figures_of(cycle)["sliding_distance"], abs=1.01e-6
            )
            assert received.capture.velocity_m_s == pytest.approx(0.05)
        assert (module.status.unreadable, module.status.restarts, module.status.missed) == (0, 0, 0)


@pytest.mark.parametrize(
    "name", ["force", "position", "window_cycle", "sample_rate", "sample_count", "velocity"]
)
async def test_one_bit_of_a_buffer_wrong_once(name: str) -> None:
    device = ScriptedDevice(ONE_BUFFER)
    draw = np.random.default_rng(8)
    register = ONE_BUFFER[name]
    async with running(ONE_BUFFER, device) as (_, module, receptions):
        for cycle in range(1, 7):
            make_buffer(device)
            words = 2 * len(samples_of(1)["force"]) if register.count > 1 else register.words
            address = register.address + int(draw.integers(0, min(words, 700)))
            seen = flipping(device, address, int(draw.integers(0, 16)), times=1)
            (received,) = await take(receptions, 1)
            del device.read  # type: ignore[method-assign]
            assert seen
            assert (received.cycle_id.cycle, received.missed) == (cycle, 0)
            for channel in ("force", "position"):
                recorded = getattr(received.capture, channel)
                np.testing.assert_allclose(recorded.values, samples_of(cycle)[channel], atol=0.0126)
                assert recorded.time_s[-1] == pytest.approx(2e-5 + 699 / 5e4)
        assert module.status.unreadable == 0


@pytest.mark.parametrize("at", [130, 300, 620])
async def test_the_reply_before_in_both_readings_of_a_buffer(at: int) -> None:
    """A line without transactions: the reply to the request before is as long, and whole."""
    device = ScriptedDevice(ONE_BUFFER)
    sound, wanted = device.read, ONE_BUFFER["force"].address + at
    before, times = np.zeros(0, ">u2"), 0

    def stale(table: str, address: int, count: int) -> Words:
        nonlocal before, times
        words = sound(table, address, count).copy()
        shown = words
        if times < 2 and address <= wanted < address + count and before.size == count:
            times, shown = times + 1, before
        before = words
        return shown

    async with running(ONE_BUFFER, device, window=1) as (_, module, receptions):
        make_buffer(device)
        device.read = stale  # type: ignore[method-assign]
        (received,) = await take(receptions, 1)
        assert times == 2
        assert received.faults == ()
        assert received.capture.force is not None
        np.testing.assert_allclose(received.capture.force.values, samples_of(1)["force"], atol=0.0126)
        assert module.status.unreadable == 0


async def test_the_reply_before_in_both_readings_of_registers_that_take_several_requests() -> None:
    content = copy.deepcopy(SHIPPED)
    for name in ("status_crc32", "capture_crc32"):
        del content["registers"][name]
    layout = RegisterMap.from_mapping(content)
    device = ScriptedDevice(layout)
    ring = layout["ring_cycle"]
    device.put("ring_cycle", np.arange(1, 1 + ring.count))
    sound, before, times = device.read, np.zeros(0, ">u2"), 0

    def stale(table: str, address: int, count: int) -> Words:
        nonlocal before, times
        words = sound(table, address, count).copy()
        shown = words
        if times < 2 and address <= ring.end - 5 < address + count and before.size == count:
            times, shown = times + 1, before
        before = words
        return shown

    async with running(layout, device, window=1, max_registers=8) as (_, module, _receptions):
        await module.connect_once()
        device.read = stale  # type: ignore[method-assign]
        image = await module.register_client.read_image(("ring_cycle",))
        assert times == 2
        np.testing.assert_array_equal(image.values["ring_cycle"], np.arange(1, 1 + ring.count))


@pytest.mark.parametrize(
    "kind", [FaultKind.TRUNCATED, FaultKind.WRONG_LENGTH, FaultKind.EXCEPTION, FaultKind.BUSY]
)
async def test_flags_in_discrete_inputs_under_faults(kind: FaultKind) -> None:
    """Replies of bits are short, and a cut one looks like another that is whole."""
    device = ScriptedDevice(ONE_BUFFER)
    async with running(ONE_BUFFER, device, timeout_s=0.3) as (server, module, receptions):
        server.faults.inject(Fault(kind, probability=0.1, remaining=3))
        for cycle in range(1, 4):
            make_buffer(device)
            (received,) = await take(receptions, 1)
            assert (received.cycle_id.cycle, received.missed, received.restarted) == (cycle, 0, False)
            assert received.capture.force is not None
            np.testing.assert_allclose(received.capture.force.values, samples_of(cycle)["force"], atol=0.0126)
        assert module.status.unreadable == 0


@st.composite
def layouts(draw: st.DrawFn) -> dict[str, Any]:
    """The shipped map with registers left out, moved, made narrower or put into another table."""
    content = copy.deepcopy(SHIPPED)
    registers = content["registers"]
    for name in draw(st.sets(st.sampled_from(sorted(registers)), max_size=12)):
        del registers[name]
    for name in draw(st.sets(st.sampled_from(sorted(registers)), max_size=3)):
        change = draw(
            st.sampled_from(
                [
                    {"table": "input"}, {"table": "discrete", "type": "bit"}, {"type": "u16"},
                    {"type": "bcd32"},
                    {"word_order": "little"}, {"byte_order": "little"}, {"address": 50_000}, {"count": 2},
                    {"type": "u16", "bit": 5}, {"offset": 1.0}, {"scale": 2.0},
                ]
            )
        )  # fmt: skip
        registers[name] = {**registers[name], **change}
    content["gaps"] = draw(st.booleans())
    content["functions"] = draw(st.sampled_from([[], [22], [23], [22, 23]]))
    return content


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(content=layouts(), max_registers=st.sampled_from([125, 40]))
async def test_any_layout_that_is_taken_gives_right_cycles(
    content: dict[str, Any], max_registers: int
) -> None:
    try:
        layout = RegisterMap.from_mapping(content)
    except MapError:
        return
    assert all(text.startswith("no register") or "`" in text for text in not_promised(layout))
    device = ScriptedDevice(layout, session=5)
    values = {
        "velocity": 0.05, "stroke": 0.0015, "force_rate": 1e6, "position_rate": 1e5, "peak_force": 120.0,
        "sliding_distance": 3e-3, "mass": 18.9,
    }  # fmt: skip
    header = {name: value for name, value in values.items() if name in layout}
    async with running(layout, device, max_registers=max_registers) as (_, module, receptions):
        for cycle in (1, 2):
            samples = {name: each for name, each in samples_of(cycle).items() if name in layout}
            device.complete(samples, **header)
            (received,) = await take(receptions, 1)
            assert (received.cycle_id.cycle, received.missed, received.restarted) == (cycle, 0, False)
            for name, recorded in samples.items():
                channel, register = getattr(received.capture, name), layout[name]
                if channel is not None and register.scale < 1.0 and not register.offset:
                    np.testing.assert_allclose(channel.values, recorded, atol=register.si_factor)
        assert module.status.unreadable == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("layout", [SUMMARY, ONE_BUFFER], ids=["summary", "one-buffer"])
def test_faults_of_every_kind_give_nothing_wrong_twice_or_untold(layout: RegisterMap, seed: int) -> None:
    """In virtual time; a cycle is made as soon as the one before is there, or gone."""
    device, injector = ScriptedDevice(layout), FaultInjector(seed)
    for kind in FaultKind:
        injector.inject(Fault(kind, probability=0.006, seconds=0.2))
    make = make_summary if layout is SUMMARY else make_buffer
    came: list[int] = []
    told = 0

    async def cell() -> None:
        nonlocal told
        async with running(layout, device, timeout_s=0.15, window=4) as (server, module, receptions):
            server.faults = injector
            make(device)
            async for received in receptions:
                cycle, capture = received.cycle_id.cycle, received.capture
                told += received.missed if came else 0
                came.append(cycle)
                if layout is SUMMARY and capture.summary is not None:
                    expected = figures_of(cycle)["peak_force"]
                    assert capture.summary.peak_force_n == pytest.approx(expected, abs=0.051)
                elif capture.force is not None:
                    np.testing.assert_allclose(capture.force.values, samples_of(cycle)["force"], atol=0.0126)
                else:
                    assert received.faults, "a cycle without content says why"
                if cycle >= 25:
                    break
                make(device, 1 + cycle % 3)
            assert module.status.restarts == 0

    run_virtually(cell(), grace_s=0.002)
    assert came == sorted(set(came))
    assert len(came) + told == came[-1] - came[0] + 1
    assert sum(injector.happened.values()) > 5
