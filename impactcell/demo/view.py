"""The live view of one cell in a terminal: friction with its band, wear, batch, alarms, where to connect."""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console, Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from impactcell.demo.alarm_lines import alarms_within, whole_alarms
from impactcell.demo.chart import LEGEND, QUALITY_STYLE, chart
from impactcell.records import Coefficient, Estimator, Snapshot
from impactcell.records.uncertainty import plus_minus, told_cycles_left

WIDE = 100
"""Columns from which on facts stand side by side and alarms in a table."""
LEAST_ROWS, MOST_ROWS = 4, 20
"""Of the chart; in a terminal too low for the least it is left out."""
LEAST_ALARMS = 2
"""Lines of alarms for whose sake a low terminal does without the chart."""
BORDER = 2
"""Lines of a frame."""


@dataclass(frozen=True, slots=True)
class Scene:
    """What the view shows.

    Attributes
    ----------
    cell : str
    endpoint : str
        Where an OPC UA client connects, and as whom.
    story : str
        What is happening in the cell, in a sentence.
    snapshots : sequence of Snapshot
        The last cycles, oldest first.
    link : str
        State of the link to the module; empty once the cell has ended, so that nobody tries to connect.
    waited_s : float
        Since the beginning.
    compiles : bool
        Whether machine code is missing on this machine, so that the first cycle waits for it.
    """

    cell: str
    endpoint: str
    story: str
    snapshots: Sequence[Snapshot]
    link: str = "connected"
    waited_s: float = 0.0
    compiles: bool = False


def render(scene: Scene, width: int = 100, height: int = 40) -> RenderableType:
    """Draw the scene for a terminal of `width` columns and `height` lines; the chart gets what is left."""
    if not scene.snapshots:
        why = (
            "compiling for this machine, once, which takes a minute or two" if scene.compiles else scene.link
        )
        waiting = f"waiting for the first cycle for {scene.waited_s:.0f} s: {why}"
        return Panel(waiting, title=f"impactcell · {scene.cell}", width=width)
    last, wide = scene.snapshots[-1], width >= WIDE
    measure = Console(width=width - 4, file=io.StringIO())

    def lines(*parts: RenderableType) -> int:
        return sum(len(measure.render_lines(part)) for part in parts)

    within = height - BORDER
    story, facts = Text(scene.story, style="italic"), _facts(last, wide=wide)
    endpoint = [Text(f"OPC UA: {scene.endpoint} · Ctrl-C ends", style="dim")] if scene.link else []
    if lines(story, *endpoint, facts) >= within:
        story.no_wrap, story.overflow = True, "ellipsis"
        facts = _facts(last, wide=wide, rows=max(within - lines(story, *endpoint) - 1, 1))
    left = within - lines(story, *endpoint, facts)
    beside_chart = left - LEAST_ROWS - BORDER
    alarms = whole_alarms(last.alarms, wide=wide)
    if lines(alarms) > (beside_chart if beside_chart >= LEAST_ALARMS else left):
        alarms = alarms_within(last.alarms, beside_chart if beside_chart >= LEAST_ALARMS else left)
    rows = min(left - lines(alarms) - BORDER, MOST_ROWS)
    parts: list[RenderableType] = [story, *endpoint, facts]
    if rows >= LEAST_ROWS:
        curve = chart(scene.snapshots, max(20, width - 16), rows)
        parts.append(Panel(curve, title=LEGEND, title_align="left"))
    title = f"impactcell · {scene.cell} · cycle {last.cycle} · "
    title += f"module {scene.link}" if scene.link else "ended"
    return Panel(Group(*parts, alarms), title=title, width=width)


def _facts(last: Snapshot, *, wide: bool, rows: int | None = None) -> Table:
    """Show what is known; in so many rows, if it is said, of which none wraps."""
    friction = last.friction
    left_column: list[tuple[str, str | Text]] = [
        ("mu_s", _coefficient(last)),
        ("mu_k", coefficient_text(friction.mu_k)),
        ("peak force", _measured(friction.peak_force_n, "N", 1)),
        ("slid", _measured(friction.sliding_distance_m * 1e6, "µm", 0)),
    ]
    right_column: list[tuple[str, str | Text]] = [
        ("wear level", _level(last)),
        ("wear limit", _limit(last)),
        ("batch", _batch(last)),
        ("signature", _signature(last)),
    ]
    if math.isfinite(last.positioning.target_m):
        left_column.append(("", ""))
        remaining = _measured(last.positioning.remaining_m * 1e3, "mm", 3)
        right_column.append(("target", f"{last.positioning.target_m * 1e3:.2f} mm, remaining {remaining}"))
    facts = Table.grid(padding=(0, 2))
    for _ in range(2 if wide else 1):
        facts.add_column(style="dim", no_wrap=True)
        facts.add_column(no_wrap=rows is not None, overflow="ellipsis")
    if wide:
        for left_row, right_row in list(zip(left_column, right_column, strict=True))[:rows]:
            facts.add_row(*left_row, *right_row)
    else:
        for name, value in [row for row in left_column + right_column if row[0]][:rows]:
            facts.add_row(name, value)
    return facts


def _plus_minus(value: float, std: float, sign: str = "") -> str:
    """Show four decimals, or as many as the first digit of the standard deviation needs."""
    decimals = 4 if not 0.0 < std < 1e-4 else min(-math.floor(math.log10(std)), 7)
    return plus_minus(value, std, f"{sign}.{decimals}f", f".{decimals}f")


def coefficient_text(coefficient: Coefficient) -> str:
    """Show a coefficient; where there is none, why."""
    said = _plus_minus(coefficient.value, coefficient.std)
    return f"{said}: {coefficient.reason}" if math.isnan(coefficient.value) and coefficient.reason else said


def _measured(value: float, unit: str, decimals: int) -> str:
    return f"{value:.{decimals}f} {unit}" if math.isfinite(value) else "none"


def _coefficient(snapshot: Snapshot) -> Text:
    mu_s = snapshot.friction.mu_s
    text = Text(coefficient_text(mu_s), style=QUALITY_STYLE[mu_s.quality])
    by = snapshot.friction.estimator
    return text if by is Estimator.NONE else text.append(f"  by {by.value}", style="dim")


def _level(snapshot: Snapshot) -> Text:
    wear = snapshot.wear
    text = Text(_plus_minus(wear.level, wear.level_std), style=QUALITY_STYLE[wear.quality])
    if math.isfinite(wear.rate_per_cycle):
        rate = _plus_minus(wear.rate_per_cycle * 1000, wear.rate_std * 1000, "+")
        text.append(f"  {rate} per 1000 cycles", style="dim")
    return text


def _limit(snapshot: Snapshot) -> str:
    wear = snapshot.wear
    if math.isnan(wear.cycles_to_limit):
        return f"{wear.limit:.3f}"
    if math.isinf(wear.cycles_to_limit):
        return f"{wear.limit:.3f}, not in sight"
    if wear.cycles_to_limit < 0.5:
        return f"{wear.limit:.3f}, passed"
    left = wear.cycles_to_limit, wear.cycles_to_limit_low, wear.cycles_to_limit_high
    return f"{wear.limit:.3f} in {told_cycles_left(*left, '{} ({} to {})')} cycles"


def _batch(snapshot: Snapshot) -> Text:
    batch = snapshot.batch
    text = Text(batch.batch_id or "unnamed").append(
        f"  offset {_plus_minus(batch.offset, batch.offset_std)}", style="dim"
    )
    if batch.last_shift_cycle:
        shift = _plus_minus(batch.last_shift, batch.last_shift_std, "+")
        text.append(f", shifted {shift} at cycle {batch.last_shift_cycle}", style="dim")
    return text


def _signature(snapshot: Snapshot) -> Text:
    signature = snapshot.signature
    if math.isnan(signature.t_squared):
        return Text(signature.reason or "being learned", style="dim")
    text = Text(
        f"T² {signature.t_squared:.1f}, SPE {signature.spe:.1f}", style=QUALITY_STYLE[signature.quality]
    )
    if math.isfinite(signature.deviates_at_m):
        text.append(f", odd at {signature.deviates_at_m * 1e3:.2f} mm", style="bold red")
    return text
