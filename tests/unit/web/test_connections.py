"""Connections that say nothing, or too slowly, or are too many: they go, the page stays for the others."""

import asyncio
import logging
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from impactcell.scada.users import User, write_users
from impactcell.web import connections, requests
from impactcell.web.interface import CellFacts, PageSettings
from impactcell.web.server import PageServer
from tests.patience import PATIENCE_S
from tests.unit.web.page import CELL, NAMES, Backend, make_page
from tests.virtual_time import run_virtually

Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]


@pytest.fixture
def server(tmp_path: Path) -> Iterator[PageServer]:
    users = tmp_path / "users.yaml"
    write_users(users, {name: User(name, role, password="x") for role, name in NAMES.items()})
    settings = PageSettings("http://127.0.0.1:0", users, tmp_path / "pki", tmp_path / "studies")
    server = PageServer(settings, [CellFacts(CELL, "m", "o")], Backend(users))
    server.start()
    yield server
    server.stop()


async def connect(server: PageServer) -> Streams:
    url = urlsplit(server.endpoint)
    return await asyncio.open_connection(url.hostname, url.port)


async def answer(streams: Streams, request: bytes) -> bytes:
    reader, writer = streams
    writer.write(request)
    await writer.drain()
    async with asyncio.timeout(PATIENCE_S):
        return await reader.readline()


async def ended(streams: Streams) -> None:
    """Wait until the other end has closed."""
    async with asyncio.timeout(PATIENCE_S):
        try:
            while await streams[0].read(4096):
                pass
        except ConnectionError:
            pass
        finally:
            streams[1].close()


WHOLE = b"GET /login HTTP/1.1\r\nHost: h\r\n\r\n"


@pytest.mark.parametrize("said", [b"", b"GET /login HTTP/1.1\r\nHost: h\r\n"], ids=["nothing", "half a head"])
async def test_who_does_not_finish_a_head_is_let_go(
    server: PageServer, said: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "HEADER_S", 0.05)
    streams = await connect(server)
    streams[1].write(said)
    await ended(streams)


FORM = b"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 100\r\n\r\n"


@pytest.mark.parametrize("said", [b"", b"user=eva"], ids=["nothing", "half a form"])
async def test_who_does_not_finish_a_form_is_told_and_let_go(
    server: PageServer, said: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests, "FORM_S", 0.05)
    streams = await connect(server)
    head = await answer(streams, b"POST /login HTTP/1.1\r\nHost: h\r\n" + FORM + said)
    assert head == b"HTTP/1.1 408 Request Timeout\r\n"
    await ended(streams)


def test_a_form_that_drips_has_its_time_and_no_more(tmp_path: Path) -> None:
    """A byte a second keeps no connection; the time that passes is none of the clock's."""

    async def dripping() -> tuple[float, list[Any]]:
        page, sent = make_page(tmp_path), []

        async def receive() -> dict[str, Any]:
            await asyncio.sleep(1.0)
            return {"type": "http.request", "body": b"u", "more_body": True}

        async def send(message: dict[str, Any]) -> None:
            sent.append(message)

        headers = {b"host": b"127.0.0.1:8480", b"content-type": b"application/x-www-form-urlencoded"}
        scope = {
            "type": "http", "method": "POST", "path": "/login", "query_string": b"lang=de",
            "headers": list(headers.items()), "http_version": "1.1", "root_path": "",
            "scheme": "http", "server": ("127.0.0.1", 8480), "client": ("127.0.0.1", 1),
        }  # fmt: skip
        await page.app(scope, receive, send)  # type: ignore[operator]
        return asyncio.get_running_loop().time(), sent

    took_s, (head, body, *_) = run_virtually(dripping())
    assert took_s == pytest.approx(requests.FORM_S)
    assert (head["status"], dict(head["headers"])[b"connection"]) == (408, b"close")
    assert "Dieses Formular kam zu langsam." in body["body"].decode()


async def test_the_second_head_has_its_time_too(server: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "HEADER_S", 0.3)
    streams = await connect(server)
    assert await answer(streams, WHOLE) == b"HTTP/1.1 200 OK\r\n"
    streams[1].write(WHOLE[:12])
    await ended(streams)


async def test_an_address_has_so_many_connections_and_no_more(
    server: PageServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "MAX_PER_ADDRESS", 3)
    held = [await connect(server) for _ in range(3)]
    for streams in held:
        assert await answer(streams, WHOLE) == b"HTTP/1.1 200 OK\r\n"
    await ended(await connect(server))
    held[0][1].close()
    async with asyncio.timeout(PATIENCE_S):
        while True:  # the server hears of the one that left in its own time
            streams = await connect(server)
            try:
                if await answer(streams, WHOLE) == b"HTTP/1.1 200 OK\r\n":
                    break
            except ConnectionError:
                pass
            finally:
                streams[1].close()
    for streams in held[1:]:
        streams[1].close()


async def test_who_leaves_in_the_middle_of_a_form_is_no_fault(
    server: PageServer, caplog: pytest.LogCaptureFixture
) -> None:
    _, writer = await connect(server)
    form = b"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 100\r\n\r\nuser=eva"
    writer.write(b"POST /login HTTP/1.1\r\nHost: h\r\n" + form)
    await writer.drain()
    writer.close()
    await writer.wait_closed()
    after = await connect(server)
    assert await answer(after, WHOLE) == b"HTTP/1.1 200 OK\r\n"
    after[1].close()
    await asyncio.to_thread(server.stop)  # every request has ended then
    assert [record.message for record in caplog.records] == []


@pytest.mark.slow
async def test_a_request_that_the_end_cuts_off_is_no_fault(
    server: PageServer, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.INFO, "uvicorn.error")
    asked = threading.Event()

    async def never(*_: object) -> None:
        asked.set()
        await asyncio.Event().wait()

    monkeypatch.setattr("impactcell.web.login_pages.login", never)
    _, writer = await connect(server)
    writer.write(WHOLE)
    await writer.drain()
    assert await asyncio.to_thread(asked.wait, PATIENCE_S)
    await asyncio.to_thread(server.stop)
    writer.close()
    said = [record for record in caplog.records if record.name == "uvicorn.error"]
    assert "a request was cut off: the service ends" in [record.message for record in said]
    assert not any(record.exc_info for record in said)
