"""A page outlives the service: it waits for the next one, whatever answers meanwhile."""

import contextlib
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from impactcell.scada import Role
from impactcell.scada.users import User, write_users
from impactcell.web import CellFacts, CellNews, PageServer, PageSettings
from impactcell.web.interface import Freshness
from tests.browser.chromium import Browser
from tests.browser.test_lost_link import CONNECTED, is_offline, states
from tests.snapshots import make_capture, make_snapshot
from tests.unit.web.page import PASSWORD, Backend

pytestmark = pytest.mark.browser

CELL = "press-1"
COUNT_STREAMS = """
    const Stream = EventSource;
    globalThis.lost_streams = 0;
    globalThis.EventSource = class extends Stream {
        constructor(...what) {
            super(...what);
            this.addEventListener("error", () => { lost_streams += 1; });
        }
    };
"""
LOST = "return globalThis.lost_streams ?? -1"


class BadGateway(BaseHTTPRequestHandler):
    """A proxy whose service is away."""

    def do_GET(self) -> None:
        self.send_error(502)

    do_HEAD = do_GET  # noqa: N815 - as the handler is asked for it

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextlib.contextmanager
def service(endpoint: str, directory: Path) -> Iterator[PageServer]:
    users = directory / "users.yaml"
    write_users(users, {"olga": User("olga", Role.OBSERVER, password="x")})
    settings = PageSettings(endpoint, users, directory / "pki", directory / "studies")
    server = PageServer(settings, [CellFacts(CELL, "", "")], Backend(users))
    server.start()
    snapshot = replace(make_snapshot(make_capture(1)), time_ns=time.time_ns())
    server.feed.put(CellNews(CELL, status=CONNECTED))
    server.feed.put(CellNews(CELL, snapshot, freshness=Freshness.LIVE))
    try:
        yield server
    finally:
        server.stop()


@contextlib.contextmanager
def proxy_without_service(endpoint: str) -> Iterator[None]:
    with ThreadingHTTPServer(("127.0.0.1", urlsplit(endpoint).port or 0), BadGateway) as proxy:
        thread = threading.Thread(target=proxy.serve_forever)
        thread.start()
        try:
            yield
        finally:
            proxy.shutdown()
            thread.join()


@contextlib.contextmanager
def before_scripts(browser: Browser, script: str) -> Iterator[None]:
    """Run a script before those of each page that is opened."""
    added = browser.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": script})
    try:
        yield
    finally:
        browser.driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", added)


def enter(browser: Browser) -> None:
    browser.log_in("olga", PASSWORD)
    browser.until(lambda: states(browser) == {"● live"}, "a cell that is live")


@pytest.mark.slow
@pytest.mark.parametrize("has_proxy", [False, True], ids=["nobody answers", "a proxy answers"])
def test_a_page_waits_for_the_service_that_was_ended_in_order(
    browser: Browser, tmp_path: Path, *, has_proxy: bool
) -> None:
    with service("http://127.0.0.1:0", tmp_path) as first:
        browser.open(first.endpoint)
        with before_scripts(browser, COUNT_STREAMS):
            enter(browser)
    meanwhile = proxy_without_service(first.endpoint) if has_proxy else contextlib.nullcontext()
    with meanwhile:
        # Each time nobody is there, and the page is still the same.
        browser.until(lambda: browser.run(LOST) >= 3, "a page that asks for its service")
        assert is_offline(browser)
    with service(first.endpoint, tmp_path):
        browser.until(lambda: browser.path == "/login", "the login")
        enter(browser)
        assert not browser.all("#offline:not([hidden])")
