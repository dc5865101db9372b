"""How parts of the page look with its own sheet: what is pressed can be read, what is long fits."""

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import impactcell.discrepancy.report
import impactcell.web
from tests.browser.chromium import DESK, PHONE, Browser

pytestmark = pytest.mark.browser

WEB = Path(impactcell.web.__file__).parent
REPORT = Path(impactcell.discrepancy.report.__file__).parent / "templates" / "style.css"
SHEET, COLUMNS = WEB / "static" / "page.css", WEB / "templates" / "_study_columns.html.j2"
LOAD = """
    const [sheet, theme, html] = arguments;
    document.documentElement.dataset.theme = theme;
    document.head.append(Object.assign(document.createElement("style"), { textContent: sheet }));
    const viewport = { name: "viewport", content: "width=device-width, initial-scale=1" };
    document.head.append(Object.assign(document.createElement("meta"), viewport));
    document.body.innerHTML = html;
"""
COLOURS = """
    const style = getComputedStyle(document.querySelector(arguments[0]));
    return [style.color, style.backgroundColor].map((text) => text.match(/[0-9.]+/g).slice(0, 3).map(Number));
"""


def show(
    browser: Browser, html: str, theme: str = "light", size: tuple[int, int] = DESK, sheet: Path = SHEET
) -> None:
    browser.open("about:blank")
    browser.show_as(theme, size)
    browser.run(LOAD, sheet.read_text(), theme, html)


def contrast(one: list[float], other: list[float]) -> float:
    """Give the contrast ratio of two colours, 0 to 255 (WCAG 2.2, relative luminance)."""

    def luminance(colour: list[float]) -> float:
        shares = (channel / 255 for channel in colour)
        linear = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in shares]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


@contextlib.contextmanager
def under_the_pointer(browser: Browser, css: str) -> Iterator[None]:
    ask = browser.driver.execute_cdp_cmd
    ask("DOM.enable", {})
    ask("CSS.enable", {})
    root = ask("DOM.getDocument", {})["root"]["nodeId"]
    node = ask("DOM.querySelector", {"nodeId": root, "selector": css})["nodeId"]
    ask("CSS.forcePseudoState", {"nodeId": node, "forcedPseudoClasses": ["hover"]})
    yield
    ask("CSS.disable", {})
    ask("DOM.disable", {})


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("pressed", ["true", "false"])
def test_a_button_under_the_pointer_can_be_read(browser: Browser, theme: str, pressed: str) -> None:
    show(browser, f'<button class="quiet" aria-pressed="{pressed}">Hour</button>', theme)
    with under_the_pointer(browser, "button"):
        assert contrast(*browser.run(COLOURS, "button")) >= 4.5


@pytest.mark.parametrize("language", ["en", "de"])
def test_a_table_that_is_stacked_on_a_phone_scrolls_nothing(browser: Browser, language: str) -> None:
    headings = {
        "en": ("Time", "Cell", "Alarm", "State", "Reason", "Comment"),
        "de": ("Zeit", "Zelle", "Alarm", "Zustand", "Grund", "Kommentar"),
    }[language]
    head = "".join(f'<th scope="col">{heading}</th>' for heading in headings)
    row = "".join(f'<td data-label="{heading}">short</td>' for heading in headings)
    table = f'<table class="stack"><thead><tr>{head}</tr></thead><tbody><tr>{row}</tr></tbody></table>'
    show(
        browser,
        f'<main><section class="panel"><div class="scroll">{table}</div></section></main>',
        size=PHONE,
    )
    wide, room = browser.run(
        "const s = document.querySelector('.scroll'); return [s.scrollWidth, s.clientWidth]"
    )
    assert wide <= room


@pytest.mark.parametrize("size", [DESK, PHONE], ids=str)
def test_an_example_in_a_field_is_not_clipped(browser: Browser, size: tuple[int, int]) -> None:
    examples = re.findall(r'\("\w+", "([^"]+)"\)', COLUMNS.read_text())
    assert "3000 mm/min" in examples
    fields = "".join(f'<label class="short">Unit<input value="{example}"></label>' for example in examples)
    show(
        browser, f'<main><section class="panel"><form class="act">{fields}</form></section></main>', size=size
    )
    clipped = (
        "return [...document.querySelectorAll('input')].filter((i) => i.scrollWidth > i.clientWidth).length"
    )
    assert browser.run(clipped) == 0


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_lines_of_a_chart_stand_out(browser: Browser, theme: str) -> None:
    names = ("edge", "curve", "bad")
    place = 'style="color: var(--%s); background: var(--panel)"'
    boxes = "".join(f'<p class="{name}" {place % name}>line</p>' for name in names)
    show(browser, boxes, theme)
    assert all(contrast(*browser.run(COLOURS, f"p.{name}")) >= 3.0 for name in names)


def test_a_map_of_colours_stays_light_where_a_report_is_dark(browser: Browser) -> None:
    curve, heat = (
        "<div class='wide'><svg></svg></div>",
        "<div class='maps'><figure><svg></svg></figure></div>",
    )
    show(browser, curve + heat, "dark", sheet=REPORT)
    style = "return [...document.querySelectorAll('svg')].map((svg) => getComputedStyle(svg)[arguments[0]])"
    assert browser.run(style, "filter") == ["invert(0.88) hue-rotate(180deg)", "none"]
    assert browser.run(style, "backgroundColor")[1] == "rgb(255, 255, 255)"


@pytest.mark.parametrize(("columns", "size", "hint"), [(5, PHONE, True), (2, PHONE, False), (5, DESK, False)])
def test_a_wide_table_of_a_report_says_that_it_goes_on(
    browser: Browser, columns: int, size: tuple[int, int], hint: bool
) -> None:
    table = f"<div class='wide'><table><tr>{'<th>Wahrscheinlichkeit</th>' * columns}</tr></table></div>"
    show(browser, f"<main>{table}</main>", size=size, sheet=REPORT)
    wide, room, content = browser.run(
        "const box = document.querySelector('.wide');"
        "return [box.scrollWidth, box.clientWidth, getComputedStyle(box, '::before').content]"
    )
    assert (wide > room) is hint
    assert ("↔" in content) is hint
