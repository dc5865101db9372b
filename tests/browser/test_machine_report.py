"""The report of a machine without a cell, in a real browser."""

import os
from pathlib import Path

import pytest

from impactcell.campaign import write
from impactcell.cli.app import run_verb
from tests.browser.chromium import DESK, PHONE, Browser
from tests.browser.shop import judge
from tests.discrepancy.test_machine_laws import SLIDE_FILE, slide

CUT_OFF = """
    const tables = [...document.querySelectorAll(".wide")].filter((place) => place.querySelector("table"));
    return tables.filter((box) => box.scrollWidth > box.clientWidth + 1).map((box) => box.innerText);
"""
"""Tables that are wider than their place."""
GROUND = "return Math.max(...getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number))"
"""Brightness of the page's ground, to 255."""
pytestmark = pytest.mark.browser


@pytest.mark.slow
def test_the_report_of_a_machine(browser: Browser, tmp_path: Path) -> None:
    """It stands alone, says what a noise floor is, and can be read on a desk and on a phone."""
    write(slide(0.6), tmp_path / "campaign")
    (tmp_path / "base.yaml").write_text(SLIDE_FILE, encoding="utf-8")
    options = ["--base", tmp_path / "base.yaml", "-o", tmp_path / "found"]
    with pytest.raises(SystemExit) as ended:
        run_verb(["discrepancy", "-q", *map(str, (tmp_path / "campaign", *options))])
    assert ended.value.code == 0
    pictures = Path(os.environ.get("IMPACTCELL_SCREENSHOTS") or tmp_path)
    faults = []
    for suffix, theme, size in (("light", "light", DESK), ("phone", "light", PHONE), ("dark", "dark", PHONE)):
        for name in ("report.de.html", "report.html"):
            browser.show_as(theme, size)
            browser.open((tmp_path / "found" / name).as_uri())
            faults += judge(browser, name, pictures / f"{name}-machine-{suffix}.png", size[0])
            faults += [f"{name} on {suffix}: {text}" for text in browser.run(CUT_OFF)]
            assert (browser.run(GROUND) < 64) is (theme == "dark")
    assert not faults
    assert "A noise floor is the difference" in browser.text
    assert "-0.0 %" not in browser.text
