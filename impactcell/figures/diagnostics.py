"""Figures 6, 7 and 8, frictional diagnostics: friction over wear, over batches and along a stroke.

The paper's text, not its images, was at hand: each figure shows one of its three time scales on synthetic
cycles whose truth is known and drawn beside what the tracker says.
"""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from impactcell.features import extract
from impactcell.figures._style import COLOURS, GREY, PALE, legend_below, write_figures
from impactcell.records import Capture, Channel, Samples
from impactcell.records.uncertainty import TOLD_STDS
from impactcell.tracking import wear_batch
from impactcell.tracking.signature import tracker
from impactcell.tracking.wear_batch import (
    BatchKnowledge,
    FrictionObservation,
    TrackerSettings,
    TrackingResult,
    initial_state,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GRAVITY_M_S2 = 9.81
"""Standard gravity, to three digits; m/s²."""
STD = 0.004
"""Standard deviation of one estimate of mu_s: 2 % of 0.2, as a tap at 3000 mm/min gives."""
LIMIT = 0.215
"""Wear limit of mu_s of figure 6, so that its cycles left come into view."""
BLUE, GREEN, RED = COLOURS
SIZE = (6.7, 3.5)
"""Width and height of a figure, inches: two panels side by side over the width of a page."""


def draw(directory: Path) -> list[Path]:
    """Write figures 6, 7 and 8 as PNG and SVG."""
    return write_figures(
        directory,
        (
            ("figure-6-friction-over-time", SIZE, over_time),
            ("figure-7-friction-over-batches", SIZE, over_batches),
            ("figure-8-friction-along-the-stroke", SIZE, along_stroke),
        ),
    )


def over_time(figure: "Figure") -> None:
    """Figure 6: wear under outliers, its level with two standard deviations, and when the limit comes."""
    rng = np.random.default_rng(6)
    cycles = np.arange(3000)
    truth = 0.2 + 4e-6 * cycles
    mu_s = truth + STD * rng.normal(size=len(cycles))
    odd = rng.random(len(cycles)) < 0.01
    mu_s[odd] += 10.0 * STD * rng.normal(size=int(odd.sum()))
    results = _tracked(mu_s, [None] * len(mu_s), BatchKnowledge.UNKNOWN)
    level = np.array([o.wear.level for o in results])
    std = np.array([o.wear.level_std for o in results])
    axes = figure.subplots(1, 2)
    axes[0].plot(cycles, mu_s, ".", color=PALE, markersize=2, label="estimate of a cycle")
    axes[0].fill_between(
        cycles, level - TOLD_STDS * std, level + TOLD_STDS * std, color=BLUE, alpha=0.4, linewidth=0
    )
    axes[0].plot(cycles, level, color=BLUE, label=f"level ± {TOLD_STDS:g} sd")
    axes[0].plot(cycles, truth, "--", color=GREY, linewidth=1.0, label="truth")
    axes[0].axhline(LIMIT, color=RED, linewidth=1.0, label="wear limit")
    axes[0].set(xlabel="cycle", ylabel="static friction coefficient", ylim=(0.185, 0.225), title="level")
    shown = cycles[500:]
    left, low, high = (
        np.array([getattr(o.wear, name) for o in results[500:]])
        for name in ("cycles_to_limit", "cycles_to_limit_low", "cycles_to_limit_high")
    )
    finite = np.minimum(high, 2e4)
    axes[1].fill_between(shown, low, finite, color=BLUE, alpha=0.25, linewidth=0, label="95 % interval")
    axes[1].plot(shown, left, color=BLUE, label="expected")
    axes[1].plot(shown, (LIMIT - truth[500:]) / 4e-6, "--", color=GREY, linewidth=1.0, label="truth")
    axes[1].set(xlabel="cycle", ylabel="cycles to the limit", ylim=(0, 1e4), title="what is left")
    _legends(axes)


def over_batches(figure: "Figure") -> None:
    """Figure 7: batches that differ, found without their ids, and their offsets with them."""
    rng = np.random.default_rng(7)
    offsets = np.array([0.0, 0.006, -0.005, 0.0025, -0.009])
    ids = np.repeat(np.arange(5), 250)
    mu_s = 0.2 + offsets[ids] + 2e-6 * np.arange(len(ids)) + STD * rng.normal(size=len(ids))
    unknown = _tracked(mu_s, [None] * len(mu_s), BatchKnowledge.UNKNOWN)
    known = _tracked(mu_s, [f"batch {i + 1}" for i in ids], BatchKnowledge.KNOWN)
    axes = figure.subplots(1, 2)
    axes[0].plot(mu_s, ".", color=PALE, markersize=2, label="estimate of a cycle")
    axes[0].plot([o.wear.level + o.batch.offset for o in unknown], color=BLUE, label="level and batch")
    shifts = [o.shift for o in unknown if o.shift is not None]
    for number, shift in enumerate(shifts):
        axes[0].axvline(
            shift.change_cycle, color=RED, linestyle=":", label="shift found" if number == 0 else None
        )
    axes[0].set(xlabel="cycle", ylabel="static friction coefficient", title="batch ids unknown")
    last = [known[250 * (i + 1) - 1].batch for i in range(5)]
    axes[1].errorbar(
        range(1, 6),
        [b.offset for b in last],
        yerr=[TOLD_STDS * b.offset_std for b in last],
        fmt="o",
        color=BLUE,
        capsize=3,
        label=f"offset ± {TOLD_STDS:g} sd",
    )
    axes[1].plot(range(1, 6), offsets, "_", color=RED, markersize=14, label="truth")
    axes[1].set(xlabel="batch", ylabel="offset from the first batch", title="batch ids known")
    _legends(axes)


def along_stroke(figure: "Figure") -> None:
    """Figure 8: friction along single strokes, and one that deviates among those that do not."""
    settings = tracker.SignatureSettings()
    state = tracker.initial_state(settings)
    judged, deviant = {}, None
    for cycle in range(120):
        rng = np.random.default_rng([8, cycle])
        capture = _slide(rng, cycle, bump=0.12 if cycle == 100 else 0.0)
        result = tracker.update(settings, state, extract(capture))
        state = result.state
        if cycle == 100:
            deviant = result
        elif result.judged:
            judged[cycle] = result
    axes = figure.subplots(1, 2)
    grid = settings.grid_m * 1e3
    for result in list(judged.values())[:20]:
        axes[0].plot(grid, result.signature.friction, color=PALE, linewidth=0.6)
    if deviant is not None:
        s = deviant.signature
        axes[0].fill_between(
            grid,
            s.friction - TOLD_STDS * s.friction_std,
            s.friction + TOLD_STDS * s.friction_std,
            color=RED,
            alpha=0.2,
            linewidth=0,
        )
        axes[0].plot(grid, s.friction, color=RED, label=f"deviant cycle ± {TOLD_STDS:g} sd")
        axes[0].axvline(s.deviates_at_m * 1e3, color=RED, linestyle=":", linewidth=1.0, label="deviates most")
        axes[1].plot([100, 100], [s.spe, s.t_squared], "o", color=RED, label="both, deviant cycle")
    axes[0].plot([], [], color=PALE, label="normal cycles")
    axes[0].set(xlabel="distance slid / mm", ylabel="kinetic friction coefficient", title="along the stroke")
    normal = {cycle: d.signature for cycle, d in judged.items() if d.deviation is None}
    axes[1].plot(list(normal), [s.spe for s in normal.values()], ".", color=BLUE, label="SPE")
    axes[1].plot(
        list(normal), [s.t_squared for s in normal.values()], "^", color=GREEN, markersize=3, label="T²"
    )
    for name, limit, colour, style in (
        ("SPE", "spe_limit", BLUE, "--"),
        ("T²", "t_squared_limit", GREEN, "-."),
    ):
        at = [getattr(s, limit) for s in normal.values()]
        axes[1].plot(list(normal), at, style, color=colour, linewidth=0.8, label=f"{name}, its own limit")
    axes[1].set(xlabel="cycle", ylabel="statistic", yscale="log", title="judging each cycle")
    _legends(axes)


def _legends(panels: "Sequence[Axes]") -> None:
    """Put each panel's legend below it, where it hides nothing that was measured."""
    for axes in panels:
        legend_below(axes)


def _tracked(
    mu_s: Samples, batches: list[str] | list[None], knowledge: BatchKnowledge
) -> list[TrackingResult]:
    settings = TrackerSettings(wear_limit=LIMIT, batch=knowledge)
    state, results = initial_state(), []
    for cycle, (value, batch) in enumerate(zip(mu_s, batches, strict=True)):
        results.append(
            wear_batch.update(settings, state, FrictionObservation(cycle, float(value), STD, batch_id=batch))
        )
        state = results[-1].state
    return results


def _slide(rng: np.random.Generator, cycle: int, bump: float) -> Capture:
    """Slide freely from 0.09 m/s over a given friction: speed from energy, time from speed, 10 kHz."""
    x = np.linspace(0.0, 4e-3, 40001)
    level, tilt = 0.01 * rng.normal(), 0.005 * rng.normal()
    friction = 1.0 + level + tilt * (x / 1e-3 - 1.0) + 0.03 * np.sin(2.0 * np.pi * x / 1.3e-3)
    friction = 0.17 * (friction + bump * np.exp(-0.5 * ((x - 1e-3) / 0.25e-3) ** 2))
    work = np.concatenate([[0.0], np.cumsum((friction[1:] + friction[:-1]) / 2.0 * np.diff(x))])
    squared = 0.09**2 - 2.0 * GRAVITY_M_S2 * work
    moving = squared > 0.0
    x, speed = x[moving], np.sqrt(squared[moving])
    # equal deceleration within a step: time = 2 dx / (v_1 + v_2), exact to second order up to rest
    time = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(x) / (speed[1:] + speed[:-1]))])
    t = np.arange(0.0, time[-1] + 0.02, 1e-4)
    position = np.interp(t, time, x) + 0.42e-6 * rng.normal(size=len(t))
    return Capture(cycle, math.nan, 18.9, None, Channel(t, position, 0.42e-6))
