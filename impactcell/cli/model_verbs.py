"""The verbs below `impactcell model`: which model a cell runs with."""

from pathlib import Path
from typing import Annotated

import typer

from impactcell.cli.options import AsJson, Cell, verb

model = typer.Typer(no_args_is_help=True, help="The model a cell runs with.")


@verb(model, "accept")
def model_accept(
    cell: Cell,
    extended: Annotated[
        Path, typer.Argument(metavar="MODEL.yaml", help="As the discrepancy workflow wrote it.")
    ],
    *,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say what would change, or why it would be refused.")
    ] = False,
    anyway: Annotated[
        bool,
        typer.Option(
            "--anyway",
            help="Also if the cell's own last taps speak against it, or nothing tells its k, b or ratio.",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Put an extended model into service; a running cell takes it over without losing its state."""
    from impactcell.cli.accept_model import accept_model, compare_models

    if dry_run:
        compare_models(cell, extended, anyway=anyway, as_json=as_json)
    else:
        accept_model(cell, extended, anyway=anyway, as_json=as_json)


@verb(model, "fit")
def model_fit(
    cell: Cell,
    *,
    campaign: Annotated[
        Path | None, typer.Option(metavar="CAMPAIGN", help="Instead of the cell's own journal.")
    ] = None,
    taps: Annotated[
        int | None,
        typer.Option(min=3, help="Of the journal, the first so many; else 30, or as many as it takes."),
    ] = None,
    anyway: Annotated[bool, typer.Option("--anyway", help="Also if it is not good enough.")] = False,
    as_json: AsJson = False,
) -> None:
    """Fit a cell's first model to its own first taps, and put it into service; says if it is good enough.

    `--taps` is of the journal; of a campaign all taps are taken.
    """
    from impactcell.cli.first_model import fit_model
    from impactcell.errors import CampaignError

    if campaign is not None and taps is not None:
        raise CampaignError("--taps is of the journal; --campaign takes all taps of the campaign")
    fit_model(cell, campaign, taps, anyway=anyway, as_json=as_json)


@verb(model, "restore")
def model_restore(cell: Cell, *, as_json: AsJson = False) -> None:
    """Put the model back into service that the last `model accept` or `model fit` replaced."""
    from impactcell.cli.accept_model import restore_model

    restore_model(cell, as_json=as_json)
