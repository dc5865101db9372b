"""The verb `impactcell import`: what can be said of measurement files on the command line."""

from pathlib import Path
from typing import Annotated

import typer


def import_files(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Measurement files, a shot or many each.")
    ],
    *,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", "--out", metavar="CAMPAIGN", help="Campaign directory to write."),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what is guessed.")] = False,
    column: Annotated[
        list[str] | None,
        typer.Option(metavar="QUANTITY=NAME", help="Which column is the force, say: force=Kraft."),
    ] = None,
    unit: Annotated[list[str] | None, typer.Option(metavar="NAME=UNIT", help="Unit of a column.")] = None,
    gain: Annotated[
        list[str] | None,
        typer.Option(
            metavar="QUANTITY=GAIN",
            help="What a signal in volts stands for: force=12.5 N/V, or 80 mV/N; position=20 mm/rev.",
        ),
    ] = None,
    sign: Annotated[list[str] | None, typer.Option(metavar="QUANTITY=+1|-1", help="Turn a channel.")] = None,
    delay: Annotated[
        list[str] | None,
        typer.Option(
            metavar="QUANTITY=TIME", help="How much too late a channel was recorded: position=0.5ms."
        ),
    ] = None,
    constant: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="For all shots: mass=18.9kg, say.")
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(
            metavar="MAP.yaml",
            help="Says the same: columns, units, gains, signs, delays, constants, excitation, trigger; "
            "and lost: words for a value that was lost, as [OVER, Error].",
        ),
    ] = None,
    excitation: Annotated[str | None, typer.Option(help="tap, free_slide or driven.")] = None,
    trigger: Annotated[
        str | None, typer.Option(help="Force at which contact begins, as '5 N'; none: t = 0 is the contact.")
    ] = None,
    delimiter: Annotated[str | None, typer.Option(help="Of a text file; tab and space by name.")] = None,
    decimal: Annotated[str | None, typer.Option(help="Of a text file: point or comma.")] = None,
    encoding: Annotated[str | None, typer.Option(help="Of a text file.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was guessed as JSON.")] = False,
) -> None:
    """Make a campaign of measurement files; what is guessed of columns, units and shots is shown.

    `--output` or `--dry-run` is needed; with both nothing is written. An option goes before what `--mapping`
    says.
    """
    from impactcell.cli.import_files import ImportOptions, named_dialect
    from impactcell.cli.import_files import import_files as run_import

    said = {
        "columns": column or (),
        "units": unit or (),
        "gains": gain or (),
        "signs": sign or (),
        "delays": delay or (),
        "constants": constant or (),
    }
    options = ImportOptions(said, mapping, named_dialect(delimiter, decimal, encoding), excitation, trigger)
    run_import(files, output, options, dry_run=dry_run, as_json=as_json)
