"""The command line: every verb is one function here, and each calls one function elsewhere.

Exit codes: 0 done, 1 failed while working, 2 bad input, 3 ended with entries that no journal took,
130 interrupted.
"""

import gc
import logging
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Annotated

import typer

from impactcell.cli.access_verbs import certs, users
from impactcell.cli.import_verb import import_files
from impactcell.cli.model_verbs import model
from impactcell.cli.options import AsJson, Cell, Cells, Directory, OptionalCell, verb
from impactcell.numerics.compilation import on_compilation
from impactcell.process.progress import say_compiling

app = typer.Typer(
    add_completion=True,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Friction from taps: estimated, tracked, alarmed and used, beside a PLC.",
)
app.add_typer(users, name="users")
app.add_typer(certs, name="certs")
effect = typer.Typer(no_args_is_help=True, help="Effects of your own.")
app.add_typer(model, name="model")
app.add_typer(effect, name="effect")


def _print_version(asked: bool) -> None:  # noqa: FBT001 - typer's callback signature
    if asked:
        from impactcell import __version__

        typer.echo(f"impactcell {__version__}")
        raise typer.Exit


@app.callback()
def program(
    *,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Friction from taps: estimated, tracked, alarmed and used, beside a PLC."""


@verb(app)
def demo(
    *,
    cycles: Annotated[int | None, typer.Option(min=1, help="End by itself after this many cycles.")] = None,
    scenario: Annotated[
        str, typer.Option(help="What happens in the cell: demo, new-effect or positioning.")
    ] = "demo",
    as_json: Annotated[bool, typer.Option("--json", help="Print one summary object last.")] = False,
) -> None:
    """Run a simulated cell and the service on loopback, with a live view."""
    from impactcell.demo import demo as run_demo

    run_demo(cycles=cycles, scenario=scenario, as_json=as_json)


@verb(app)
def run(cells: Cells) -> None:
    """Run the service; SIGTERM ends it cleanly, SIGHUP reloads what can be reloaded."""
    from impactcell.process.signals import told_when_ended
    from impactcell.process.stopping import STOPPED_EARLY

    gc.disable()  # until it has started: what is loaded and built by then stays, and is much to look through
    try:
        with told_when_ended(lambda: logging.getLogger("impactcell.service").info(STOPPED_EARLY)):
            from impactcell.service import run as run_service
            from impactcell.settings import read_cells

            cells_read = read_cells(cells)
        run_service(cells_read)
    finally:
        gc.freeze()  # the interpreter's end would look through everything once more, for a second or three
        gc.enable()


@verb(app)
def check(cells: Cells, *, as_json: AsJson = False) -> None:
    """Report every fault of the cell files at once, and whether each cell fits together as a whole."""
    from impactcell.cli.check import check as run_check

    run_check(cells, as_json=as_json)


@verb(app)
def init(
    directory: Annotated[Path, typer.Argument(metavar="[DIR]", help="Where to write.")] = Path(),
    *,
    name: Annotated[str | None, typer.Option(help="Name of the cell.")] = None,
    host: Annotated[str | None, typer.Option(help="Address of its module.")] = None,
    port: Annotated[int | None, typer.Option(help="Its Modbus TCP port.")] = None,
    register_map: Annotated[str | None, typer.Option("--map", help="A map file, or fpga-v1.")] = None,
    mass_kg: Annotated[float | None, typer.Option(help="Mass of the part.")] = None,
    stroke_mm: Annotated[float | None, typer.Option(help="Stroke from first contact on.")] = None,
    max_velocity_mm_per_min: Annotated[float | None, typer.Option(help="Fastest tap.")] = None,
    wear_limit: Annotated[float | None, typer.Option(metavar="MU", help="mu_s that counts as worn.")] = None,
    force_noise_n: Annotated[float | None, typer.Option(help="Of its force sensor, one sd.")] = None,
    position_noise_um: Annotated[float | None, typer.Option(help="Of its position sensor.")] = None,
    campaign: Annotated[
        Path | None, typer.Option(metavar="CAMPAIGN", help="Taps to fit the first model to.")
    ] = None,
) -> None:
    """Begin a cell: write its cell file, register map and first model; asks for what is not said.

    Without a terminal `--mass-kg`, `--stroke-mm` and `--wear-limit` have to be said.
    """
    from impactcell.cli.init import QUESTIONS, ask
    from impactcell.cli.init import init as run_init

    given = locals()
    run_init(directory, ask({key: given[key] for key in QUESTIONS}), campaign)


@verb(app)
def probe(cell: Cell) -> None:
    """Look once at a cell's live module: identity, status, and one tap, read as its map says."""
    from impactcell.cli.probe import probe as run_probe

    run_probe(cell)


@verb(app)
def schema() -> None:
    """Print the JSON Schema of a cell file."""
    from impactcell.settings import schema as cell_schema

    typer.echo(cell_schema())


@verb(app)
def calibrate(
    cell: Cell,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="MODEL.yaml", help="Model file to write.")
    ],
) -> None:
    """Fit the predictors of equations (4) and (5) to the cell's own plant."""
    from impactcell.cli.calibrate import calibrate as run_calibrate

    run_calibrate(cell, output)


@verb(app)
def estimate(
    campaign: Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="A campaign directory.")],
    *,
    cell: OptionalCell = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="OUT.csv", help="CSV file to write.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Estimate the friction of every shot of a campaign."""
    from impactcell.cli.estimate import estimate as run_estimate

    run_estimate(campaign, cell, output, as_json=as_json)


verb(app, "import")(import_files)


@verb(app)
def track(
    series: Annotated[Path, typer.Argument(metavar="SERIES.csv", help="cycle,mu_s,mu_s_std[,batch]")],
    *,
    batch: Annotated[
        str | None, typer.Option(help="known or unknown; known by default where there is a batch column")
    ] = None,
    limit: Annotated[float | None, typer.Option(metavar="MU", help="Wear limit of mu_s.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Replay a friction series through the tracker and its alarms."""
    from impactcell.cli.track import track as run_track

    run_track(series, batch, limit, as_json=as_json)


@verb(app)
def discrepancy(
    output: Directory,
    campaign: Annotated[Path | None, typer.Argument(metavar="CAMPAIGN", help="A campaign directory.")] = None,
    *,
    cell: OptionalCell = None,
    journal: Annotated[Path | None, typer.Option(metavar="DB", help="Recorded captures instead.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the resampling.")] = 0,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="A dask scheduler.")] = None,
    effects: Annotated[
        list[Path] | None, typer.Option(metavar="PATH", help="A file or folder of effects of your own.")
    ] = None,
    base: Annotated[
        Path | None, typer.Option(metavar="MODEL.yaml", help="Base model of a machine that is no cell.")
    ] = None,
    train: Annotated[
        str | None, typer.Option(metavar="GLOB", help="With --base: shots or batches that fit.")
    ] = None,
    test: Annotated[
        str | None, typer.Option(metavar="GLOB", help="With --base: shots or batches that are held out.")
    ] = None,
    title: Annotated[
        str, typer.Option(metavar="TEXT", help="What the report calls it, in place of the campaign's name.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Find where model and measurement disagree, name the missing effect, prove it.

    Of CAMPAIGN and `--journal` one is named. With `--base` only CAMPAIGN, `--train`, `--test`, `--seed`,
    `--title` and `--json` go; `--train` and `--test` go only with it.
    """
    from impactcell.cli.discrepancy import discrepancy as run_discrepancy
    from impactcell.cli.discrepancy import discrepancy_of_machine
    from impactcell.cli.effects import offer
    from impactcell.errors import CampaignError

    if base is not None:
        if campaign is None or journal or cell or scheduler is not None or effects:
            raise CampaignError("--base goes with a campaign, --train, --test, --seed and --title alone")
        discrepancy_of_machine(
            campaign, output, base, patterns=(train, test), seed=seed, title=title, as_json=as_json
        )
        return
    if train is not None or test is not None:
        raise CampaignError("--train and --test go with --base; without it the seed divides the shots")
    offer(effects or ())
    run_discrepancy(
        campaign,
        output,
        cell=cell,
        journal=journal,
        seed=seed,
        scheduler=scheduler,
        title=title,
        as_json=as_json,
    )


@verb(app)
def export(
    journal: Annotated[Path, typer.Argument(metavar="DB", help="A cell's journal.")],
    output: Directory,
    *,
    cell: Annotated[
        Path | None,
        typer.Option(metavar="CELL.yaml", help="Cell that recorded it: states mass, stroke and noise."),
    ] = None,
    first_cycle: Annotated[int | None, typer.Option(help="First cycle to export.")] = None,
    last_cycle: Annotated[int | None, typer.Option(help="Last cycle to export.")] = None,
) -> None:
    """Write a campaign directory from the captures of a journal."""
    from impactcell.cli.export import export as run_export

    run_export(journal, output, cell=cell, first_cycle=first_cycle, last_cycle=last_cycle)


@verb(app)
def figures(output: Directory) -> None:
    """Redraw the source paper's figures from this code."""
    from impactcell.figures import draw
    from impactcell.process.console import print_result

    for path in draw(output):
        print_result(str(path))


@verb(effect, "check")
def effect_check(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Files of effects, or folders of them.")
    ],
) -> None:
    """Hold effects of your own to what every effect owes; the files are run."""
    from impactcell.cli.effects import check_effects

    check_effects(files)


def run_verb(arguments: list[str] | None = None) -> None:
    """Run one verb; raises what the verb raises, and SystemExit for a mistake in the command line."""
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(message)s", stream=sys.stderr)
    logging.getLogger("impactcell").setLevel(logging.INFO)
    on_compilation(say_compiling)
    _all_verbs()(arguments)


@cache
def _all_verbs() -> Callable[[list[str] | None], object]:
    """Put the verbs together, once in a process."""
    return typer.main.get_command(app)
