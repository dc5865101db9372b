"""A stop while the service starts: it ends then, what was opened is closed, and it says so."""

import asyncio
import logging
import threading
from pathlib import Path
from typing import Any

import pytest

from impactcell.journal.store import Journal
from impactcell.process.stopping import STOPPED_EARLY
from impactcell.scada import Server
from impactcell.service import Service, service
from impactcell.service.cell_task import CellTask
from impactcell.settings import read_cells
from tests.integration.processes import write_cell
from tests.patience import PATIENCE_S


async def stopped(paths: list[Path], stop: asyncio.Event) -> Service:
    """Run a service that is stopped while it starts."""
    stopped_early, started = Service(read_cells(paths)), asyncio.Event()
    async with asyncio.timeout(PATIENCE_S):
        await stopped_early.run(stop, started.set)
    assert not started.is_set()
    return stopped_early


def is_free(journal: Path, cell: str) -> bool:
    """Open a journal that nobody else may have open."""
    with Journal(journal, cell) as opened:
        return opened.cell == cell


async def test_a_stop_does_not_wait_for_what_compiles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    stop, compiled, loop = asyncio.Event(), threading.Event(), asyncio.get_running_loop()

    def compile_for_ever(_: object) -> None:
        loop.call_soon_threadsafe(stop.set)
        compiled.wait()

    monkeypatch.setattr(service, "load_planners", compile_for_ever)
    with caplog.at_level(logging.INFO):
        early = await stopped([write_cell(tmp_path, 1)], stop)
    compiled.set()
    assert early.running == {}
    assert not (tmp_path / "press-1.sqlite").exists()
    assert caplog.messages == [STOPPED_EARLY]


async def test_the_cell_that_is_being_made_is_closed_and_no_other_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    given = threading.Event()

    def make(*arguments: Any) -> CellTask:
        loop.call_soon_threadsafe(lambda: (stop.set(), loop.call_soon(given.set)))
        assert given.wait(PATIENCE_S), "the loop does not run while a cell is made"
        return CellTask(*arguments)

    monkeypatch.setattr(service, "CellTask", make)
    paths = [write_cell(tmp_path, 1, "press-1"), write_cell(tmp_path, 2, "press-2")]
    early = await stopped(paths, stop)
    assert [*early.running] == ["press-1"]
    assert is_free(tmp_path / "press-1.sqlite", "press-1")
    assert not (tmp_path / "press-2.sqlite").exists()


async def test_a_stop_while_the_server_is_built_closes_the_cells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop = asyncio.Event()

    async def build_for_ever(*_: object) -> None:
        stop.set()
        await asyncio.Event().wait()

    monkeypatch.setattr(Server, "_built", build_for_ever)
    early = await stopped([write_cell(tmp_path, 1)], stop)
    assert [*early.running] == ["press-1"]
    assert is_free(tmp_path / "press-1.sqlite", "press-1")
