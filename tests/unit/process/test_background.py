"""Verbs in processes of their own: their result, their steps, their end."""

import asyncio
import os
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from impactcell.process import background
from impactcell.process.background import run_verb
from tests.patience import PATIENCE_S


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], object]:
    """Write a program in the place of this one."""
    package = tmp_path / "impactcell"
    package.mkdir()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return (package / "__main__.py").write_text


@pytest.mark.slow
async def test_a_verb_of_this_program() -> None:
    outcome = await run_verb(["check", "there-is-none.yaml"], 60.0)
    assert outcome.exit_code == 2
    assert not outcome.is_done
    assert "there-is-none.yaml" in outcome.messages[-1]


async def test_output_steps_and_priority(program: Callable[[str], object]) -> None:
    program(
        "import os, sys\n"
        "sys.stderr.write('step: one\\na fault\\nstep: two\\n' + 'x' * 200_000 + '\\nlast\\n')\n"
        "print(os.nice(0), sys.argv[1:], 'y' * 5_000_000)\n"
    )
    steps: list[str] = []
    outcome = await run_verb(["a", "b c"], 60.0, steps.append)
    assert outcome.is_done
    assert steps == ["one", "two"]
    assert outcome.messages[0] == "a fault"
    assert outcome.messages[-1] == "last"
    assert outcome.output.startswith("19 ['a', 'b c'] yyy")
    assert len(outcome.output) == background.MAX_OUTPUT_BYTES


async def test_memory_is_limited(program: Callable[[str], object]) -> None:
    program("import sys\ntry:\n    bytearray(9_000_000_000)\nexcept MemoryError:\n    sys.exit(7)\n")
    assert (await run_verb([], 60.0)).exit_code == 7


@pytest.mark.slow
@pytest.mark.parametrize("how", ["time", "cancel"])
async def test_it_ends_with_all_that_it_started(program: Callable[[str], object], how: str) -> None:
    program(
        "import subprocess, sys, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(300)'])\n"
        "sys.stderr.write(f'step: {child.pid}\\n')\n"
        "sys.stderr.flush()\n"
        "time.sleep(300)\n"
    )
    begun: asyncio.Future[int] = asyncio.get_running_loop().create_future()
    work = asyncio.create_task(
        run_verb([], 2.0 if how == "time" else 300.0, lambda step: begun.set_result(int(step)))
    )
    async with asyncio.timeout(PATIENCE_S):
        child = await begun
        if how == "time":
            assert (await work).exit_code is None
        else:
            work.cancel()
            with pytest.raises(asyncio.CancelledError):
                await work
        while psutil.pid_exists(child) and psutil.Process(child).status() != psutil.STATUS_ZOMBIE:
            await asyncio.sleep(0.01)
    assert child != os.getpid()
