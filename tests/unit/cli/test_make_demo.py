"""`make demo` is ended by Ctrl-C: make reports no error then, and any other one as it is."""

import os
import shutil
import signal
import subprocess
from pathlib import Path

import pytest

from tests.patience import PATIENCE_S

ROOT = Path(__file__).parents[3]
INTERRUPTED = "kill -INT $PPID; exit 130"
"""A terminal sends Ctrl-C to every process that it shows: to the recipe's shell as well. What make does
with its own, which may come while it waits for that shell, is not ours to test."""


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
@pytest.mark.parametrize(
    ("demo", "said", "code"),
    [
        (INTERRUPTED, "", 0),
        ("exit 130", "", 0),
        ("exit 0", "", 0),
        ("exit 2", "demo] Error 2", 2),
    ],
)
def test_ctrl_c_is_no_error(tmp_path: Path, demo: str, said: str, code: int) -> None:
    program = tmp_path / "bin" / "impactcell"
    program.parent.mkdir()
    program.write_text(f"#!/bin/sh\n{demo}\n")
    program.chmod(0o755)
    (tmp_path / ".installed").touch()
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    done = subprocess.run(
        ["make", "demo", f"VENV={tmp_path}"],
        cwd=ROOT, env=environment, start_new_session=True, capture_output=True, text=True, timeout=PATIENCE_S,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    assert done.returncode == code
    assert done.stdout == ""
    assert said in done.stderr if said else done.stderr == ""
