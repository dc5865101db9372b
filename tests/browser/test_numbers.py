"""How the script of the page writes numbers: with the digits that are known, alike wherever they stand."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import impactcell.web
from impactcell.alarms.rule import CycleInputs, RuleContext
from impactcell.alarms.rules import batch_shift
from impactcell.records import Evidence
from impactcell.records.uncertainty import TOLD_STDS, told_cycles
from impactcell.web.cell_view import CellView
from impactcell.web.interface import CellNews, Freshness
from impactcell.web.messages import Messages
from tests.browser.chromium import Browser
from tests.snapshots import make_capture, make_snapshot

pytestmark = pytest.mark.browser

SCRIPT = Path(impactcell.web.__file__).parent / "static" / "live.js"
LOAD = """
    const [code, language, texts, toldStds] = arguments;
    document.documentElement.lang = language;
    document.body.dataset.toldStds = toldStds;
    const json = Object.assign(document.createElement("script"), { type: "application/json", id: "texts" });
    json.textContent = texts;
    document.body.append(json);
    document.head.append(Object.assign(document.createElement("script"), { textContent: code }));
"""
SHOW = """
    const [path, form, card] = arguments, root = document.createElement("div");
    root.innerHTML = '<b data-quantity="" data-unit="" data-form=""></b>';
    Object.assign(root.firstChild.dataset, { quantity: path, form });
    showValues(root, card);
    return root.textContent;
"""


def load(browser: Browser, language: str) -> None:
    code = re.sub(r"^import .*|^export ", "", SCRIPT.read_text(), flags=re.MULTILINE)
    texts = Messages(language).for_script()
    browser.open("about:blank")
    offered = "Object.assign(window, { showValues, showState, showFriction, cyclesLeft, showAlarm });"
    browser.run(LOAD, f"{code}\n{offered}", language, json.dumps(texts), TOLD_STDS)


def card(**values: Any) -> dict[str, Any]:
    return {"values": {name.replace("__", "/"): value for name, value in values.items()}, "qualities": {}}


@pytest.mark.parametrize(
    ("language", "value", "std", "said"),
    [
        ("en", 0.56, 0.00055, "0.5600 ± 0.0011"),
        ("de", 0.56, 0.00055, "0,5600 ± 0,0011"),
        ("en", 0.2034, 0.0062, "0.203 ± 0.012"),
        ("en", 0.2034, 0.000498, "0.2034 ± 0.0010"),
        ("en", 4321.6, 60.0, "4322 ± 120"),
    ],
)
def test_a_value_has_the_digits_of_what_stands_behind_it(
    browser: Browser, language: str, value: float, std: float, said: str
) -> None:
    load(browser, language)
    content = card(Wear__Level=value, Wear__LevelStdDev=std)
    for form in ("coefficient", ""):
        assert browser.run(SHOW, "Wear/Level", form, content) == said
    told = Messages(language)
    assert f"{told.beside_std(value, std)} ± {told.told_std(std)}" == said


def test_a_model_is_called_by_its_effects_in_words(browser: Browser) -> None:
    load(browser, "de")
    content = card(Model__Name="rail + viscous_friction") | {"model": {"de": "rail + Viskose Reibung"}}
    assert browser.run(SHOW, "Model/Name", "", content) == "rail + Viskose Reibung"


@pytest.mark.parametrize(
    ("language", "std", "common", "wear", "beside"),
    [
        ("en", 0.0017, 0.0095, "0.2665 ± 0.0034 / 0.4000", "± 0.019 alike in all cycles, beside it"),
        ("de", 0.0017, 0.0095, "0,2665 ± 0,0034 / 0,4000", "± 0,019 daneben, in allen Zyklen gleich"),
        ("en", 0.0017, None, "0.2665 ± 0.0034 / 0.4000", ""),
        ("en", None, None, "0.2665 / 0.4000", ""),
    ],
)
def test_the_head_of_a_cell_says_how_well_its_wear_is_known(
    browser: Browser, language: str, std: float | None, common: float | None, wear: str, beside: str
) -> None:
    load(browser, language)
    content = card(
        Friction__StaticFriction=0.26, Friction__StaticFrictionStdDev=0.002, Wear__Level=0.2665,
        Wear__LevelStdDev=std, Wear__LevelCommonStdDev=common, Wear__Limit=0.4, Wear__CyclesToLimit=None,
    )  # fmt: skip
    script = """
        const root = document.createElement("div");
        root.innerHTML = '<b data-field="wear"></b><b data-field="wear_common"></b>';
        showFriction(root, arguments[0]);
        return [...root.children].map((place) => place.textContent);
    """
    assert browser.run(script, content) == [wear, beside]


def test_cycles_that_are_left_are_whole_ones_and_the_same_everywhere(browser: Browser) -> None:
    load(browser, "en")
    content = card(
        Wear__Level=0.2,
        Wear__Limit=0.25,
        Wear__CyclesToLimit=1234.9,
        Wear__CyclesToLimitLow=987.6,
        Wear__CyclesToLimitHigh=12345.6,
    )
    assert [told_cycles(count) for count in (1234.9, 987.6, 12345.6)] == ["1230", "987", "12300"]
    said = browser.run("return cyclesLeft(arguments[0])", content["values"])
    assert said == "1230 (from 987 to 12300)"
    for path, part in (("", "1230"), ("Low", "987"), ("High", "12300")):
        assert browser.run(SHOW, f"Wear/CyclesToLimit{path}", "cycles", content) == part


@pytest.mark.parametrize(
    ("language", "high", "said"),
    [
        ("en", 0.0, "limit passed"),
        ("en", 7.4, "at the limit, perhaps beyond"),
        ("de", 7.4, "an der Grenze, vielleicht darüber"),
        ("en", None, "at the limit, perhaps beyond"),
    ],
)
def test_a_limit_is_passed_once_no_cycle_may_be_left(
    browser: Browser, language: str, high: float | None, said: str
) -> None:
    """At most seven cycles were left beside it, and the alarm came thirteen later."""
    load(browser, language)
    content = card(
        Wear__Level=0.2503, Wear__Limit=0.25, Wear__CyclesToLimit=0.0, Wear__CyclesToLimitLow=0.0,
        Wear__CyclesToLimitHigh=high,
    )  # fmt: skip
    assert browser.run("return cyclesLeft(arguments[0])", content["values"]) == said


def test_the_reference_batch_has_no_uncertain_offset_to_itself(browser: Browser) -> None:
    load(browser, "en")
    content = card(Batch__Offset=0.0, Batch__OffsetStdDev=0.0)
    content["qualities"] = {"Batch/Offset": "uncertain"}
    assert browser.run(SHOW, "Batch/Offset", "coefficient", content) == "the reference batch itself"
    content["values"] |= {"Batch/Offset": 0.012, "Batch/OffsetStdDev": 0.001}
    assert browser.run(SHOW, "Batch/Offset", "coefficient", content) == "0.0120 ± 0.0020 (uncertain)"


@pytest.mark.parametrize("language", ["en", "de"])
def test_the_number_of_a_cycle_is_written_as_in_the_text_of_an_alarm(browser: Browser, language: str) -> None:
    load(browser, language)
    shift = Evidence(change_cycle=1234567, size=0.03, size_std=0.002)
    inputs = CycleInputs(1234567, make_snapshot(make_capture()).wear, shift=shift)
    context = RuleContext(batch_shift.RULE.settings, active=False)
    message = batch_shift.evaluate(inputs, context).message.text(language)
    assert "1234567" in message
    content = card(Friction__CycleNumber=1234567, Batch__LastShiftCycle=1234567)
    assert browser.run(SHOW, "Friction/CycleNumber", "count", content) == "1234567"
    assert browser.run(SHOW, "Batch/LastShiftCycle", "cycle", content) == "1234567"
    large = card(Friction__SlidingDistance=98765.4, Friction__SlidingDistanceStdDev=60.0)
    assert browser.run(SHOW, "Friction/SlidingDistance", "", large) == "98765 ± 120"


@pytest.mark.parametrize(
    ("language", "freshness", "said"),
    [
        ("en", Freshness.STARTING, "○ starting"),
        ("de", Freshness.STARTING, "○ startet"),
        ("en", Freshness.COMPILING, "○ starting: compiling, takes minutes"),
        ("de", Freshness.COMPILING, "○ startet: übersetzt, dauert Minuten"),
    ],
)
def test_a_module_that_was_not_asked_yet_is_not_told_in_red(
    browser: Browser, language: str, freshness: Freshness, said: str
) -> None:
    load(browser, language)
    view = CellView("press-1")
    view.take(CellNews("press-1", freshness=freshness))
    script = """
        const root = document.createElement("div");
        root.innerHTML = '<b data-field="state"></b>';
        showState(root, JSON.parse(arguments[0]));
        return [root.textContent, root.firstChild.className];
    """
    assert browser.run(script, view.encode("card").decode()) == [said, "state plain"]


def test_cycles_left_are_not_said_where_wear_is_not_known(browser: Browser) -> None:
    load(browser, "en")
    unknown = {"Wear/Level": None, "Wear/Limit": 0.25, "Wear/CyclesToLimit": None}
    assert browser.run("return cyclesLeft(arguments[0])", unknown) == "–"
    flat = unknown | {"Wear/Level": 0.2}
    never = "return cyclesLeft({ ...arguments[0], 'Wear/CyclesToLimit': Infinity })"
    assert browser.run(never, flat) == "limit is not being approached"


@pytest.mark.parametrize(
    ("language", "left", "low", "said"),
    [
        ("en", 316.0, 49.0, ("more than 49", "never")),
        ("de", 316.0, 49.0, ("mehr als 49", "nie")),
        ("en", 170570000.0, 32224.7, ("more than 32200", "never")),
        ("en", 316.0, 0.4, ("316 (from 0 to never)", "never")),
    ],
)
def test_a_limit_that_is_perhaps_never_reached_is_said_to_be(
    browser: Browser, language: str, left: float, low: float, said: tuple[str, str]
) -> None:
    """The middle of what has no end says nothing: "170570000 (from 32224 to never)" stood there."""
    load(browser, language)
    snapshot = make_snapshot(make_capture())
    wear = replace(snapshot.wear, level=0.2, limit=0.25, cycles_to_limit=left, cycles_to_limit_low=low)
    view = CellView("press-1")
    view.take(CellNews("press-1", replace(snapshot, wear=wear)))
    sent = view.encode("card").decode()
    assert browser.run("return cyclesLeft(JSON.parse(arguments[0]).values)", sent) == said[0]
    parsed = SHOW.replace("form, card] = arguments", "form, sent] = arguments, card = JSON.parse(sent)")
    assert browser.run(parsed, "Wear/CyclesToLimitHigh", "cycles", sent) == said[1]


@pytest.mark.parametrize(
    ("language", "said"),
    [
        ("en", "▲ Deviant cycle (not acknowledged): cleared; it said: friction is off"),
        ("de", "▲ Abweichender Zyklus (nicht quittiert): vorbei; gemeldet war: Reibung passt nicht"),
    ],
)
def test_an_alarm_that_has_cleared_says_what_it_said(browser: Browser, language: str, said: str) -> None:
    load(browser, language)
    script = """
        const alarm = { name: "DeviantCycle", active: false, acknowledged: false, enabled: true, time_ms: 1 };
        const evidence = { compared: {}, size: null, change_cycle: null };
        Object.assign(alarm, { shelved: "unshelved", evidence });
        alarm.message = { en: "friction is off", de: "Reibung passt nicht" };
        const place = document.createElement("div");
        showAlarm(place, [alarm], "");
        return place.textContent;
    """
    assert browser.run(script) == said


def test_an_alarm_whose_time_is_not_known_is_shown_before_those_that_are_over(browser: Browser) -> None:
    load(browser, "en")
    script = """
        const evidence = { compared: {}, size: null, change_cycle: null };
        const seen = { evidence, enabled: true, shelved: "unshelved", active: false, acknowledged: true };
        const open = { ...seen, active: true, acknowledged: false };
        const alarms = [
            { ...seen, name: "BatchShift", message: { en: "" }, time_ms: 0 },
            { ...seen, name: "DeviantCycle", message: { en: "friction is off" }, time_ms: 1e12 },
            { ...open, name: "WearLimit", message: { en: "worn" }, time_ms: 0 },
        ];
        const place = document.createElement("div");
        showAlarm(place, alarms, "none");
        return place.textContent;
    """
    assert browser.run(script) == "▲ Wear limit (not acknowledged): worn"
