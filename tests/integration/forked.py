"""A command line in a process that is forked off one in which all is loaded: it begins within milliseconds.

How long Python takes to load a program is not what these tests try.
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

from tests.integration.running import Running

SERVER = multiprocessing.get_context("forkserver")
SERVER.set_forkserver_preload(
    [
        *("impactcell.cli.app", "impactcell.service", "impactcell.discrepancy.report", "simulator.serving"),
        *("simulator.campaign_files", "tests.integration.preloaded"),
    ]
)


class ForkedProcess:
    """Looks like a process of asyncio."""

    def __init__(self, process: ForkServerProcess) -> None:
        self._process = process
        self._end = asyncio.create_task(asyncio.to_thread(process.join))
        # Nobody else asks for the exit code: it can be read once.

    @property
    def returncode(self) -> int | None:
        return self._process.exitcode if self._end.done() else None

    def kill(self) -> None:
        self._process.kill()

    def terminate(self) -> None:
        self._process.terminate()

    async def wait(self) -> int | None:
        await asyncio.shield(self._end)
        return self._process.exitcode


def _run(arguments: tuple[str, ...], output: Connection, errors: Connection) -> None:
    signal.set_wakeup_fd(-1)
    os.dup2(output.fileno(), 1)
    os.dup2(errors.fileno(), 2)
    output.close()
    errors.close()
    sys.argv = list(arguments)
    runpy.run_module(arguments[0], run_name="__main__", alter_sys=True)


async def _stream(connection: Connection) -> tuple[asyncio.StreamReader, asyncio.BaseTransport]:
    """Read a connection as bytes."""
    stream = asyncio.StreamReader()
    end = os.fdopen(os.dup(connection.fileno()), "rb")
    connection.close()
    transport, _ = await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(stream), end
    )
    return stream, transport


@contextlib.asynccontextmanager
async def forked(*arguments: str) -> AsyncIterator[Running]:
    """Run a Python module; it is ended by SIGTERM afterwards."""
    (output, writes_output), (errors, writes_errors) = (SERVER.Pipe(duplex=False) for _ in range(2))
    process = SERVER.Process(target=_run, args=(arguments, writes_output, writes_errors))
    await asyncio.to_thread(process.start)
    writes_output.close()
    writes_errors.close()
    (text, one), (lines, other) = await _stream(output), await _stream(errors)
    running = Running(ForkedProcess(process), text)
    reader = asyncio.create_task(running.follow(lines))
    try:
        yield running
    finally:
        if running.process.returncode is None:
            running.process.terminate()
        await running.process.wait()
        await reader
        one.close()
        other.close()
        process.close()
