"""Overshoot and taps by hidden effect, of the planner before its last change and since.

Drawn from stored rows: closed loops on a plant that the planner's model does not describe, a row a condition
and version, as `python -m tests.benchmarks.positioning_hidden` gathers and stores them beside this file.
"""

import csv
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Final

from impactcell.figures._style import COLOURS, GREY, PALE, write_figures
from impactcell.physics.effect_names import in_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STORED: Final = "hidden_effects.csv"
"""Beside this file."""
PROMISED: Final = 1e-3
"""Overshoots a task that the planner promises at most."""
VERSIONS: Final = (("before", "before", PALE), ("now", "now", COLOURS[0]))
"""Name in the rows, what it is called, and its colour."""


@dataclass(frozen=True, slots=True)
class ConditionCount:
    """What became of the tasks of one condition: how many, how many overshot, taps in all."""

    condition: str
    version: str
    tasks: int
    overshot: int
    taps: int

    @property
    def label(self) -> str:
        """Name as it is drawn; the strength where it is not the default."""
        name, strength = self.condition.split("@")
        words = in_words(name)
        return words if strength == "1" else f"{words}, {strength}"


def stored_counts() -> list[ConditionCount]:
    """Return the rows that are stored."""
    lines = (files(__package__) / STORED).read_text(encoding="utf-8").splitlines()
    return [
        ConditionCount(
            row["condition"], row["version"], int(row["tasks"]), int(row["overshot"]), int(row["taps"])
        )
        for row in csv.DictReader(lines)
    ]


def draw(directory: Path) -> list[Path]:
    """Write the figure as PNG and SVG."""
    return write_figures(directory, [("positioning-hidden", (7.2, 8.6), by_effect)])


def by_effect(figure: "Figure") -> None:
    """Draw a line a condition: overshoots in per cent of the tasks, and taps a task, of each version."""
    counts = stored_counts()
    labels = list(dict.fromkeys(count.label for count in counts))
    overshoot, taps = figure.subplots(1, 2, sharey=True)
    for version, title, colour in VERSIONS:
        part = [count for count in counts if count.version == version]
        places = [labels.index(count.label) for count in part]
        tasks = sum(count.tasks for count in part)
        share = 100.0 * sum(count.overshot for count in part) / max(tasks, 1)
        style = {"linestyle": "none", "marker": "o", "markersize": 4, "color": colour}
        legend = f"{title}: {tasks} tasks, {share:.2g} %"
        overshoot.plot([100.0 * c.overshot / c.tasks for c in part], places, label=legend, **style)
        taps.plot([c.taps / c.tasks for c in part], places, **style)
    overshoot.axvline(100.0 * PROMISED, color=GREY, linewidth=0.8, linestyle="--")
    overshoot.set_xlabel("tasks that overshoot / %")
    taps.set_xlabel("taps a task")
    overshoot.set_yticks(range(len(labels)), labels, fontsize=6.5)
    overshoot.invert_yaxis()
    figure.legend(loc="outside upper center", fontsize=7, ncols=2)
