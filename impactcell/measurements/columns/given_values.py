"""What the user says of his files, and what of it does not fit them."""

from collections.abc import Mapping as AbstractMapping
from collections.abc import Sequence
from dataclasses import dataclass, field

from impactcell.campaign import Excitation
from impactcell.errors import MeasurementError
from impactcell.measurements.columns.assignment import Assignment
from impactcell.measurements.columns.column_units import unit_of
from impactcell.measurements.columns.recognition import CHANNELS, ColumnMeaning
from impactcell.measurements.notation.gains import Gain
from impactcell.measurements.notation.units import parse_unit
from impactcell.measurements.table import MeasuredColumn, Table


@dataclass(frozen=True, slots=True)
class Given:
    """What the user says instead of letting it be guessed; empty where he says nothing.

    Attributes
    ----------
    columns : mapping
        Name of the column that holds a quantity, as `force`: `Kraft 1`.
    units : mapping
        Unit of a column, as written, by the column's name.
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
    lost : frozenset of str
        Words, in lower case, that stand for a value that was lost.
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
    lost: frozenset[str] = frozenset()


def without_use(assignments: Sequence[Assignment], given: Given, tables: Sequence[Table]) -> list[str]:
    """Tell what was given and would change nothing: who gave it believes that it counts."""
    columns = {item.meaning: item.column for item in assignments}
    faults = [
        f"a {what} of the {meaning} was given, and no column is the {meaning}; name it with --column "
        f"{meaning}=NAME, or take the {what} away"
        for what, said in (("sign", given.signs), ("delay", given.delays))
        for meaning in said
        if meaning not in columns
    ]
    times = [item.column for item in assignments if item.meaning is ColumnMeaning.TIME]
    channels = {item.column for item in assignments if item.meaning in CHANNELS}
    measured = [table for table in tables if any(column.name in channels for column in table.columns)]
    timed = all(any(table.column(name) for name in times) for table in measured or tables)
    if times and "rate_hz" in given.constants and timed:
        time = times[0]
        faults.append(
            f"the times are those of column {time!r}, so that the rate has no use; take the rate away, or "
            f"say --column 'ignored={time}' for it to count"
        )
    return faults


def unused_gains(
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


def check_given(columns: AbstractMapping[str, MeasuredColumn], given: Given) -> None:
    """Refuse columns and units that are not there, and columns that are given as two things.

    Raises
    ------
    MeasurementError
        Naming the column, and what there is.
    """
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
