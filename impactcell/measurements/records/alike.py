"""Files of one import that do not hold the same: what one lacks may be there under another name."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from impactcell.campaign import Excitation
from impactcell.measurements.columns.mapping import Mapping
from impactcell.measurements.columns.recognition import CHANNELS, ColumnMeaning
from impactcell.measurements.columns.scalars import EXAMPLES, said_beside
from impactcell.measurements.faults import raise_faults
from impactcell.measurements.records.measured_records import Record
from impactcell.measurements.table import Table

OF_TAPS = (ColumnMeaning.VELOCITY, ColumnMeaning.DIRECTION, ColumnMeaning.START)
"""What a tap has one value of and what would else be taken of it is another."""
MAY_LACK = (ColumnMeaning.BATCH, ColumnMeaning.DWELL, ColumnMeaning.COVARIATE)
"""What is left empty where a file has none of it."""


def check_channels_alike(records: Sequence[Record], mapping: Mapping) -> None:
    """Refuse records without a channel that others have.

    Raises
    ------
    MeasurementError
        Naming the record, the one that has the channel, and the way out.
    """
    faults = []
    for meaning in CHANNELS:
        item = mapping.of(meaning)
        with_it = next((record for record in records if meaning in record.values), None)
        if item is None or with_it is None:
            continue
        faults += [
            f"{record.place}: has no {meaning}, which {with_it.place} has as column {item.column!r}; call it "
            f"so here too, import the files one by one, or leave it out of all with --column "
            f"'ignored={item.column}'"
            for record in records
            if meaning not in record.values
        ]
    raise_faults(faults)


def check_scalars_alike(tables: Sequence[Table], mapping: Mapping, excitation: Excitation) -> None:
    """Refuse files without a mass, or of taps a velocity and the like, that others have.

    Raises
    ------
    MeasurementError
        Naming the file, one that has it, and the way out.
    """
    meanings = (ColumnMeaning.MASS, *(OF_TAPS if excitation is Excitation.TAP else ()))
    raise_faults([fault for meaning in meanings for fault in _lacking(tables, mapping, meaning)])


def left_empty(tables: Sequence[Table], records: Sequence[Record], mapping: Mapping) -> list[str]:
    """Tell what some files have no column of, and which records say no mass where others do."""
    notes = []
    for item in mapping.assignments:
        files = {table.recorded_in: False for table in tables}
        for table in tables:
            files[table.recorded_in] |= table.column(item.column) is not None
        without = [file for file, has_it in files.items() if not has_it]
        if item.meaning in MAY_LACK and without:
            notes.append(
                f"column {item.column!r} is in {len(files) - len(without)} of {len(files)} files only: left "
                f"empty for the others, the first {_name(without[0])}"
            )
    masses = [str(ColumnMeaning.MASS) in {**mapping.given.constants, **one.scalars} for one in records]
    if any(masses) and not all(masses):
        first = records[masses.index(False)].place
        notes.append(
            f"no mass is stated in {masses.count(False)} of {len(masses)} records, the first {_name(first)}: "
            "it is left empty there; give --set mass=18.9kg"
        )
    return notes


def _lacking(tables: Sequence[Table], mapping: Mapping, meaning: ColumnMeaning) -> Iterator[str]:
    if str(meaning) in mapping.given.constants:
        return
    item = mapping.of(meaning)
    said: dict[str, str] = {}
    for table in tables:
        if item is not None and table.column(item.column) is not None:
            said[table.recorded_in] = f"has as column {item.column!r}"
        elif meaning in said_beside(table):
            said.setdefault(table.recorded_in, "says beside its columns")
    for file in dict.fromkeys(table.recorded_in for table in tables if said):
        if file not in said:
            other, how = next(iter(said.items()))
            yield f"{file}: has no {meaning}, which {other} {how}; {_way_out(meaning, how, mapping)}"


def _way_out(meaning: ColumnMeaning, how: str, mapping: Mapping) -> str:
    ways = ["call it so here too" if how.startswith("has") else "say it here too"]
    if meaning in EXAMPLES:
        ways.append(f"give it for all with --set {EXAMPLES[meaning]}")
    item = mapping.of(meaning)
    if item is not None:
        ways.append(f"leave it out of all with --column 'ignored={item.column}'")
    return f"{', '.join(ways[:-1])}, or {ways[-1]}" if len(ways) > 1 else ways[0]


def _name(place: str) -> str:
    """File of a place without its directory."""
    return Path(place).name
