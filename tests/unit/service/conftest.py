"""A positioning task of the shipped positioning cell, with a module that shows what a test tells it to."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio

from impactcell.service.positioning import PositioningTask
from impactcell.settings import CellConfig, read_cell
from tests.integration.processes import CONFIG
from tests.told_module import ToldModule, task_of, worker_of


@pytest.fixture(scope="module")
def cell() -> CellConfig:
    return read_cell(CONFIG / "cells" / "positioning.yaml")


@pytest.fixture
def module(cell: CellConfig) -> ToldModule:
    return ToldModule.of(cell)


@pytest_asyncio.fixture
async def task(tmp_path: Path, cell: CellConfig, module: ToldModule) -> AsyncIterator[PositioningTask]:
    worker = worker_of(cell, tmp_path / "j")
    yield task_of(cell, module, worker)
    await worker.close()
