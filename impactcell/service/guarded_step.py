"""One cycle through the pipeline, whatever its capture holds, and not more of them at a time than help."""

import os
import threading
from dataclasses import replace

from impactcell import cell as core
from impactcell.cell import CellDesign, CellState, StepResult
from impactcell.process.cell_logger import CellLogger
from impactcell.records import BatchAnnouncement, Capture, PositioningState

_CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
"""Cores that this process may use."""
_computing = threading.BoundedSemaphore(_CORES)
"""As many cells compute at a time as there are cores, in the order in which they came: more would finish
later, all of them, and keep the event loop waiting for the interpreter."""


def guarded_step(
    log: CellLogger,
    design: CellDesign,
    state: CellState,
    capture: Capture,
    positioning: PositioningState,
    announcement: BatchAnnouncement | None,
    faults: tuple[str, ...],
    *,
    restarted: bool,
) -> StepResult:
    """Take a cycle through `cell.step`; one that cannot be computed counts, without its content."""
    with _computing:
        try:
            return core.step(design, state, capture, positioning, announcement, faults, restarted=restarted)
        except Exception as error:
            # A capture that nobody foresaw must not stop the cell.
            log.exception("cannot be computed; it counts as unreadable", cycle=capture.cycle)
            reason = f"cannot be computed ({type(error).__name__}: {error})"
            fault = f"{design.name}: cycle {capture.cycle}: {reason}"
            empty = replace(capture, force=None, position=None, actuator=None, summary=None)
            return core.step(
                design, state, empty, positioning, announcement, (*faults, fault), restarted=restarted
            )
