"""The live page in a real browser: a running service, a simulated module, an OPC UA client beside it."""

import json
import os
from collections.abc import AsyncIterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import pytest_asyncio
from asyncua import ua

from impactcell.scada import Role
from impactcell.scada.users import User, read_users, with_password, write_users
from impactcell.web import system_page
from tests.browser.chromium import DESK, PHONE, WALL, Browser, need_chromium
from tests.browser.shop import PASSWORDS, Shop, at_work, enter, judge
from tests.opcua_server import PatientClient

pytestmark = [pytest.mark.browser, pytest.mark.asyncio(loop_scope="module")]

CELL = "press-hall-4_line-2_station-17_carbide-table-north-of-two.second"
"""As long as the name of a cell may be."""
PAGES = {
    "cells": "/",
    "cell": f"/cells/{CELL}",
    "alarms": "/alarms",
    "studies": "/studies",
    "system": "/system",
}
SCRIPT = "<script>document.title='owned'</script>"
MOST_BYTES = 200_000
"""What is asked of a page with all that belongs to it."""
LIMIT_PASSED = """
    const meter = document.querySelector("meter");
    return [meter.value, meter.high, meter.low, meter.optimum];
"""


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def shop(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Shop]:
    need_chromium()
    scenario = {
        "strikes": {"period_s": 0.5, "velocities_mm_per_min": [4000]},
        "wear": {"mu_s_per_1000_cycles": 4.0},
        "batches": [{"from_cycle": 1, "id": "A"}, {"from_cycle": 12, "id": SCRIPT[:16]}],
    }
    directory = tmp_path_factory.mktemp("shop")
    alarms, signature = {"wear_limit": 0.21}, {"learning_cycles": 10}
    async with at_work(directory, 20, scenario, CELL, alarms=alarms, signature=signature) as shop:
        yield shop


@pytest.mark.slow
async def test_each_cycle_comes_to_a_page_that_stays_open(shop: Shop, browser: Browser) -> None:
    await shop.beside(lambda: enter(browser, shop, "olga"))
    card = f'[data-cell="{CELL}"]'
    for _ in range(5):
        shop.module.strike()
        cycle = shop.module.device.cycle

        def is_shown(cycle: int = cycle) -> bool:
            return int(browser.all(card)[0].get_attribute("data-cycle") or 0) >= cycle

        await shop.beside(lambda: browser.until(is_shown, "the cycle"))
    shown = await shop.beside(lambda: browser.find(f"{card} [data-field=mu_s]").text)
    assert float(shown) == pytest.approx(shop.last.friction.mu_s.value, abs=0.05)


@pytest.mark.slow
async def test_an_alarm_that_is_acknowledged_here_is_acknowledged_over_opc_ua(
    shop: Shop, browser: Browser
) -> None:
    await shop.watched.alarm(CELL, "WearLimit", active=True)
    comment = f"seen {SCRIPT}"

    def acknowledge() -> None:
        enter(browser, shop, "otto")
        browser.open(f"{shop.page}/alarms")
        form = f'[data-alarm="{CELL}-WearLimit"] form'
        browser.write(f"{form} input[name=comment]", comment)
        browser.find(f"{form} button[value=acknowledge]").click()
        browser.find(f'[data-alarm="{CELL}-WearLimit"] .said')

    client = PatientClient(shop.endpoint)
    client.set_user("olga")
    client.set_password(PASSWORDS["olga"])
    async with client:
        index = await client.get_namespace_index("urn:impactcell:cells")

        def node(path: str) -> object:
            return client.get_node(ua.NodeId(f"{CELL}/WearLimit/{path}", index))

        assert not await node("AckedState/Id").read_value()  # type: ignore[attr-defined]
        await shop.beside(acknowledge)
        assert await node("AckedState/Id").read_value()  # type: ignore[attr-defined]
        assert (await node("Comment").read_value()).Text == comment  # type: ignore[attr-defined]
    text = await shop.beside(lambda: browser.text)
    assert comment in text
    assert await shop.beside(lambda: browser.driver.title) == "Alarms · impactcell"
    assert [entry.user for entry in shop.audit() if entry.action == "acknowledge"] == [
        "otto (operator) from 127.0.0.1"
    ]


@pytest.mark.slow
async def test_a_wrong_password_leads_nowhere(shop: Shop, browser: Browser) -> None:
    def guess() -> str:
        browser.open(f"{shop.page}/system")
        browser.log_in("eva", "not-this-one")
        browser.find("[role=alert]")
        return browser.path

    assert await shop.beside(guess) == "/login"
    await shop.beside(lambda: browser.log_in("eva", PASSWORDS["eva"]))
    await shop.beside(lambda: browser.until(lambda: browser.path == "/system", "where it was going"))


@pytest.mark.slow
async def test_an_observer_sees_all_and_is_offered_nothing(shop: Shop, browser: Browser) -> None:
    await shop.watched.alarm(CELL, "WearLimit", active=True)

    def look() -> list[object]:
        enter(browser, shop, "olga")
        browser.open(f"{shop.page}/alarms")
        browser.find(f'[data-alarm="{CELL}-WearLimit"]')
        return browser.all('form[action="/alarms/act"]')

    assert await shop.beside(look) == []
    token = await shop.beside(lambda: browser.all("input[name=csrf]")[0].get_attribute("value"))
    script = """
        const [csrf, cell] = arguments;
        const body = new URLSearchParams({csrf, cell, alarm: "WearLimit", action: "shelve", minutes: "5"});
        return fetch("/alarms/act", {method: "POST", body}).then((answer) => answer.status);
    """
    assert await shop.beside(lambda: browser.run(script, token, CELL)) == 403


@pytest.mark.slow
async def test_a_session_that_ends_leads_to_the_login(shop: Shop, browser: Browser) -> None:
    users = read_users(shop.directory / "users.yaml")
    guest = with_password(User("guest", Role.OBSERVER), "for-a-while")
    write_users(shop.directory / "users.yaml", {**users, "guest": guest})

    def come() -> None:
        browser.open(shop.page)
        browser.log_in("guest", "for-a-while")
        browser.find(f'[data-cell="{CELL}"][data-cycle]')

    await shop.beside(come)
    write_users(shop.directory / "users.yaml", users)
    await shop.beside(lambda: browser.until(lambda: browser.path == "/login", "the login"))
    assert "The session is over" in await shop.beside(lambda: browser.text)


@pytest.mark.slow
async def test_a_script_in_a_batch_id_is_shown_as_text(shop: Shop, browser: Browser) -> None:
    def look() -> None:
        enter(browser, shop, "olga")
        for path in PAGES.values():
            browser.open(shop.page + path)
            browser.find("main")
            if path in ("/", PAGES["cell"]):
                browser.until(lambda: SCRIPT[:16] in browser.text, "the batch")
            assert "owned" not in browser.driver.title
            assert not browser.run(
                "return [...document.scripts].some((s) => s.textContent.includes('owned'))"
            )

    await shop.beside(look)


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "de"])
@pytest.mark.parametrize(("theme", "size"), [("light", DESK), ("dark", DESK), ("light", PHONE)], ids=str)
async def test_every_page(
    shop: Shop, browser: Browser, tmp_path: Path, language: str, theme: str, size: tuple[int, int]
) -> None:
    """Is small, asks nobody else, fits, and has nothing that keeps people from using it."""
    await shop.watched.alarm(CELL, "WearLimit", active=True)
    pictures = Path(os.environ.get("IMPACTCELL_SCREENSHOTS") or tmp_path)
    suffix = f"{'phone' if size == PHONE else theme}{'' if language == 'en' else f'-{language}'}"

    def look() -> None:
        browser.show_as(theme, size)
        browser.open(f"{shop.page}/login?lang={language}")
        faults = judge(browser, "login", pictures / f"page-login-{suffix}.png", size[0])
        browser.log_in("eva", PASSWORDS["eva"])
        browser.until(lambda: browser.path == "/", "the cells")
        for name, path in PAGES.items():
            browser.driver.execute_cdp_cmd("Network.clearBrowserCache", {})
            browser.traffic()
            browser.open(shop.page + path)
            if path in ("/", PAGES["cell"]):
                browser.find(f'[data-cell="{CELL}"][data-cycle]')
            if name == "cell":
                browser.until(lambda: len(browser.all("canvas")) == 4, "four charts")
                value, high, low, best = browser.run(LIMIT_PASSED)
                assert value > high > low > best, "a limit that is passed is red, not amber"
            opening_s = 1e-3 * browser.run(
                "return performance.getEntriesByType('navigation')[0].loadEventEnd"
            )
            hosts, length = browser.traffic()
            print(f"{name} {suffix}: opened in {opening_s:.3f} s, {length} bytes")
            assert hosts == {shop.page.removeprefix("http://")}
            assert 1_000 < length < MOST_BYTES
            faults += judge(browser, name, pictures / f"page-{name}-{suffix}.png", size[0])
        assert not faults, json.dumps(faults, indent=1)

    await shop.beside(look)


ONE_CARD = """
    window.EventSource = class extends EventSource {
        addEventListener(kind, take) {
            if (kind !== "card") return super.addEventListener(kind, take);
            const takeOnceDrawn = (event) => {
                if (document.querySelector("#trend canvas")) take(event);
                else setTimeout(() => takeOnceDrawn(event), 10);
            };
            super.addEventListener(kind, takeOnceDrawn, { once: true });
        }
    };
"""
"""Of the cards that the service sends a page takes only the first, and only once its trend is drawn."""
LIMIT_IS_DRAWN = """
    const canvas = document.querySelector("#trend canvas");
    if (!canvas) return false;
    const bad = getComputedStyle(document.documentElement).getPropertyValue("--bad").trim();
    const [red, green, blue] = [1, 3, 5].map((at) => parseInt(bad.slice(at, at + 2), 16));
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    const near = (i, value) => Math.abs(data[i] - value) < 12;
    return data.some((_, i) => i % 4 === 0
        && near(i, red) && near(i + 1, green) && near(i + 2, blue) && data[i + 3] > 100);
"""


@pytest.mark.slow
async def test_the_wear_limit_is_drawn_as_soon_as_it_is_known(shop: Shop, browser: Browser) -> None:
    def look() -> None:
        enter(browser, shop, "olga")
        ask = browser.driver.execute_cdp_cmd
        script = ask("Page.addScriptToEvaluateOnNewDocument", {"source": ONE_CARD})
        try:
            browser.open(shop.page + PAGES["cell"])
            browser.find("#trend canvas")
            browser.find(f'[data-cell="{CELL}"][data-cycle]')
            browser.until(lambda: browser.run(LIMIT_IS_DRAWN), "the limit")
        finally:
            ask("Page.removeScriptToEvaluateOnNewDocument", script)

    await shop.beside(look)


SUBMIT = """
    const [path, fields] = arguments;
    const form = Object.assign(document.createElement("form"), {method: "post", action: path});
    for (const [name, value] of Object.entries(fields))
        form.append(Object.assign(document.createElement("input"), {name, value}));
    document.body.append(form);
    form.submit();
"""
"""Sends a form that no page of ours offers."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("theme", "size", "language"), [("dark", DESK, "en"), ("light", PHONE, "de")], ids=str
)
async def test_every_page_of_a_refusal(
    shop: Shop,
    browser: Browser,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    theme: str,
    size: tuple[int, int],
    language: str,
) -> None:
    """Not found, not allowed, too long, a fault of the page, a session that is over: each can be read."""
    pictures = Path(os.environ.get("IMPACTCELL_SCREENSHOTS") or tmp_path)
    suffix = f"{'phone' if size == PHONE else theme}{'' if language == 'en' else f'-{language}'}"

    def fail(*_: object) -> None:
        raise RuntimeError("a disk that is gone")

    def look() -> None:
        browser.show_as(theme, size)
        browser.open(f"{shop.page}/login?lang={language}")
        browser.log_in("olga", PASSWORDS["olga"])
        browser.until(lambda: browser.path == "/", "the cells")
        token = browser.all("input[name=csrf]")[0].get_attribute("value")
        ways = {
            "404": lambda: browser.open(f"{shop.page}/nothing"),
            "403": lambda: browser.run(SUBMIT, "/alarms/act", {"csrf": token, "cell": CELL}),
            "413": lambda: browser.run(SUBMIT, "/alarms/act", {"csrf": token, "comment": "long " * 5000}),
            "500": lambda: browser.open(f"{shop.page}/system"),
        }
        faults = []
        for code, go in ways.items():
            go()
            browser.until(lambda code=code: f"({code})" in browser.text, f"the page of {code}")
            seen = judge(browser, code, pictures / f"page-{code}-{suffix}.png", size[0])
            faults += [fault for fault in seen if f"status of {code}" not in fault]
        browser.driver.add_cookie({"name": f"impactcell_{urlsplit(shop.page).port}", "value": "over"})
        browser.open(f"{shop.page}/alarms")
        over = {"en": "The session is over", "de": "Die Sitzung ist zu Ende"}[language]
        browser.until(lambda: over in browser.text, "that the session is over")
        faults += judge(browser, "over", pictures / f"page-over-{suffix}.png", size[0])
        assert not faults, json.dumps(faults, indent=1)

    monkeypatch.setattr(system_page, "_cell_system", fail)
    await shop.beside(look)


@pytest.mark.slow
async def test_a_screen_on_the_wall(shop: Shop, browser: Browser, tmp_path: Path) -> None:
    """Has larger letters, and nothing that keeps people from reading it."""
    pictures = Path(os.environ.get("IMPACTCELL_SCREENSHOTS") or tmp_path)

    def look() -> None:
        browser.show_as("dark", WALL)
        enter(browser, shop, "olga")
        browser.find(f'[data-cell="{CELL}"][data-cycle]')
        faults = judge(browser, "wall", pictures / "page-wall-dark.png", WALL[0])
        letters = browser.run("return parseFloat(getComputedStyle(document.documentElement).fontSize)")
        assert letters >= 24
        assert browser.run("return document.querySelector('main').clientWidth") == WALL[0]
        assert not faults, json.dumps(faults, indent=1)

    await shop.beside(look)


@pytest.mark.slow
async def test_worn_parts_were_replaced(shop: Shop, browser: Browser) -> None:
    """An engineer says so, the level is learned anew, the audit log has it; an observer is not offered it."""
    form = f'form[action="/cells/{CELL}/reset-wear"]'

    def look() -> int:
        enter(browser, shop, "olga")
        browser.open(f"{shop.page}{PAGES['cell']}")
        browser.find(f'[data-cell="{CELL}"][data-cycle]')
        return len(browser.all(form))

    def press() -> None:
        browser.forget()
        enter(browser, shop, "eva")
        browser.open(f"{shop.page}{PAGES['cell']}")
        browser.find("summary").click()
        browser.write(f"{form} input[name=comment]", "new plate")
        browser.find(f"{form} button").click()
        browser.find(".notice.good")

    assert await shop.beside(look) == 0
    await shop.beside(press)
    said = [entry for entry in shop.audit() if entry.action == "ResetWear"]
    assert [(entry.user, entry.result) for entry in said] == [("eva (engineer) from 127.0.0.1", "Good")]
    assert "new plate" in said[0].arguments
