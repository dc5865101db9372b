"""`impactcell import`: measurement files become a campaign, and what was guessed of them is shown."""

import json
import os
from collections.abc import Mapping as AbstractMapping
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from impactcell.campaign import Campaign, Coordinate, Excitation, from_contact
from impactcell.errors import CampaignError, MeasurementError
from impactcell.measurements import (
    Dialect,
    Imported,
    Limits,
    Mapping,
    Table,
    guess,
    make_campaign,
    read_tables,
    write_campaign,
)
from impactcell.measurements.given import read_given
from impactcell.process.console import is_quiet, print_note, print_result


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What was said on the command line of how to read the files.

    Attributes
    ----------
    said : mapping
        Lists of `NAME=VALUE` by `columns`, `units`, `gains`, `signs`, `delays` and `constants`.
    mapping : Path or None
        YAML that says the same; the command line goes before it.
    dialect : Dialect
    excitation, trigger : str or None
    """

    said: AbstractMapping[str, Sequence[str]] = field(default_factory=dict)
    mapping: Path | None = None
    dialect: Dialect = field(default_factory=Dialect)
    excitation: str | None = None
    trigger: str | None = None


def import_files(
    files: Sequence[Path],
    output: Path | None,
    options: ImportOptions,
    *,
    dry_run: bool = False,
    as_json: bool = False,
) -> None:
    """Read measurement files and write a campaign directory; a dry run only says what would be in it.

    Raises
    ------
    MeasurementError, CampaignError
        What is wrong, by file and line or column, and the way out; nothing has been written.
    """
    if output is None and not dry_run:
        raise MeasurementError("say where to write with -o CAMPAIGN, or --dry-run to see what is guessed")
    if dry_run:
        output = None
    given = read_given(options.said, options.mapping, options.excitation, options.trigger)
    limits = Limits()
    if len(files) > limits.files:
        raise MeasurementError(
            f"{len(files)} files are more than the {limits.files} that are imported at once"
        )
    _check_distinct(files)
    dialect = replace(options.dialect, lost=given.lost)
    tables = [table for file in files for table in read_tables(file, limits, dialect)]
    mapping = guess(tables, given)
    if not as_json and not is_quiet():
        _print_guess(tables, mapping)
    try:
        imported = (
            make_campaign(tables, mapping) if output is None else write_campaign(tables, mapping, output)
        )
    except (MeasurementError, CampaignError) as error:
        if as_json:  # what was understood, for whoever has to put the rest right
            faults = {**_understood(tables, mapping), "faults": str(error).splitlines()}
            print_result(json.dumps(faults, ensure_ascii=False, indent=1))
        raise
    imported = replace(imported, notes=(*imported.notes, *_doubted_units(imported.campaign)))
    if as_json:
        print_result(json.dumps(_summary(tables, mapping, imported, output), ensure_ascii=False, indent=1))
        return
    for note in imported.notes:
        print_note(note)
    shots = len(imported.campaign.shots)
    where = "nothing written (--dry-run)" if output is None else f"in {output}"
    print_result(
        f"{shots} {'shot' if shots == 1 else 'shots'} of excitation {imported.campaign.excitation}, {where}"
    )


def _doubted_units(campaign: Campaign) -> list[str]:
    """Say what the verbs that take the campaign will refuse it for: a unit wrong by a large factor.

    Of taps and slides of a part only: how a drive and a machine move is for a base model to say.
    """
    from impactcell.discrepancy.data import check_campaign_units

    if campaign.coordinate is Coordinate.ROTATION or campaign.excitation is Excitation.DRIVEN:
        return []
    try:
        check_campaign_units(from_contact(campaign)[0])
    except CampaignError as error:
        return [f"{error}; it will be refused as it stands (--unit NAME=UNIT says another)"]
    return []


def _check_distinct(files: Sequence[Path]) -> None:
    """Refuse a file that is named twice, by whatever path: its shots would count twice."""
    names: dict[str, Path] = {}
    for file in files:
        before = names.setdefault(os.path.realpath(file), file)
        if before is not file:
            raise MeasurementError(f"{file}: is the file {before}, which is named already; name it once")


def named_dialect(delimiter: str | None, decimal: str | None, encoding: str | None) -> Dialect:
    """Give a dialect from the words of the command line.

    Raises
    ------
    MeasurementError
        The delimiter is no single character, or the decimal mark neither point nor comma.
    """
    delimiter = {"tab": "\t", "\\t": "\t", "space": " ", "semicolon": ";", "comma": ","}.get(
        delimiter or "", delimiter
    )
    decimal = {"point": ".", "comma": ","}.get(decimal or "", decimal)
    if delimiter is not None and len(delimiter) != 1:
        raise MeasurementError(
            f"delimiter {delimiter!r} is not one character; tab and space are said by name"
        )
    if decimal not in (None, ".", ","):
        raise MeasurementError(f"decimal {decimal!r} is neither point nor comma")
    return Dialect(delimiter, decimal, encoding)


def _print_guess(tables: Sequence[Table], mapping: Mapping) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table as Grid

    grid = Grid("column", "quantity", "unit", "why", "sure", box=SIMPLE)
    for item in mapping.assignments:
        unit = "-" if item.unit is None else item.unit.symbol
        grid.add_row(
            _plain(item.column), item.meaning, _plain(unit), _plain(item.why), f"{item.confidence:.0%}"
        )
    console = Console(stderr=True)
    of_many = f"{len(tables)} tables; the first: " if len(tables) > 1 else ""
    console.print(f"{of_many}{_plain('; '.join(tables[0].notes))}", markup=False)
    console.print(grid)


def _plain(text: str) -> str:
    """Text of a file as a terminal may show it: no control characters, no markup."""
    return "".join(sign if sign.isprintable() else "�" for sign in text).replace("[", "\\[")


def _understood(tables: Sequence[Table], mapping: Mapping) -> dict[str, Any]:
    return {
        "tables": [{"name": table.title, "rows": len(table), "notes": list(table.notes)} for table in tables],
        "columns": [
            {
                "column": item.column,
                "quantity": str(item.meaning),
                "unit": None if item.unit is None else item.unit.symbol,
                "why": item.why,
                "confidence": round(item.confidence, 2),
            }
            for item in mapping.assignments
        ],
    }


def _summary(
    tables: Sequence[Table], mapping: Mapping, imported: Imported, output: Path | None
) -> dict[str, Any]:
    return {
        **_understood(tables, mapping),
        "excitation": str(imported.campaign.excitation),
        "shots": len(imported.campaign.shots),
        "notes": list(imported.notes),
        "campaign": None if output is None else str(output),
    }
