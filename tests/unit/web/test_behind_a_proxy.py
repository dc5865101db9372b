"""The page behind a proxy that ends TLS: the address in the browser is another than the one it listens on."""

from http.cookies import SimpleCookie
from pathlib import Path

import httpx
import pytest

from impactcell.scada import Role
from impactcell.web.interface import CellNews
from tests.unit.web.page import (
    ADDRESS,
    NAMES,
    PASSWORD,
    Page,
    acknowledgement,
    csrf_of,
    log_in,
    make_page,
    put,
    raised,
)

PUBLIC = "https://cells.plant.example"
HOSTS = ["cells.plant.example", "127.0.0.1:8480"]
"""What a proxy says it asks for: the address in the browser, or the one that it was told."""
FORWARDED = {
    "x-forwarded-proto": "https",
    "x-forwarded-host": "cells.plant.example",
    "forwarded": "proto=https",
}


async def entered(page: Page, client: httpx.AsyncClient) -> httpx.Response:
    return await log_in(client, NAMES[Role.OPERATOR], PASSWORD)


@pytest.mark.parametrize("host", HOSTS)
async def test_who_comes_through_the_proxy_logs_in_and_acknowledges(tmp_path: Path, host: str) -> None:
    page = make_page(tmp_path, public_url=PUBLIC)
    await put(page, CellNews("press-1", alarms=(raised(),)))
    async with page.client() as client:
        client.headers.update({"host": host, "origin": PUBLIC, "sec-fetch-site": "same-origin"})
        answer = await entered(page, client)
        assert answer.status_code == 303, answer.text
        (cookie,) = SimpleCookie(answer.headers["set-cookie"]).values()
        assert (cookie.key, cookie["secure"], cookie["httponly"]) == ("impactcell_443", True, True)
        client.headers["cookie"] = (
            f"{cookie.key}={cookie.value}"  # to a client that asks over http it is none
        )
        form = {"csrf": await csrf_of(client), **acknowledgement(raised())}
        assert (await client.post("/alarms/act", data=form)).status_code == 303
    assert len(page.backend.acted) == 1


@pytest.mark.parametrize("host", HOSTS)
@pytest.mark.parametrize(
    "origin", ["http://cells.plant.example", "https://elsewhere.example", f"{PUBLIC}:8443", ADDRESS, "null"]
)
async def test_a_form_from_elsewhere_is_refused_whatever_is_said_to_be_forwarded(
    tmp_path: Path, host: str, origin: str
) -> None:
    page = make_page(tmp_path, public_url=PUBLIC)
    forwarded = FORWARDED | {"x-forwarded-host": origin.partition("://")[2]}
    async with page.client() as client:
        client.headers.update({"host": host, "origin": origin, **forwarded})
        answer = await entered(page, client)
    assert answer.status_code == 403
    assert not page.backend.logins


async def test_a_proxy_that_the_cell_file_says_nothing_of_is_told_with_the_way_out(tmp_path: Path) -> None:
    page = make_page(tmp_path)
    async with page.client() as client:
        client.headers.update(
            {"host": HOSTS[0], "origin": PUBLIC, "sec-fetch-site": "same-origin", **FORWARDED}
        )
        answer = await entered(page, client)
    assert answer.status_code == 403
    assert "web.public_url" in answer.text
    assert not page.backend.logins


async def test_a_page_that_is_public_in_the_clear_has_a_cookie_that_comes_back(tmp_path: Path) -> None:
    page = make_page(tmp_path, public_url="http://cells.plant.example:8080")
    async with page.client() as client:
        client.headers["origin"] = "http://cells.plant.example:8080"
        answer = await entered(page, client)
    (cookie,) = SimpleCookie(answer.headers["set-cookie"]).values()
    assert (cookie.key, cookie["secure"]) == ("impactcell_8080", "")
