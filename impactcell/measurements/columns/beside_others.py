"""What a column is in the light of the others: an axis, a coordinate of a picture, a measured speed."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from impactcell.measurements.columns.assignment import SURE, Assignment, changes_within
from impactcell.measurements.columns.recognition import VOCABULARY, ColumnMeaning, normalised, rate_name
from impactcell.measurements.notation.units import Dimension
from impactcell.measurements.table import MeasuredColumn, Table

GIVEN = 1.0
"""Confidence of what was given."""
Chosen = dict[str, Assignment]
Quantities = dict[ColumnMeaning, Assignment]


def prefer_position(chosen: Chosen, quantities: Quantities, candidates: Sequence[Assignment]) -> None:
    """Take what may be actuator or position, as of an axis, for the position where no other column is."""
    actuator = quantities.get(ColumnMeaning.ACTUATOR)
    if actuator is None or actuator.confidence == GIVEN or ColumnMeaning.POSITION in quantities:
        return
    if _is_coordinate(actuator):
        del quantities[ColumnMeaning.ACTUATOR]
        position = replace(actuator, meaning=ColumnMeaning.POSITION)
        chosen[actuator.column] = quantities[ColumnMeaning.POSITION] = position
        return
    for item in candidates:
        if item.meaning is ColumnMeaning.POSITION and item.column == actuator.column:
            if item.confidence >= actuator.confidence:
                del quantities[ColumnMeaning.ACTUATOR]
                chosen[item.column] = quantities[ColumnMeaning.POSITION] = item
            return


def leave_out_of_picture(chosen: Chosen, quantities: Quantities) -> None:
    """Leave out the y beside the x of what was filmed: without a force nothing is an actuator."""
    actuator, position = quantities.get(ColumnMeaning.ACTUATOR), quantities.get(ColumnMeaning.POSITION)
    if actuator is None or position is None or ColumnMeaning.FORCE in quantities:
        return
    if actuator.confidence < GIVEN and _is_coordinate(actuator):
        del quantities[ColumnMeaning.ACTUATOR]
        chosen[actuator.column] = replace(
            actuator,
            meaning=ColumnMeaning.IGNORED,
            confidence=SURE,
            why=f"a coordinate beside {position.column!r}, as of a film; of what swings export the angle",
        )


def leave_out_measured_speed(chosen: Chosen, quantities: Quantities, tables: Sequence[Table]) -> None:
    """Leave out a velocity that nobody gave a unit where it was measured beside the position."""
    velocity, position = quantities.get(ColumnMeaning.VELOCITY), quantities.get(ColumnMeaning.POSITION)
    if velocity is None or position is None or velocity.unit is not None or velocity.confidence == GIVEN:
        return
    beside = [
        column.values
        for table in tables
        if (column := table.column(velocity.column)) is not None and table.column(position.column) is not None
    ]
    if beside and all(map(changes_within, beside)):
        del quantities[ColumnMeaning.VELOCITY]
        chosen[velocity.column] = replace(
            velocity, meaning=ColumnMeaning.IGNORED, confidence=SURE, why="a speed, as the position has it"
        )


def rate_of_position(
    column: MeasuredColumn, dimension: Dimension | None, quantities: Mapping[ColumnMeaning, Assignment]
) -> str:
    """Say whether a column is called as a rate of a position that is there; empty where it is not."""
    rates = (Dimension.VELOCITY, Dimension.ANGULAR_VELOCITY, Dimension.ACCELERATION, Dimension.NONE)
    if column.text is not None or ColumnMeaning.POSITION not in quantities:
        return ""
    if (dimension is not None and dimension not in rates) or not changes_within(column.values):
        return ""
    return rate_name(column.name)


def _is_coordinate(item: Assignment) -> bool:
    """Whether a column is called an actuator by a sign of a coordinate only, as y and z."""
    return normalised(item.column) in VOCABULARY[ColumnMeaning.ACTUATOR].symbols.split()
