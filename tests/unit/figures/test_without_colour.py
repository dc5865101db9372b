"""Colours tell nothing that shape or label does not, and no legend lies on what was measured."""

from collections.abc import Callable

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

from impactcell.figures import diagnostics, friction, positioning
from impactcell.figures._style import COLOURS, STYLE

pytestmark = pytest.mark.slow

AS_PRINTED = 200
"""Points of the curves that go through the marks of figure 3, which tell them apart."""


@pytest.mark.parametrize(
    "make", [friction.response, friction.force_and_distance, friction.errors, diagnostics.along_stroke]
)
def test_curves_of_different_colour_differ_in_print(
    drawn: Callable[[Callable[[Figure], None]], Figure], make: Callable[[Figure], None]
) -> None:
    with mpl.rc_context(STYLE):
        for axes in drawn(make).axes:
            told: dict[tuple[object, ...], set[object]] = {}
            for line in axes.get_lines():
                count = len(line.get_xdata())  # type: ignore[arg-type]
                if line.get_color() in COLOURS and count > 1 and count != AS_PRINTED:
                    dashes = line._unscaled_dash_pattern  # type: ignore[attr-defined]
                    look = line.get_linestyle(), line.get_marker(), repr(dashes)
                    told.setdefault(look, set()).add(line.get_color())
            assert all(len(colours) == 1 for colours in told.values()), told


def test_legends_of_positioning_are_below(drawn: Callable[[Callable[[Figure], None]], Figure]) -> None:
    with mpl.rc_context(STYLE):
        for axes in drawn(positioning.remaining_distance).axes:
            legend = axes.get_legend()
            assert legend is not None
            assert not legend.get_window_extent().overlaps(axes.bbox)
