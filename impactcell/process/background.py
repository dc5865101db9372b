"""Verbs of this program in processes of their own, at the lowest priority: nothing beside is to notice."""

import asyncio
import contextlib
import os
import shutil
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from impactcell.process.progress import LINES_VARIABLE, STEP_PREFIX

NICE: Final = shutil.which("nice")
"""POSIX `nice`; None where the system has none, and the priority stays as it is."""
SHELL: Final = shutil.which("sh")
"""POSIX shell, for `ulimit`."""
MAX_MEMORY_KB: Final = 8_000_000
"""Address space of a process, kB: what is beyond fails there and not in the service (`ulimit -v`)."""
MAX_OUTPUT_BYTES: Final = 4_000_000
"""Of standard output; more than any verb writes."""
MAX_LINES: Final = 200
"""Last lines of standard error that are kept."""
MAX_LINE_BYTES: Final = 65_536
"""Longest line of standard error."""
GRACE_S: Final = 2.0
"""How long a process that is ended may take to tidy up."""


@dataclass(frozen=True, slots=True)
class VerbOutcome:
    """How a verb ended.

    Attributes
    ----------
    exit_code : int or None
        None where its time was over.
    output : str
        Standard output.
    messages : tuple of str
        Last lines of standard error, without the steps.
    """

    exit_code: int | None
    output: str
    messages: tuple[str, ...]

    @property
    def is_done(self) -> bool:
        """Whether it did what it was asked for."""
        return self.exit_code == 0

    @property
    def said(self) -> tuple[str, ...]:
        """The messages, without the name of the program before them."""
        return tuple(message.removeprefix("impactcell: ") for message in self.messages)


async def run_verb(
    arguments: Sequence[str], timeout_s: float, on_step: Callable[[str], None] | None = None
) -> VerbOutcome:
    """Run `impactcell ARGUMENTS`; it ends with whoever waits for it.

    Parameters
    ----------
    arguments : sequence of str
    timeout_s : float
        After so long it is ended.
    on_step : callable, optional
        Called with each step that it reports.
    """
    process = await asyncio.create_subprocess_exec(
        *_command(arguments),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        env={**os.environ, LINES_VARIABLE: "1", "PYTHONUNBUFFERED": "1", "COLUMNS": "200"},
        limit=MAX_LINE_BYTES,
        start_new_session=True,
    )
    assert process.stdout is not None  # noqa: S101 - a pipe was asked for
    assert process.stderr is not None  # noqa: S101
    messages: list[str] = []
    reading = asyncio.gather(
        _read(process.stdout), _follow(process.stderr, messages, on_step or (lambda _: None)), process.wait()
    )
    try:
        async with asyncio.timeout(timeout_s):
            output, _, exit_code = await reading
    except TimeoutError:
        return VerbOutcome(None, "", tuple(messages))
    finally:
        reading.cancel()
        await asyncio.shield(_end(process))
    return VerbOutcome(exit_code, output, tuple(messages))


def _command(arguments: Sequence[str]) -> list[str]:
    python = [sys.executable, "-m", "impactcell", *arguments]
    if NICE is None:
        return python
    lowly = [NICE, "-n", "19", *python]
    return lowly if SHELL is None else [SHELL, "-c", f'ulimit -v {MAX_MEMORY_KB}; exec "$@"', "sh", *lowly]


async def _read(stream: asyncio.StreamReader) -> str:
    output = bytearray()
    while data := await stream.read(MAX_LINE_BYTES):
        output += data[: MAX_OUTPUT_BYTES - len(output)]
    return output.decode(errors="replace")


async def _follow(stream: asyncio.StreamReader, messages: list[str], on_step: Callable[[str], None]) -> None:
    while True:
        try:
            line = await stream.readline()
        except ValueError:  # longer than a line may be
            continue
        if not line:
            return
        text = line.decode(errors="replace").rstrip()
        if text.startswith(STEP_PREFIX):
            on_step(text.removeprefix(STEP_PREFIX))
        elif text:
            messages.append(text)
            del messages[:-MAX_LINES]


async def _end(process: asyncio.subprocess.Process) -> None:
    """End what has not ended, with all that it started."""
    for sign in (signal.SIGTERM, signal.SIGKILL):
        if process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, sign)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(GRACE_S):
                await process.wait()
