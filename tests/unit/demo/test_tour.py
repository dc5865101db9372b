"""The tour tells every event of every scenario that comes with the program, and the page shows it."""

import asyncio
from pathlib import Path

import pytest
import yaml

from impactcell.alarms import Message
from impactcell.demo.scenario_setup import CONFIG, SCENARIOS, story
from impactcell.demo.tour import tour
from impactcell.process.shipped import ROOT, shipped_config
from impactcell.scada import Role
from impactcell.web.interface import TourStop
from impactcell.web.texts.pages import PAGE_TEXTS
from tests.unit.web.page import CELL, make_page


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_what_happens_is_told_with_where_to_look(scenario: str) -> None:
    content = yaml.safe_load((CONFIG / "sim" / f"{scenario}.yaml").read_text())
    stops = tour(content)
    assert [stop.cycle for stop in stops[:-1]] == sorted(cycle for cycle, _ in story(content))
    assert stops[-1].cycle is None
    for stop in stops:
        for said in (stop.what, stop.where):
            assert said.english
            assert said.german not in ("", said.english)


def test_summary_tour_and_page_call_the_way_of_an_odd_cycle_alike() -> None:
    content = {"deviations": [{"cycle": 40, "kind": "bump"}]}
    [(_, said)], told = story(content), tour(content)[0].what
    english, german = (words.split()[-1] for words in PAGE_TEXTS["signature"])
    assert said.endswith(f" a bump along its {english}")
    assert told.english.endswith(f" a bump along its {english}.")
    assert told.german.endswith(f" entlang seines {german}.")


async def test_the_page_gives_the_tour(tmp_path: Path) -> None:
    stop = TourStop(7, Message("It <happens>.", "Es <geschieht>."), Message("There.", "Dort."))
    page = make_page(tmp_path, tour=(stop, TourStop(None, Message("Yours.", "Ihres."), Message("x", "y"))))
    async with page.logged_in(Role.OBSERVER) as client:
        for path in ("/", f"/cells/{CELL}"):
            text = (await client.get(path)).text
            assert text.count("data-cycle-from") == 1, "what the reader may do is not ticked off by a cycle"
            assert 'data-cycle-from="7"' in text
            assert "It &lt;happens&gt;." in text
            text = (await client.get(f"{path}?lang=de")).text
            assert "<b>Es &lt;geschieht&gt;.</b>" in text
            assert ">Dort.<" in text
            await client.get(f"{path}?lang=en")
    await asyncio.sleep(0)


def test_the_wheel_has_what_the_demo_needs(tmp_path: Path) -> None:
    import tomllib

    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["data-files"]
    shipped = {path for patterns in declared.values() for pattern in patterns for path in ROOT.glob(pattern)}
    assert shipped >= set((ROOT / "config").glob("*/*.yaml"))
    assert shipped_config() == ROOT / "config"
    assert shipped_config(tmp_path).parts[-3:] == ("share", "impactcell", "config")
