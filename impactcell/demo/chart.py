"""A chart of mu_s over the last cycles, drawn with characters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rich.text import Text

from impactcell.alarms.rules import deviant_cycle
from impactcell.records import Quality, Snapshot
from impactcell.records.uncertainty import TOLD_STDS

QUALITY_STYLE = {Quality.GOOD: "green", Quality.UNCERTAIN: "yellow", Quality.BAD: "red"}


LEGEND = f"mu_s • cycle ░ level+batch ± {TOLD_STDS:g} sd ✗ deviant ┆ shift"


def chart(snapshots: Sequence[Snapshot], columns: int, rows: int) -> Text:
    """Draw one column a cycle: what stands in `LEGEND`, the level with the offset of its batch."""
    visible = list(snapshots)[-columns:]
    bands = [_band(s) for s in visible]
    numbers = [s.friction.mu_s.value for s in visible] + [edge for band in bands for edge in band]
    finite = [n for n in numbers if math.isfinite(n)]
    if not finite:
        return Text("no usable estimate yet", style="dim")
    low, high = min(finite), max(finite)
    margin = max(0.02 * abs(high), 0.1 * (high - low), 1e-4)
    low, high = low - margin, high + margin

    scale = _Scale(low, high, rows)
    shifts = _shifts(visible)
    text = Text()
    for row in range(rows):
        label = f"{high - (row + 0.5) * (high - low) / rows:7.4f} " if row % 3 == 0 else " " * 8
        text.append(label, style="dim")
        for snapshot, band in zip(visible, bands, strict=True):
            mark, style = _mark(snapshot, row, scale, band)
            shifted = mark == " " and snapshot.cycle in shifts
            text.append(*(("┆", "magenta") if shifted else (mark, style)))
        text.append("\n" if row + 1 < rows else "")
    return text


def _shifts(snapshots: Sequence[Snapshot]) -> set[int]:
    """Cycles of the batch shifts as last believed: each is found, and refined, some cycles after it."""
    last, shift_cycles = 0, [0]
    for snapshot in snapshots:
        shift = snapshot.batch.last_shift_cycle
        if shift > last:
            shift_cycles.append(shift)
            last = snapshot.cycle
        elif shift:
            shift_cycles[-1] = shift
    return set(shift_cycles)


def _band(snapshot: Snapshot) -> tuple[float, float]:
    wear, batch = snapshot.wear, snapshot.batch
    offset, offset_std = (
        value if math.isfinite(value) else 0.0 for value in (batch.offset, batch.offset_std)
    )
    centre, reach = wear.level + offset, TOLD_STDS * math.hypot(wear.level_std, offset_std)
    return centre - reach, centre + reach


def _mark(snapshot: Snapshot, row: int, scale: "_Scale", band: tuple[float, float]) -> tuple[str, str]:
    mu_s = snapshot.friction.mu_s
    if math.isfinite(mu_s.value) and scale.row(mu_s.value) == row:
        odd = any(
            alarm.active and alarm.name == deviant_cycle.NAME and alarm.cycle == snapshot.cycle
            for alarm in snapshot.alarms
        )
        return ("✗", "bold red") if odd else ("•", QUALITY_STYLE[mu_s.quality])
    if math.isfinite(band[0]) and scale.row(band[1]) <= row <= scale.row(band[0]):
        return "░", "blue"
    return " ", ""


@dataclass(frozen=True, slots=True)
class _Scale:
    low: float
    high: float
    rows: int

    def row(self, value: float) -> int:
        share = (self.high - value) / (self.high - self.low)
        return min(self.rows - 1, max(0, int(share * self.rows)))
