"""A few cycles of the cell's own model before the first real one, so that all is compiled when it comes.

What only a change of the material or hundreds of cycles need is compiled while the first real ones come: on a
new machine it takes ten seconds, in which the cycle that needs it would wait.
"""

import gc
import threading
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from impactcell import cell as core
from impactcell.cell import CellDesign
from impactcell.journal.capture_codec import encode_capture
from impactcell.physics import TapInput, simulate_tap
from impactcell.records import Capture, Channel, PositioningState, uniform_times
from impactcell.service.factory import cell_design, positioning_cell, tap_planner
from impactcell.settings import CellConfig
from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import FrictionObservation, TrackerSettings, TrackerState

CYCLES = 8
"""Cycles of warm-up: enough to learn a shortened signature and judge by it."""
FORCE_HZ, POSITION_HZ = 100_000.0, 10_000.0
"""Sampling rates of the cycles of warm-up; any that show contact and slide."""

SERIES = 800
"""Estimates of friction that the tracker is given beside the first real cycles, ..."""
CHANGES = {60: 0.05, 300: 0.012, 500: -0.03}
"""... and cycles of it from which on they are higher by so much, ..."""
WEAR, RUN_IN = 1e-4, 720
"""... wear a cycle, and the cycle at which it ends, ..."""
ANNOUNCED, OUTLIER = 300, 30
"""... one of which begins another batch, said to be one; and a cycle that is an outlier."""

_lock, _changes_lock = threading.Lock(), threading.Lock()
_warm: set[tuple[object, ...]] = set()


def load_planners(cells: Iterable[CellConfig]) -> None:
    """Make the planner of each cell that positions, and forget it: its code is compiled or loaded then.

    Raises
    ------
    PositioningError
        A limit of a cell is one that no cell has.
    """
    for cell in cells:
        if cell.settings.positioning is not None:
            tap_planner(cell, positioning_cell(cell), cell_design(cell), cell.register_map)


def warm_up(design: CellDesign, stop: Callable[[], bool] = lambda: False) -> None:
    """Take cycles of the nominal plant through the whole pipeline, and forget them; `stop` ends it early.

    Once a process is enough for all cells that need the same code: many that start together are not kept from
    their modules by each other.
    """
    kind = (*design.model.plant.effects, design.tracker.batch, design.defaults.stroke_m is None)
    with _lock:
        if kind not in _warm and _run_cycles(design, stop):
            _warm.add(kind)
            # What has been loaded and compiled by now stays: looking through all of it for garbage would hold
            # up a cycle for a tenth of a second now and then.
            gc.collect()
            gc.freeze()


def warm_up_for_changes(design: CellDesign, stop: Callable[[], bool] = lambda: False) -> None:
    """Take a series with wear, changes and an outlier through the tracker, and forget it.

    Once a process, as `warm_up`; no other cell's first cycle waits for it.
    """
    kind = ("changes", design.tracker.batch)
    with _changes_lock:
        if kind not in _warm and _run_series(design.tracker, stop):
            _warm.add(kind)


def _run_series(settings: TrackerSettings, stop: Callable[[], bool]) -> bool:
    state, random = TrackerState(), np.random.default_rng(1)
    for cycle in range(1, SERIES + 1):
        if stop():
            return False
        change = sum(size for begin, size in CHANGES.items() if cycle >= begin)
        mu_s = (
            0.2 + WEAR * min(cycle, RUN_IN) + change + 0.05 * (cycle == OUTLIER) + random.normal(0.0, 0.002)
        )
        batch = "second" if cycle >= ANNOUNCED else "first"
        estimate = FrictionObservation(cycle, mu_s, 0.002, cycle * 10**9, batch)
        state = wear_batch.update(settings, state, estimate).state
    return True


def _run_cycles(design: CellDesign, stop: Callable[[], bool]) -> bool:
    design_for_warmup = replace(design, signature=replace(design.signature, learned_cycles=2))
    state = core.initial_state(design_for_warmup)
    for cycle in range(1, CYCLES + 1):
        if stop():
            return False
        capture = _capture(design_for_warmup, cycle)
        state = core.step(design_for_warmup, state, capture, PositioningState()).state
        encode_capture(capture)
    return True


def _capture(design: CellDesign, cycle: int) -> Capture:
    tap = TapInput(
        velocity_m_s=0.06,
        mass_kg=design.defaults.mass_kg or 18.9,
        stroke_m=design.defaults.stroke_m or float("inf"),
        halts_at_separation=design.defaults.stroke_m is None,
    )
    motion = simulate_tap(design.model.plant, tap)
    random = np.random.default_rng(cycle)
    force_s = uniform_times(0.0, FORCE_HZ, int(motion.separation_s * 1.2 * FORCE_HZ))
    position_s = uniform_times(0.0, POSITION_HZ, int((motion.stop_s * 1.1 + 0.005) * POSITION_HZ))
    force = motion.sample(force_s).force_n + random.normal(
        0.0, design.defaults.force_noise_std_n, len(force_s)
    )
    position = motion.sample(position_s).position_m + random.normal(
        0.0, design.defaults.position_noise_std_m, len(position_s)
    )
    return Capture(
        cycle=cycle,
        velocity_m_s=tap.velocity_m_s,
        mass_kg=tap.mass_kg,
        force=Channel(force_s, force, resolution=1e-3),
        position=Channel(position_s, position),
        stroke_m=tap.stroke_m,
        time_ns=cycle * 10**9,
    )
