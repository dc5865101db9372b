"""Which cycle is read next when status block and window do not agree."""

import logging

import pytest

from impactcell.fieldbus.cycles.cycle_choice import CycleChoice
from impactcell.fieldbus.cycles.fetched_capture import NotFetched
from impactcell.fieldbus.cycles.status_block import StatusBlock
from impactcell.fieldbus.registers import RegisterMap
from impactcell.process.cell_logger import CellLogger
from impactcell.records import CycleId


@pytest.mark.parametrize(
    ("last", "oldest", "after_five"),
    [(CycleId(2, 3), 4, 5), (CycleId(1, 3), 1, 1)],
    ids=["in one life", "after a restart"],
)
def test_a_cycle_that_is_never_shown_is_passed_over_but_not_the_first_of_a_life(
    fpga: RegisterMap, last: CycleId, oldest: int, after_five: int
) -> None:
    """After a restart the window may still show the life before: its ring is not given up for that."""
    choice = CycleChoice(fpga, CellLogger(logging.getLogger(__name__), "cell-1"))
    status = StatusBlock("ready", 2, 16, tuple(range(1, 17)), None, None)
    for attempt in range(5):
        target = choice.target(last, status, float(attempt))
        assert target is not None
        assert (target.cycle_id, target.restarted) == (CycleId(2, oldest), last.session != 2)
        choice.record_failure(target, NotFetched.NOT_SHOWN, float(attempt))
    target = choice.target(last, status, 5.0)
    assert target is not None
    assert target.cycle_id == CycleId(2, after_five)
    choice.record_success()
    target = choice.target(last, status, 6.0)
    assert target is not None
    assert target.cycle_id == CycleId(2, oldest)
