"""A lasting condition takes two lines of the log, however long it lasts."""

import logging

import pytest

from impactcell.process.cell_logger import CellLogger
from impactcell.process.condition_log import QUIET_CYCLES, ConditionLog


def test_a_line_when_it_begins_and_one_when_it_is_over(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    log = ConditionLog(CellLogger(logging.getLogger("cell"), "press-1"))
    for cycle in range(1, 101):
        log.update([f"residuals are {8 + cycle / 7:.2f} times the noise"] if cycle % 2 else [], cycle)
    for cycle in range(101, 101 + QUIET_CYCLES):
        log.update(["another"], cycle)
    assert [record.getMessage() for record in caplog.records] == [
        "cell=press-1 cycle=1 residuals are 8.14 times the noise",
        "cell=press-1 cycle=101 another",
        "cell=press-1 over since cycle 100, 50 cycles from 1 on: residuals are 8.14 times the noise",
    ]


def test_one_cycle_is_one_and_the_last_of_many_is_no_condition_of_its_own(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    log = ConditionLog(CellLogger(logging.getLogger("cell"), "press-1"))
    for cycle in range(1, 4):
        log.update([f"learned in {4 - cycle} cycle{'s' * (cycle < 3)}", *(["odd"] * (cycle == 2))], cycle)
    log.update([], 3 + QUIET_CYCLES)
    assert [record.getMessage() for record in caplog.records] == [
        "cell=press-1 cycle=1 learned in 3 cycles",
        "cell=press-1 cycle=2 odd",
        "cell=press-1 over since cycle 4, 3 cycles from 1 on: learned in 3 cycles",
        "cell=press-1 over since cycle 3, 1 cycle from 2 on: odd",
    ]


def test_a_module_that_counts_anew_ends_what_was(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    log = ConditionLog(CellLogger(logging.getLogger("cell"), "press-1"))
    for cycle in (1000, 1, 2):
        log.update(["it"], cycle)
    assert len(caplog.records) == 1
    log.update([], 2 + QUIET_CYCLES)
    assert caplog.records[-1].getMessage().startswith("cell=press-1 over since cycle 3, 3 cycles")
