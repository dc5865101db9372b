"""Remaining distance against tap number, by mass: the planner in closed loop with a cell that is not nominal.

The cell's stiffness is 10 % above, its damping 10 % below what the planner was told; each tap's friction
scatters by 3 %. One planner serves all masses in turn and learns from every tap; its first five tasks are
drawn apart. The plant is `impactcell.physics`, tap by tap.
"""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from impactcell.figures._style import COLOURS, GREY, legend_below, write_figures
from impactcell.physics import Plant, TapInput, simulate_tap
from impactcell.positioning import Tap, TapPlanner

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MASSES_KG = (8.0, 16.0, 32.0)
"""One panel each; an octave apart."""
NOMINAL = Plant(stiffness_n_per_m=6.5e5, damping_n_s_per_m=465.0, mu_s=0.2, mu_k=0.152)
"""What the planner is told: the reference plant, without viscous friction."""
STIFFNESS, DAMPING, MU_S, RATIO = 7.15e5, 418.5, 0.22, 0.76
"""Of the cell: k in N/m and b in N s/m, 10 % above and below the nominal ones, mu_s, and mu_k / mu_s."""
SCATTER = 0.03
"""Relative standard deviation of each tap's friction, as a real surface scatters."""
TOLERANCE_M = 10e-6
"""Of the paper's task."""
TASKS = 25
"""Of each mass."""
LEARNING = 5
"""First tasks of each mass, drawn apart."""
MOST_TAPS = 60
"""After so many a task is given up: it would have failed."""
FLOOR_M = 0.3e-6
"""Below this a remainder is drawn here, for the logarithmic axis."""
SEED = 7
"""Of the tasks and of the scatter."""


def draw(directory: Path) -> list[Path]:
    """Write the figure as PNG and SVG."""
    return write_figures(directory, [("positioning", (7.2, 3.2), remaining_distance)])


def remaining_distance(figure: "Figure") -> None:
    """Draw the remaining distance of every task, a panel for each mass."""
    courses = _courses()
    axes: list[Axes] = list(figure.subplots(1, len(MASSES_KG), sharey=True))
    for axis, mass, colour in zip(axes, MASSES_KG, COLOURS, strict=True):
        _panel(axis, courses[mass], mass, colour)
        legend_below(axis)
    axes[0].set_ylabel("remaining distance / mm")


def _courses() -> dict[float, list[list[float]]]:
    """Remaining distances (m) from task start to end, for each task of each mass, in the order made."""
    rng = np.random.default_rng(SEED)
    planner = TapPlanner(tolerance_m=TOLERANCE_M, plant=NOMINAL)
    courses: dict[float, list[list[float]]] = {mass: [] for mass in MASSES_KG}
    for _ in range(TASKS):
        for mass in MASSES_KG:
            course = [float(rng.uniform(2e-3, 40e-3))]
            while len(course) <= MOST_TAPS:
                tap = planner.next_tap(course[-1], mass)
                if not isinstance(tap, Tap):
                    break
                mu_s = MU_S * (1.0 + SCATTER * rng.standard_normal())
                plant = Plant(STIFFNESS, DAMPING, mu_s, RATIO * mu_s)
                moved = simulate_tap(plant, TapInput(tap.velocity_m_s, mass, tap.stroke_m)).displacement_m
                planner.observe(tap, moved, mass)
                course.append(course[-1] - moved)
            courses[mass].append(course)
    return courses


def _panel(axis: "Axes", courses: list[list[float]], mass: float, colour: str) -> None:
    for n, course in enumerate(courses):
        learning = n < LEARNING
        shown = [max(abs(remaining), FLOOR_M) * 1e3 for remaining in course]
        axis.semilogy(
            range(len(course)), shown, color=GREY if learning else colour, linewidth=0.8,
            alpha=0.9 if learning else 0.5, linestyle="--" if learning else "-", marker=".", markersize=3,
            label={0: "first five tasks", LEARNING: "later tasks"}.get(n),
        )  # fmt: skip
    axis.axhspan(FLOOR_M * 0.7e3, TOLERANCE_M * 1e3, color="#dddddd", zorder=0)
    axis.set_ylim(FLOOR_M * 0.7e3, 60.0)
    mean = math.fsum(len(course) - 1 for course in courses[LEARNING:]) / (len(courses) - LEARNING)
    axis.set_title(f"{mass:g} kg: {mean:.1f} taps on average")
    axis.set_xlabel("tap")
    axis.set_xticks(range(0, max(map(len, courses)), 1 if max(map(len, courses)) < 9 else 2))
    # no course is inside before its second tap: the place is free
    axis.text(-0.15, 0.75e3 * TOLERANCE_M, "inside\n±10 µm", va="top", fontsize=7, color=GREY)
