"""The picture of README and docs, taken from the running product: `python docs/pictures.py`.

The report is the one of README's own campaign, photographed by Chromium (`apt-get install chromium`). Run it
when that looks different.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
PAGE = (1000, 1150)
COLOURS = 48
"""Of the photograph: a report is drawn, not painted, and stays small."""


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
    report()
