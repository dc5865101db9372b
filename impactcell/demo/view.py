"""The live view of one cell in a terminal: friction with its band, wear, batch, alarms, where to connect."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from impactcell.demo.chart import QUALITY_STYLE, chart
from impactcell.records import Alarm, Snapshot


@dataclass(frozen=True, slots=True)
class Scene:
    """What the view shows.

    Attributes
    ----------
    cell : str
    endpoint : str
        Where an OPC UA client connects.
    story : str
        What is happening in the cell, in a sentence.
    snapshots : sequence of Snapshot
        The last cycles, oldest first.
    link : str
        State of the link to the module.
    """

    cell: str
    endpoint: str
    story: str
    snapshots: Sequence[Snapshot]
    link: str = "connected"


def render(scene: Scene, width: int = 100) -> RenderableType:
    """Draw the scene for a terminal `width` columns wide."""
    if not scene.snapshots:
        return Panel(f"waiting for the first cycle ({scene.link})", title=f"impactcell · {scene.cell}")
    last = scene.snapshots[-1]
    facts = Table.grid(padding=(0, 2))
    facts.add_column(style="dim", no_wrap=True)
    facts.add_column(no_wrap=True)
    facts.add_column(style="dim", no_wrap=True)
    facts.add_column()
    facts.add_row("mu_s", _coefficient(last), "wear level", _level(last))
    facts.add_row(
        "mu_k",
        Text(_plus_minus(last.friction.mu_k.value, last.friction.mu_k.std)),
        "wear limit",
        _limit(last),
    )
    facts.add_row("peak force", f"{last.friction.peak_force_n:.1f} N", "batch", _batch(last))
    facts.add_row("slid", f"{last.friction.sliding_distance_m * 1e6:.0f} µm", "signature", _signature(last))
    curve = Panel(
        chart(scene.snapshots, max(20, width - 16)), title="static friction mu_s", title_align="left"
    )
    title = f"impactcell · {scene.cell} · cycle {last.cycle} · module {scene.link}"
    subtitle = f"OPC UA: {scene.endpoint} · Ctrl-C ends"
    return Panel(
        Group(Text(scene.story, style="italic"), facts, curve, _alarms(last.alarms)),
        title=title,
        subtitle=subtitle,
        width=width,
    )


def _plus_minus(value: float, std: float) -> str:
    if math.isnan(value):
        return "none"
    return f"{value:.4f} ± {std:.4f}" if math.isfinite(std) else f"{value:.4f}"


def _coefficient(snapshot: Snapshot) -> Text:
    mu_s = snapshot.friction.mu_s
    text = Text(_plus_minus(mu_s.value, mu_s.std), style=QUALITY_STYLE[mu_s.quality])
    return text.append(f"  by {snapshot.friction.estimator.value}", style="dim")


def _level(snapshot: Snapshot) -> Text:
    wear = snapshot.wear
    text = Text(_plus_minus(wear.level, wear.level_std), style=QUALITY_STYLE[wear.quality])
    if math.isfinite(wear.rate_per_cycle):
        text.append(f"  {wear.rate_per_cycle * 1000:+.4f} per 1000 cycles", style="dim")
    return text


def _limit(snapshot: Snapshot) -> str:
    wear = snapshot.wear
    if math.isnan(wear.cycles_to_limit):
        return f"{wear.limit:.3f}"
    if math.isinf(wear.cycles_to_limit):
        return f"{wear.limit:.3f}, not in sight"
    between = f"{_count(wear.cycles_to_limit_low)} to {_count(wear.cycles_to_limit_high)}"
    return f"{wear.limit:.3f} in {wear.cycles_to_limit:.0f} ({between}) cycles"


def _count(cycles: float) -> str:
    return "never" if math.isinf(cycles) else f"{cycles:.0f}"


def _batch(snapshot: Snapshot) -> Text:
    batch = snapshot.batch
    text = Text(batch.batch_id or "unnamed").append(
        f"  offset {_plus_minus(batch.offset, batch.offset_std)}", style="dim"
    )
    if batch.last_shift_cycle:
        text.append(f", shifted {batch.last_shift:+.4f} at cycle {batch.last_shift_cycle}", style="dim")
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


def _alarms(alarms: Sequence[Alarm]) -> RenderableType:
    shown = [alarm for alarm in alarms if alarm.active or not alarm.acknowledged]
    if not shown:
        return Text("no alarms", style="green")
    table = Table(expand=True, box=None, header_style="dim")
    for heading in ("alarm", "state", "since cycle", "message"):
        table.add_column(heading, no_wrap=heading != "message")
    for alarm in shown:
        state = ("active" if alarm.active else "cleared") + ("" if alarm.acknowledged else ", unacknowledged")
        style = "bold red" if alarm.active else "yellow"
        table.add_row(Text(alarm.name.value, style=style), state, str(alarm.cycle), alarm.message)
    return table
