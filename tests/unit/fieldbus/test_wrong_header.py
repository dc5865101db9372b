"""One wrong bit in the header of a capture: never anything wrong of it. Truth: what the device was given."""

import math

import numpy as np
import pytest

from impactcell.fieldbus.registers import RegisterMap, Words
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import HEADER, assert_whole, make, running


def flipping(device: ScriptedDevice, address: int, bit: int, times: int) -> list[int]:
    """Let readings of a register come with a wrong bit, so many times; returns how often that happened."""
    read, seen = device.read, []

    def wrong(table: str, first: int, count: int) -> Words:
        words = read(table, first, count)
        if first <= address < first + count and len(seen) < times:
            seen.append(first)
            words = words.copy()
            words[address - first] ^= np.uint16(1 << bit)
        return words

    device.read = wrong  # type: ignore[method-assign]
    return seen


@pytest.mark.slow
async def test_every_bit_of_the_header_wrong_once(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga)
    first, end = fpga["window_sequence"].address, fpga.header()[-1].end
    bits = [(address, bit) for address in range(first, end) for bit in range(16)]
    async with running(fpga, device) as (_, module, receptions):
        for cycle, (address, bit) in enumerate(bits, 1):
            draw = np.random.default_rng(cycle)
            force, position = draw.normal(0.0, 50.0, 40), draw.normal(0.0, 1e-3, 10)
            force[7], position[3] = HEADER["peak_force"], HEADER["sliding_distance"]
            device.complete({"force": force, "position": position}, **HEADER)
            seen = flipping(device, address, bit, times=1)
            received = await anext(receptions)
            del device.read  # type: ignore[method-assign]
            assert seen, (address, bit)
            assert (received.cycle_id.cycle, received.missed, received.faults) == (cycle, 0, ())
            capture = received.capture
            assert capture.force is not None
            assert capture.position is not None
            np.testing.assert_allclose(capture.force.values, force, atol=0.0126)
            np.testing.assert_allclose(capture.position.values, position, atol=0.6e-9)
            assert capture.velocity_m_s == pytest.approx(HEADER["velocity"], rel=1e-6)
            assert capture.time_ns == HEADER["cycle_time"]
        assert (module.status.unreadable, module.status.restarts) == (0, 0)


@pytest.mark.parametrize("register", ["force_count", "position_count"])
async def test_a_count_that_stays_wrong_gives_no_capture_without_its_crc(
    fpga: RegisterMap, register: str
) -> None:
    device = ScriptedDevice(fpga)
    make(device)
    flipping(device, fpga[register].address, 15, times=1000)
    async with running(fpga, device) as (_, module, receptions):
        bad = await anext(receptions)
        del device.read  # type: ignore[method-assign]
        make(device)
        assert_whole(await anext(receptions))
        assert module.status.unreadable == 1
    assert (bad.capture.force, bad.capture.position) == (None, None)
    assert math.isnan(bad.capture.velocity_m_s)
    assert f"cell-1: cycle 1 could not be read: register {register} (" in bad.faults[0]
