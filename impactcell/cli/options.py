"""Options and arguments that several verbs share."""

import logging
from pathlib import Path
from typing import Annotated

import typer


def _be_quiet(quiet: bool) -> None:  # noqa: FBT001 - typer's callback signature
    if quiet:
        logging.getLogger("impactcell").setLevel(logging.ERROR)


def _be_verbose(verbose: bool) -> None:  # noqa: FBT001 - typer's callback signature
    if verbose:
        logging.getLogger("impactcell").setLevel(logging.DEBUG)


Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Only errors.", callback=_be_quiet)]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="More of what happens.", callback=_be_verbose)]
Cells = Annotated[list[Path], typer.Argument(metavar="CELL.yaml", help="One file a cell.")]
Cell = Annotated[Path, typer.Argument(metavar="CELL.yaml")]
OptionalCell = Annotated[
    Path | None, typer.Option("--cell", metavar="CELL.yaml", help="Use this cell's model.")
]
Directory = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Where to write.")]
