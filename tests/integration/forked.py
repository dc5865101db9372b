"""The command line in a process that is forked off one in which all is loaded: it begins within milliseconds.

What is tried by killing a service often is not how long Python takes to load it.
"""

import asyncio
import contextlib
import multiprocessing
import os
import runpy
import signal
import sys
from collections.abc import AsyncIterator
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess

from tests.integration.processes import Running

_SERVER = multiprocessing.get_context("forkserver")
_SERVER.set_forkserver_preload(["impactcell.cli.app", "impactcell.service", "tests.integration.preloaded"])


class ForkedProcess:
    """Looks like a process of asyncio."""

    def __init__(self, process: ForkServerProcess) -> None:
        self._process = process

    @property
    def returncode(self) -> int | None:
        return self._process.exitcode

    def kill(self) -> None:
        self._process.kill()

    def terminate(self) -> None:
        self._process.terminate()

    async def wait(self) -> int | None:
        await asyncio.to_thread(self._process.join)
        return self._process.exitcode


def _run(arguments: tuple[str, ...], errors: Connection) -> None:
    signal.set_wakeup_fd(-1)
    os.dup2(errors.fileno(), 2)
    sys.argv = list(arguments)
    runpy.run_module(arguments[0], run_name="__main__", alter_sys=True)


@contextlib.asynccontextmanager
async def forked(*arguments: str) -> AsyncIterator[Running]:
    """Run a Python module; it is ended by SIGTERM afterwards."""
    receiver, sender = _SERVER.Pipe(duplex=False)
    process = _SERVER.Process(target=_run, args=(arguments, sender))
    await asyncio.to_thread(process.start)
    sender.close()
    lines = asyncio.StreamReader()
    transport, _ = await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(lines), os.fdopen(os.dup(receiver.fileno()), "rb")
    )
    receiver.close()
    running = Running(ForkedProcess(process))
    reader = asyncio.create_task(running.follow(lines))
    try:
        yield running
    finally:
        if running.process.returncode is None:
            running.process.terminate()
        await running.process.wait()
        await reader
        transport.close()
        process.close()
