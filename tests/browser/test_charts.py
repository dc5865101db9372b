"""Charts as they are drawn: where there is nothing, nothing is."""

from pathlib import Path

import pytest

import impactcell.web
from tests.browser.chromium import Browser

pytestmark = pytest.mark.browser

STATIC = Path(impactcell.web.__file__).parent / "static"
LOAD = """
    const root = document.documentElement, script = document.createElement("script");
    root.lang = "en";
    for (const [name, value] of Object.entries({ band: "#f00", curve: "#00f", soft: "#000", grid: "#fff" }))
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


def test_a_band_breaks_off_where_either_edge_has_no_value(browser: Browser) -> None:
    library, charts = (
        (STATIC / name).read_text() for name in ("vendor/uplot/uPlot.iife.min.js", "charts.js")
    )
    browser.run(
        LOAD,
        f"{library}; window.uPlot = uPlot;\n{charts.replace('export class', 'class')}; window.Chart = Chart;",
    )
    for low, high, drawn in (
        ((), (), "########"),
        ((4,), (4,), "###--###"),
        ((4, 5), (), "###---##"),
        ((), (4, 5), "###---##"),
        ((0, 1), (8,), "--#####-"),
        ((2,), (6,), "#--##--#"),
    ):
        edges = without(1.0, *low), without(2.0, *high)
        assert browser.driver.execute_async_script(DRAW, *edges, without(1.2)) == drawn, (low, high)
