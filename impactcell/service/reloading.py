"""What a running cell takes over from its files, and when they have changed."""

from dataclasses import replace

from impactcell.process.cell_logger import CellLogger
from impactcell.settings import CellConfig, read_cell

UNCHANGEABLE = (
    *("cell", "module", "opcua", "web", "journal", "monitoring", "identification", "positioning"),
)
"""Sections of a cell file that only a restart takes over."""


def reloaded_cell(cell: CellConfig, log: CellLogger) -> CellConfig:
    """Read the files of a running cell again; what only a restart takes over stays, and is told.

    Raises
    ------
    ImpactCellError
        They cannot be read, or have faults.
    """
    reloaded = read_cell(cell.path)
    unchangeable = {
        name: getattr(cell.settings, name)
        for name in UNCHANGEABLE
        if getattr(reloaded.settings, name) != getattr(cell.settings, name)
    }
    told = [*unchangeable]
    if "module" not in unchangeable and reloaded.register_map != cell.register_map:
        told.append(f"what {reloaded.settings.module.register_map} says")
    if told:
        log.warning("changed, but taken over only by a restart: %s", ", ".join(told))
    return replace(cell, settings=reloaded.settings.model_copy(update=unchangeable), model=reloaded.model)


def model_time_ns(cell: CellConfig) -> int:
    """When the model file was written; 0 while it is being replaced, or cannot be seen."""
    try:
        return cell.settings.model.stat().st_mtime_ns
    except OSError:
        return 0
