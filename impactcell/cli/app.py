"""The command line: every verb is one function here, and each calls one function elsewhere.

Exit codes: 0 done, 1 failed while working, 2 bad input, 130 interrupted.
"""

import logging
import sys
from pathlib import Path
from typing import Annotated

import typer

from impactcell.cli.access_verbs import certs, users
from impactcell.cli.options import Cell, Cells, Directory, OptionalCell, Quiet, Verbose
from impactcell.errors import (
    AccessError,
    CampaignError,
    ForeignJournalError,
    ImpactCellError,
    MapError,
    SeriesError,
    SettingsError,
)

BAD_INPUT = (AccessError, CampaignError, ForeignJournalError, MapError, SeriesError, SettingsError)


app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Friction from taps: estimated, tracked, alarmed and used, beside a PLC.",
)
model = typer.Typer(no_args_is_help=True, help="The model a cell runs with.")
app.add_typer(users, name="users")
app.add_typer(certs, name="certs")
app.add_typer(model, name="model")


@app.command()
def demo(
    *,
    cycles: Annotated[int | None, typer.Option(min=1, help="End by itself after this many cycles.")] = None,
    scenario: Annotated[
        str, typer.Option(help="What happens in the cell: demo, new-effect or positioning.")
    ] = "demo",
    as_json: Annotated[bool, typer.Option("--json", help="Print one summary object last.")] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Run a simulated cell and the service on loopback, with a live view."""
    del quiet, verbose
    from impactcell.demo import demo as run_demo

    run_demo(cycles=cycles, scenario=scenario, as_json=as_json)


@app.command()
def run(cells: Cells, *, quiet: Quiet = False, verbose: Verbose = False) -> None:
    """Run the service; SIGTERM ends it cleanly, SIGHUP reloads what can be reloaded."""
    del quiet, verbose
    from impactcell.service import run as run_service
    from impactcell.settings import read_cells

    run_service(read_cells(cells))


@app.command()
def check(cells: Cells, *, quiet: Quiet = False, verbose: Verbose = False) -> None:
    """Report every fault of the cell files at once as file:line:column: message."""
    del quiet, verbose
    from impactcell.process.console import print_result
    from impactcell.settings import read_cells

    read_cells(cells)
    print_result(f"{len(cells)} cell file{'s' * (len(cells) > 1)} in order")


@app.command()
def schema(*, quiet: Quiet = False, verbose: Verbose = False) -> None:
    """Print the JSON Schema of a cell file."""
    del quiet, verbose
    from impactcell.settings import schema as cell_schema

    typer.echo(cell_schema())


@app.command()
def calibrate(
    cell: Cell,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="MODEL.yaml", help="Model file to write.")
    ],
    *,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Fit the predictors of equations (4) and (5) to the cell's own plant."""
    del quiet, verbose
    from impactcell.cli.calibrate import calibrate as run_calibrate

    run_calibrate(cell, output)


@app.command()
def estimate(
    campaign: Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="A campaign directory.")],
    *,
    cell: OptionalCell = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="OUT.csv", help="CSV file to write.")
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Estimate the friction of every shot of a campaign."""
    del quiet, verbose
    from impactcell.cli.estimate import estimate as run_estimate

    run_estimate(campaign, cell, output)


@app.command()
def track(
    series: Annotated[Path, typer.Argument(metavar="SERIES.csv", help="cycle,mu_s,mu_s_std[,batch]")],
    *,
    batch: Annotated[
        str | None, typer.Option(help="known or unknown; known by default where there is a batch column")
    ] = None,
    limit: Annotated[float | None, typer.Option(metavar="MU", help="Wear limit of mu_s.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Replay a friction series through the tracker and its alarms."""
    del quiet, verbose
    from impactcell.cli.track import track as run_track

    run_track(series, batch, limit, as_json=as_json)


@app.command()
def discrepancy(
    output: Directory,
    campaign: Annotated[Path | None, typer.Argument(metavar="CAMPAIGN", help="A campaign directory.")] = None,
    *,
    cell: OptionalCell = None,
    journal: Annotated[Path | None, typer.Option(metavar="DB", help="Recorded captures instead.")] = None,
    seed: Annotated[int, typer.Option(help="Of the resampling.")] = 0,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="A dask scheduler.")] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Find where model and measurement disagree, name the missing effect, prove it."""
    del quiet, verbose
    from impactcell.cli.discrepancy import discrepancy as run_discrepancy

    run_discrepancy(campaign, output, cell=cell, journal=journal, seed=seed, scheduler=scheduler)


@app.command()
def export(
    journal: Annotated[Path, typer.Argument(metavar="DB", help="A cell's journal.")],
    output: Directory,
    *,
    first_cycle: Annotated[int | None, typer.Option(help="First cycle to export.")] = None,
    last_cycle: Annotated[int | None, typer.Option(help="Last cycle to export.")] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write a campaign directory from the captures of a journal."""
    del quiet, verbose
    from impactcell.cli.export import export as run_export

    run_export(journal, output, first_cycle=first_cycle, last_cycle=last_cycle)


@app.command()
def figures(output: Directory, *, quiet: Quiet = False, verbose: Verbose = False) -> None:
    """Redraw the source paper's figures from this code."""
    del quiet, verbose
    from impactcell.figures import draw
    from impactcell.process.console import print_result

    for path in draw(output):
        print_result(str(path))


@model.command("accept")
def model_accept(
    cell: Cell,
    extended: Annotated[
        Path, typer.Argument(metavar="MODEL.yaml", help="As the discrepancy workflow wrote it.")
    ],
    *,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Put an extended model into service; a running cell takes it over without losing its state."""
    del quiet, verbose
    from impactcell.cli.accept_model import accept_model

    accept_model(cell, extended)


def run_verb(arguments: list[str] | None = None) -> None:
    """Run one verb; turn what it raises into a message and an exit code."""
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(message)s", stream=sys.stderr)
    logging.getLogger("impactcell").setLevel(logging.INFO)
    try:
        app(arguments)
    except BAD_INPUT as error:
        typer.echo(str(error), err=True)
        sys.exit(2)
    except ImpactCellError as error:
        typer.echo(f"impactcell: {error}", err=True)
        sys.exit(1)
