"""What a table has instead of a position or a force: a speed, a current, a voltage."""

from collections.abc import Sequence

from impactcell.measurements.columns.assignment import Assignment
from impactcell.measurements.columns.recognition import SPEED_OF, ColumnMeaning, normalised, rate_name
from impactcell.measurements.notation.units import Dimension

DRIVE_WORDS = frozenset((
    "current", "strom", "motorstrom", "voltage", "spannung", "motorspannung", "u", "i", "ia", "iq", "ua",
    "vir", "pwm", "duty",
))  # fmt: skip
"""Names of what drives a motor, to which its torque is in proportion, or nearly."""
CURRENT_WORDS = frozenset(("current", "strom", "motorstrom", "i", "ia", "iq"))
"""Those of a current."""


def speed_among(assignments: Sequence[Assignment]) -> str | None:
    """Give the column of a speed."""
    speeds = [
        item.column
        for item in assignments
        if item.meaning is ColumnMeaning.VELOCITY
        or (item.unit is not None and item.unit.dimension in SPEED_OF.values())
        or rate_name(item.column) == "speed"
    ]
    return speeds[0] if speeds else None


def drive_among(assignments: Sequence[Assignment]) -> tuple[str, str] | None:
    """Give the column of a current, else of a voltage, that was not taken for anything, and its unit."""
    free = [item for item in assignments if item.meaning is ColumnMeaning.COVARIATE]
    for dimension in (Dimension.CURRENT, Dimension.VOLTAGE):
        for item in free:
            if item.unit is not None and item.unit.dimension is dimension:
                return item.column, dimension.value
    named = [item.column for item in free if item.unit is None and _words(item) & DRIVE_WORDS]
    currents = [item.column for item in free if item.column in named and _words(item) & CURRENT_WORDS]
    if currents:
        return currents[0], Dimension.CURRENT.value
    return (named[0], Dimension.VOLTAGE.value) if named else None


def ways_from_signals(assignments: Sequence[Assignment], lacking: Sequence[ColumnMeaning]) -> list[str]:
    """Say how channels that are lacking follow from what else there is."""
    ways = []
    speed, drive = speed_among(assignments), drive_among(assignments)
    if ColumnMeaning.POSITION in lacking and speed is not None:
        ways.append(f"where {speed!r} is the speed of what moves, --column 'position={speed}' sums it up")
    if ColumnMeaning.FORCE in lacking and drive is not None:
        option = _option(*drive, assignments)
        ways.append(f"where {drive[0]!r} drives, say what it stands for: {option}")
    return ways


def note_of_drive(assignments: Sequence[Assignment]) -> list[str]:
    """Tell what may have driven a motion that is taken for a free one."""
    drive = drive_among(assignments)
    if drive is None:
        return []
    option = _option(*drive, assignments)
    return [f"{drive[0]!r} may have driven what is taken to move freely: {option} says what it stands for"]


def _option(name: str, unit: str, assignments: Sequence[Assignment]) -> str:
    """Say how a signal is given as a force, or as a torque where the position is no length."""
    lengths = (item.unit is not None and item.unit.dimension is Dimension.LENGTH for item in assignments)
    of = "12.5 N" if any(lengths) else "0.05 N m"
    return f"--column 'force={name}' --gain 'force={of}/{unit}'"


def _words(item: Assignment) -> frozenset[str]:
    return frozenset(normalised(item.column).split("_"))
