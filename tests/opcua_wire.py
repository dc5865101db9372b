"""OPC UA without a client: frames as bytes, and a bare connection to a server."""

import asyncio
import contextlib
import struct
from collections.abc import AsyncIterator

from asyncua import ua
from asyncua.ua.ua_binary import struct_to_binary

from tests.opcua_server import PatientClient, Site
from tests.patience import PATIENCE_S

NONE_URI = b"http://opcfoundation.org/UA/SecurityPolicy#None"


def frame(kind: bytes, body: bytes, chunk: bytes = b"F", size: int | None = None) -> bytes:
    return kind + chunk + struct.pack("<I", size if size is not None else 8 + len(body)) + body


def hello(url: bytes = b"opc.tcp://localhost", receive: int = 65536, send: int = 65536) -> bytes:
    return frame(b"HEL", struct.pack("<IIIIIi", 0, receive, send, 0, 0, len(url)) + url)


def open_channel(request_type: int = 0, mode: int = 1, uri: bytes = NONE_URI, sequence: int = 1) -> bytes:
    request = ua.OpenSecureChannelRequest()
    request.Parameters.RequestType = ua.SecurityTokenRequestType(request_type)
    request.Parameters.SecurityMode = ua.MessageSecurityMode(mode)
    request.Parameters.RequestedLifetime = 60_000
    security = struct.pack("<i", len(uri)) + uri + struct.pack("<ii", -1, -1)
    return frame(
        b"OPN",
        struct.pack("<I", 0) + security + struct.pack("<II", sequence, sequence) + struct_to_binary(request),
    )


def message(channel: int, token: int, body: bytes, sequence: int = 2, chunk: bytes = b"F") -> bytes:
    return frame(b"MSG", struct.pack("<IIII", channel, token, sequence, sequence) + body, chunk)


class Raw:
    """A bare TCP connection to the server."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    async def send(self, data: bytes) -> None:
        self.writer.write(data)
        await self.writer.drain()

    async def receive(self) -> tuple[bytes, bytes]:
        head = await asyncio.wait_for(self.reader.readexactly(8), PATIENCE_S)
        size = struct.unpack("<I", head[4:])[0]
        return head[:3], await self.reader.readexactly(size - 8)

    async def error(self) -> int:
        kind, body = await self.receive()
        assert kind == b"ERR", (kind, body)
        assert await asyncio.wait_for(self.reader.read(), PATIENCE_S) == b"", "the connection was not closed"
        return struct.unpack("<I", body[:4])[0]

    async def channel(self) -> tuple[int, int]:
        await self.send(hello())
        assert (await self.receive())[0] == b"ACK"
        await self.send(open_channel())
        kind, body = await self.receive()
        assert kind == b"OPN"
        # The token is the last structure but the nonce: version, channel, token, created, lifetime, nonce.
        channel, token = struct.unpack("<II", body[-28:-20]) if body[-4:] != b"\xff" * 4 else (0, 0)
        channel, token = struct.unpack("<I", body[:4])[0], token
        return channel, token


@contextlib.asynccontextmanager
async def raw(here: Site) -> AsyncIterator[Raw]:
    port = int(here.server.endpoint.split(":")[2].split("/")[0])
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        yield Raw(reader, writer)
    finally:
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()


async def alive(here: Site) -> None:
    client = PatientClient(here.server.endpoint)
    endpoints = await client.connect_and_get_server_endpoints()
    assert len(endpoints) == 3
