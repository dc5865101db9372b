"""Who asks and does not take the answer holds a connection for so long, however small what is left of it."""

import asyncio
import socket
import ssl
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from uvicorn.server import ServerState

from impactcell.web.connections import STALLED_S, Connection
from tests.certificates import Authority
from tests.virtual_time import run_virtually

REQUEST = b"GET / HTTP/1.1\r\nHost: h\r\n\r\n"
CHUNK = b"x" * 40_000
"""More than the sockets take, and less than what the transport below TLS takes (64 KiB)."""
LONG, SHORT = 100, 1
"""Chunks of an answer: of a short one, all that is left lies in the transport's buffer."""
FOR_EVER_S = 3600.0
Send = Callable[[dict[str, Any]], Any]


class Served:
    """The server's end of a pair of sockets, and the client's."""

    def __init__(self, chunks: int) -> None:
        self.near, self.far = socket.socketpair()
        self.near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        self.far.setblocking(False)
        self.chunks = chunks
        self.state = ServerState()

    async def __call__(self, _scope: object, _receive: object, send: Send) -> None:
        """Answer."""
        await send({"type": "http.response.start", "status": 200, "headers": []})
        for left in reversed(range(self.chunks)):
            await send({"type": "http.response.body", "body": CHUNK, "more_body": left > 0})

    async def connect(self, tls: ssl.SSLContext | None) -> None:
        config = uvicorn.Config(
            self, loop="asyncio", ws="none", lifespan="off", log_config=None, timeout_keep_alive=10
        )
        config.load()
        serving = asyncio.get_running_loop().connect_accepted_socket(
            lambda: Connection(config, self.state, {}), self.near, ssl=tls
        )
        if tls is None:
            await serving
            self.far.send(REQUEST)
            return
        accepting = asyncio.ensure_future(serving)
        await self._ask_over_tls()
        await accepting

    async def _ask_over_tls(self) -> None:
        loop, trusting = asyncio.get_running_loop(), ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        trusting.check_hostname, trusting.verify_mode = False, ssl.CERT_NONE
        incoming, outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
        client = trusting.wrap_bio(incoming, outgoing)
        while True:
            try:
                client.do_handshake()
                break
            except ssl.SSLWantReadError:
                self.far.send(outgoing.read())
                incoming.write(await loop.sock_recv(self.far, 2**16))
        client.write(REQUEST)
        self.far.send(outgoing.read())

    async def until_gone(self) -> float:
        """Wait until the server has no connection any more; gives when that was, in seconds."""
        loop = asyncio.get_running_loop()
        while self.state.connections and loop.time() < FOR_EVER_S:
            await asyncio.sleep(1.0)
        return loop.time()


@pytest.fixture(params=["http", "https"])
def tls(request: pytest.FixtureRequest, tmp_path: Path) -> ssl.SSLContext | None:
    if request.param == "http":
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(*Authority(tmp_path, "plant").issue("page"))
    return context


@pytest.mark.parametrize("is_half_closed", [False, True], ids=["open", "half closed"])
@pytest.mark.parametrize("chunks", [LONG, SHORT], ids=["long", "short"])
def test_who_takes_nothing_of_an_answer_is_let_go(
    tls: ssl.SSLContext | None, chunks: int, *, is_half_closed: bool
) -> None:
    async def ask() -> float:
        served = Served(chunks)
        with served.far:
            await served.connect(tls)
            await asyncio.sleep(1.0)
            if is_half_closed:
                served.far.shutdown(socket.SHUT_WR)
            return await served.until_gone()

    assert STALLED_S <= run_virtually(ask()) <= 3.0 * STALLED_S


def test_who_takes_an_answer_slowly_gets_all_of_it() -> None:
    async def take() -> tuple[int, float]:
        served, taken = Served(LONG), 0
        with served.far:
            await served.connect(None)
            while True:
                await asyncio.sleep(0.8 * STALLED_S)
                try:
                    while data := served.far.recv(2**16):
                        taken += len(data)
                except BlockingIOError:
                    continue
                return taken, asyncio.get_running_loop().time()

    taken, took_s = run_virtually(take())
    assert taken > LONG * len(CHUNK)
    assert took_s > 100.0 * STALLED_S
