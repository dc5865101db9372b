"""A cell of which little is known, and one that places parts: what its page shows, on a phone in German."""

import asyncio
import math
import time
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pytest_asyncio

from impactcell.journal.store import Journal
from impactcell.records import Coefficient, Estimator, ModuleStatus, PositioningState, Quality, Snapshot
from impactcell.scada import Role
from impactcell.scada.users import User, write_users
from impactcell.web import CellFacts, CellNews, PageServer, PageSettings
from impactcell.web.interface import Freshness
from tests.browser.chromium import PHONE, Browser, need_chromium
from tests.browser.shop import judge
from tests.snapshots import make_capture, make_snapshot
from tests.unit.web.page import PASSWORD, Backend

pytestmark = [pytest.mark.browser, pytest.mark.asyncio(loop_scope="module")]

NAN = math.nan
UNKNOWN, PLACING, SILENT = "unknown", "placing", "silent"


def unknown(snapshot: Snapshot) -> Snapshot:
    """Make a snapshot of a cycle in which nothing could be estimated."""
    none = Coefficient(NAN, NAN, Quality.BAD, "no force was recorded")
    signature, nothing = snapshot.signature, np.full(30, NAN)
    return replace(
        snapshot,
        friction=replace(snapshot.friction, mu_s=none, mu_k=none, estimator=Estimator.NONE, peak_force_n=NAN),
        wear=replace(
            snapshot.wear, level=NAN, level_std=NAN, cycles_to_limit=NAN, cycles_to_limit_low=NAN,
            quality=Quality.BAD, reason="mu_s is missing, the cycle is not used",
        ),
        batch=replace(snapshot.batch, offset=NAN, offset_std=NAN, quality=Quality.BAD),
        signature=replace(
            signature, friction=nothing, friction_std=nothing, t_squared=NAN, spe=NAN, quality=Quality.BAD,
            reason="no position was recorded",
        ),
    )  # fmt: skip


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def server(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[PageServer]:
    need_chromium()
    directory: Path = tmp_path_factory.mktemp("page")
    users = directory / "users.yaml"
    write_users(users, {"otto": User("otto", Role.OPERATOR, password="x")})
    (directory / "studies").write_text("no directory: nothing can be stored in it")
    settings = PageSettings("http://127.0.0.1:0", users, directory / "pki", directory / "studies")
    cells = [
        CellFacts(UNKNOWN, "10.0.0.9:502", "", directory / "unknown.sqlite"),
        CellFacts(PLACING, "10.0.0.9:502", "", has_positioning=True),
        CellFacts(SILENT, "10.0.0.8:502", ""),
    ]
    server = PageServer(settings, cells, Backend(users))
    server.start()
    connected, lost = (
        ModuleStatus(connected=True),
        "silent: 10.0.0.8:502 device 1: no connection within 0.5 s",
    )
    for cycle in range(1, 4):
        capture = make_capture(1_234_560 + cycle)
        summary = replace(capture, force=None, position=None)
        snapshot = replace(make_snapshot(capture), time_ns=time.time_ns())
        task = PositioningState(0.0125, 0.004 / cycle, 0.05, 0.0015, running=True, taps=cycle)
        with Journal(directory / "unknown.sqlite", UNKNOWN) as journal:
            journal.append(replace(summary, time_ns=snapshot.time_ns), unknown(snapshot), b"", ())
        server.feed.put(CellNews(UNKNOWN, unknown(snapshot), summary, connected, freshness=Freshness.LIVE))
        placing = replace(snapshot, positioning=task)
        server.feed.put(CellNews(PLACING, placing, capture, status=connected, freshness=Freshness.STALE))
    server.feed.put(CellNews(SILENT, status=ModuleStatus(connected=False, reason=lost)))
    try:
        yield server
    finally:
        await asyncio.to_thread(server.stop)


def enter(browser: Browser, server: PageServer) -> None:
    browser.show_as("dark", PHONE)
    browser.open(f"{server.endpoint}/login?lang=de")
    browser.log_in("otto", PASSWORD)
    browser.find(f'[data-cell="{UNKNOWN}"][data-cycle]')


@pytest.mark.slow
async def test_what_is_not_known_is_a_dash_and_says_why(
    server: PageServer, browser: Browser, tmp_path: Path
) -> None:
    def look() -> None:
        enter(browser, server)
        card = browser.find(f'[data-cell="{UNKNOWN}"]')
        assert card.find_element("css selector", "[data-field=cycles_left]").text == "–"
        browser.open(f"{server.endpoint}/cells/{UNKNOWN}")
        browser.find("[data-cycle]")
        browser.until(lambda: browser.find("#signature").text == "in diesem Zyklus nicht aufgezeichnet")
        browser.until(lambda: browser.find("#trend").text == "keine verwendbare Reibung in dieser Zeit")
        assert browser.find("[data-field=wear_reason]").text == "µs fehlt, der Zyklus wird nicht verwendet"
        assert not {"NaN", "null", "undefined", "Infinity"} & set(browser.text.split())
        assert judge(browser, "unknown", tmp_path / "unknown.png", PHONE[0]) == []

    await asyncio.to_thread(look)


@pytest.mark.slow
async def test_taps_to_a_target_fit_a_phone(server: PageServer, browser: Browser, tmp_path: Path) -> None:
    def look() -> None:
        enter(browser, server)
        browser.open(f"{server.endpoint}/cells/{PLACING}")
        rows = browser.until(lambda: browser.all("#taps tbody tr"), "the taps")
        assert rows[0].text.split() == ["1234563", "3000", "1,333"]
        wide, room = browser.run(
            "const s = document.querySelector('#taps').parentElement; return [s.scrollWidth, s.clientWidth]"
        )
        assert wide <= room
        assert judge(browser, "placing", tmp_path / "placing.png", PHONE[0]) == []

    await asyncio.to_thread(look)


@pytest.mark.slow
async def test_a_module_that_answers_is_not_called_live(server: PageServer, browser: Browser) -> None:
    """What the system page shows is of when it was opened, also where no cycle has come for long."""

    def look() -> str:
        enter(browser, server)
        browser.open(f"{server.endpoint}/system")
        browser.find("dl.figures")
        return browser.text

    text = await asyncio.to_thread(look)
    assert "live" not in {word.lower() for word in text.split()}
    assert "Modul antwortet" in text
    assert "silent: 10.0.0.8:502 Gerät 1: keine Verbindung innerhalb von 0,5 s" in text
    assert "Stand: " in text


@pytest.mark.slow
async def test_a_file_that_is_not_taken_says_why(
    server: PageServer, browser: Browser, tmp_path: Path
) -> None:
    table = tmp_path / "stoss.csv"
    table.write_text("t;F\n0;1\n")

    def drop() -> None:
        enter(browser, server)
        browser.open(f"{server.endpoint}/studies")
        browser.find("input[type=file]").send_keys(str(table))
        browser.find("#drop-form button").click()
        said = lambda: browser.find("#drop-note").text == "Auf der Platte ist kein Platz dafür."  # noqa: E731
        browser.until(said, "why it was not taken")

    await asyncio.to_thread(drop)
