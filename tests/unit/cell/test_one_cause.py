"""One cause, one alarm: a batch, a part, an effect that the model lacks, a model that is taken over."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from impactcell import cell as core
from impactcell.cell import CellDesign, CellState
from impactcell.records import PositioningState
from impactcell.service.factory import cell_design
from impactcell.settings import read_cell
from impactcell.tracking.wear_batch import BatchKnowledge
from tests.integration.processes import CONFIG
from tests.taps import VISCOUS, Tap

pytestmark = pytest.mark.slow

STRIBECK: dict[str, Any] = {
    "stribeck_friction": {"friction_increase": 0.05, "stribeck_velocity_m_s": 0.04},
}
PATCH: dict[str, Any] = {"friction_patch": {"amplitude": 0.5, "position_m": 0.001, "width_m": 0.0004}}
SCATTER = 0.012
LEARNED = 70


@dataclass
class Cell:
    """A cell, and what its alarms did: (cycle, condition, whether it is active)."""

    design: CellDesign
    state: CellState
    cycle: int = 0
    batch_id: str | None = None

    def run(
        self, cycles: int, friction: Callable[[int], float] = lambda _: 0.2, effects: dict[str, Any] = VISCOUS
    ) -> list[tuple[int, str, bool]]:
        moved = []
        for n in range(cycles):
            self.cycle += 1
            draw = np.random.default_rng([self.cycle, 5])
            mu_s = friction(n) * (1.0 + SCATTER * draw.standard_normal())
            tap = Tap(0.06, mu_s, stroke_m=1.5e-3, effects=effects)
            capture = replace(
                tap.capture(draw, cycle=self.cycle), time_ns=self.cycle * 10**9, batch_id=self.batch_id
            )
            done = core.step(self.design, self.state, capture, PositioningState())
            self.state = done.state
            moved += [(self.cycle, alarm.name, alarm.active) for alarm in done.changed]
        return moved


def learned(name: str, batch_id: str | None = None) -> Cell:
    design = cell_design(read_cell(CONFIG / "cells" / name))
    knowledge = BatchKnowledge.UNKNOWN if batch_id is None else BatchKnowledge.KNOWN
    design = replace(design, tracker=replace(design.tracker, batch=knowledge))
    cell = Cell(design, core.initial_state(design), batch_id=batch_id)
    assert cell.run(LEARNED) == []
    return cell


@pytest.fixture(scope="module")
def watching() -> Cell:
    return learned("prototype.yaml")


@pytest.mark.parametrize("step", [0.1, 0.25])
def test_an_unannounced_batch_calls_once(watching: Cell, step: float) -> None:
    moved = replace(watching).run(12, lambda _: 0.2 * (1.0 + step))
    assert [(name, active) for _, name, active in moved] == [("BatchShift", True)]


def test_a_deviant_cycle_after_a_batch_is_told_while_the_batch_still_is(watching: Cell) -> None:
    cell = replace(watching)
    assert [name for _, name, _ in cell.run(20, lambda _: 0.22)] == ["BatchShift"]
    moved = cell.run(1, lambda _: 0.22, VISCOUS | PATCH) + cell.run(6, lambda _: 0.22)
    assert ("DeviantCycle", True) in [(name, active) for _, name, active in moved]
    assert cell.state.alarms.alarm("BatchShift").active


def test_a_part_that_is_odd_as_a_whole_is_told_when_it_is_sure_that_no_batch_follows(watching: Cell) -> None:
    moved = replace(watching).run(8, lambda n: 0.2 * (1.2 if n == 0 else 1.0))
    assert moved[0] == (LEARNED + 6, "DeviantCycle", True)
    assert [(name, active) for _, name, active in moved[1:]] == [("DeviantCycle", False)]


@pytest.mark.parametrize("batch_id", [None, "A"])
def test_an_effect_and_the_model_that_takes_it_over(batch_id: str | None) -> None:
    cell = learned("new-effect.yaml", batch_id)
    appeared = cell.run(15, effects=VISCOUS | STRIBECK)
    assert [(name, active) for _, name, active in appeared] == [("ModelGap", True)]
    plant = replace(cell.design.model.plant, effects=VISCOUS | STRIBECK)
    cell.design = replace(cell.design, model=replace(cell.design.model, plant=plant, name="extended"))
    cell.state = core.migrate_state(cell.design, cell.state, 0)
    assert cell.state.model_changed
    level = cell.state.tracker.filter.mean[0] if cell.state.tracker.filter is not None else None
    after = cell.run(32, effects=VISCOUS | STRIBECK)
    assert not any(active for _, _, active in after)
    assert ("ModelGap", False) in [(name, active) for _, name, active in after]
    if batch_id is not None:
        # the level goes on from where it was: what the other model made of the estimates is an offset
        assert cell.state.tracker.filter is not None
        assert abs(cell.state.tracker.filter.mean[0] - level) < 0.01


def test_the_same_model_again_is_no_change(watching: Cell) -> None:
    assert core.migrate_state(watching.design, watching.state, 0) is watching.state
