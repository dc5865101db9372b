"""A module whose clock is not set, as without a battery after power-up: its cycles have dates anyway."""

import logging
import re
import time
from dataclasses import replace

import pytest

from impactcell.fieldbus.cycles.cycle_dates import CycleDates, clock_ahead
from impactcell.fieldbus.cycles.decoding import empty_capture
from impactcell.fieldbus.registers import RegisterMap
from impactcell.process.cell_logger import CellLogger
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import HEADER, make, running

SECOND = 10**9


@pytest.mark.parametrize("shown_ns", [0, 90 * SECOND], ids=["not set", "counting from power-up"])
async def test_a_cycle_of_a_clock_that_is_not_set_was_made_when_it_was_read(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture, shown_ns: int
) -> None:
    device = ScriptedDevice(fpga)
    async with running(fpga, device) as (_, _module, receptions):
        for cycle in range(3):
            before_ns = time.time_ns()
            make(device, cycle_time=shown_ns and shown_ns + cycle * SECOND)
            received = await anext(receptions)
            assert received.faults == ()
            assert before_ns <= received.capture.time_ns <= time.time_ns()
    (told,) = [record for record in caplog.records if "not set" in record.getMessage()]
    assert told.levelno == logging.WARNING
    assert told.getMessage() == (
        "cell=cell-1 cycle=1 register cycle_time (264) shows no date, as of a clock that is not set. Until "
        "it does, a cycle has the time at which it was read; set the module's clock"
    )


async def test_a_clock_that_is_set_later_counts_from_then_on_and_only_then(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    device = ScriptedDevice(fpga)
    set_ns = HEADER["cycle_time"]
    times_ns, began_ns = [], time.time_ns()
    async with running(fpga, device) as (_, _module, receptions):
        for shown_ns in (0, set_ns, set_ns + SECOND, 0):
            make(device, cycle_time=shown_ns)
            times_ns.append((await anext(receptions)).capture.time_ns)
    assert times_ns[1:3] == [set_ns, set_ns + SECOND]
    assert began_ns <= times_ns[0] <= times_ns[3] <= time.time_ns()
    assert sum("not set" in record.getMessage() for record in caplog.records) == 1


async def test_a_cycle_that_cannot_be_read_says_nothing_of_the_clock(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    device = ScriptedDevice(fpga)
    make(device, capture_crc32=12345)
    make(device, fpga.slots // 2)
    began_ns = time.time_ns()
    async with running(fpga, device) as (_, module, receptions):
        received = await anext(receptions)
        assert module.status.unreadable == 1
    assert received.faults
    assert began_ns <= received.capture.time_ns <= time.time_ns()
    assert not any("not set" in record.getMessage() for record in caplog.records)


HOUR = 3600 * SECOND


@pytest.mark.parametrize(
    ("ahead_ns", "said", "way_out"),
    [
        (2 * HOUR, "2 h 0 min", "or say `unit: ns, offset: -7200000000000` at cycle_time in map fpga-v1"),
        (5 * HOUR + 45 * 60 * SECOND, "5 h 45 min", "offset: -20700000000000`"),
        (24 * HOUR, "24 h 0 min", "set the module's clock to UTC"),
        (10 * 60 * SECOND, "0 h 10 min", "set the module's clock to UTC"),
    ],
)
async def test_a_clock_that_is_ahead_is_told_once_with_the_way_out(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture, ahead_ns: int, said: str, way_out: str
) -> None:
    """The time of a cycle stays the module's."""
    device = ScriptedDevice(fpga)
    async with running(fpga, device) as (_, _module, receptions):
        for ahead in (ahead_ns, ahead_ns, 0, ahead_ns):
            shown_ns = time.time_ns() + ahead
            make(device, cycle_time=shown_ns)
            assert (await anext(receptions)).capture.time_ns == shown_ns
    (text,) = [record.getMessage() for record in caplog.records if "ahead" in record.getMessage()]
    assert f"register cycle_time (264) shows a time {said} ahead of this machine's UTC" in text
    assert way_out in text
    assert ("offset" in text) == ("offset" in way_out)


def tell(dates: CycleDates, ahead_ns: int, now_s: float, *, restarted: bool = False) -> None:
    """A newest cycle by a clock that is so far ahead."""
    capture = replace(empty_capture(7), time_ns=time.time_ns() + ahead_ns)
    dates.dated(capture, readable=True, is_newest=True, restarted=restarted, now_s=now_s)


def test_a_clock_that_leaps_to_and_fro_is_told_once_an_hour(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    dates = CycleDates(fpga, CellLogger(logging.getLogger(__name__), "cell-1"))
    for cycle in range(100):
        tell(dates, 2 * HOUR * (cycle % 2) * (1 + cycle), now_s=50.0 + 90.0 * cycle)
    assert len(caplog.records) == 3


def test_a_clock_that_is_years_behind_is_told_once_with_the_way_out(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture
) -> None:
    """By no cycle that may be as old: the newest one at the start, and after a restart of the module."""
    dates = CycleDates(fpga, CellLogger(logging.getLogger(__name__), "cell-1"))
    years_ns = 400 * 24 * HOUR
    tell(dates, -years_ns, 0.0)
    tell(dates, -years_ns, 1.0, restarted=True)
    tell(dates, 0, 2.0)
    tell(dates, -300 * 24 * HOUR, 3.0)
    assert not caplog.records
    for second in range(5):
        tell(dates, -years_ns, 10.0 + second)
    (told,) = caplog.records
    assert told.getMessage() == (
        "cell=cell-1 cycle=7 register cycle_time (264) shows a time 400 days behind this machine's UTC: "
        "cycles and alarms are dated in the past; set the module's clock to UTC"
    )


def test_the_offset_of_a_local_time_is_in_the_unit_of_its_register(fpga: RegisterMap) -> None:
    """What is proposed takes the time back: decoded with it, the register shows UTC."""
    utc_s, zone_s = 1_795_000_000.0, 7200.0
    for change in ({"unit": "ms"}, {"unit": "s", "offset": 900.0}, {"unit": "us", "scale": 10.0}, {}):
        clock = replace(fpga["cycle_time"], **change)
        layout = replace(fpga, registers={**fpga.registers, "cycle_time": clock})
        (proposed,) = re.findall(r"`(.*?)`", clock_ahead(layout, zone_s))
        entry = dict(part.split(": ") for part in proposed.split(", "))
        put_right = replace(clock, unit=entry.get("unit", clock.unit), offset=float(entry["offset"]))
        shown = clock.decode(clock.encode(utc_s + zone_s if change else int((utc_s + zone_s) * 1e9)))
        assert shown == pytest.approx((utc_s + zone_s) * (1.0 if change else 1e9))
        words = clock.encode(utc_s + zone_s if change else int((utc_s + zone_s) * 1e9))
        assert put_right.decode(words) == pytest.approx(utc_s, abs=1e-3)


def test_a_clock_that_is_right_or_behind_is_not_ahead(fpga: RegisterMap) -> None:
    assert [clock_ahead(fpga, ahead_s) for ahead_s in (-7200.0, 0.0, 59.0)] == ["", "", ""]
