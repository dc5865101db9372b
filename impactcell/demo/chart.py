"""A chart of mu_s over the last cycles, drawn with characters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rich.text import Text

from impactcell.records import AlarmName, Quality, Snapshot

ROWS = 12
QUALITY_STYLE = {Quality.GOOD: "green", Quality.UNCERTAIN: "yellow", Quality.BAD: "red"}


def chart(snapshots: Sequence[Snapshot], columns: int) -> Text:
    """Draw one column a cycle: a dot for the estimate, shading for the level with its offset, ± 2 sd."""
    shown = list(snapshots)[-columns:]
    bands = [_band(s) for s in shown]
    numbers = [s.friction.mu_s.value for s in shown] + [edge for band in bands for edge in band]
    finite = [n for n in numbers if math.isfinite(n)]
    if not finite:
        return Text("no usable estimate yet", style="dim")
    low, high = min(finite), max(finite)
    margin = max(0.02 * abs(high), 0.1 * (high - low), 1e-4)
    low, high = low - margin, high + margin

    scale = _Scale(low, high)
    text = Text()
    for row in range(ROWS):
        label = f"{high - (row + 0.5) * (high - low) / ROWS:7.4f} " if row % 3 == 0 else " " * 8
        text.append(label, style="dim")
        for snapshot, (bottom, top) in zip(shown, bands, strict=True):
            text.append(*_mark(snapshot, row, scale, (bottom, top)))
        text.append("\n")
    return text


def _band(snapshot: Snapshot) -> tuple[float, float]:
    wear = snapshot.wear
    offset = snapshot.batch.offset if math.isfinite(snapshot.batch.offset) else 0.0
    centre = wear.level + offset
    return centre - 2 * wear.level_std, centre + 2 * wear.level_std


def _mark(snapshot: Snapshot, row: int, scale: "_Scale", band: tuple[float, float]) -> tuple[str, str]:
    mu_s = snapshot.friction.mu_s
    if math.isfinite(mu_s.value) and scale.row(mu_s.value) == row:
        odd = any(
            alarm.active and alarm.name is AlarmName.DEVIANT_CYCLE and alarm.cycle == snapshot.cycle
            for alarm in snapshot.alarms
        )
        return ("✗", "bold red") if odd else ("•", QUALITY_STYLE[mu_s.quality])
    if math.isfinite(band[0]) and scale.row(band[1]) <= row <= scale.row(band[0]):
        return "░", "blue"
    if snapshot.batch.last_shift_cycle == snapshot.cycle:
        return "┆", "magenta"
    return " ", ""


@dataclass(frozen=True, slots=True)
class _Scale:
    low: float
    high: float

    def row(self, value: float) -> int:
        return min(ROWS - 1, max(0, int((self.high - value) / (self.high - self.low) * ROWS)))
