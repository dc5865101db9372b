"""A cell's YAML file as frozen models; every fault at once, with file, line and column."""

from impactcell.settings.cells import CellConfig, read_cell, read_register_map
from impactcell.settings.one_process import read_cells
from impactcell.settings.sections import CellSettings, schema

__all__ = ["CellConfig", "CellSettings", "read_cell", "read_cells", "read_register_map", "schema"]
