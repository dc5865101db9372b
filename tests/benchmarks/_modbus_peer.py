"""Servers for the fieldbus benchmark, each in a process: `python -m tests.benchmarks._modbus_peer KIND`.

Prints its port and serves until standard input closes. Two show what asyncio alone costs, answering 12 bytes
with the bytes of a good reply and looking at none of them: `bare` sends message by message, `counted` sends
the replies to all that came in one read at once.
"""

import asyncio
import logging
import sys

import numpy as np

from impactcell.fieldbus.registers import WIRE, Words
from simulator.modbus_server import ModbusServer

REQUEST_BYTES = 12
REPLY = bytes([0, 1, 0, 0, 0, 253, 1, 3, 250]) + bytes(250)


class Image:
    """Registers with their own address in them."""

    def __init__(self) -> None:
        self.words = np.arange(65_536).astype(WIRE)

    def read(self, table: str, address: int, count: int) -> Words:
        return self.words[address : address + count]

    def write(self, address: int, words: Words) -> None:
        self.words[address : address + words.size] = words


class Bare(asyncio.Protocol):
    def __init__(self, *, together: bool) -> None:
        self.together = together

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self.held = 0

    def data_received(self, data: bytes) -> None:
        requests, self.held = divmod(self.held + len(data), REQUEST_BYTES)
        if self.together:
            self.transport.write(REPLY * requests)
            return
        for _ in range(requests):
            self.transport.write(REPLY)


async def serve(kind: str) -> None:
    if kind == "simulator":
        ours = ModbusServer(Image())
        await ours.start()
        port = ours.port
    elif kind in ("bare", "counted"):
        server = await asyncio.get_running_loop().create_server(
            lambda: Bare(together=kind == "counted"), "127.0.0.1", 0
        )
        port = server.sockets[0].getsockname()[1]
    else:
        from pymodbus.server import ModbusTcpServer
        from pymodbus.simulator import DataType, SimData, SimDevice

        data = [SimData(0, values=list(range(65_000)), datatype=DataType.REGISTERS)]
        theirs = ModbusTcpServer(SimDevice(1, simdata=data), address=("127.0.0.1", 0))
        await theirs.serve_forever(background=True)
        assert isinstance(theirs.transport, asyncio.Server)
        port = theirs.transport.sockets[0].getsockname()[1]
    print(port, flush=True)
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    asyncio.run(serve(sys.argv[1]))
