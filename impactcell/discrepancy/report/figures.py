"""Pictures of the report as inline SVG."""

import io
from types import ModuleType
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from impactcell.discrepancy.data import BETWEEN_SHOTS, CHANNELS
from impactcell.discrepancy.search import ALL, ModelEvidence
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.records import MM_PER_MIN

UNITS = ("N", "mm", "mm")
SCALES = (1.0, 1e3, 1e3)
"""From SI to the units of the figures."""
INK, BEFORE, AFTER = "#22313f", "#c8553d", "#2a7f8e"
MEASURED, UNTESTED = "#9fb0bf", "#eceff2"
MAP_SCALE = (2.0, 8.0)
"""Scores over their spread at both ends of the map's colours: noise alone, up to 3, stays pale."""
RESIDUAL_SCALE = 10.0
"""Residuals are drawn over ± this many standard deviations of the noise at least: noise alone looks thin."""
FACTOR_SCALE_PERCENT = 5.0
"""Friction factors are drawn over ± this at least [%]: one per cent, usual from shot to shot, looks small."""
# Style of all figures: they stand on the page's own ground, which may be dark; the salt makes ids in an SVG
# the same in every run.
STYLE: Any = {
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "axes.facecolor": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.edgecolor": "#8a97a3",
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "impactcell",
}


class _Written(ScalarFormatter):
    """Numbers at an axis, as the language writes them."""

    def __init__(self, said: ModuleType) -> None:
        super().__init__()
        self._said = said

    def __call__(self, x: float, pos: int | None = None) -> str:
        return str(self._said.written(super().__call__(x, pos)))


def svg(figure: Figure, said: ModuleType) -> str:
    """Write a figure as text that a page holds."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if isinstance(axis.get_major_formatter(), ScalarFormatter):
                axis.set_major_formatter(_Written(said))
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None}, bbox_inches="tight")
    text = out.getvalue()
    return text[text.index("<svg") :]


def map_figure(evidence: ModelEvidence, said: ModuleType) -> str:
    """Map of phases against covariates: colour for the statistic, a ring if significant, grey if untested."""
    residual_map = evidence.map
    rows, columns = len(residual_map.rows), len(residual_map.columns)
    statistic = np.full(rows * columns, np.nan)
    adjusted = np.full(rows * columns, np.nan)
    count = len(evidence.map_tests.statistic)
    statistic[:count], adjusted[:count] = evidence.map_tests.statistic, evidence.map_tests.p_adjusted
    absent = ~np.isin(np.arange(rows * columns), residual_map.cell)
    statistic[absent] = adjusted[absent] = np.nan
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(1.6 + 0.85 * columns, 0.9 + 0.42 * rows))
        axes = figure.add_subplot()
        shown = np.ma.masked_invalid(np.sqrt(statistic).reshape(rows, columns))
        axes.set_facecolor(UNTESTED)
        image = axes.imshow(shown, cmap="YlOrRd", vmin=MAP_SCALE[0], vmax=MAP_SCALE[1], aspect="auto")
        for row in range(rows):
            for column in range(columns):
                place = row * columns + column
                if np.isfinite(adjusted[place]) and adjusted[place] <= 0.05:
                    axes.plot(column, row, "o", color="white", markeredgecolor=INK, markersize=6)
        axes.set_xticks(
            range(columns), [_column(name, said) for name in residual_map.columns], rotation=30, ha="right"
        )
        axes.set_yticks(range(rows), [said.phrase(name) for name in residual_map.rows])
        axes.set_xticks(np.arange(columns + 1) - 0.5, minor=True)
        axes.set_yticks(np.arange(rows + 1) - 0.5, minor=True)
        axes.grid(which="minor", color="white", linewidth=1.5)
        axes.tick_params(which="both", length=0)
        for spine in axes.spines.values():
            spine.set_visible(False)
        bar = figure.colorbar(image, ax=axes, shrink=0.85, pad=0.02)
        bar.set_label(said.label("|score| over its spread"))
        return svg(figure, said)


def _column(name: str, said: ModuleType) -> str:
    special = {ALL: "all shots", "shot": "order"}.get(name)
    return str(said.phrase(name) if special is None else said.label(special))


def trace_figure(result: DiscrepancyResult, said: ModuleType) -> str:
    """Held-out shots, the best to the worst explained: measured and modelled, residuals before and after."""
    problem = result.held_problem
    shots = problem.shots
    nominal_fit, extended_fit = result.held_nominal, result.held_final
    extended = result.final is not result.nominal
    models = (
        ((nominal_fit, BEFORE, said.label("before")), (extended_fit, AFTER, said.label("after")))
        if extended
        else ((nominal_fit, AFTER, said.label("nominal")),)
    )
    misfit = nominal_fit.misfit(shots) / problem.sizes
    missed = shots.unwhiten(extended_fit.residual)
    order = [int(place) for place in np.argsort(misfit)]
    chosen = list(dict.fromkeys((order[0], order[len(order) // 2], order[-1])))
    channels = [number for number in range(3) if (shots.channel == number).any()]
    times, is_weighed = shots.times, not result.prepared.lacks_mass
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.5, 2.4 * len(channels) * 1.15))
        grid = figure.add_gridspec(
            2 * len(channels),
            len(chosen),
            height_ratios=[2.2, 1.0] * len(channels),
            hspace=0.28,
            wspace=0.22,
        )
        for column, shot in enumerate(chosen):
            part = shots.samples_of(shot)
            item = shots.items[shot]
            for row, channel in enumerate(channels):
                in_channel = shots.channel[part] == channel
                t = times[part][in_channel] * 1e3
                scale = SCALES[channel]
                measured = shots.values[part][in_channel] * scale
                fitted = measured - missed[part][in_channel] * scale
                upper = figure.add_subplot(grid[2 * row, column])
                lower = figure.add_subplot(grid[2 * row + 1, column], sharex=upper)
                step = max(len(t) // 400, 1)
                upper.plot(
                    t[::step],
                    measured[::step],
                    ".",
                    color=MEASURED,
                    markersize=4,
                    label=said.label("measured"),
                )
                upper.plot(
                    t,
                    fitted,
                    color=AFTER,
                    linewidth=1.1,
                    label=said.label("extended model" if extended else "nominal model"),
                )
                upper.tick_params(labelbottom=False)
                lower.tick_params(labelbottom=row == len(channels) - 1)
                lower.axhspan(-2, 2, color="#eef2f5", zorder=0)
                for model, colour, label in models:
                    shown = _moving_average(model.residual[part][in_channel], step)[::step]
                    lower.plot(t[::step], shown, color=colour, linewidth=0.8, label=label)
                low, high = lower.get_ylim()
                lower.set_ylim(min(low, -RESIDUAL_SCALE), max(high, RESIDUAL_SCALE))
                if column == 0:
                    upper.set_ylabel(f"{said.phrase(CHANNELS[channel])} [{UNITS[channel]}]")
                    lower.set_ylabel(said.label("residual\n[noise std]"))
                if row == 0:
                    upper.set_title(_setting(item, said, is_weighed=is_weighed), fontsize=9)
                    if column == 0:
                        upper.legend(frameon=False, fontsize=8)
                        if extended:
                            lower.legend(
                                frameon=False, fontsize=8, ncols=2, loc="lower right", bbox_to_anchor=(1, 0.8)
                            )
                if row == len(channels) - 1:
                    lower.set_xlabel(said.label("time [ms]"))
        figure.align_ylabels()
        return svg(figure, said)


def _moving_average(values: np.ndarray, step: int) -> np.ndarray:
    if step < 2:
        return values
    return np.convolve(values, np.ones(step) / step, mode="same")


def _setting(shot: Any, said: ModuleType, *, is_weighed: bool) -> str:
    parts = [f"{said.label('shot')} {shot.number}"]
    if np.isfinite(shot.velocity_m_s):
        parts.append(f"{shot.velocity_m_s / MM_PER_MIN:.0f} mm/min")
    if is_weighed and np.isfinite(shot.mass_kg):
        parts.append(said.written(f"{shot.mass_kg:.3g} kg"))
    parts.append("+" if shot.direction > 0 else "−")
    return ", ".join(parts)


def factor_figure(result: DiscrepancyResult, said: ModuleType) -> str:
    """Friction factor of every shot in order, before and after, training and held out."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.5, 2.3))
        axes = figure.add_subplot()
        models = [(result.final, result.held_final, AFTER, "training")]
        if result.final is not result.nominal:
            nominal = (result.nominal, result.held_nominal, BEFORE, "before")
            models = [nominal, (result.final, result.held_final, AFTER, "after")]
        for model, held, colour, label in models:
            axes.plot(
                result.training + 1,
                100.0 * model.shot_parameters.log_factor,
                "o",
                color=colour,
                markersize=3.5,
                label=said.label(label),
            )
            axes.plot(
                result.held_out + 1,
                100.0 * held.shot_parameters.log_factor,
                "o",
                color=colour,
                markersize=4.5,
                markerfacecolor="white",
                label=", ".join(said.label(part) for part in (label, "held out") if part != "training"),
            )
        axes.axhline(0.0, color="#8a97a3", linewidth=0.8)
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, -FACTOR_SCALE_PERCENT), max(high, FACTOR_SCALE_PERCENT))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_xlabel(said.label("shot, in order"))
        axes.set_ylabel(said.label("friction factor [%]"))
        axes.legend(frameon=False, fontsize=8, ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0))
        return svg(figure, said)


def shape_figure(result: DiscrepancyResult, said: ModuleType) -> str | None:
    """Free-form term of what is left unexplained."""
    gap = result.unexplained
    if gap is None or not gap.shapes or gap.phase == BETWEEN_SHOTS:
        return None
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.2 * len(gap.shapes), 2.3))
        for number, shape in enumerate(gap.shapes):
            axes = figure.add_subplot(1, len(gap.shapes), number + 1)
            axes.axhline(0.0, color="#8a97a3", linewidth=0.8)
            axes.plot(shape.place, shape.size, "o-", color=BEFORE, markersize=4)
            axes.set_title(f"{said.phrase(shape.channel)}, {said.phrase(shape.phase)}", fontsize=9)
            axes.set_xlabel(said.label("place within the phase, 0 = start, 1 = end"))
            what = "residual, times {} [noise std]" if shape.times else "mean residual [noise std]"
            axes.set_ylabel(said.label(what).format(said.phrase(shape.times)))
        return svg(figure, said)
