"""Values that no tap has, and modules that never show what they count. Truth: what the device was given."""

import asyncio
import copy
import logging
import math
import time
from typing import Any

import numpy as np
import pytest

from impactcell.errors import MapError
from impactcell.fieldbus.acquisition import ReceivedCycle
from impactcell.fieldbus.probe import probe
from impactcell.fieldbus.registers import RegisterMap
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import make, running, take
from tests.unit.fieldbus.test_poorer_modules import ONE_BUFFER, declared, make_buffer

AT = 50_000


def with_register(name: str, **declaration: Any) -> RegisterMap:
    content = copy.deepcopy(declared("one-buffer"))
    content["registers"][name] = {"address": AT, "table": "input", **declaration}
    return RegisterMap.from_mapping(content)


async def received_with(name: str, code: np.ndarray, **declaration: Any) -> ReceivedCycle:
    """Give a cycle of a module that shows a code in one register, and the next one, which is sound."""
    layout = with_register(name, **declaration)
    device = ScriptedDevice(layout)
    make_buffer(device)
    words = code.view(">u2")[::-1]
    sound = device.images["input"][AT : AT + words.size].copy()
    device.images["input"][AT : AT + words.size] = words
    async with running(layout, device) as (_, module, receptions):
        (received,) = await take(receptions, 1)
        device.images["input"][AT : AT + words.size] = sound
        make_buffer(device)
        (following,) = await take(receptions, 1)
        assert (received.cycle_id.cycle, following.cycle_id.cycle, following.missed) == (1, 2, 0)
        assert module.status.connected
        return received


@pytest.mark.parametrize("value", [math.inf, -math.inf, 3e38, 1e-38, -1.0])
@pytest.mark.parametrize(
    ("name", "unit", "field", "absent"),
    [
        ("velocity", "m/s", "velocity_m_s", math.nan),
        ("dwell", "s", "dwell_s", math.nan),
        ("mass", "kg", "mass_kg", math.nan),
        ("sample_rate", "Hz", "force", None),
    ],
)
async def test_what_cannot_be_is_told_and_left_out(
    name: str, unit: str, field: str, absent: float | None, value: float
) -> None:
    received = await received_with(name, np.array([value], ">f4"), type="f32", unit=unit)
    assert any(f"{name} ({AT})" in fault or "no time axis" in fault for fault in received.faults)
    shown = getattr(received.capture, field)
    assert shown is None if absent is None else math.isnan(shown)


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan, 3e38])
@pytest.mark.parametrize("name", ["start_position", "peak_force", "sliding_distance", "sample_start"])
async def test_what_has_no_end_is_told_and_left_out(name: str, value: float) -> None:
    unit = {"peak_force": "N", "sample_start": "s"}.get(name, "m")
    received = await received_with(name, np.array([value], ">f4"), type="f32", unit=unit)
    capture = received.capture
    assert received.faults
    assert capture.start_m == 0.0
    assert capture.summary is not None
    assert not math.isinf(capture.summary.peak_force_n)
    assert not math.isinf(capture.summary.sliding_distance_m)
    assert (capture.force is None) == (name == "sample_start")


@pytest.mark.parametrize(
    ("kind", "unit", "value", "time_ns"),
    [
        ("f64", "s", 1e300, None),
        ("f64", "s", math.inf, None),
        ("f64", "s", -5.0, None),
        ("f64", "s", 1.7e9, 1_700_000_000_000_000_000),
        ("i64", "", -5, None),
        ("i64", "", -(2**63), None),
        ("u64", "", 2**64 - 1, None),
    ],
)
async def test_a_time_that_is_no_date_is_told_and_the_cycle_is_of_now(
    kind: str, unit: str, value: float, time_ns: int | None
) -> None:
    code = np.array([value], {"f64": ">f8", "i64": ">i8", "u64": ">u8"}[kind])
    began_ns = time.time_ns()
    received = await received_with("cycle_time", code, type=kind, unit=unit)
    read_ns = received.capture.time_ns
    assert began_ns <= read_ns <= time.time_ns() if time_ns is None else read_ns == time_ns
    assert (not received.faults) == (time_ns is not None)
    assert all(f"register cycle_time ({AT})" in fault for fault in received.faults)


@pytest.mark.parametrize(("kind", "dtype"), [("i16", ">i2"), ("i32", ">i4"), ("i64", ">i8")])
async def test_fewer_samples_than_none_are_told(kind: str, dtype: str) -> None:
    for count in (-1, np.iinfo(dtype).min):
        received = await received_with("sample_count", np.array([count], dtype), type=kind)
        told = f"register sample_count ({AT}): {count} samples, but the map has room for 8000"
        assert any(told in fault for fault in received.faults)
        assert received.capture.force is None


async def stalled(device: ScriptedDevice, layout: RegisterMap, caplog: pytest.LogCaptureFixture) -> list[str]:
    """What is told of a module that counts a cycle and never shows it; then it does, and is read."""
    caplog.set_level(logging.WARNING, logger="impactcell")
    async with running(layout, device) as (_, module, receptions):
        waiting = asyncio.ensure_future(anext(receptions))
        await asyncio.sleep(25.0)
        assert not waiting.done()
        told = [record.getMessage() for record in caplog.records]
        device.start(2)
        make(device) if layout.has_ring else make_buffer(device)
        received = await waiting
        assert (received.cycle_id.session, received.cycle_id.cycle) == (2, 1)
        assert module.status.connected
    return told


@pytest.mark.slow
async def test_a_ring_that_never_holds_what_is_counted_is_told_once(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    device = ScriptedDevice(fpga)
    make(device)
    device.put("ring_cycle", np.zeros(fpga.slots, dtype=np.int64))
    (told,) = await stalled(device, fpga, caplog)
    assert "cycle_counter shows 1, but ring_cycle no cycle at all; see whether cycle_counter (" in told
    assert "ring_cycle (" in told
    assert told.endswith("are right in map fpga-v1")


@pytest.mark.slow
async def test_a_buffer_that_never_shows_what_is_counted_is_told_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    device = ScriptedDevice(ONE_BUFFER)
    make_buffer(device)
    device.put("window_cycle", 77 + 2**31)
    (told,) = await stalled(device, ONE_BUFFER, caplog)
    assert "cycle_counter shows 1, but its slot shows another cycle" in told
    assert "window_cycle (10) are right in map one-buffer" in told


async def test_probe_tells_of_a_ring_that_is_not_where_the_map_has_it(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga)
    make(device)
    device.put("ring_cycle", np.arange(7, 7 + fpga.slots))
    async with running(fpga, device) as (_, module, _receptions):
        result = await probe(module)
    (fault,) = result.faults
    assert "cell-1: cycle_counter shows 1, but ring_cycle 7, 8, 9, 10 ...: one of them has another" in fault


@pytest.mark.parametrize("name", ["cycle_counter", "window_cycle", "session"])
def test_nothing_is_counted_with_one_bit(name: str) -> None:
    with pytest.raises(MapError, match=f"register {name} must be u16, u32, bcd16 or bcd32"):
        with_register(name, type="u16", bit=3)
