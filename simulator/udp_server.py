"""A simulated module on UDP: a datagram is a request, and so is its reply."""

import asyncio
from typing import Any, cast

from simulator.client_connection import ClientConnection
from simulator.modbus_server import ModbusServer

Address = tuple[Any, ...]


class _Peer(asyncio.Transport):
    """What a connection sends through to one client."""

    def __init__(self, endpoint: asyncio.DatagramTransport, address: Address) -> None:
        super().__init__()
        self._endpoint, self._address = endpoint, address

    def write(self, data: "bytes | bytearray | memoryview[Any]") -> None:
        """Send a datagram."""
        self._endpoint.sendto(data, self._address)

    def abort(self) -> None:
        """Do nothing: there is no connection that could be reset."""


class _DatagramConnection(ClientConnection):
    """One client; what a datagram holds beside whole requests belongs to no other."""

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        self._buffer = b""


class _Datagrams(asyncio.DatagramProtocol):
    def __init__(self, server: ModbusServer) -> None:
        self.gone = asyncio.Event()
        self._server = server
        self._endpoint: asyncio.DatagramTransport | None = None
        self._clients: dict[Address, ClientConnection] = {}

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._endpoint = cast("asyncio.DatagramTransport", transport)

    def datagram_received(self, data: bytes, addr: Address) -> None:
        assert self._endpoint is not None  # noqa: S101 - it is what has received
        client = self._clients.get(addr)
        if client is None:
            client = self._clients[addr] = _DatagramConnection(self._server)
            client.connection_made(_Peer(self._endpoint, addr))
        client.data_received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        for client in self._clients.values():
            client.connection_lost(exc)
        self.gone.set()


class UdpServer(ModbusServer):
    """Serves devices over UDP."""

    _endpoint: asyncio.DatagramTransport | None = None
    _datagrams: _Datagrams | None = None

    async def start(self) -> None:
        """Bind; `port` then is the port that was given by the system if it was 0."""
        self._endpoint, self._datagrams = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _Datagrams(self), local_addr=(self.host, self.port)
        )
        self.port = self._endpoint.get_extra_info("sockname")[1]

    async def close(self) -> None:
        """Unbind."""
        endpoint, self._endpoint = self._endpoint, None
        if endpoint is not None and self._datagrams is not None:
            endpoint.abort()
            await self._datagrams.gone.wait()
