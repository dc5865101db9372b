"""What positioning has learned is there after a restart, and a new task plans with it."""

from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from impactcell import cell as core
from impactcell.fieldbus.acquisition import ModuleAcquisition
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.transports import transport_for
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.positioning import PlannerPosterior
from impactcell.positioning.model_hypotheses import join, parts_of
from impactcell.records import PositioningState
from impactcell.service.factory import cell_design
from impactcell.service.positioning import PositioningTask
from impactcell.service.worker import CellWorker
from impactcell.settings import CellConfig, read_cell
from tests.integration.processes import CONFIG
from tests.snapshots import make_capture, make_snapshot


@pytest.fixture(scope="module")
def cell() -> CellConfig:
    return read_cell(CONFIG / "cells" / "positioning.yaml")


def task_of(cell: CellConfig, design: core.CellDesign, worker: CellWorker) -> PositioningTask:
    client = ModbusClient(transport_for(cell.settings.module.link))
    module = ModuleAcquisition(cell.name, client, cell.register_map)
    return PositioningTask(cell, design, module, worker, lambda: None)


def assert_same(posterior: PlannerPosterior, expected: PlannerPosterior) -> None:
    for name in ("weights", "means", "covs", "scatter_weights", "hypotheses"):
        np.testing.assert_array_equal(getattr(posterior, name), getattr(expected, name))
    assert posterior.uncounted_evidence == expected.uncounted_evidence
    assert (posterior.taps, posterior.surprise) == (expected.taps, expected.surprise)


async def test_the_planner_goes_on_after_a_restart(tmp_path: Path, cell: CellConfig) -> None:
    design = cell_design(cell)
    first = CellWorker(design, Journal(tmp_path / "j", cell.name), Retention())
    task = task_of(cell, design, first)
    untaught = task.belief
    learned = PlannerPosterior(
        untaught.weights,
        1.01 * untaught.means,
        0.5 * untaught.covs,
        untaught.scatter_weights,
        taps=7,
        surprise=0.25,
        hypotheses=untaught.hypotheses,
        uncounted_evidence=1.5,
    )
    first.belief = learned
    await first.process(make_capture(1), PositioningState(), None)
    await first.close()
    second = CellWorker(design, Journal(tmp_path / "j", cell.name), Retention())
    assert second.belief is not None
    assert_same(second.belief, learned)
    assert_same(task_of(cell, design, second).belief, learned)
    await second.close()
    with pytest.raises(AssertionError):
        assert_same(untaught, learned)


async def test_a_model_that_is_accepted_clears_what_taps_said_of_the_one_before(
    tmp_path: Path, cell: CellConfig
) -> None:
    design = cell_design(cell)
    worker = CellWorker(design, Journal(tmp_path / "j", cell.name), Retention())
    task = task_of(cell, design, worker)
    learned = task.belief
    lacking = join(parts_of(learned), np.array([1e-6, 1e-6, 1e-6, 1.0]), learned)
    worker.belief = lacking
    task = task_of(cell, design, worker)
    assert task.state.predictions.lacking
    await task.redesign(cell, design)  # settings were read again, the model is the same
    assert task.state.predictions.lacking
    plant = replace(design.model.plant, stiffness_n_per_m=1.01 * design.model.plant.stiffness_n_per_m)
    await task.redesign(cell, replace(design, model=replace(design.model, plant=plant)))
    assert not task.state.predictions.lacking
    assert worker.belief is task.belief
    await worker.close()


@pytest.mark.parametrize("accepted", [True, False], ids=["another model", "the same model"])
async def test_a_model_that_was_accepted_while_the_service_did_not_run_clears_it_too(
    tmp_path: Path, cell: CellConfig, *, accepted: bool
) -> None:
    """ModelGap went on asking for the workflow whose model was in service."""
    design = cell_design(cell)
    worker = CellWorker(design, Journal(tmp_path / "j", cell.name), Retention())
    learned = task_of(cell, design, worker).belief
    worker.belief = join(parts_of(learned), np.array([1e-6, 1e-6, 1e-6, 1.0]), replace(learned, taps=9))
    await worker.process(make_capture(1), PositioningState(), None)
    await worker.close()
    if accepted:
        plant = design.model.plant
        plant = replace(plant, stiffness_n_per_m=1.01 * plant.stiffness_n_per_m)
        design = replace(design, model=replace(design.model, plant=plant))
    for _ in range(2):  # no cycle comes in the first of the two starts
        worker = CellWorker(design, Journal(tmp_path / "j", cell.name), Retention())
        task = task_of(cell, design, worker)
        assert (task.belief.taps, task.state.predictions.lacking) == (9, not accepted)
        await worker.close()


async def test_a_shift_of_the_batch_before_a_restart_is_no_news_after_it(
    tmp_path: Path, cell: CellConfig
) -> None:
    """What taps have shown of the friction would be given up for it."""
    design = cell_design(cell)
    worker = CellWorker(design, Journal(tmp_path / "j", cell.name), Retention())
    snapshot = make_snapshot(make_capture(7))
    shifted = replace(snapshot, batch=replace(snapshot.batch, last_shift_cycle=5))
    worker._snapshot = shifted
    task = task_of(cell, design, worker)
    with patch.object(type(task._planner.taps), "observe_friction") as told:
        task.update_friction(shifted)
        task.update_friction(replace(shifted, batch=replace(shifted.batch, last_shift_cycle=8)))
    assert [call.kwargs["batch_changed"] for call in told.call_args_list] == [False, True]
    await worker.close()
