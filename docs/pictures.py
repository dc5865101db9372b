"""The pictures of README and docs, taken from the running product: `python docs/pictures.py`.

The live view is what `make demo` shows after its story has been told; the report is the one of README's own
campaign, photographed by Chromium (`apt-get install chromium`). Run it when either looks different.
"""

import asyncio
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from PIL import Image
from rich._export_format import CONSOLE_SVG_FORMAT
from rich.console import Console

from impactcell.demo.runner import _DemoRun
from impactcell.demo.scenario_setup import set_up_scenario
from impactcell.demo.view import render

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
COLUMNS, ROWS, CYCLES = 100, 38, 110
PAGE = (1000, 1150)
COLOURS = 48
"""Of the photograph: a report is drawn, not painted, and stays small."""


def live_view() -> None:
    """Run the demo to its end and draw what it shows then."""
    with set_up_scenario("demo", CYCLES) as setup:
        demo = _DemoRun(setup, CYCLES)
        asyncio.run(demo.follow(lambda _demo, _snapshot: None))
        scene = demo.scene()
    # Who may connect is drawn anew for every demo.
    scene = replace(scene, endpoint=scene.endpoint.split(" · ")[0], link="connected")
    console = Console(record=True, width=COLUMNS, height=ROWS, force_terminal=True, file=sys.stderr)
    console.print(render(scene, COLUMNS, ROWS))
    plain = re.sub(r"@font-face \{\{.*?\}\}\n", "", CONSOLE_SVG_FORMAT, flags=re.DOTALL)
    svg = console.export_svg(title="make demo", code_format=plain)
    (IMAGES / "live-view.svg").write_text(svg, encoding="utf-8")


def report() -> None:
    """Write README's campaign, find what is hidden in it, and photograph the report."""
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("chromium is not installed; the report was not photographed")
    with tempfile.TemporaryDirectory() as directory:
        campaign, out, photo = (Path(directory) / name for name in ("campaign", "out", "photo.png"))
        scenario = ["config/sim/campaign.yaml", "-o", str(campaign), "--hide", "quadratic_drag"]
        python = [sys.executable, "-m"]
        subprocess.run([*python, "simulator", "campaign", *scenario], cwd=ROOT, check=True)
        subprocess.run(
            [*python, "impactcell", "discrepancy", str(campaign), "-o", str(out)], cwd=ROOT, check=True
        )
        subprocess.run(
            [
                chromium,
                "--headless",
                "--no-sandbox",
                "--hide-scrollbars",
                f"--window-size={PAGE[0]},{PAGE[1]}",
                f"--screenshot={photo}",
                (out / "report.html").as_uri(),
            ],
            check=True,
            capture_output=True,
        )
        image = Image.open(photo).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
        image.save(IMAGES / "report.png", optimize=True)


if __name__ == "__main__":
    IMAGES.mkdir(exist_ok=True)
    live_view()
    report()
