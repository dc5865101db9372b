"""What a column was taken for, and what has to be given before a campaign can be written."""

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

import numpy as np

from impactcell.measurements.columns.recognition import (
    CHANNELS,
    ROTATION_WORDS,
    SPEED_OF,
    SYMBOL_MATCH,
    VOCABULARY,
    WORD_MATCH,
    ColumnMeaning,
    name_score,
    rate_name,
)
from impactcell.measurements.columns.sampling_step import doubt_of_step, sampling_step_s
from impactcell.measurements.notation.gains import SIGNALS
from impactcell.measurements.notation.moments import unread_moments
from impactcell.measurements.notation.units import Dimension, MeasuredUnit
from impactcell.measurements.table import MeasuredColumn, Table
from impactcell.records import Samples

SURE = 0.5
"""Confidence from which on a guess is used without being confirmed."""
UNSURE = 0.35
"""Confidence of the first of several columns that may be the same quantity."""
MEASURED_CHANGES = 0.1
"""Share of a column's samples that differ from the one before, beyond which it was measured."""
OF_MOTION = (*CHANNELS, ColumnMeaning.VELOCITY, ColumnMeaning.MASS)
"""Quantities whose unit is another one where what moves turns."""
UNITLESS = (
    ColumnMeaning.SHOT,
    ColumnMeaning.DIRECTION,
    ColumnMeaning.BATCH,
    ColumnMeaning.COVARIATE,
    ColumnMeaning.IGNORED,
)
"""Quantities that need no unit."""
ASCENDING_SHARE = 0.8
"""Share of steps forward from which on a column may be a time: it begins anew with each shot of a file."""
TURN_ROUND = "turn the rows of the file round"
"""What to do where the last row was recorded first."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """What one column means.

    Attributes
    ----------
    column : str
    meaning : ColumnMeaning
    unit : MeasuredUnit or None
        None where the file says none and none was given: such a column cannot be used where one is needed.
    confidence : float
        0 to 1; 1 where it was given.
    why : str
    """

    column: str
    meaning: ColumnMeaning
    unit: MeasuredUnit | None
    confidence: float
    why: str

    @property
    def summed_up(self) -> bool:
        """Whether this is a position of which the speed was recorded."""
        of_speed = self.unit is not None and self.unit.dimension in SPEED_OF.values()
        return of_speed and self.meaning is ColumnMeaning.POSITION


def ascends(values: Samples) -> bool:
    """Whether a column goes forward in nearly all of its steps, as a time does."""
    steps = np.diff(values) > 0.0
    return bool(steps.size) and float(np.mean(steps)) > ASCENDING_SHARE


def lacking(
    assignments: Sequence[Assignment],
    constants: Mapping[str, float],
    tables: Sequence[Table],
    told: AbstractSet[ColumnMeaning] = frozenset(),
    ways: Sequence[str] = (),
) -> list[str]:
    """Say what has to be given first; nothing of the quantities whose lack has been `told` already.

    `ways` say how a position or a force follows from what else there is.
    """
    faults = [
        fault
        for item in assignments
        for fault in _of_column(item, _written_unit(item, tables), turns=rotates(item, assignments))
    ]
    faults += _contradictions(assignments)
    present = {*told, *(item.meaning for item in assignments)}
    if ColumnMeaning.TIME not in present and any(
        sampling_step_s(table, constants) is None for table in tables
    ):
        left = (ColumnMeaning.IGNORED, ColumnMeaning.COVARIATE)
        unused = {item.column for item in assignments if item.meaning in left and item.unit is None}
        named = {item.column for item in assignments if _is_called_time(item)}
        faults.append(f"no column of time was found{_no_time(tables, named, unused)}")
    if not {ColumnMeaning.POSITION, ColumnMeaning.FORCE} & present:
        names = ", ".join(repr(item.column) for item in assignments)
        faults.append(
            f"neither position nor force was found among {names}; name them with --column position=NAME and "
            f"--column force=NAME{_or_encoding(tables)}{''.join(f'; {way}' for way in ways)}"
        )
    return faults


def _or_encoding(tables: Sequence[Table]) -> str:
    """Say how names become readable whose file may be in another encoding than it was read in."""
    for table in tables:
        if table.encoding and not all(column.name.isascii() for column in table.columns):
            return (
                f", or, where the names are others, give the encoding of the file, which was read as "
                f"{table.encoding}: --encoding gb18030, say"
            )
    return ""


def _written_unit(item: Assignment, tables: Sequence[Table]) -> str:
    """Give what the first table that has a column writes as its unit; empty where it writes none."""
    columns = (table.column(item.column) for table in tables)
    return next((column.unit or "" for column in columns if column is not None), "")


def rotates(item: Assignment, assignments: Sequence[Assignment]) -> bool:
    """Whether what moves turns: by the units of channels, mass and speed, else by how any is called."""
    if item.meaning not in OF_MOTION:
        return False
    channels = [one for one in assignments if one.meaning in CHANNELS]
    channels += [one for one in assignments if one.meaning in OF_MOTION and one.meaning not in CHANNELS]
    for one in channels:
        dimensions = VOCABULARY[one.meaning].dimensions
        if one.unit is not None and one.unit.dimension in dimensions:
            return one.unit.dimension is not dimensions[0]
    if any(one.unit is not None and one.unit.dimension is Dimension.ANGULAR_VELOCITY for one in assignments):
        return True
    return any(name_score(one.column, one.meaning)[1] in ROTATION_WORDS for one in channels)


def _of_column(item: Assignment, written: str, *, turns: bool) -> list[str]:
    if item.meaning in UNITLESS:
        return []
    faults = []
    if item.unit is None:
        faults.append(no_unit(item, written, turns=turns))
    elif item.unit.dimension not in VOCABULARY[item.meaning].dimensions and not item.summed_up:
        faults.append(
            f"column {item.column!r} ({item.meaning}) is in {item.unit.symbol}; "
            f"{_way_to_unit(item, item.meaning, item.unit)}"
        )
    by_sign_alone = item.unit is None and item.confidence >= SYMBOL_MATCH  # its unit will make it sure
    if item.confidence < SURE and not by_sign_alone and item.meaning in (ColumnMeaning.TIME, *CHANNELS):
        faults.append(
            f"column {item.column!r} may be the {item.meaning} ({item.why}); confirm it with --column "
            f"'{item.meaning}={item.column}', or name the right one"
        )
    return faults


def no_unit(item: Assignment, written: str, *, turns: bool) -> str:
    """Say that a column has no unit, or has `written` one that is not known, and which it may be."""
    dimension = VOCABULARY[item.meaning].dimensions[1 if turns else 0]
    if item.meaning is ColumnMeaning.POSITION and rate_name(item.column) == "speed":  # to be summed up
        dimension = SPEED_OF[dimension]
    unit = dimension.value
    lack = f"is in {written!r}, no unit that is known" if written else "has no unit"
    return (
        f"column {item.column!r} ({item.meaning}) {lack}; say --unit '{item.column}={unit}', or which it is"
    )


def _way_to_unit(item: Assignment, meaning: ColumnMeaning, unit: MeasuredUnit) -> str:
    """Say how a column that is in a unit of something else can be used as a quantity."""
    fitting = VOCABULARY[meaning].dimensions[0].value
    if meaning is ColumnMeaning.FORCE and unit.dimension is Dimension.MASS:
        weights = {"kg": "kgf", "lb": "lbf"}
        if (of_weight := weights.get(unit.symbol.lower().removesuffix("s"))) is not None:
            return f"say --unit '{item.column}={of_weight}' where its weight is meant, else its unit"
    way = f"give its unit with --unit '{item.column}={fitting}'"
    if meaning is ColumnMeaning.POSITION and unit.dimension in SPEED_OF.values():
        return f"say --column 'position={item.column}' to have the speed summed up, or {way}"
    if meaning not in CHANNELS or unit.dimension not in SIGNALS:
        return way
    signal = "" if unit.dimension is Dimension.NONE else f"/{unit.symbol}"
    return f"say what that stands for with --gain '{meaning}=12.5 {fitting}{signal}', or {way}"


def _contradictions(assignments: Sequence[Assignment]) -> list[str]:
    """Tell columns that are called as a channel that is not there, in a unit that no such channel has."""
    present = {item.meaning for item in assignments}
    faults = []
    for item in assignments:
        if item.unit is None or item.unit.dimension is Dimension.NONE or item.confidence == 1.0:
            continue
        for meaning in (ColumnMeaning.TIME, *CHANNELS):
            dimensions = VOCABULARY[meaning].dimensions
            if name_score(item.column, meaning)[0] < WORD_MATCH or item.unit.dimension in dimensions:
                continue
            if meaning in present and item.meaning is ColumnMeaning.COVARIATE:
                continue  # another column is that channel, so this is one more, of whatever
            faults.append(
                f"column {item.column!r} is called as the {meaning}, but is in {item.unit.symbol}; "
                f"{_way_to_unit(item, meaning, item.unit)}, or what it is with --column "
                f"'covariate={item.column}'"
            )
    return faults


def _is_called_time(item: Assignment) -> bool:
    """Whether a column is called as a time; by a symbol, as t, only where it is in a unit of time, too."""
    score = name_score(item.column, ColumnMeaning.TIME)[0]
    return score >= WORD_MATCH or (
        score >= SYMBOL_MATCH and item.unit is not None and item.unit.dimension is Dimension.TIME
    )


def _no_time(tables: Sequence[Table], named: AbstractSet[str], unused: AbstractSet[str]) -> str:
    """Say why what is `named` so is no time, or which `unused` one goes up as a time, and the way out."""
    way = "; name it with --column time=NAME, or give its rate, as --set rate=10kHz"
    for table in tables:
        if doubt := doubt_of_step(table):
            return f": {doubt}{way}"
    for table in tables:
        for column in table.columns:
            if column.name not in named:
                continue
            if column.text is not None:
                holds = unread_moments(column.text)[0] or "text"
                return f": {column.name!r} holds {holds}, as {column.text[0][:40]!r}{way}"
            if not ascends(column.values):
                return _no_ascent(column, way)
    for table in tables:
        for column in table.columns:
            if column.name not in unused or column.text is not None or not is_clock(column.values):
                continue
            step = float(np.median(np.diff(column.values)))
            if step != round(step) or step > 1.0:
                unit = "s" if step < 1.0 else "ms"
                return (
                    f": {column.name!r} goes up by {step:.6g} a row and may be it, in a unit to be said, as "
                    f"--unit '{column.name}={unit}'{way}"
                )
    return way


def _no_ascent(column: MeasuredColumn, way: str) -> str:
    steps = np.diff(column.values)
    if runs_backwards(steps):
        return f": {column.name!r} runs backwards; {TURN_ROUND}"
    forward = f": {column.name!r} goes forward in {np.sum(steps > 0.0)} of {steps.size} steps"
    if (steps >= 0.0).all() and steps.any():
        return f"{forward} and repeats in the others; {more_digits(column.name)}"
    return f"{forward} only{way}"


def runs_backwards(steps: Samples) -> bool:
    """Whether steps of a time are those of a file whose last row was recorded first."""
    return bool((steps <= 0.0).all() and steps.any())


def more_digits(column: str) -> str:
    """Give the way out of times that repeat."""
    return (
        f"rounded times do so: export them with more digits, or say --column 'ignored={column}' "
        f"--set rate=10kHz, with the rate of the recorder, where that is constant"
    )


def changes_within(values: Samples) -> bool:
    """Whether a column changes as what is measured does; what is set for a shot stays for all of it."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(len(steps)) and float(np.mean(steps != 0.0)) > MEASURED_CHANGES


def is_clock(values: Samples) -> bool:
    """Whether a column goes forward in all of its steps, most of them alike, as times of samples do."""
    steps = np.diff(values)
    middle = float(np.median(steps)) if steps.size else 0.0
    alike = np.abs(steps - middle) < 0.5 * middle
    return bool((steps > 0.0).all() and alike.any() and np.mean(alike) > ASCENDING_SHARE)


def counts_rows(values: Samples) -> bool:
    """Whether a column goes by equal steps: it counts rows, or is one more time."""
    steps = np.diff(values)
    return bool(steps[0] != 0.0 and np.allclose(steps, steps[0], rtol=1e-6, atol=0.0))
