"""The whole way in a real browser: drop a CSV, read what is missing, accept it, see the gap close."""

import csv
import os
import time
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest
import pytest_asyncio
import yaml
from matplotlib.image import imread

from simulator.campaign_files import write
from simulator.campaign_scenario import CampaignScenario
from tests.browser.chromium import DESK, PHONE, Browser, need_chromium
from tests.browser.shop import CELL, Shop, at_work, enter, judge
from tests.integration.processes import CONFIG
from tests.patience import COMPILING_S

pytestmark = [pytest.mark.browser, pytest.mark.asyncio(loop_scope="module")]

MISSING = {"stribeck_friction": {"friction_increase": 0.03, "stribeck_velocity_m_s": 0.04}}
KNOWN = {"viscous_friction": {"viscous_coefficient_n_s_per_m": 85}}
"""What the cell's model has already."""
HEADER = "Schuss;Zeit [ms];Kraft [N];Weg [mm];Geschwindigkeit [mm/min];Masse [kg];Richtung\n"


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def shop(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Shop]:
    """A cell in which an effect acts that its model does not know."""
    need_chromium()
    directory = tmp_path_factory.mktemp("shop")
    (directory / "model.yaml").write_bytes((CONFIG / "models" / "prototype.yaml").read_bytes())
    scenario = {
        "strikes": {"period_s": 0.5, "velocities_mm_per_min": [2000, 4000, 6000]},
        "appearances": [{"from_cycle": 1, "effects": MISSING}],
    }
    async with at_work(directory, 3, scenario, model="model.yaml") as shop:
        yield shop


def write_measurement(directory: Path) -> Path:
    """Strike 40 shots on the same plant, and write them as a logger would: one file, in German, ms and mm."""
    scenario = {
        "format": 1, "excitation": "tap", "seed": 5, "plant": {"spread": 0}, "hide": [*KNOWN, *MISSING],
        "strengths": {**KNOWN, **MISSING}, "masses_kg": [18.9], "replicates": 4,
        "sensors": {
            "force": {"rate_hz": 5000, "noise_std": 0.4},
            "position": {"rate_hz": 5000, "noise_std": 1.5e-6},
        },
    }  # fmt: skip
    write(CampaignScenario.model_validate(scenario), directory / "shots")
    table = directory / "versuch 3.csv"
    with table.open("w", encoding="utf-8") as file, (directory / "shots" / "shots.csv").open() as shots:
        file.write(HEADER)
        for shot in csv.DictReader(shots):
            constant = (shot["velocity_mm_per_min"], shot["mass_kg"], shot["direction"])
            with (directory / "shots" / "traces" / f"{shot['shot']}.csv").open() as trace:
                for row in csv.DictReader(trace):
                    ms, force = 1e3 * float(row["time_s"]), row["force_n"]
                    mm = f"{1e3 * float(row['position_m']):.6f}" if row["position_m"] else ""
                    cells = (shot["shot"], f"{ms:.4f}", force, mm, *constant)
                    file.write(";".join(cells).replace(".", ",") + "\n")
    return table


def gap(browser: Browser) -> float:
    """Read the gap off the cell's page."""
    text = " ".join(place.text for place in browser.all('[data-quantity="Model/Gap"]')) or "–"
    return float("nan") if text == "–" else float(text.split()[0])


def is_report_painted(browser: Browser, picture: Path, theme: str) -> bool:
    """Take the picture again, and say whether the report is to be seen in it, on the ground of the theme."""
    browser.screenshot(picture)
    place = "const box = document.querySelector('iframe.report').getBoundingClientRect();"
    x, y, width, height = browser.run(
        f"{place} return [box.x, box.y + scrollY, box.width, box.height].map(Math.round)"
    )
    inside = imread(picture)[y + 10 : y + height - 10, x + 10 : x + width - 10, :3]
    # Of each colour by itself: the ground alone varies from colour to colour.
    is_painted = inside.size > 0 and float(inside.std(axis=(0, 1)).max()) > 0.01
    return is_painted and (float(np.median(inside)) < 0.5) is (theme == "dark")


@pytest.mark.slow
async def test_drop_name_accept_and_see_the_gap_close(shop: Shop, browser: Browser, tmp_path: Path) -> None:
    table = write_measurement(tmp_path)
    pictures = Path(os.environ.get("IMPACTCELL_SCREENSHOTS") or tmp_path)

    def before() -> float:
        enter(browser, shop, "eva")
        browser.open(f"{shop.page}/cells/{CELL}")
        browser.until(lambda: gap(browser) > 1.5, "a gap")
        return gap(browser)

    def drop() -> None:
        browser.open(f"{shop.page}/studies")
        browser.find("#drop-form input[type=file]").send_keys(str(table))
        browser.find("#drop-form button").click()
        browser.find('[data-stage="confirming"]', COMPILING_S)

    def run() -> float:
        begun = time.monotonic()
        browser.find('button[value="discrepancy"]').click()
        browser.find('[data-effect="stribeck_friction"]', COMPILING_S)
        browser.until(
            lambda: "Missing: Stribeck friction" in browser.text_within("iframe.report"), "the report"
        )
        named_s = time.monotonic() - begun
        browser.find('[data-stage="done"]', COMPILING_S)  # what accepting it would change is told last
        return named_s

    def accept() -> None:
        browser.find('form[action$="/accept"] button').click()
        browser.find('[data-acceptance="accept"]', COMPILING_S)

    def closed() -> float:
        browser.open(f"{shop.page}/cells/{CELL}")
        browser.until(lambda: 0.0 < gap(browser) < 1.5, "the gap closed")
        browser.until(lambda: len(browser.all("canvas")) == 4, "four charts")
        browser.screenshot(pictures / "page-accepted-light.png")
        return gap(browser)

    open_gap = await shop.beside(before)
    begun = time.monotonic()
    await shop.beside(drop)
    shown = await shop.beside(lambda: browser.text)
    assert "40 shots, 18.9 kg, 2000–6000 mm/min" in shown
    assert "Geschwindigkeit" in shown
    assert "versuch_3.csv" in shown
    study_s = await shop.beside(run)
    print(f"dropped to named: {time.monotonic() - begun:.1f} s, of that the study {study_s:.1f} s")

    def look_in_german() -> list[str]:
        address = browser.driver.current_url
        browser.show_as("light", PHONE)
        browser.open(f"{address}?lang=de")
        found = judge(browser, "study, German", pictures / "page-study-phone-de.png", PHONE[0])
        assert "Es fehlt: Stribeck-Reibung" in browser.text
        assert "Nachsehen: die Schmierung" in browser.text
        browser.open(f"{address}?lang=en")
        return found

    faults = await shop.beside(look_in_german)
    for theme, size in (("light", DESK), ("dark", DESK), ("light", PHONE)):
        suffix = "phone" if size == PHONE else theme

        def look(theme: str = theme, size: tuple[int, int] = size, suffix: str = suffix) -> list[str]:
            browser.show_as(theme, size)
            picture = pictures / f"page-study-{suffix}.png"
            found = judge(browser, "study", picture, size[0])
            browser.until(lambda: is_report_painted(browser, picture, theme), "the report in its frame")
            for chosen in ("dark", "light", "auto"):  # whatever the system shows
                browser.run("document.documentElement.dataset.theme = arguments[0]", chosen)
                shown = theme if chosen == "auto" else chosen
                browser.until(lambda shown=shown: is_report_painted(browser, picture, shown), "its colours")
            # As a file: the page shows it in a sandbox in which nothing runs, not even what judges it.
            browser.open(next(shop.directory.rglob("report.html")).as_uri())
            found += judge(browser, "report", pictures / f"report-{suffix}.png", size[0])
            browser.driver.back()
            browser.find("iframe.report")
            return found

        faults += await shop.beside(look)
    assert not faults
    await shop.beside(lambda: browser.show_as("light", DESK))
    await shop.beside(accept)
    print(f"gap {open_gap:.2f}, then {await shop.beside(closed):.2f}")
    assert shop.last.model_name == "prototype + stribeck_friction"
    assert [(entry.action, entry.user.split()[0]) for entry in shop.audit()] == [("model accept", "eva")]

    def undo() -> None:
        browser.driver.back()
        browser.find('form[action$="/restore"] button').click()
        browser.find('[data-acceptance="restore"]', COMPILING_S)

    await shop.beside(undo)
    model = shop.directory / "model.yaml"
    assert yaml.safe_load(model.read_text())["name"] == "prototype"


@pytest.mark.slow
async def test_markup_in_the_name_of_a_file_is_text(shop: Shop, browser: Browser, tmp_path: Path) -> None:
    table = tmp_path / "versuch <b>3.csv"
    table.write_text("a;b\n1;2\n2;3\n")

    def drop() -> str:
        enter(browser, shop, "otto")
        browser.open(f"{shop.page}/studies")
        browser.find("#drop-form input[type=file]").send_keys(str(table))
        browser.find("#drop-form button").click()
        browser.find(".faults li", COMPILING_S)
        assert not browser.all(".study h1 b")
        return browser.text

    shown = await shop.beside(drop)
    assert "versuch <b>3.csv" in shown
    assert "versuch_b_3.csv" in shown
    assert "not readable yet" in shown
    assert "in the form below" in shown
    assert "--column" not in shown


@pytest.mark.slow
async def test_what_cannot_be_read_is_said_and_a_script_in_a_name_is_text(
    shop: Shop, browser: Browser, tmp_path: Path
) -> None:
    name = "<img src=x onerror=document.title='owned'>.csv"
    (tmp_path / name).write_text("<script>document.title='owned'</script>;b\n1;zwei\n")
    (tmp_path / "wide.csv").write_text(";".join(f"c{i}" for i in range(10_000)) + "\n" + "1;" * 9999 + "1\n")

    def drop(path: Path) -> str:
        browser.open(f"{shop.page}/studies")
        browser.find("#drop-form input[type=file]").send_keys(str(path))
        browser.find("#drop-form button").click()
        browser.find(".faults li", COMPILING_S)
        assert browser.driver.title != "owned"
        return browser.all(".faults")[0].text

    await shop.beside(lambda: enter(browser, shop, "otto"))
    assert await shop.beside(lambda: drop(tmp_path / name))
    assert "10000 columns" in await shop.beside(lambda: drop(tmp_path / "wide.csv"))


@pytest.mark.slow
async def test_an_observer_looks_and_drops_nothing(shop: Shop, browser: Browser) -> None:
    def look() -> str:
        enter(browser, shop, "olga")
        browser.open(f"{shop.page}/studies")
        assert not browser.all("#drop-form")
        return browser.text

    assert "Operators and engineers can drop measurements here." in await shop.beside(look)
