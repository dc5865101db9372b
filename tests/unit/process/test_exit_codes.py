"""Streams that are closed, or cannot be written: no traceback."""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from impactcell.cli.app import run_verb
from impactcell.process.exit_codes import ExitCode, exit_code_of

SAYS = """
import sys
from impactcell.process.exit_codes import exit_code_of

def work():
    sys.stdout.write({text})
    sys.exit(0)

sys.exit(exit_code_of("impactcell", work))
"""


@pytest.mark.parametrize(
    ("verb", "said"),
    [
        (["users", "add", "users.yaml", "ops"], "a password has at least 8 characters"),
        (["init", "cell", "--name", "x"], "init needs --mass-kg, --stroke-mm, --wear-limit"),
    ],
)
def test_a_closed_standard_input_is_an_empty_one(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    verb: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", None)
    code = exit_code_of("impactcell", partial(run_verb, verb))
    sys.stdin.close()
    assert code == ExitCode.BAD_INPUT
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a system without /dev/full")
@pytest.mark.parametrize("text", ["'few'", "'many' * 100_000"])
def test_an_output_that_cannot_be_written_is_told(text: str, unbuffered: str) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-c", SAYS.format(text=text)],
            stdout=full,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    told = "impactcell: the output cannot be written: No space left on device\n"
    assert (done.returncode, done.stderr) == (ExitCode.FAILED, told)


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_who_has_gone_is_told_nothing(unbuffered: str) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe:
        done = subprocess.run(
            [sys.executable, "-c", SAYS.format(text="'few'")],
            stdout=pipe,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (ExitCode.FAILED, "")


def test_what_is_said_on_a_closed_output_goes_nowhere() -> None:
    done = subprocess.run(
        ["sh", "-c", 'exec "$0" -c "$1" >&-', sys.executable, SAYS.format(text="'few'")],
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (ExitCode.DONE, "")
