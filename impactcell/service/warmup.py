"""A few cycles of the cell's own model before the first real one, so that all is compiled when it comes."""

import gc
import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from impactcell import cell as core
from impactcell.cell import CellDesign
from impactcell.journal.capture_codec import encode_capture
from impactcell.physics import TapInput, simulate_tap
from impactcell.records import Capture, Channel, PositioningState, uniform_times

CYCLES = 8
"""Cycles of warm-up: enough to learn a shortened signature and judge by it."""
FORCE_HZ, POSITION_HZ = 100_000.0, 10_000.0
"""Sampling rates of the cycles of warm-up; any that show contact and slide."""

_lock = threading.Lock()
_warm: set[tuple[object, ...]] = set()


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
