"""Figures 2, 3 and 4: all drawn, as PNG and SVG."""

import xml.etree.ElementTree as ET
from pathlib import Path

import matplotlib as mpl
import pytest

from impactcell.figures import friction

pytestmark = pytest.mark.slow


def test_three_figures_in_two_formats(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mpl.use("Agg")
    monkeypatch.setattr(friction, "SHOTS", 3)
    first = friction.draw(tmp_path)
    assert [path.suffix for path in first] == [".png", ".svg"] * 3
    for path in first:
        content = path.read_bytes()
        if path.suffix == ".png":
            assert content.startswith(b"\x89PNG")
        else:
            assert ET.fromstring(content).tag.endswith("svg")
