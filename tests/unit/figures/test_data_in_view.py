"""Every panel of every figure shows what it is about, and figure 8 the cycle that deviates."""

import importlib
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from impactcell import figures
from impactcell.figures import diagnostics
from impactcell.figures._style import STYLE


def drawings(monkeypatch: pytest.MonkeyPatch) -> dict[str, Callable[[Figure], None]]:
    """Give what draws each figure, by the name of its file."""
    found: dict[str, Callable[[Figure], None]] = {}

    def note(directory: Path, given: Any) -> list[Path]:
        found.update({name: make for name, _, make in given})
        return []

    for topic in pkgutil.iter_modules(figures.__path__):
        if not topic.name.startswith("_"):
            module = importlib.import_module(f"{figures.__name__}.{topic.name}")
            monkeypatch.setattr(module, "write_figures", note)
            module.draw(Path())
    return found


@pytest.mark.slow
def test_no_panel_is_empty(
    drawn: Callable[[Callable[[Figure], None]], Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    with mpl.rc_context(STYLE):
        shown = {name: drawn(make).axes for name, make in drawings(monkeypatch).items()}
    assert {"figure-2-response", "figure-8-friction-along-the-stroke"} < set(shown)
    panels = {(name, place): axes for name, panel in shown.items() for place, axes in enumerate(panel)}
    assert [key for key, axes in panels.items() if not np.isfinite(axes.dataLim.get_points()).all()] == []


def test_the_cycle_whose_friction_rises_half_way_is_drawn_as_deviant(
    drawn: Callable[[Callable[[Figure], None]], Figure],
) -> None:
    """The friction of cycle 100 is an eighth larger about 1 mm."""
    with mpl.rc_context(STYLE):
        along, judged = drawn(diagnostics.along_stroke).axes
    deviant, place = (
        next(line for line in along.get_lines() if str(line.get_label()).startswith(label))
        for label in ("deviant cycle", "deviates most")
    )
    assert np.isfinite(deviant.get_ydata()).any()
    assert place.get_xdata()[0] == pytest.approx(1.0, abs=0.25)  # type: ignore[index]
    spe = next(line for line in judged.get_lines() if line.get_label() == "SPE")
    assert len(spe.get_xdata()) > 50  # type: ignore[arg-type]
