"""What each column of a table means: guessed, with the reason and how sure, or given."""

from collections.abc import Mapping as AbstractMapping
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace

from impactcell.measurements.columns.assignment import (
    SURE,
    UNSURE,
    Assignment,
    ascends,
    changes_within,
    counts_rows,
    lacking,
)
from impactcell.measurements.columns.beside_others import (
    GIVEN,
    leave_out_measured_speed,
    leave_out_of_picture,
    prefer_position,
    rate_of_position,
)
from impactcell.measurements.columns.column_units import (
    contrary_units,
    covariates_without_unit,
    measured_unit,
    unit_of,
    without_unit,
)
from impactcell.measurements.columns.given_values import Given, check_given, unused_gains, without_use
from impactcell.measurements.columns.joints import OF_JOINT, Joints, joints_of
from impactcell.measurements.columns.motion_signals import ways_from_signals
from impactcell.measurements.columns.recognition import (
    CHANNELS,
    SPEED_OF,
    UNIT_ALONE,
    UNIT_MATCH,
    VOCABULARY,
    ColumnMeaning,
    name_score,
)
from impactcell.measurements.columns.repeated_rows import without_repeats
from impactcell.measurements.columns.text_channels import text_channels
from impactcell.measurements.notation.units import Dimension, MeasuredUnit
from impactcell.measurements.table import MeasuredColumn, Table

PRIORITY = (
    ColumnMeaning.TIME, ColumnMeaning.FORCE, ColumnMeaning.ACTUATOR, ColumnMeaning.POSITION,
    ColumnMeaning.SHOT, ColumnMeaning.VELOCITY, ColumnMeaning.MASS, ColumnMeaning.DIRECTION,
    ColumnMeaning.BATCH, ColumnMeaning.DWELL, ColumnMeaning.START,
)  # fmt: skip
"""Order in which equally sure guesses are taken."""


@dataclass(frozen=True, slots=True)
class Mapping:
    """What the columns of tables mean.

    Attributes
    ----------
    assignments : tuple of Assignment
        One a column, in their order.
    given : Given
    faults : tuple of str
        What has to be given before a campaign can be written, each with the way out.
    """

    assignments: tuple[Assignment, ...]
    given: Given
    faults: tuple[str, ...]

    def of(self, meaning: ColumnMeaning) -> Assignment | None:
        """Give the column of a quantity that only one can have."""
        return next((item for item in self.assignments if item.meaning is meaning), None)

    def time_of(self, table: Table) -> Assignment | None:
        """Give the column of time of a table: what was recorded apart may call it otherwise."""
        return next(
            (
                item
                for item in self.assignments
                if item.meaning is ColumnMeaning.TIME and table.column(item.column) is not None
            ),
            None,
        )


def guess(tables: Sequence[Table], given: Given | None = None) -> Mapping:
    """Say what each column of the tables means.

    Columns that several tables share are one; of a quantity that only one can have, the surest gets it. Only
    of time each table may have its own.

    Raises
    ------
    MeasurementError
        A column or unit that was given is not there.
    """
    given = given or Given()
    tables, _ = without_repeats(tables, given)
    columns: dict[str, MeasuredColumn] = {}
    for table in tables:
        for column in table.columns:
            columns.setdefault(column.name, column)
    check_given(columns, given)
    beside = _beside(tables)
    joints = joints_of([name for name, column in columns.items() if column.text is None], given.columns)
    candidates = [
        candidate
        for column in columns.values()
        if not joints.why_out(column.name)
        for candidate in _candidates(column, given, list(columns.values()), beside[column.name])
    ]
    candidates.sort(key=lambda item: (-item.confidence, PRIORITY.index(item.meaning)))
    chosen: dict[str, Assignment] = {}
    quantities: dict[ColumnMeaning, Assignment] = {}
    for item in candidates:
        taken = quantities.get(item.meaning)
        if item.meaning is ColumnMeaning.TIME and taken is not None:
            of_time = [one for one in chosen.values() if one.meaning is ColumnMeaning.TIME]
            taken = next((one for one in of_time if one.column in beside[item.column]), None)
        if taken is not None and taken.confidence < GIVEN and abs(taken.confidence - item.confidence) < 0.05:
            unsure = replace(
                taken,
                confidence=min(taken.confidence, UNSURE),
                why=f"{taken.why}; {item.column!r} could be it too",
            )
            quantities[item.meaning] = chosen[taken.column] = unsure
        if taken is None and item.column not in chosen:
            chosen[item.column] = quantities[item.meaning] = item
    prefer_position(chosen, quantities, candidates)
    leave_out_of_picture(chosen, quantities)
    leave_out_measured_speed(chosen, quantities, tables)
    shot = quantities.get(ColumnMeaning.SHOT)
    if shot is not None and shot.confidence < GIVEN and _counts_samples(shot.column, tables, quantities):
        del chosen[shot.column]
    assignments = tuple(
        chosen.get(name) or _further(column, given, quantities, joints) for name, column in columns.items()
    )
    texts = text_channels(assignments, tables)
    faults = [fault for _, fault in texts.values()]
    told = {meaning for meaning, _ in texts.values()}
    if of_joints := joints.fault():
        faults.append(of_joints)
        told |= set(OF_JOINT)
    faults += lacking(assignments, given.constants, tables, told, ways_from_signals(assignments, OF_JOINT))
    faults += [*without_use(assignments, given, tables), *unused_gains(assignments, given, columns)]
    faults += without_unit(tables, assignments, given.units, given.gains)
    faults += covariates_without_unit(tables, assignments, given.units)
    faults += contrary_units(tables, given.units)
    return Mapping(assignments, given, tuple(faults))


def _counts_samples(
    name: str, tables: Sequence[Table], quantities: AbstractMapping[ColumnMeaning, Assignment]
) -> bool:
    """Whether a column counts the rows wherever a channel stands beside it; in a list it may count shots."""
    channels = {quantities[meaning].column for meaning in CHANNELS if meaning in quantities}
    beside = [
        column.values
        for table in tables
        if (column := table.column(name)) is not None and any(map(table.column, channels))
    ]
    return bool(beside) and all(len(values) > 2 and counts_rows(values) for values in beside)


def _beside(tables: Sequence[Table]) -> dict[str, set[str]]:
    """Names of the columns that stand in one table with each, its own among them."""
    beside: dict[str, set[str]] = {}
    for table in tables:
        names = {column.name for column in table.columns}
        for name in names:
            beside.setdefault(name, set()).update(names)
    return beside


def _candidates(
    column: MeasuredColumn, given: Given, columns: Sequence[MeasuredColumn], beside: AbstractSet[str]
) -> list[Assignment]:
    """Whatever a column could be, with how sure it is."""
    unit = unit_of(column, given.units)
    if column.name in given.others:
        return []
    named = [meaning for meaning, name in given.columns.items() if name == column.name]
    if named:
        return [Assignment(column.name, named[0], measured_unit(unit, named[0], given.gains), GIVEN, "given")]
    found = []
    for meaning in PRIORITY:
        said = given.columns.get(meaning)
        if said is not None and (said in beside or meaning is not ColumnMeaning.TIME):
            continue
        measured = measured_unit(unit, meaning, given.gains)
        score, why = _score(column, meaning, measured, columns, given)
        if score > 0.0:
            found.append(Assignment(column.name, meaning, measured, score, why))
    return found


def _score(
    column: MeasuredColumn,
    meaning: ColumnMeaning,
    unit: MeasuredUnit | None,
    columns: Sequence[MeasuredColumn],
    given: Given,
) -> tuple[float, str]:
    is_text = column.text is not None
    if is_text != (meaning is ColumnMeaning.BATCH) and not (meaning is ColumnMeaning.BATCH and not is_text):
        return 0.0, ""
    score, word = name_score(column.name, meaning)
    fits = unit is not None and unit.dimension in VOCABULARY[meaning].dimensions
    if unit is not None and unit.dimension is not Dimension.NONE and not fits:
        return 0.0, ""
    if meaning is ColumnMeaning.TIME and not ascends(column.values):
        return 0.0, ""
    if score:
        why = f"named {word!r}"
        return (min(score + UNIT_MATCH, 0.99), f"{why}, unit fits") if fits and unit else (score, why)
    alone = meaning in (ColumnMeaning.TIME, ColumnMeaning.FORCE, ColumnMeaning.POSITION)
    return _score_by_unit(unit, columns, given) if fits and alone and unit is not None else (0.0, "")


def _score_by_unit(unit: MeasuredUnit, columns: Sequence[MeasuredColumn], given: Given) -> tuple[float, str]:
    """How sure a unit alone makes what a column is."""
    if unit.dimension is not Dimension.NONE:
        same = [
            other
            for other in columns
            if (of := unit_of(other, given.units)) and of.dimension is unit.dimension
        ]
        if len(same) == 1:
            return UNIT_ALONE + 0.1, f"the only column in {unit.symbol}"
        return UNIT_ALONE, f"by its unit {unit.symbol}"
    return 0.0, ""


def _dimension_of(item: Assignment | None) -> Dimension:
    return Dimension.NONE if item is None or item.unit is None else item.unit.dimension


def _further(
    column: MeasuredColumn,
    given: Given,
    quantities: AbstractMapping[ColumnMeaning, Assignment],
    joints: Joints,
) -> Assignment:
    """Take a column that is none of the quantities for a covariate: it may still explain friction.

    The mean of a speed that changes within a shot says nothing that the position does not.
    """
    unit = unit_of(column, given.units)
    if column.name in given.others:
        return Assignment(column.name, given.others[column.name], unit, GIVEN, "given")
    if why := joints.why_out(column.name):
        return Assignment(column.name, ColumnMeaning.IGNORED, unit, SURE, why)
    if column.text is None and len(column.values) > 2 and counts_rows(column.values):
        is_count = float(column.values[1] - column.values[0]).is_integer()
        why = "counts the rows" if is_count else "goes by equal steps, as a time does"
        return Assignment(column.name, ColumnMeaning.IGNORED, unit, UNIT_MATCH + SURE, why)
    dimension = None if unit is None else unit.dimension
    rate = rate_of_position(column, dimension, quantities)
    speed = SPEED_OF.get(_dimension_of(quantities.get(ColumnMeaning.POSITION)))
    if unit is not None and dimension is speed and changes_within(column.values):
        rate = rate or "speed"
    if rate:
        why = f"{'an' if rate == 'acceleration' else 'a'} {rate}, as the position has it"
        return Assignment(column.name, ColumnMeaning.IGNORED, unit, SURE, why)
    return Assignment(column.name, ColumnMeaning.COVARIATE, unit, SURE, "none of the known quantities")
