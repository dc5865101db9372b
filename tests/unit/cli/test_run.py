"""`impactcell run` looks for no garbage until it has started, and leaves the interpreter as it was."""

import gc
from pathlib import Path

import pytest

from impactcell.cli.app import run
from impactcell.errors import ImpactCellError


def test_a_start_that_fails_leaves_the_collector_on(tmp_path: Path) -> None:
    with pytest.raises(ImpactCellError):
        run([tmp_path / "there-is-none.yaml"])
    assert gc.isenabled()


def test_the_collector_rests_while_the_service_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    enabled: list[bool] = []
    monkeypatch.setattr("impactcell.settings.read_cells", lambda cells: cells)
    monkeypatch.setattr("impactcell.service.run", lambda _: enabled.append(gc.isenabled()))
    run([])
    assert (enabled, gc.isenabled()) == ([False], True)
