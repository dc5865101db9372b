"""How a part was moved, told by the shapes of its records: struck, driven, or left to slide."""

from collections.abc import Sequence

import numpy as np

from impactcell.campaign import Coordinate, Excitation
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.records.measured_records import Record
from impactcell.records import Samples

PULSE_SHARE = 0.4
"""Share of a record in which the force is above half its range: a tap's contact is shorter, a drive is
not."""
DRIVE_REVERSAL = 0.25
"""Force of the other sign as a share of the largest from which on it drives both ways; a contact only
pushes."""
END_SHARE = 0.05
"""Share of a record at its begin and end by which is told whether a channel came back."""
SIDE_SHARE = 0.1
"""How far from its mean something is on one side of it, as a share of its range [1]."""
FEWEST_CHANGES = 4
"""Changes of side from which on something swings: what slides and springs back makes one or two."""
SWAPPED = (
    "the position is a short push, as the force of a tap is, and the force stays where it went, as a part "
    "does: they look swapped (--column force=NAME --column position=NAME, and --unit of both, say which is "
    "which)"
)
"""Said of records of which `looks_swapped` is true."""


def excitation_of(records: Sequence[Record], notes: list[str]) -> Excitation:
    """Tell contacts, which push for a short while, from a drive; without force the part slides freely."""
    forces = [
        record.values[ColumnMeaning.FORCE] for record in records if ColumnMeaning.FORCE in record.values
    ]
    if not forces:
        notes.append("excitation free_slide: no force was recorded (--excitation says otherwise)")
        return Excitation.FREE_SLIDE
    if 2 * sum(not _is_push(force) for force in forces) > len(forces):
        notes.append(
            "excitation driven: the force acts all the time or both ways (--excitation says otherwise)"
        )
        return Excitation.DRIVEN
    notes.append("excitation tap: the force is a short push (--excitation says otherwise)")
    return Excitation.TAP


def looks_swapped(records: Sequence[Record]) -> bool:
    """Tell by their shapes, whatever their units, whether force and position of most records are swapped."""
    swapped = [
        _is_push(record.values[ColumnMeaning.POSITION])
        and not _stays(record.values[ColumnMeaning.POSITION])
        and _stays(record.values[ColumnMeaning.FORCE])
        for record in records
        if {ColumnMeaning.POSITION, ColumnMeaning.FORCE} <= set(record.values)
    ]
    return 2 * sum(swapped) > len(records)


def notes_of_swings(records: Sequence[Record], excitation: Excitation, coordinate: Coordinate) -> list[str]:
    """Tell what swings and was taken for a slide along a line: a pendulum of which x was filmed, say."""
    if excitation is not Excitation.FREE_SLIDE or coordinate is Coordinate.ROTATION:
        return []
    swinging = [record.place for record in records if _changes_side(record.values[ColumnMeaning.POSITION])]
    if not swinging:
        return []
    of = "it swings to and fro" if len(records) == 1 else f"{len(swinging)} of {len(records)} records swing"
    return [f"{of}; of a pendulum give the angle (--column position=NAME --unit NAME=rad)"]


def _changes_side(values: Samples) -> bool:
    """Say whether a channel goes from one side of its mean to the other again and again."""
    centred = values - np.mean(values)
    sides = np.sign(centred[np.abs(centred) > SIDE_SHARE * np.ptp(values)])
    return int(np.count_nonzero(np.diff(sides))) >= FEWEST_CHANGES


def _is_push(values: Samples) -> bool:
    """Say whether a channel leaves where it rests for a short while only, and to one side."""
    centred = values - np.median(values)
    largest = float(np.abs(centred).max())
    is_short = float(np.mean(np.abs(centred) > 0.5 * largest)) < PULSE_SHARE
    return is_short and not min(centred.max(), -centred.min()) > DRIVE_REVERSAL * largest


def _stays(values: Samples) -> bool:
    """Say whether a channel ends far from where it began."""
    count = max(1, round(END_SHARE * len(values)))
    return bool(abs(np.mean(values[-count:]) - np.mean(values[:count])) > 0.5 * np.ptp(values))
