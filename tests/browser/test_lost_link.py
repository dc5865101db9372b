"""A page that hears nothing says so, and what is worth a look among many cells is named above them."""

import asyncio
import contextlib
import os
import re
import time
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import pytest_asyncio

from impactcell.records import ModuleStatus
from impactcell.scada import Role
from impactcell.scada.users import User, write_users
from impactcell.web import CellFacts, CellNews, PageServer, PageSettings
from impactcell.web.interface import Freshness
from impactcell.web.sessions import IDLE_S
from tests.browser.chromium import PHONE, Browser, need_chromium
from tests.patience import PATIENCE_S
from tests.snapshots import make_capture, make_snapshot
from tests.unit.web.page import PASSWORD, Backend, raised

pytestmark = [pytest.mark.browser, pytest.mark.asyncio(loop_scope="module")]

CELLS = [f"press-{number}" for number in range(1, 9)]
CONNECTED, LOST = ModuleStatus(connected=True), ModuleStatus(connected=False, reason="no answer")
LATER = """
    const Now = Date;
    globalThis.Date = class extends Now {
        constructor(...at) { if (at.length) super(...at); else super(Now.now() + 60000); }
    };
"""
"""A minute passes in the browser."""
SEEN = """
    const [isSeen] = arguments;
    const told = { visibilityState: isSeen ? "visible" : "hidden", hidden: !isSeen };
    for (const [name, value] of Object.entries(told)) {
        Object.defineProperty(document, name, { configurable: true, get: () => value });
    }
    document.dispatchEvent(new Event("visibilitychange"));
"""
"""The tab comes in front of the others, or behind them."""
LOOKED = "setTimeout(arguments[0], 1000)"
"""Each second the page looks whether it has heard something; timers come in the order they are due in."""
ASK = """
    const done = arguments[arguments.length - 1];
    const asked = fetch("/alarms/rows", { signal: AbortSignal.timeout(arguments[0]) });
    asked.then((answer) => done(answer.status), (error) => done(error.name));
"""


class Relay:
    """What lies between browser and service, and can be cut: with a word, or in silence."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._server: asyncio.Server | None = None
        self._writers: set[asyncio.StreamWriter] = set()
        self._passes = asyncio.Event()
        self._passes.set()
        self.port = 0

    async def open(self) -> None:
        self._server = await asyncio.start_server(self._relay, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    async def cut(self) -> None:
        assert self._server is not None
        self._server.close()
        for writer in self._writers:
            writer.transport.abort()
        await self._server.wait_closed()

    def freeze(self) -> None:
        self._passes.clear()

    def thaw(self) -> None:
        self._passes.set()

    async def _relay(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        inside, outside = await asyncio.open_connection("127.0.0.1", self._port)
        self._writers |= {writer, outside}
        await asyncio.gather(self._pass(reader, outside), self._pass(inside, writer))
        self._writers -= {writer, outside}

    async def _pass(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while data := await reader.read(2**16):
                await self._passes.wait()
                writer.write(data)
                await writer.drain()
        writer.close()


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def server(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[PageServer]:
    need_chromium()
    directory: Path = tmp_path_factory.mktemp("page")
    users = directory / "users.yaml"
    write_users(users, {"olga": User("olga", Role.OBSERVER, password="x")})
    settings = PageSettings("http://127.0.0.1:0", users, directory / "pki", directory / "studies")
    server = PageServer(settings, [CellFacts(name, "", "") for name in CELLS], Backend(users))
    server.start()
    try:
        yield server
    finally:
        await asyncio.to_thread(server.stop)


@pytest_asyncio.fixture(loop_scope="module")
async def relay(server: PageServer) -> AsyncIterator[Relay]:
    relay = Relay(urlsplit(server.endpoint).port or 0)
    await relay.open()
    snapshot = replace(make_snapshot(make_capture(1)), time_ns=time.time_ns())
    for cell in CELLS:
        server.feed.put(CellNews(cell, status=CONNECTED))
        server.feed.put(CellNews(cell, snapshot, freshness=Freshness.LIVE))
    try:
        yield relay
    finally:
        relay.thaw()
        await relay.cut()


def states(browser: Browser) -> set[str]:
    return {place.text for place in browser.all(".card .state")}


def enter(browser: Browser, relay: Relay) -> None:
    browser.open(f"http://127.0.0.1:{relay.port}/")
    browser.log_in("olga", PASSWORD)
    browser.until(lambda: states(browser) == {"● live"}, "cells that are live")
    assert not browser.find("main").get_attribute("class")


def is_offline(browser: Browser) -> bool:
    return "No connection to the service" in browser.text and states(browser) == {"? unknown"}


@pytest.mark.slow
async def test_a_link_that_is_cut(relay: Relay, browser: Browser) -> None:
    await asyncio.to_thread(enter, browser, relay)
    await relay.cut()
    await asyncio.to_thread(browser.until, lambda: is_offline(browser), "that nothing is heard")
    notice = browser.find("#offline").text
    assert re.search(r"\(\w+ \d+, \d{4}, \d\d:\d\d:\d\d\)$", notice), "as every time on the page"
    await relay.open()
    back = lambda: states(browser) == {"● live"} and not browser.all("#offline:not([hidden])")  # noqa: E731
    await asyncio.to_thread(browser.until, back, "cells that are live again")


@pytest.mark.slow
async def test_a_link_that_falls_silent(relay: Relay, browser: Browser) -> None:
    """As with a cable that is pulled: no end of the connection ever comes."""
    await asyncio.to_thread(enter, browser, relay)
    relay.freeze()
    await asyncio.to_thread(browser.run, LATER)
    await asyncio.to_thread(browser.until, lambda: is_offline(browser), "that nothing is heard")
    relay.thaw()
    back = lambda: states(browser) == {"● live"} and not browser.all("#offline:not([hidden])")  # noqa: E731
    await asyncio.to_thread(browser.until, back, "cells that are live again")


@pytest.mark.slow
async def test_of_many_tabs_only_the_one_in_front_holds_a_connection(
    server: PageServer, relay: Relay, browser: Browser
) -> None:
    """A browser opens six to a host, whatever the number of tabs."""
    await asyncio.to_thread(enter, browser, relay)
    first = browser.driver.current_window_handle
    viewed = lambda: server.feed.viewers == 1  # noqa: E731
    try:
        for _ in range(7):
            await asyncio.to_thread(browser.run, SEEN, False)
            await asyncio.to_thread(browser.driver.switch_to.new_window, "tab")
            await asyncio.to_thread(browser.open, f"http://127.0.0.1:{relay.port}/")
            await asyncio.to_thread(
                browser.until, lambda: states(browser) == {"● live"}, "cells that are live"
            )
            await asyncio.to_thread(browser.until, viewed, "one stream")
        asked = await asyncio.to_thread(browser.driver.execute_async_script, ASK, 1e3 * PATIENCE_S)
        assert asked == 200
    finally:
        for tab in set(browser.driver.window_handles) - {first}:
            browser.driver.switch_to.window(tab)
            browser.driver.close()
        browser.driver.switch_to.window(first)


@pytest.mark.slow
async def test_a_tab_that_comes_in_front_again_is_as_of_now(
    server: PageServer, relay: Relay, browser: Browser
) -> None:
    await asyncio.to_thread(enter, browser, relay)
    await asyncio.to_thread(browser.run, SEEN, False)
    await asyncio.to_thread(browser.until, lambda: not server.feed.viewers, "no stream")
    for cell in CELLS:
        server.feed.put(CellNews(cell, status=LOST, freshness=Freshness.LOST))
    await asyncio.to_thread(browser.run, LATER)
    await asyncio.to_thread(browser.driver.execute_async_script, LOOKED)
    assert not browser.all("#offline:not([hidden])")
    assert states(browser) == {"● live"}
    await asyncio.to_thread(browser.run, SEEN, True)
    assert "● live" not in states(browser)
    now = lambda: states(browser) == {"✕ no connection to the module"}  # noqa: E731
    await asyncio.to_thread(browser.until, now, "the cells as they are")
    await asyncio.to_thread(browser.driver.execute_async_script, LOOKED)
    assert not browser.all("#offline:not([hidden])")


@pytest.mark.slow
async def test_a_tab_that_comes_in_front_again_without_the_service_says_so(
    server: PageServer, relay: Relay, browser: Browser
) -> None:
    await asyncio.to_thread(enter, browser, relay)
    await asyncio.to_thread(browser.run, SEEN, False)
    await asyncio.to_thread(browser.until, lambda: not server.feed.viewers, "no stream")
    await relay.cut()
    await asyncio.to_thread(browser.run, SEEN, True)
    await asyncio.to_thread(browser.until, lambda: is_offline(browser), "that nothing is heard")
    notice = browser.find("#offline").text
    assert re.search(r"\(\w+ \d+, \d{4}, \d\d:\d\d:\d\d\)$", notice), "as every time on the page"
    await relay.open()
    back = lambda: states(browser) == {"● live"} and not browser.all("#offline:not([hidden])")  # noqa: E731
    await asyncio.to_thread(browser.until, back, "cells that are live again")


@pytest.mark.slow
async def test_a_tab_behind_others_is_not_logged_out(
    server: PageServer, relay: Relay, browser: Browser
) -> None:
    watch = "const ask = fetch; globalThis.fetch = (...what) => { is_used = true; return ask(...what); };"
    await asyncio.to_thread(enter, browser, relay)
    await asyncio.to_thread(browser.run, SEEN, False)
    await asyncio.to_thread(browser.until, lambda: not server.feed.viewers, "no stream")
    await asyncio.to_thread(browser.run, f"globalThis.is_used = false; {watch}")
    await asyncio.to_thread(browser.driver.execute_async_script, LOOKED)
    assert not browser.run("return is_used")
    await asyncio.to_thread(browser.run, LATER.replace("60000", f"{1e3 * IDLE_S / 2}"))
    used = lambda: browser.run("return is_used")  # noqa: E731
    await asyncio.to_thread(browser.until, used, "that the session is in use")
    assert not server.feed.viewers


@pytest.mark.slow
async def test_the_notice_stays_in_sight(relay: Relay, browser: Browser) -> None:
    browser.show_as("light", PHONE)
    await asyncio.to_thread(enter, browser, relay)
    await relay.cut()
    await asyncio.to_thread(browser.until, lambda: is_offline(browser), "that nothing is heard")
    top = browser.run(
        "scrollTo(0, document.body.scrollHeight);"
        "return [scrollY, document.getElementById('offline').getBoundingClientRect().top];"
    )
    if pictures := os.environ.get("IMPACTCELL_SCREENSHOTS"):
        await asyncio.to_thread(browser.screenshot, Path(pictures) / "page-offline-phone.png")
    await relay.open()
    assert top[0] > 1000
    assert 0 <= top[1] < 20


@pytest.mark.slow
async def test_what_to_look_at_is_named_above_many_cells(
    server: PageServer, relay: Relay, browser: Browser
) -> None:
    await asyncio.to_thread(enter, browser, relay)
    assert not browser.find(".cards").find_elements("css selector", "#worries:not([hidden])")
    snapshot = replace(make_snapshot(make_capture(2)), cycle=2, time_ns=time.time_ns(), alarms=(raised(),))
    server.feed.put(CellNews("press-7", snapshot, freshness=Freshness.LIVE))
    server.feed.put(CellNews("press-3", status=LOST, freshness=Freshness.LOST))
    named = lambda: {link.text for link in browser.all("#worries a")}  # noqa: E731
    await asyncio.to_thread(
        browser.until, lambda: named() == {"▲ press-7", "✕ press-3"}, "the two cells that are named"
    )
    if pictures := os.environ.get("IMPACTCELL_SCREENSHOTS"):
        await asyncio.to_thread(browser.screenshot, Path(pictures) / "page-worries-light.png")
    await asyncio.to_thread(lambda: browser.all("#worries a")[-1].click())
    await asyncio.to_thread(browser.until, lambda: browser.path == "/cells/press-7", "the cell's page")
