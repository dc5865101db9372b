"""The list of open alarms is as of now where it is looked at, and stays as it is under somebody's hands."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from selenium.webdriver.common.keys import Keys

from impactcell.alarms import EventKind
from impactcell.records import Shelving
from impactcell.scada.users import User, write_users
from impactcell.web import CellFacts, CellNews, PageServer, PageSettings
from tests.browser.chromium import Browser
from tests.browser.test_lost_link import SEEN
from tests.unit.web.page import NAMES, PASSWORD, Backend, raised

pytestmark = pytest.mark.browser

CELLS = ("press-1", "press-2", "press-3")
ROWS_ASKED_FOR = """
    const ask = fetch;
    globalThis.rows_asked_for = 0;
    globalThis.fetch = (...what) => { rows_asked_for += what[0] === "/alarms/rows"; return ask(...what); };
"""


@pytest.fixture
def backend(tmp_path: Path) -> Backend:
    return Backend(tmp_path / "users.yaml")


@pytest.fixture(params=[1, 3], ids=["one cell", "three cells"])
def server(
    request: pytest.FixtureRequest, browser: Browser, backend: Backend, tmp_path: Path
) -> Iterator[PageServer]:
    """A page with somebody logged in; each cell has an alarm."""
    users = backend.users
    write_users(users, {name: User(name, role, password="x") for role, name in NAMES.items()})
    settings = PageSettings("http://127.0.0.1:0", users, tmp_path / "pki", tmp_path / "studies")
    cells = CELLS[: request.param]
    server = PageServer(settings, [CellFacts(name, "", "") for name in cells], backend)
    server.start()
    for cell in cells:
        server.feed.put(CellNews(cell, alarms=(raised(),)))
    try:
        browser.open(server.endpoint)
        browser.log_in("otto", PASSWORD)
        browser.until(lambda: browser.path == "/", "the cells")
        yield server
    finally:
        server.stop()


def put(server: PageServer, name: str, cycle: int) -> None:
    alarm = replace(raised(), name=name, cycle=cycle)
    server.feed.put(CellNews(CELLS[0], alarms=(alarm,)))


def open_with(browser: Browser, server: PageServer, script: str) -> None:
    """Open the alarms with a script that runs before those of the page."""
    run = {"source": script}
    added = browser.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", run)
    try:
        browser.open(f"{server.endpoint}/alarms")
    finally:
        browser.driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", added)


def listed(browser: Browser) -> set[str]:
    return {article.get_attribute("data-alarm") for article in browser.all("#open article")}


@pytest.mark.slow
def test_a_tab_that_was_opened_behind_others_lists_what_is_when_it_comes_in_front(
    server: PageServer, browser: Browser
) -> None:
    open_with(browser, server, SEEN.replace("arguments", "[false]"))
    before = listed(browser)
    assert f"{CELLS[0]}-DeviantCycle" in before
    put(server, "WearLimit", 8)
    browser.run(SEEN, True)
    after = before | {f"{CELLS[0]}-WearLimit"}
    browser.until(lambda: listed(browser) == after, "the alarm that came meanwhile")


@pytest.mark.slow
def test_a_list_is_asked_for_where_it_has_changed_and_no_more(server: PageServer, browser: Browser) -> None:
    open_with(browser, server, ROWS_ASKED_FOR)
    put(server, "WearLimit", 8)
    new = f"{CELLS[0]}-WearLimit"
    browser.until(lambda: new in listed(browser), "the alarm that came")
    assert browser.run("return rows_asked_for") <= 1  # none where the alarm came before the page
    put(server, "BatchShift", 9)
    browser.until(lambda: f"{CELLS[0]}-BatchShift" in listed(browser), "the next one")
    assert browser.run("return rows_asked_for") <= 2


@pytest.mark.slow
def test_what_somebody_writes_stays_until_he_wants_the_list_anew(
    server: PageServer, browser: Browser
) -> None:
    comment = f'[data-alarm="{CELLS[0]}-DeviantCycle"] input[name=comment]'
    browser.open(f"{server.endpoint}/alarms")
    browser.write(comment, "seen by")
    browser.run(SEEN, False)
    put(server, "WearLimit", 8)
    browser.run(SEEN, True)
    browser.find("#renew")
    assert browser.find(comment).get_attribute("value") == "seen by"
    browser.find("#renew").click()
    browser.until(lambda: f"{CELLS[0]}-WearLimit" in listed(browser), "the alarm that came meanwhile")
    assert not browser.all("#renew:not([hidden])")


@pytest.mark.slow
@pytest.mark.parametrize("is_acknowledged", [False, True], ids=["not acknowledged", "to be confirmed"])
def test_enter_does_what_the_field_is_for(
    server: PageServer, backend: Backend, browser: Browser, *, is_acknowledged: bool
) -> None:
    alarm = replace(raised(), acknowledged=is_acknowledged, confirmed=not is_acknowledged)
    server.feed.put(CellNews(CELLS[0], alarms=(alarm,)))
    of_alarm = f'[data-alarm="{CELLS[0]}-DeviantCycle"] input[name={{}}]'
    for count, (field, text) in enumerate((("minutes", "45"), ("comment", "seen")), start=1):
        browser.open(f"{server.endpoint}/alarms")
        browser.write(of_alarm.format(field), f"{text}{Keys.ENTER}")
        browser.until(lambda count=count: len(backend.acted) == count, "what was done")
    done = [(action.event, action.comment, action.shelve_s) for _, _, action, _ in backend.acted]
    assert done == [(EventKind.SHELVE_TIMED, "", 2700.0), (EventKind.COMMENT, "seen", 0.0)]


PRESS_TWICE = """
    const held = [], button = document.querySelector("button[value=acknowledge]");
    addEventListener("submit", (event) => held.push(event.defaultPrevented));
    button.click();
    button.click();
    return held;
"""


@pytest.mark.slow
@pytest.mark.parametrize("server", [1], indirect=True)
def test_a_button_that_is_pressed_twice_sends_its_form_once(
    server: PageServer, backend: Backend, browser: Browser
) -> None:
    """The second answer said that somebody had acknowledged it already."""
    browser.open(f"{server.endpoint}/alarms")
    for count in (1, 2):  # again on the page that came of it
        browser.find("button[value=acknowledge]")
        assert browser.run(PRESS_TWICE) == [False, True]
        browser.until(lambda count=count: len(backend.acted) == count, "what was done")
        browser.until(lambda: browser.run("return !document.querySelector('[data-sent]')"), "the page anew")


@pytest.mark.slow
@pytest.mark.parametrize("path", ["/", f"/cells/{CELLS[0]}"])
def test_what_is_shelved_hides_nothing_that_is_open(server: PageServer, browser: Browser, path: str) -> None:
    opened = replace(raised("a scratch"), acknowledged=True)
    shelved = replace(raised("worn"), name="WearLimit", shelving=Shelving.TIMED, time_ns=2 * 10**18)
    server.feed.put(CellNews(CELLS[0], alarms=(shelved, opened)))
    browser.open(f"{server.endpoint}{path}?lang=de")
    told = f'[data-cell="{CELLS[0]}"] .alarm'
    browser.until(lambda: "▲ " in browser.find(told).text, "the alarm that is open")
    assert "a scratch" in browser.find(told).text
    server.feed.put(CellNews(CELLS[0], alarms=(replace(opened, active=False),)))
    browser.until(lambda: "‖ " in browser.find(told).text, "the alarm that is shelved")
    assert "(zurückgestellt, nicht quittiert): worn" in browser.find(told).text
    assert not browser.all(f"{told}.is-open")
