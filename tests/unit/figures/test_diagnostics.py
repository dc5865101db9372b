"""Figures 6, 7 and 8: what was measured is in view."""

from collections.abc import Callable

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

from impactcell.figures import diagnostics
from impactcell.figures._style import STYLE

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("make", [diagnostics.over_batches, diagnostics.along_stroke])
def test_a_legend_hides_nothing(make: Callable[[Figure], None]) -> None:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.7, 3.5))
        make(figure)
        figure.draw_without_rendering()
        for axes in figure.axes:
            legend = axes.get_legend()
            assert legend is not None
            place = legend.get_window_extent()
            assert not place.overlaps(axes.bbox)
            assert not place.overlaps(axes.xaxis.label.get_window_extent())
            assert figure.bbox.y0 <= place.y0
