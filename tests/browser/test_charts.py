"""Charts as they are drawn: where there is nothing, nothing is."""

from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest

import impactcell.web
from tests.browser.chromium import Browser

pytestmark = pytest.mark.browser

STATIC = Path(impactcell.web.__file__).parent / "static"
LOAD = """
    const root = document.documentElement, script = document.createElement("script");
    root.lang = "en";
    const lines = { edge: "#800", curve: "#00f", bad: "#0a0", soft: "#000", grid: "#fff" };
    for (const [name, value] of Object.entries({ ...lines, band: "#f00", panel: "#fff" }))
        root.style.setProperty(`--${name}`, value);
    script.textContent = arguments[0];
    document.head.append(script);
    document.body.innerHTML = '<div id="chart" style="width: 600px; height: 300px"></div>';
    const edges = [{ colour: "band", width: 1 }, { colour: "band", width: 1 }];
    const series = [...edges, { colour: "curve", width: 2 }];
    window.chart = new Chart(document.getElementById("chart"), { unit: "N", xUnit: "ms", series });
"""
DRAW = """
    const [low, high, line, done] = arguments;
    chart.show([low.map((_, x) => x), low, high, line]);
    requestAnimationFrame(() => requestAnimationFrame(() => {
        const { plot } = chart;
        done(low.slice(1).map((_, x) => {
            const at = [plot.valToPos(x + 0.5, "x", true), plot.valToPos(1.5, "y", true)].map(Math.round);
            return plot.ctx.getImageData(...at, 1, 1).data[3] ? "#" : "-";
        }).join(""));
    }));
"""
"""What is drawn half way between the edges, between each x and the next."""


def without(value: float, *places: int) -> list[float | None]:
    return [None if x in places else value for x in range(9)]


@pytest.fixture
def charts(browser: Browser) -> Browser:
    library, charts = (
        (STATIC / name).read_text() for name in ("vendor/uplot/uPlot.iife.min.js", "charts.js")
    )
    browser.run(
        LOAD,
        f"{library}; window.uPlot = uPlot;\n{charts.replace('export class', 'class')}; window.Chart = Chart;",
    )
    return browser


def test_a_band_breaks_off_where_either_edge_has_no_value(charts: Browser) -> None:
    for low, high, drawn in (
        ((), (), "########"),
        ((4,), (4,), "###--###"),
        ((4, 5), (), "###---##"),
        ((), (4, 5), "###---##"),
        ((0, 1), (8,), "--#####-"),
        ((2,), (6,), "#--##--#"),
    ):
        edges = without(1.0, *low), without(2.0, *high)
        assert charts.driver.execute_async_script(DRAW, *edges, without(1.2)) == drawn, (low, high)


LABELS = """
    const [width, data, options, done] = arguments;
    document.getElementById("chart").style.width = `${width}px`;
    const series = [{ colour: "band", width: 1 }, { colour: "band", width: 1 }];
    const other = new Chart(document.getElementById("chart"), { unit: "N", xUnit: "ms", series, ...options });
    other.show(data);
    requestAnimationFrame(() => {
        done(other.plot.axes.map((axis) => axis._values));
        other.clear("");
    });
"""


@pytest.mark.parametrize(
    "span_s", [60, 100, 180, 400, 1000, 3600, 8 * 3600, 5 * 86_400, 30 * 86_400], ids=str
)
def test_a_trend_as_wide_as_a_phone_has_its_times(charts: Browser, span_s: int) -> None:
    times = [1.8e9 + 7.0, 1.8e9 + 7.0 + span_s]
    labels, _ = charts.driver.execute_async_script(LABELS, 320, [times, [1, 2], [2, 3]], {"time": True})
    assert 2 <= len(labels) <= 6
    assert len(set(labels)) == len(labels)


@pytest.mark.parametrize(
    ("begin", "hours", "said"),
    [
        ("2026-11-26T06:30", 72, {"12:00\n26 Nov", "00:00\n27 Nov", "12:00", "00:00\n29 Nov"}),
        ("2026-11-26T22:10", 3, {"22:30\n26 Nov", "00:00\n27 Nov", "01:00"}),
        ("2026-11-26T08:10", 6, {"10:00", "12:00", "14:00"}),  # of one day
        ("2026-10-24T06:30", 72, {"00:00\n25 Oct", "00:00\n26 Oct"}),  # the clock is put back on the 25th
    ],
)
def test_a_trend_beyond_midnight_says_which_day(
    charts: Browser, begin: str, hours: int, said: set[str]
) -> None:
    zone = "Europe/Berlin"
    start = datetime.fromisoformat(begin).replace(tzinfo=ZoneInfo(zone)).timestamp()
    charts.run("document.documentElement.lang = 'en-GB'")
    charts.driver.execute_cdp_cmd("Emulation.setTimezoneOverride", {"timezoneId": zone})
    try:
        data = [[start, start + 3600.0 * hours], [1, 2], [2, 3]]
        labels, _ = charts.driver.execute_async_script(LABELS, 600, data, {"time": True})
    finally:
        charts.driver.execute_cdp_cmd("Emulation.setTimezoneOverride", {"timezoneId": ""})
    assert said <= set(labels), labels


def test_the_labels_of_an_axis_have_as_many_decimals_as_its_steps(charts: Browser) -> None:
    _, labels = charts.driver.execute_async_script(LABELS, 600, [[0, 1], [0.195, 0.25], [0.2, 0.265]], {})
    assert labels == ["0.20", "0.22", "0.24", "0.26"]
    for size in (1e-7, 1e-3, 1.0, 1e6):
        _, labels = charts.driver.execute_async_script(
            LABELS, 600, [[0, 1], [0, size], [size, 1.1 * size]], {}
        )
        assert len(set(labels)) == len(labels) > 2


@pytest.mark.parametrize("value", [0.0, 0.05, 0.25, 18.5, 3000.0])
def test_one_value_alone_has_labels_that_fit(charts: Browser, value: float) -> None:
    """A limit without any friction beside it had labels of twelve digits, of which the last were seen."""
    data = [[0, 1], [value, value], [value, value]]
    _, labels = charts.driver.execute_async_script(LABELS, 600, data, {})
    assert len(set(labels)) == len(labels) > 1
    assert max(map(len, labels)) <= 7


def test_an_axis_ends_where_the_last_curve_does(charts: Browser) -> None:
    """Three quarters of the friction along a short slide were an empty grid."""
    short, shorter, none = [1, 2, 3, None, None, None], [1, 2, None, None, None, None], [None] * 6
    labels, _ = charts.driver.execute_async_script(LABELS, 600, [list(range(6)), shorter, short], {})
    assert float(labels[-1]) == 2.0
    labels, _ = charts.driver.execute_async_script(LABELS, 600, [list(range(6)), none, none], {})
    assert float(labels[-1]) == 5.0


WORD = """
    const [curve, marks, done] = arguments;
    chart.show([curve.map((_, x) => x), curve, curve, curve], marks);
    requestAnimationFrame(() => requestAnimationFrame(() => {
        const { ctx, bbox } = chart.plot, y = Math.round(chart.plot.valToPos(2, "y", true));
        const count = (top, height, is) => {
            const { data } = ctx.getImageData(bbox.left, top, bbox.width, height);
            const at = data.keys().filter((i) => i % 4 === 0);
            return at.reduce((sum, i) => sum + is(data[i], data[i + 1], data[i + 2], data[i + 3]), 0);
        };
        const isGreen = (r, g, b, alpha) => g > 120 && r < 60 && b < 60 && alpha > 100;
        const above = Math.max(y - 20, bbox.top);
        done([count(above, y - 2 - above, isGreen), count(y + 3, 18, isGreen)]);
    }));
"""
"""Counts what is drawn in the colour of a limit at 2, above its line and below."""
LIMIT = {"y": 2, "text": "limit", "colour": "bad", "dashed": True}


def test_the_word_of_a_limit_stands_above_its_line_and_no_curve_runs_through_it(charts: Browser) -> None:
    ask = charts.driver.execute_async_script
    alone = ask(WORD, [1.0, 1.2, 1.1, 1.2, 3.0, 1.0], [LIMIT])
    assert alone[0] > 20
    assert alone[1] == 0
    struck = ask(WORD, [1.0, 1.2, 1.1, 2.05, 2.1, 2.1], [LIMIT])
    assert struck[0] > 0.8 * alone[0], "a curve runs through the word"
    charts.run("chart.element.style.height = '220px'")  # as high as that of a page, with a batch at its top
    topmost = ask(WORD, [1.0, 1.2, 1.1, 1.2, 1.3, 1.4], [{"x": 0.1, "text": "A", "colour": "soft"}, LIMIT])
    assert topmost[0] > 20
    assert topmost[1] == 0
    batch = {"x": 4.9, "text": "batch C of the north hall", "colour": "soft"}
    beside = ask(WORD, [1.0, 1.2, 1.1, 1.2, 1.3, 1.4], [batch, LIMIT])
    assert beside[1] > 20, "the word stands on that of a batch"
