"""What hostile connections hold is bounded while they hold it, and comes back when they go."""

import asyncio
import contextlib
import json
import struct
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator

import pytest

from impactcell.opcua.transport.connection_table import MAX_UNFINISHED_BYTES_PER_ADDRESS
from impactcell.opcua.transport.tcp_connection import MAX_QUEUED_BYTES
from tests.integration.processes import ROOT
from tests.opcua_wire import Raw, frame

pytestmark = pytest.mark.slow

CONNECTIONS = 24
UNFINISHED = 56
"""Chunks of 60 000 bytes of a message that never ends: 3.5 MB, of which sixty once held 224 MB."""
MB = 1024 * 1024


@contextlib.asynccontextmanager
async def server() -> AsyncIterator[tuple[Process, int]]:
    """Run a server in a process of its own; it tells its memory when it is asked."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "tests.integration.opcua_memory", stdin=PIPE, stdout=PIPE, cwd=ROOT
    )
    try:
        assert process.stdout is not None
        yield process, json.loads(await process.stdout.readline())["port"]
    finally:
        process.kill()
        await process.wait()


async def memory(process: Process) -> dict[str, int]:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(b"\n")
    await process.stdin.drain()
    told: dict[str, int] = json.loads(await process.stdout.readline())
    return told


async def hold(port: int) -> asyncio.StreamWriter:
    """Send as much of a message as is taken, and not its end."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError, TimeoutError):
        channel, _ = await Raw(reader, writer).channel()
        for sequence in range(2, 2 + UNFINISHED):
            body = struct.pack("<IIII", channel, 13, sequence, 2) + b"\0" * 60_000
            writer.write(frame(b"MSG", body, b"C"))
            await writer.drain()
    return writer


async def test_unfinished_messages_of_many_connections() -> None:
    async with server() as (process, port):
        for writer in await asyncio.gather(*(hold(port) for _ in range(5))):
            writer.transport.abort()
        before = await memory(process)
        held = await asyncio.gather(*(hold(port) for _ in range(CONNECTIONS)))
        during = await memory(process)
        # What is held, and what waits in the buffers of connections that are being closed.
        assert during["traced"] - before["traced"] < MAX_UNFINISHED_BYTES_PER_ADDRESS + CONNECTIONS * (
            MAX_QUEUED_BYTES
        )
        for writer in held:
            writer.transport.abort()
        after = await memory(process)
        while after["connections"]:
            after = await memory(process)
        assert after["traced"] - before["traced"] < 1 * MB
        assert after["rss"] - before["rss"] < 40 * MB
