"""A change that was said calls nobody: by whomever it was said, whatever its first capture holds."""

from dataclasses import replace

import numpy as np
import pytest

from impactcell import cell as core
from impactcell.cell import CellDesign, CellState
from impactcell.records import BatchAnnouncement, Capture, PositioningState
from impactcell.service.factory import cell_design
from impactcell.settings import read_cell
from impactcell.tracking.wear_batch import BatchKnowledge
from tests.integration.processes import CONFIG
from tests.taps import Tap

pytestmark = pytest.mark.slow

SECOND = 10**9
AT = 44
"""First cycle after a change."""


@pytest.fixture(scope="module")
def design() -> CellDesign:
    design = cell_design(read_cell(CONFIG / "cells" / "prototype.yaml"))
    return replace(design, signature=replace(design.signature, learned_cycles=12))


def capture(cycle: int, mu_s: float, batch_id: str | None = None, session: int = 3) -> Capture:
    draw = np.random.default_rng([cycle, 9])
    tap = Tap(0.06, mu_s * (1.0 + 0.004 * draw.standard_normal()), stroke_m=1.5e-3)
    seen = tap.capture(draw, cycle=cycle)
    return replace(seen, time_ns=(cycle + 5) * SECOND, batch_id=batch_id, session=session)


@pytest.fixture(scope="module")
def learned(design: CellDesign) -> CellState:
    state = core.initial_state(design)
    for cycle in range(1, AT):
        state = core.step(design, state, capture(cycle, 0.2, "A"), PositioningState()).state
    return state


def called(
    design: CellDesign,
    state: CellState,
    captures: list[Capture],
    announcement: BatchAnnouncement | None = None,
) -> list[str]:
    """Conditions that came active."""
    found = []
    for each in captures:
        done = core.step(design, state, each, PositioningState(), announcement)
        state = done.state
        found += [alarm.name for alarm in done.changed if alarm.active]
    return found


def changed(batch_id: str | None, *, unreadable: bool) -> list[Capture]:
    captures = [capture(cycle, 0.22, batch_id) for cycle in range(AT, AT + 14)]
    if unreadable:
        captures[0] = replace(captures[0], force=None, position=None)
    return captures


@pytest.mark.parametrize("unreadable", [False, True], ids=["whole", "first capture unreadable"])
@pytest.mark.parametrize("batch_id", ["A", "B"])
@pytest.mark.parametrize("batch", BatchKnowledge)
def test_a_change_that_the_plc_announced_calls_nobody(design, learned, batch, batch_id, unreadable):
    """Under the same name a false DeviantCycle came, and with its first capture unreadable a BatchShift."""
    design = replace(design, tracker=replace(design.tracker, batch=batch))
    captures = changed(batch_id, unreadable=unreadable)
    assert called(design, learned, captures, BatchAnnouncement(1, AT, "B")) == []
    assert "BatchShift" in called(design, learned, captures)


@pytest.mark.parametrize("unreadable", [False, True], ids=["whole", "first capture unreadable"])
def test_a_change_that_a_person_said_or_another_model_is_calls_nobody(design, learned, unreadable):
    captures = changed("A", unreadable=unreadable)
    assert called(design, core.start_batch(learned, "B", expected=True), captures) == []
    assert called(design, replace(learned, model_changed=True), captures) == []


def test_a_surface_that_was_renewed_is_no_deviant_cycle(design, learned):
    """The first tap after a reset of wear was one, and its alarm stood for twenty cycles."""
    fresh = core.reset_wear_level(learned, AT)
    before, after = learned.signature.reference, fresh.signature.reference
    assert (before.weight > 0.0, after.weight) == (True, 0.0)
    assert after.variation is before.variation
    captures = [capture(cycle, 0.16, "A") for cycle in range(AT, AT + 14)]
    assert called(design, fresh, captures) == []
    assert "DeviantCycle" in called(design, replace(fresh, signature=learned.signature), captures)


@pytest.mark.parametrize("shown", ["nothing first", "at once"])
def test_the_first_announcement_to_a_module_that_has_started_anew_counts(design, learned, shown):
    """One whose number was the last that had been seen was taken for the one before the start."""
    state = learned
    for cycle in (AT, AT + 1):
        done = core.step(
            design, state, capture(cycle, 0.2, "A"), PositioningState(), BatchAnnouncement(1, AT)
        )
        state = done.state
    assert state.batch.last_announcement == 1
    expected = []
    for cycle in range(1, 6):
        told = None if shown == "nothing first" and cycle < 3 else BatchAnnouncement(1, 4, "B")
        again = replace(capture(cycle, 0.2, "A", session=4), time_ns=(AT + 6 + cycle) * SECOND)
        named = core.step(design, state, again, PositioningState(), told)
        state = named.state
        expected.append(state.alarms.suppressed_cycles == design.alarms.announced_cycles)
    assert expected == [False, False, False, True, False]


def test_an_announcement_that_is_still_shown_counts_once(design, learned):
    state = learned
    for cycle in range(AT, AT + 6):
        done = core.step(
            design, state, capture(cycle, 0.2, "A"), PositioningState(), BatchAnnouncement(1, AT)
        )
        state = done.state
    assert state.alarms.suppressed_cycles == design.alarms.announced_cycles - 5
