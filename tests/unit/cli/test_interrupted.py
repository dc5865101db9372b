"""Ctrl-C while a command is still being imported."""

import subprocess
import sys

import pytest

INTERRUPTED_AT = """
import os, signal, sys

signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background is born to ignore it

class CtrlC:
    def find_spec(self, name, *_):
        if name == sys.argv[2]:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, CtrlC())
main = __import__(sys.argv[1], fromlist=["main"]).main
sys.exit(main(sys.argv[3:]))
"""


@pytest.mark.parametrize(
    ("program", "imported", "arguments", "said"),
    [
        ("impactcell.__main__", "typer", ["schema"], "interrupted\n"),
        ("impactcell.__main__", "impactcell.settings", ["schema"], ""),
        ("simulator.__main__", "scipy", ["serve", "config/sim/prototype.yaml"], ""),
    ],
)
def test_ctrl_c_leaves_no_traceback(program: str, imported: str, arguments: list[str], said: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED_AT, program, imported, *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", said)
