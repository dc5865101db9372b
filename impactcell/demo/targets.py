"""What became of the parts that were tapped to their targets: a table at the end of the demo, and JSON."""

import math
from collections.abc import Sequence
from typing import Any

from rich.table import Table
from rich.text import Text

from impactcell.positioning.task_state_machine import TaskOutcome


def targets_table(outcomes: Sequence[TaskOutcome], tolerance_m: float) -> Table:
    """One row a part, in their order, and below what they come to, but for ways that are not known."""
    table = Table(title="parts tapped to their targets", title_justify="left", header_style="dim", box=None)
    for heading in ("part", "mass", "from", "target", "taps", "off target", ""):
        table.add_column(heading, justify="left" if not heading else "right", no_wrap=bool(heading))
    for number, outcome in enumerate(outcomes, 1):
        off_um = (outcome.position_m - outcome.target_m) * 1e6
        table.add_row(
            str(number),
            f"{outcome.mass_kg:.1f} kg",
            f"{outcome.start_m * 1e3:.3f} mm",
            f"{outcome.target_m * 1e3:.3f} mm",
            str(outcome.taps),
            f"{round(off_um) + 0:+d} µm" if math.isfinite(off_um) else "–",
            Text("inside", style="green") if outcome.settled else Text(outcome.reason, style="bold red"),
        )
    hits = sum(outcome.settled for outcome in outcomes)
    taps = sum(outcome.taps for outcome in outcomes)
    ways_m = (abs(outcome.position_m - outcome.start_m) for outcome in outcomes)
    travelled = math.fsum(way_m for way_m in ways_m if math.isfinite(way_m))
    table.caption_justify = "left"
    table.caption = (
        f"{hits} of {len(outcomes)} inside ± {tolerance_m * 1e6:.0f} µm, {taps} taps, "
        f"{taps / max(len(outcomes), 1):.1f} a part, {travelled * 1e3:.1f} mm travelled"
    )
    return table


def targets_json(outcomes: Sequence[TaskOutcome]) -> list[dict[str, Any]]:
    """One object a part, in their order; null where it is not known where the part lies."""
    return [
        {
            "target_mm": outcome.target_m * 1e3,
            "start_mm": outcome.start_m * 1e3,
            "end_mm": number(outcome.position_m * 1e3),
            "off_target_um": number((outcome.position_m - outcome.target_m) * 1e6),
            "mass_kg": outcome.mass_kg,
            "taps": outcome.taps,
            "inside": outcome.settled,
            "reason": outcome.reason,
        }
        for outcome in outcomes
    ]


def number(value: float) -> float | None:
    """Give a number that JSON has; None for one that is not known."""
    return value if math.isfinite(value) else None
