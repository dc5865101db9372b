"""Cells that a service begins together do not all do at the same cycle what takes as long as several."""

from collections import Counter
from dataclasses import replace

import pytest

from impactcell.service.factory import COMMISSIONED_APART, cell_design
from impactcell.settings import read_cell
from tests.integration.processes import CONFIG

CELLS = 48


def delay(name: str) -> int:
    cell = read_cell(CONFIG / "cells" / "prototype.yaml")
    settings = cell.settings.model_copy(update={"cell": name})
    return cell_design(replace(cell, settings=settings)).tracker.commissioning_delay


@pytest.mark.slow
def test_cells_are_spread_over_the_cycles_that_there_are_for_it() -> None:
    cells_at = Counter(delay(f"cell-{number}") for number in range(CELLS))
    assert set(cells_at) <= set(range(COMMISSIONED_APART))
    assert max(cells_at.values()) <= 4


def test_a_cell_does_it_at_the_same_cycle_whenever_it_is_replayed() -> None:
    assert delay("press-1") == delay("press-1") == 12
