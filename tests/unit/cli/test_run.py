"""`impactcell run` until it has started: it looks for no garbage, and a stop ends it with a word."""

import gc
import subprocess
import sys
from pathlib import Path

import pytest

from impactcell.cli.app import run
from impactcell.errors import ImpactCellError
from impactcell.process.stopping import STOPPED_EARLY

STOPPED_AT = """
import os, signal, sys

signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background is born to ignore it

class Stop:
    def find_spec(self, name, *_):
        if name == sys.argv[2]:
            os.kill(os.getpid(), getattr(signal, sys.argv[1]))

sys.meta_path.insert(0, Stop())
from impactcell.__main__ import main
main(sys.argv[3:])
"""


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


@pytest.mark.parametrize(("number", "code"), [("SIGTERM", 0), ("SIGINT", 130)])
def test_a_stop_while_it_is_loaded_is_told(number: str, code: int) -> None:
    done = subprocess.run(
        [sys.executable, "-c", STOPPED_AT, number, "impactcell.service", "run", "cell.yaml"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr == f"INFO {STOPPED_EARLY}\n"
