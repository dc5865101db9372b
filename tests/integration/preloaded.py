"""Imported where `forked` forks off: what a cell computes with is compiled once, not in each life."""

from impactcell.service.factory import cell_design
from impactcell.service.warmup import warm_up
from impactcell.settings import read_cell
from tests.integration.processes import CONFIG

warm_up(cell_design(read_cell(CONFIG / "cells" / "prototype.yaml")), lambda: False)
