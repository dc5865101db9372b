"""How all figures look, and how they are written: the same code gives the same bytes."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS: Final = ("#0072b2", "#009e73", "#d55e00")
"""Blue, green and vermilion of Okabe and Ito's palette, which all eyes tell apart (2008)."""
DASHES: Final = ("-", (0, (6, 1.5)), (0, (3, 1, 1, 1)))
MARKERS: Final = ("o", "s", "^")
"""What tells the curves of the three colours apart where there is none."""
GREY: Final = "#555555"
"""Of what is said beside the curves."""
PALE: Final = "#bbbbbb"
"""Of single cycles behind the curves."""
STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "svg.fonttype": "none",
    "svg.hashsalt": "impactcell",
    "savefig.dpi": 200,
    "figure.constrained_layout.use": True,
}
"""Of matplotlib: text at the size of a paper's caption, points; 200 dots an inch print at column width."""

Drawing = tuple[str, tuple[float, float], Callable[["Figure"], None]]
"""Name of the file, width and height in inches, and what draws it."""


def legend_below(axes: "Axes") -> None:
    """Put a panel's legend below it, where it hides nothing that was measured."""
    axes.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2)


def write_figures(directory: Path, drawings: Iterable[Drawing]) -> list[Path]:
    """Draw each figure and write it as PNG and SVG."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    files = []
    with mpl.rc_context(STYLE):
        for name, size, draw in drawings:
            figure = Figure(figsize=size)
            draw(figure)
            for suffix, undated in (("png", {"Software": None}), ("svg", {"Date": None})):
                files.append(directory / f"{name}.{suffix}")
                figure.savefig(files[-1], metadata=undated)
    return files
