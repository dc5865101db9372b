"""What each column of a table means: guessed, with the reason and how sure, or given."""

from collections.abc import Mapping as AbstractMapping
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from impactcell.campaign import Excitation
from impactcell.errors import MeasurementError
from impactcell.measurements.assignment import SURE, Assignment, ascends, changes_within, counts_rows, lacking
from impactcell.measurements.column_units import (
    contrary_units,
    covariates_without_unit,
    measured_unit,
    unit_of,
    without_unit,
)
from impactcell.measurements.gains import Gain
from impactcell.measurements.recognition import (
    SPEED_OF,
    UNIT_ALONE,
    UNIT_MATCH,
    VOCABULARY,
    ColumnMeaning,
    name_score,
)
from impactcell.measurements.table import MeasuredColumn, Table
from impactcell.measurements.text_channels import text_channels
from impactcell.measurements.units import Dimension, MeasuredUnit, parse_unit

GIVEN = 1.0
"""Confidence of what was given."""
PRIORITY = (
    ColumnMeaning.TIME, ColumnMeaning.FORCE, ColumnMeaning.ACTUATOR, ColumnMeaning.POSITION,
    ColumnMeaning.SHOT, ColumnMeaning.VELOCITY, ColumnMeaning.MASS, ColumnMeaning.DIRECTION,
    ColumnMeaning.BATCH, ColumnMeaning.DWELL, ColumnMeaning.START,
)  # fmt: skip
"""Order in which equally sure guesses are taken."""


@dataclass(frozen=True, slots=True)
class Given:
    """What the user says instead of letting it be guessed; empty where he says nothing.

    Attributes
    ----------
    columns : mapping
        MeasuredColumn of a quantity, as `force`: `Kraft 1`.
    units : mapping
        MeasuredUnit of a column by its name.
    signs : mapping
        +1 or -1 for a channel, as `force`: -1.
    excitation : Excitation or None
    trigger : float or str or None
        Threshold of the force [N] at which contact begins; `none` where t = 0 is the contact already.
    constants : mapping
        Mass, velocity, direction, stroke, rate and gravity of all shots, in SI units, by their names.
    others : mapping
        Columns that are covariates or ignored, by their names.
    gains : mapping
        What the signal in the column of a channel stands for.
    delays : mapping
        How much later than it happened a channel was recorded [s].
    """

    columns: AbstractMapping[ColumnMeaning, str] = field(default_factory=dict)
    units: AbstractMapping[str, str] = field(default_factory=dict)
    signs: AbstractMapping[ColumnMeaning, int] = field(default_factory=dict)
    excitation: Excitation | None = None
    trigger: float | str | None = None
    constants: AbstractMapping[str, float] = field(default_factory=dict)
    others: AbstractMapping[str, ColumnMeaning] = field(default_factory=dict)
    gains: AbstractMapping[ColumnMeaning, Gain] = field(default_factory=dict)
    delays: AbstractMapping[ColumnMeaning, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Mapping:
    """What the columns of tables with the same columns mean.

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


def guess(tables: Sequence[Table], given: Given | None = None) -> Mapping:
    """Say what each column of the tables means.

    Columns that several tables share are one; of a quantity that only one can have, the surest gets it.

    Raises
    ------
    MeasurementError
        A column or unit that was given is not there.
    """
    given = given or Given()
    columns: dict[str, MeasuredColumn] = {}
    for table in tables:
        for column in table.columns:
            columns.setdefault(column.name, column)
    _check_given(columns, given)
    candidates = [
        candidate
        for column in columns.values()
        for candidate in _candidates(column, given, list(columns.values()))
    ]
    candidates.sort(key=lambda item: (-item.confidence, PRIORITY.index(item.meaning)))
    chosen: dict[str, Assignment] = {}
    quantities: dict[ColumnMeaning, Assignment] = {}
    for item in candidates:
        taken = quantities.get(item.meaning)
        if taken is not None and taken.confidence < GIVEN and abs(taken.confidence - item.confidence) < 0.05:
            unsure = replace(
                taken,
                confidence=min(taken.confidence, 0.4),
                why=f"{taken.why}; {item.column!r} could be it too",
            )
            quantities[item.meaning] = chosen[taken.column] = unsure
        if taken is None and item.column not in chosen:
            chosen[item.column] = quantities[item.meaning] = item
    speed = SPEED_OF.get(_dimension_of(quantities.get(ColumnMeaning.POSITION)))
    assignments = tuple(
        chosen.get(name) or _further(column, given, speed) for name, column in columns.items()
    )
    texts = text_channels(assignments, tables)
    faults = [fault for _, fault in texts.values()]
    faults += lacking(assignments, given.constants, tables, {meaning for meaning, _ in texts.values()})
    faults += [*_without_use(assignments, given, tables), *_unused_gains(assignments, given, columns)]
    faults += without_unit(tables, assignments, given.units, given.gains)
    faults += covariates_without_unit(tables, assignments, given.units)
    faults += contrary_units(tables, given.units)
    return Mapping(assignments, given, tuple(faults))


def _without_use(assignments: Sequence[Assignment], given: Given, tables: Sequence[Table]) -> list[str]:
    """Tell what was given and would change nothing: who gave it believes that it counts."""
    columns = {item.meaning: item.column for item in assignments}
    faults = [
        f"a {what} of the {meaning} was given, and no column is the {meaning}; name it with --column "
        f"{meaning}=NAME, or take the {what} away"
        for what, said in (("sign", given.signs), ("delay", given.delays))
        for meaning in said
        if meaning not in columns
    ]
    time = columns.get(ColumnMeaning.TIME)
    if time is not None and "rate_hz" in given.constants and all(table.column(time) for table in tables):
        faults.append(
            f"the times are those of column {time!r}, so that the rate has no use; take the rate away, or "
            f"say --column 'ignored={time}' for it to count"
        )
    return faults


def _unused_gains(
    assignments: Sequence[Assignment], given: Given, columns: AbstractMapping[str, MeasuredColumn]
) -> list[str]:
    """Tell gains of what is no column, or of one that is in no unit of their signal."""
    names = {item.meaning: item.column for item in assignments}
    faults = []
    for meaning, gain in given.gains.items():
        name = names.get(meaning)
        if name is None:
            faults.append(
                f"a gain of the {meaning} was given, and no column is the {meaning}; name it with --column "
                f"{meaning}=NAME, or take the gain away"
            )
        elif (unit := unit_of(columns[name], given.units)) and gain.measured(unit) is None:
            faults.append(
                f"column {name!r} ({meaning}) is in {unit.symbol}, of which a gain of {gain.text} says "
                f"nothing; take it away, or say --unit '{name}={gain.signal.symbol}'"
            )
    return faults


def _check_given(columns: AbstractMapping[str, MeasuredColumn], given: Given) -> None:
    known = ", ".join(repr(name) for name in columns)
    faults = [
        f"there is no column {name!r}; the columns are {known}"
        for name in (*given.columns.values(), *given.units, *given.others)
        if name not in columns
    ]
    faults += [
        f"the unit {unit!r} of {name!r} is not known; write it as mm, N, mm/min or deg, say"
        for name, unit in given.units.items()
        if parse_unit(unit) is None
    ]
    meanings = [(name, str(meaning)) for meaning, name in given.columns.items()]
    meanings += [(name, str(meaning)) for name, meaning in given.others.items()]
    for name in dict.fromkeys(name for name, _ in meanings):
        several = [meaning for of, meaning in meanings if of == name]
        if len(several) > 1:
            faults.append(f"column {name!r} is given as {' and as '.join(several)}; it is one of them")
    if faults:
        raise MeasurementError("\n".join(faults))


def _candidates(column: MeasuredColumn, given: Given, columns: Sequence[MeasuredColumn]) -> list[Assignment]:
    """Whatever a column could be, with how sure it is."""
    unit = unit_of(column, given.units)
    if column.name in given.others:
        return []
    named = [meaning for meaning, name in given.columns.items() if name == column.name]
    if named:
        return [Assignment(column.name, named[0], measured_unit(unit, named[0], given.gains), GIVEN, "given")]
    found = []
    for meaning in PRIORITY:
        if meaning in given.columns:
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


def _further(column: MeasuredColumn, given: Given, speed: Dimension | None) -> Assignment:
    """Take a column that is none of the quantities for a covariate: it may still explain friction.

    The mean of a `speed` that changes within a shot says nothing that the position does not.
    """
    unit = unit_of(column, given.units)
    if column.name in given.others:
        return Assignment(column.name, given.others[column.name], unit, GIVEN, "given")
    if column.text is None and len(column.values) > 2 and counts_rows(column.values):
        return Assignment(column.name, ColumnMeaning.IGNORED, unit, UNIT_MATCH + SURE, "counts the rows")
    if unit is not None and unit.dimension is speed and changes_within(column.values):
        return Assignment(column.name, ColumnMeaning.IGNORED, unit, SURE, "a speed, as the position has it")
    return Assignment(column.name, ColumnMeaning.COVARIATE, unit, SURE, "none of the known quantities")
