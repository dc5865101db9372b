"""Pictures of the report as inline SVG."""

import io
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from impactcell.discrepancy.data.shots import CHANNELS
from impactcell.discrepancy.model.phases import BETWEEN_SHOTS
from impactcell.discrepancy.search.evidence import Evidence
from impactcell.discrepancy.search.residual_map import ALL
from impactcell.discrepancy.workflow import Findings

UNITS = ("N", "mm", "mm")
SCALES = (1.0, 1e3, 1e3)
INK, BEFORE, AFTER = "#22313f", "#c8553d", "#2a7f8e"
MEASURED, UNSEEN = "#9fb0bf", "#eceff2"
STYLE: Any = {
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


def _svg(figure: Figure) -> str:
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None}, bbox_inches="tight")
    text = out.getvalue()
    return text[text.index("<svg") :]


def chart(evidence: Evidence) -> str:
    """Map of phases against covariates: colour for the statistic, a ring if significant, grey if untested."""
    made = evidence.map
    rows, columns = len(made.rows), len(made.columns)
    statistic = np.full(rows * columns, np.nan)
    adjusted = np.full(rows * columns, np.nan)
    count = len(evidence.map_tests.statistic)
    statistic[:count], adjusted[:count] = evidence.map_tests.statistic, evidence.map_tests.adjusted
    absent = ~np.isin(np.arange(rows * columns), made.cell)
    statistic[absent] = adjusted[absent] = np.nan
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(1.6 + 0.85 * columns, 0.9 + 0.42 * rows))
        axes = figure.add_subplot()
        shown = np.ma.masked_invalid(np.sqrt(statistic).reshape(rows, columns))
        axes.set_facecolor(UNSEEN)
        image = axes.imshow(shown, cmap="YlOrRd", vmin=1.0, vmax=6.0, aspect="auto")
        for row in range(rows):
            for column in range(columns):
                place = row * columns + column
                if np.isfinite(adjusted[place]) and adjusted[place] <= 0.05:
                    axes.plot(column, row, "o", color="white", markeredgecolor=INK, markersize=6)
        axes.set_xticks(range(columns), [_label(name) for name in made.columns], rotation=30, ha="right")
        axes.set_yticks(range(rows), [name.replace("_", " ") for name in made.rows])
        axes.set_xticks(np.arange(columns + 1) - 0.5, minor=True)
        axes.set_yticks(np.arange(rows + 1) - 0.5, minor=True)
        axes.grid(which="minor", color="white", linewidth=1.5)
        axes.tick_params(which="both", length=0)
        for spine in axes.spines.values():
            spine.set_visible(False)
        bar = figure.colorbar(image, ax=axes, shrink=0.85, pad=0.02)
        bar.set_label("|score| over its spread")
        return _svg(figure)


def _label(name: str) -> str:
    return {ALL: "all shots", "shot": "order"}.get(name, name.replace("_", " "))


def traces(findings: Findings) -> str:
    """Three held-out shots, slow to fast: measured and modelled, and the residuals before and after."""
    problem = findings.held_problem
    shots = problem.shots
    old, new = findings.held_nominal, findings.held_final
    extended = findings.final is not findings.nominal
    models = ((old, BEFORE, "before"), (new, AFTER, "after")) if extended else ((old, AFTER, "nominal"),)
    misfit = old.misfit(shots) / problem.sizes
    missed = shots.unwhitened(new.residual)
    order = np.argsort(misfit)
    chosen = [int(order[0]), int(order[len(order) // 2]), int(order[-1])]
    channels = [number for number in range(3) if (shots.channel == number).any()]
    times = shots.times
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.5, 2.4 * len(channels) * 1.15))
        grid = figure.add_gridspec(
            2 * len(channels), 3, height_ratios=[2.2, 1.0] * len(channels), hspace=0.28, wspace=0.22
        )
        for column, shot in enumerate(chosen):
            part = shots.of(shot)
            item = shots.items[shot]
            for row, channel in enumerate(channels):
                mine = shots.channel[part] == channel
                t = times[part][mine] * 1e3
                scale = SCALES[channel]
                measured = shots.values[part][mine] * scale
                fitted = measured - missed[part][mine] * scale
                upper = figure.add_subplot(grid[2 * row, column])
                lower = figure.add_subplot(grid[2 * row + 1, column], sharex=upper)
                step = max(len(t) // 400, 1)
                upper.plot(t[::step], measured[::step], ".", color=MEASURED, markersize=4, label="measured")
                upper.plot(
                    t,
                    fitted,
                    color=AFTER,
                    linewidth=1.1,
                    label="extended model" if extended else "nominal model",
                )
                upper.tick_params(labelbottom=False)
                lower.tick_params(labelbottom=row == len(channels) - 1)
                lower.axhspan(-2, 2, color="#eef2f5", zorder=0)
                for model, colour, label in models:
                    shown = _smooth(model.residual[part][mine], step)[::step]
                    lower.plot(t[::step], shown, color=colour, linewidth=0.8, label=label)
                if column == 0:
                    upper.set_ylabel(f"{CHANNELS[channel]} [{UNITS[channel]}]")
                    lower.set_ylabel("residual\n[noise std]")
                if row == 0:
                    upper.set_title(_setting(item), fontsize=9)
                    if column == 0:
                        upper.legend(frameon=False, fontsize=8)
                        if extended:
                            lower.legend(
                                frameon=False, fontsize=8, ncols=2, loc="lower right", bbox_to_anchor=(1, 0.8)
                            )
                if row == len(channels) - 1:
                    lower.set_xlabel("time [ms]")
        figure.align_ylabels()
        return _svg(figure)


def _smooth(values: np.ndarray, step: int) -> np.ndarray:
    if step < 2:
        return values
    return np.convolve(values, np.ones(step) / step, mode="same")


def _setting(shot: Any) -> str:
    parts = [f"shot {shot.number}"]
    if np.isfinite(shot.velocity_m_s):
        parts.append(f"{shot.velocity_m_s * 6e4:.0f} mm/min")
    if np.isfinite(shot.mass_kg):
        parts.append(f"{shot.mass_kg:.3g} kg")
    parts.append("+" if shot.direction > 0 else "−")
    return ", ".join(parts)


def factors(findings: Findings) -> str:
    """Friction factor of every shot in order, before and after, training and held out."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.5, 2.3))
        axes = figure.add_subplot()
        models = [(findings.final, findings.held_final, AFTER, "training")]
        if findings.final is not findings.nominal:
            nominal = (findings.nominal, findings.held_nominal, BEFORE, "before")
            models = [nominal, (findings.final, findings.held_final, AFTER, "after")]
        for model, held, colour, label in models:
            axes.plot(
                findings.training + 1,
                100.0 * model.local.log_factor,
                "o",
                color=colour,
                markersize=3.5,
                label=label,
            )
            axes.plot(
                findings.held_out + 1, 100.0 * held.local.log_factor, "o", color=colour, markersize=4.5,
                markerfacecolor="white", label=f"{label}, held out".removeprefix("training, "),
            )  # fmt: skip
        axes.axhline(0.0, color="#8a97a3", linewidth=0.8)
        axes.set_xlabel("shot, in order")
        axes.set_ylabel("friction factor [%]")
        axes.legend(frameon=False, fontsize=8, ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0))
        return _svg(figure)


def shape(findings: Findings) -> str | None:
    """Free-form term of what is left unexplained."""
    left = findings.unexplained
    if left is None or not left.shapes or left.phase == BETWEEN_SHOTS:
        return None
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.2 * len(left.shapes), 2.3))
        for number, one in enumerate(left.shapes):
            axes = figure.add_subplot(1, len(left.shapes), number + 1)
            axes.axhline(0.0, color="#8a97a3", linewidth=0.8)
            axes.plot(one.place, one.size, "o-", color=BEFORE, markersize=4)
            axes.set_title(f"{one.channel}, {one.phase.replace('_', ' ')}", fontsize=9)
            axes.set_xlabel("place within the phase, 0 = start, 1 = end")
            axes.set_ylabel(
                f"residual, times {one.times} [noise std]" if one.times else "mean residual [noise std]"
            )
        return _svg(figure)
