"""Which taps the registers of a cell that places parts can command: how far, and in which steps."""

from collections.abc import Iterator
from typing import Final

from impactcell.errors import RasterError
from impactcell.fieldbus.positioning_registers import commanded_values
from impactcell.records import MM_PER_MIN
from impactcell.settings.cells import CellConfig

COARSE_STROKE: Final = 0.5
"""Step of the stroke over the tolerance, from which on steps are told. Of 50 parts with a tolerance of 10 µm
none stayed outside with 1, which took a tenth more taps, 3 with 2, and 15 with 5. Our choice."""
COARSE_VELOCITY: Final = 0.1
"""Step of the velocity over the largest, from which on steps are told: it costs taps where that of the stroke
is coarse, too. Our choice."""


def doubted_commands(cell: CellConfig) -> Iterator[tuple[tuple[str, ...], str, bool]]:
    """Yield a place in the cell file, what is to be said there, and whether it is a fault."""
    positioning, actuator = cell.settings.positioning, cell.settings.actuator
    if positioning is None:
        return
    fastest, longest = actuator.max_velocity_mm_per_min, actuator.max_stroke_mm
    coarse_stroke = COARSE_STROKE * positioning.tolerance_um * 1e-3
    steps, coarse = [], False
    for name, key, limit, unit, si, largest_step in (
        (
            "command_velocity",
            "max_velocity_mm_per_min",
            fastest,
            "mm/min",
            MM_PER_MIN,
            COARSE_VELOCITY * fastest,
        ),
        ("command_stroke", "max_stroke_mm", longest, "mm", 1e-3, coarse_stroke),
    ):
        try:
            values = commanded_values(cell.register_map, name)
            has_any = values.has_up_to(limit * si)
        except RasterError:
            has_any = False
        if not has_any:
            told = f"register {name} has no value between 0 and {limit:g} {unit}: no tap can be commanded"
            yield ("actuator", key), told, True
            continue
        step, last = values.step / si, values.last / si
        if last < limit:
            told = f"register {name} ends at {last:g} {unit}: no tap is commanded from there to {limit:g}"
            yield ("actuator", key), told, False
        if step:
            steps.append(f"{step:.3g} {unit} of register {name}")
        coarse |= step > largest_step
    if coarse:
        told = f"taps are planned in whole steps, {' and '.join(steps)}: with a tolerance of "
        told += f"{positioning.tolerance_um:g} µm tasks may take more of them, and parts may stay outside"
        yield ("positioning",), told, False
