"""What is compiled when: the first cycle need not wait, and neither need the first change of material."""

import asyncio
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from impactcell.cell import CellDesign
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.service import warmup
from impactcell.service.factory import cell_design
from impactcell.service.worker import CellWorker
from impactcell.settings import read_cell
from tests.integration.processes import CONFIG
from tests.patience import PATIENCE_S

COMPILES_NOTHING_MORE = """
import gc
from dataclasses import replace
import numpy as np
from numba.core.registry import CPUDispatcher
from impactcell.service.factory import cell_design
from impactcell.service.warmup import warm_up, warm_up_for_changes
from impactcell.settings import read_cell
from impactcell.tracking.wear_batch import FrictionObservation, TrackerState, update
from tests.integration.processes import CONFIG

design = cell_design(read_cell(CONFIG / "cells" / "demo.yaml"))
warm_up(design)
gc.unfreeze()
functions = [one for one in gc.get_objects() if isinstance(one, CPUDispatcher)]

def compiled():
    return {(one.py_func.__module__, one.py_func.__name__, len(one.overloads)) for one in functions}

for batch in type(design.tracker.batch):
    settings = replace(design.tracker, batch=batch)
    warm_up_for_changes(replace(design, tracker=settings))
    before, state, random = compiled(), TrackerState(), np.random.default_rng(7)
    for cycle in range(1, 1501):
        step = 0.01 * (cycle > 90) - 0.02 * (cycle > 700)
        mu_s = 0.15 + 1e-4 * min(cycle, 1200) + step + 0.001 * random.normal()
        given = FrictionObservation(cycle, mu_s, 0.001, cycle * 10**9, "A" if cycle <= 700 else "B")
        state = update(settings, state, given).state
    assert state.rate_change is not None
    print(sorted(compiled() - before))
"""


@pytest.mark.slow
def test_after_both_warm_ups_a_tracker_compiles_nothing_more() -> None:
    """A demo stood still for 12 s on a new machine, just when its material had changed."""
    done = subprocess.run(
        [sys.executable, "-c", COMPILES_NOTHING_MORE], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == ["[]", "[]"]


async def test_cycles_do_not_wait_for_what_only_a_change_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, may_end, ended = threading.Event(), threading.Event(), asyncio.Event()
    loop = asyncio.get_running_loop()

    def compiling(_: CellDesign, stop: Callable[[], bool]) -> None:
        begun.set()
        may_end.wait()
        assert not stop()
        loop.call_soon_threadsafe(ended.set)

    monkeypatch.setattr("impactcell.service.worker.warm_up", lambda *_: None)
    monkeypatch.setattr("impactcell.service.worker.warm_up_for_changes", compiling)
    design = cell_design(read_cell(CONFIG / "cells" / "prototype.yaml"))
    worker = CellWorker(design, Journal(tmp_path / "j", "c"), Retention())
    await worker.warm_up()
    await asyncio.to_thread(begun.wait)
    may_end.set()
    await ended.wait()
    await worker.close()


def test_no_other_cell_waits_for_its_first_cycle_while_one_compiles_for_changes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begun, may_end = threading.Event(), threading.Event()

    def compiling(*_: object) -> bool:
        begun.set()
        return may_end.wait()

    monkeypatch.setattr(warmup, "_warm", set())
    monkeypatch.setattr(warmup, "_run_series", compiling)
    monkeypatch.setattr(warmup, "_run_cycles", lambda *_: False)
    design = cell_design(read_cell(CONFIG / "cells" / "prototype.yaml"))
    first = threading.Thread(target=warmup.warm_up_for_changes, args=(design,))
    second = threading.Thread(target=warmup.warm_up, args=(design,), daemon=True)
    first.start()
    begun.wait()
    second.start()
    second.join(PATIENCE_S)
    waited = second.is_alive()
    may_end.set()
    first.join()
    second.join()
    assert not waited
