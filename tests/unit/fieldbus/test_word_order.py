"""A wrong word order or scale is proved at connect, and the right one never refused."""

import asyncio
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.fieldbus.cycles.plausibility import wrong_word_order
from impactcell.fieldbus.register_image import RegisterImage, decoded_image, group_registers
from impactcell.fieldbus.registers import RegisterMap
from impactcell.records import ModuleStatus
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import HEADER, make, running
from tests.unit.fieldbus.test_stale_status import layout

__all__ = ["layout"]


def image_of(registers: RegisterMap, device: ScriptedDevice, *names: str) -> RegisterImage:
    blocks = group_registers([registers[name] for name in names], 125)
    return decoded_image(
        blocks, [device.image[block.address : block.end].astype(">u2").tobytes() for block in blocks]
    )


STATUS = ("state", "session", "cycle_counter", "ring_cycle")


@pytest.mark.parametrize("cycles", [1, 2, 20])
async def test_a_wrong_word_order_is_refused_by_name_and_nothing_is_taken(
    layout: RegisterMap, cycles: int
) -> None:
    device = ScriptedDevice(layout, session=7)
    make(device, cycles)
    async with running(layout.with_word_order("little"), device) as (_, module, receptions):
        coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        while "the word order is wrong, with `word_order: big` all of it can be" not in module.status.reason:
            await asyncio.sleep(0)
            assert not coming.done()
        assert not module.status.connected
        coming.cancel()
        await asyncio.gather(coming, return_exceptions=True)
    assert device.acknowledged == []


@pytest.mark.slow
async def test_a_counter_that_goes_on_is_no_new_reason(
    layout: RegisterMap, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A module that went on striking filled the log with its counter, line by line."""
    proofs: list[str] = []

    def proved(*shown: Any) -> str | None:
        told = wrong_word_order(*shown)
        proofs.extend([told] if told else [])
        return told

    for module_name in ("status_reader", "identity"):
        monkeypatch.setattr(f"impactcell.fieldbus.cycles.{module_name}.wrong_word_order", proved)
    device = ScriptedDevice(layout, session=7)
    make(device, 20)
    statuses = [ModuleStatus()]
    async with running(layout.with_word_order("little"), device, statuses=statuses) as (
        _,
        module,
        receptions,
    ):
        coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        while "the word order is wrong" not in module.status.reason:
            await asyncio.sleep(0)
        for _ in range(2):
            make(device)
            proofs.clear()
            while len(proofs) < 6:  # two on each connection at most
                await asyncio.sleep(0)
        coming.cancel()
        await asyncio.gather(coming, return_exceptions=True)
        told = [line for line in caplog.messages if "the word order is wrong" in line]
        assert len(told) == 1, told
        assert len([one for one in statuses if "the word order is wrong" in one.reason]) == 1


async def test_a_module_that_has_made_no_cycle_yet_is_judged_by_its_first(layout: RegisterMap) -> None:
    registers = layout.with_word_order("little")
    device = ScriptedDevice(registers, session=7)
    async with running(layout, device) as (_, module, receptions):
        coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        for _ in range(200):
            await asyncio.sleep(0)
        make(device)
        while "with `word_order: little` all of it can be" not in module.status.reason:
            await asyncio.sleep(0)
            assert not coming.done()
        coming.cancel()
        await asyncio.gather(coming, return_exceptions=True)


@pytest.mark.slow
@settings(max_examples=300)
@given(
    session=st.integers(0, 2**32 - 1),
    counter=st.integers(0, 2**32 - 2),
    made=st.integers(0, 20),
    header=st.fixed_dictionaries(
        {},
        optional={
            "velocity": st.floats(1e-4, 0.2),
            "cycle_time": st.sampled_from([0, 1_795_255_128_123_456_789]),
            "mass": st.just(float("nan")) | st.floats(0.1, 1000.0),
            "stroke": st.just(float("inf")) | st.floats(1e-4, 0.1),
            "force_rate": st.sampled_from([1e3, 1e5, 1e6]),
        },
    ),
)
def test_the_right_word_order_is_never_refused(
    fpga: RegisterMap, session: int, counter: int, made: int, header: dict[str, Any]
) -> None:
    """Whatever counter, session and quantities a module may have."""
    device = ScriptedDevice(fpga, session, counter)
    for _ in range(made):
        device.complete({"force": np.ones(3)}, **(HEADER | header))
    window = [register.name for register in fpga.header()]
    images = [image_of(fpga, device, *STATUS), *([image_of(fpga, device, *window)] if made else [])]
    assert wrong_word_order(fpga, *images) is None
    if made:
        swapped = fpga.with_word_order("little")
        told = wrong_word_order(
            swapped, image_of(swapped, device, *STATUS), image_of(swapped, device, *window)
        )
        assert told is None or "word_order: big" in told


async def test_a_part_that_is_only_pushed_has_no_wrong_scale(fpga: RegisterMap) -> None:
    """0.25 mm after most of the 1.5 mm of the stroke: so short a slide is no fault of the map."""
    device = ScriptedDevice(fpga)
    samples = {"force": np.linspace(0.0, 30.0, 50), "position": np.linspace(0.0, 1.7e-3, 50)}
    device.complete(samples, **(HEADER | {"stroke": 1.5e-3, "peak_force": 30.0, "sliding_distance": 0.25e-3}))
    device.complete(samples, **(HEADER | {"stroke": 1.0e-4, "peak_force": 30.0, "sliding_distance": 0.25e-3}))
    async with running(fpga, device) as (_, _, receptions):
        pushed, struck = await anext(receptions), await anext(receptions)
    assert pushed.faults == ()
    assert any("sliding_distance" in fault for fault in struck.faults), struck.faults


async def test_the_noise_of_the_samples_is_no_slide(fpga: RegisterMap) -> None:
    """After a slow push of the whole stroke a part slides by itself for half a micrometre, or hardly more."""
    device = ScriptedDevice(fpga)
    noise = 1.5e-6 * np.random.default_rng(1).standard_normal(2000)
    header = HEADER | {"stroke": 1.5e-3, "peak_force": 30.0, "sliding_distance": 0.5e-6}
    for pushed_m in (1.5e-3, 1.53e-3):
        position = pushed_m * np.clip(np.linspace(-0.5, 1.5, 2000), 0.0, 1.0) + noise
        device.complete({"force": np.linspace(0.0, 30.0, 50), "position": position}, **header)
    async with running(fpga, device) as (_, _, receptions):
        still, further = await anext(receptions), await anext(receptions)
    assert still.faults == ()
    assert any("sliding_distance" in fault for fault in further.faults), further.faults


@pytest.mark.parametrize(
    ("register", "change", "told"),
    [
        ("force", {"scale": 25.0}, "register peak_force (278): 214 N, but the samples of force show"),
        ("force", {"unit": "kN"}, "scale or unit of one of them is wrong in the map"),
        ("peak_force", {"unit": "mN"}, "register peak_force (278): 0.213 N"),
        (
            "position",
            {"unit": "um"},
            "register sliding_distance (280): 0.0042 m, but the samples of",
        ),
        ("sliding_distance", {"unit": "m"}, "register sliding_distance (280): 4.2e+03 m"),
    ],
)
async def test_a_wrong_scale_is_named(
    fpga: RegisterMap, register: str, change: dict[str, Any], told: str
) -> None:
    device = ScriptedDevice(fpga)
    make(device)
    wrong = RegisterMap(
        fpga.name, {**fpga.registers, register: replace(fpga[register], **change, saturation=None)}
    )
    async with running(wrong, device) as (_, _, receptions):
        received = await anext(receptions)
    assert any(told in fault and "is wrong in the map" in fault for fault in received.faults), received.faults
