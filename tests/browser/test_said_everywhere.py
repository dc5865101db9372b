"""What is said on every page, is said once, or would be a silence."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.scada.users import User, write_users
from impactcell.web import CellFacts, CellNews, PageServer, PageSettings
from tests.browser.chromium import Browser
from tests.snapshots import make_capture, make_snapshot
from tests.unit.web.page import NAMES, PASSWORD, Backend, raised

pytestmark = pytest.mark.browser

CELLS = ("press-1", "press-2")
BEGIN = """
    const body = new URLSearchParams(arguments[0]);
    return fetch("/studies", { method: "POST", body }).then((answer) => answer.json());
"""


@pytest.fixture
def server(browser: Browser, tmp_path: Path) -> Iterator[PageServer]:
    """A page with an engineer logged in."""
    users = tmp_path / "users.yaml"
    write_users(users, {name: User(name, role, password="x") for role, name in NAMES.items()})
    settings = PageSettings("http://127.0.0.1:0", users, tmp_path / "pki", tmp_path / "studies")
    server = PageServer(settings, [CellFacts(name, "", "") for name in CELLS], Backend(users))
    server.start()
    try:
        browser.open(server.endpoint)
        browser.log_in("eva", PASSWORD)
        browser.until(lambda: browser.path == "/", "the cells")
        yield server
    finally:
        server.stop()


def count(browser: Browser) -> str:
    return "".join(place.text for place in browser.all("#open-alarms:not([hidden])"))


@pytest.mark.slow
@pytest.mark.parametrize(
    "path", ["/", f"/cells/{CELLS[0]}", "/alarms", "/studies", "/studies/{study}", "/system"]
)
def test_the_count_of_open_alarms_is_of_now_and_of_all_cells(
    server: PageServer, browser: Browser, tmp_path: Path, path: str
) -> None:
    if "{study}" in path:
        browser.open(f"{server.endpoint}/studies")
        csrf = browser.run("return document.getElementById('drop-form').dataset.csrf")
        path = path.format(study=browser.run(BEGIN, {"csrf": csrf, "cell": CELLS[0], "title": "rail"})["id"])
    browser.open(f"{server.endpoint}{path}")
    assert count(browser) == ""
    server.feed.put(CellNews(CELLS[1], alarms=(raised(),)))
    browser.until(lambda: count(browser) == "1", "the alarm of another cell")
    server.feed.put(CellNews(CELLS[0], alarms=(raised(),)))
    browser.until(lambda: count(browser) == "2", "both alarms")


@pytest.mark.slow
def test_what_came_of_a_form_is_said_once(server: PageServer, browser: Browser) -> None:
    for path, said in (
        (f"/cells/{CELLS[0]}?done=reset-wear", "learned anew, from the next cycle on"),
        ("/alarms?cell=press-1&refused=BadConditionNotShelved", "it is not shelved any more"),
    ):
        browser.open(f"{server.endpoint}{path}")
        browser.until(lambda said=said: said in browser.text, said)
        address = browser.until(
            lambda: (at := browser.run("return location.search")) in ("", "?cell=press-1") and (at or "none"),
            "an address without it",
        )
        browser.driver.refresh()
        browser.find("h1, h2")
        assert said not in browser.text, address


@pytest.mark.slow
def test_a_form_without_a_file_says_so(server: PageServer, browser: Browser) -> None:
    for language, said in (("en", "Choose files, or drop them here."), ("de", "Bitte Dateien wählen")):
        browser.open(f"{server.endpoint}/studies?lang={language}")
        browser.until(lambda: browser.find("#drop-form button").click() or said in browser.text, said)  # noqa: B023


@pytest.mark.slow
def test_charts_say_that_there_was_no_tap_yet(server: PageServer, browser: Browser) -> None:
    for language, said in (
        ("en", "no tap since the service was started"),
        ("de", "kein Stoß seit dem Start"),
    ):
        browser.open(f"{server.endpoint}/cells/{CELLS[0]}?lang={language}")
        for chart in ("force", "position", "signature"):
            browser.until(lambda: said in browser.find(f"#{chart}").text, f"{chart}: {said}")  # noqa: B023
    server.feed.put(
        CellNews(CELLS[0], replace(make_snapshot(make_capture(7)), time_ns=10**18), make_capture(7))
    )
    browser.find("#force canvas")
