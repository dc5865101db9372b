"""Figures that are drawn in a moment."""

from collections.abc import Callable

import pytest
from matplotlib.figure import Figure

from impactcell.figures import friction, positioning


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[Figure], None]], Figure]:
    """Draw a figure, of few taps and tasks."""
    monkeypatch.setattr(friction, "SHOTS", 2)
    course = [[20e-3, 1e-3, 4e-6]] * (positioning.LEARNING + 1)
    monkeypatch.setattr(positioning, "_courses", lambda: dict.fromkeys(positioning.MASSES_KG, course))

    def draw(make: Callable[[Figure], None]) -> Figure:
        figure = Figure(figsize=(7.2, 3.2))
        make(figure)
        figure.draw_without_rendering()
        return figure

    return draw
