"""Whatever words a module shows become a capture and faults that name registers, never an exception."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.fieldbus.cycles import decoding, status_block
from impactcell.fieldbus.registers import WIRE, RegisterMap, Words
from impactcell.records import Channel

ARRAYS = ("force", "position", "actuator")


def words_of(data: bytes) -> Words:
    return np.frombuffer(data, dtype=WIRE)


def header_words(fpga: RegisterMap) -> int:
    fields = fpga.header()
    return fields[-1].end - fields[0].address


def assert_sound(channel: Channel | None) -> None:
    if channel is None:
        return
    assert channel.time_s.size == channel.values.size > 0
    assert np.isfinite(channel.time_s).all()
    assert np.isfinite(channel.values).all()
    assert (np.diff(channel.time_s) > 0.0).all()


@pytest.mark.slow
@settings(max_examples=300)
@given(data=st.data())
def test_arbitrary_window_words_become_a_sound_capture(fpga: RegisterMap, data: st.DataObject) -> None:
    words = words_of(data.draw(st.binary(min_size=2 * header_words(fpga), max_size=2 * header_words(fpga))))
    first = fpga["window_sequence"].address
    header = {
        register.name: register.decode(words[register.address - first : register.end - first])
        for register in fpga.header()
    }
    counts = decoding.sample_counts(fpga, header)
    samples = {}
    for name in ARRAYS:
        assert counts[name] <= fpga[name].count
        size = 2 * fpga[name].words_per_value * data.draw(st.integers(0, 6))
        samples[name] = words_of(data.draw(st.binary(min_size=size, max_size=size)))
    capture, faults = decoding.capture_from_words(fpga, header, samples)
    assert all("register " in fault for fault in faults)
    assert math.isnan(capture.velocity_m_s) or 0.0 < capture.velocity_m_s < math.inf
    assert math.isnan(capture.mass_kg) or 0.0 < capture.mass_kg < math.inf
    assert math.isnan(capture.stroke_m) or capture.stroke_m > 0.0
    assert capture.direction in (-1, 1)
    for channel in (capture.force, capture.position, capture.actuator):
        assert_sound(channel)


@settings(max_examples=200)
@given(data=st.data())
def test_arbitrary_status_words_become_a_report(fpga: RegisterMap, data: st.DataObject) -> None:
    registers = [fpga[name] for name in status_block.STATUS_REGISTERS]
    words = {
        register.name: words_of(
            data.draw(st.binary(min_size=2 * register.words, max_size=2 * register.words))
        )
        for register in registers
    }
    report = status_block.decode_status(fpga, {name: fpga[name].decode(each) for name, each in words.items()})
    assert len(report.ring) == fpga.slots
    assert report.batch is not None
    assert report.positioning is not None


def test_a_map_without_the_optional_registers_still_gives_captures(fpga: RegisterMap) -> None:
    optional = {
        "direction", "mass", "stroke", "dwell", "start_position", "peak_force", "sliding_distance",
        "batch_id",
        "actuator", "actuator_rate", "actuator_start", "actuator_count", "capture_crc32",
    }  # fmt: skip
    bare = RegisterMap("bare", {name: each for name, each in fpga.registers.items() if name not in optional})
    header = {
        "window_cycle": 7, "cycle_time": 0, "velocity": 0.05, "force_rate": 1e6, "force_start": 0.0,
        "force_count": 3, "position_rate": 1e5, "position_start": 0.0, "position_count": 2,
    }  # fmt: skip
    samples = {
        "force": bare["force"].encode(np.array([1.0, 2.0, 1.5])),
        "position": bare["position"].encode(np.array([0.0, 1e-6])),
    }
    capture, faults = decoding.capture_from_words(bare, header, samples)
    assert faults == []
    assert (capture.cycle, capture.direction, capture.stroke_m) == (7, 1, math.inf)
    assert capture.summary is None
    assert capture.batch_id is None
    assert capture.force is not None
    np.testing.assert_allclose(capture.force.values, [1.0, 2.0, 1.5])


@pytest.mark.parametrize(
    ("dwell_s", "is_fault"), [(0.0, False), (math.nan, False), (2.5, False), (-1.0, True)]
)
def test_a_tap_without_a_dwell_is_no_fault_and_a_negative_one_is(
    fpga: RegisterMap, dwell_s: float, is_fault: bool
) -> None:
    first = fpga["window_sequence"].address
    words = words_of(bytes(2 * header_words(fpga)))
    header = {
        register.name: register.decode(words[register.address - first : register.end - first])
        for register in fpga.header()
    }
    empty = {name: words_of(b"") for name in ARRAYS}
    capture, faults = decoding.capture_from_words(fpga, {**header, "dwell": dwell_s}, empty)
    assert any("dwell" in fault for fault in faults) is is_fault
    assert math.isnan(capture.dwell_s) if is_fault else capture.dwell_s == pytest.approx(dwell_s, nan_ok=True)
