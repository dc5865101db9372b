"""`impactcell discrepancy`: where model and measurement disagree, and what is missing."""

import json
import math
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from impactcell.api.findings import write_findings
from impactcell.api.machine_findings import investigate_with_base, write_machine_findings
from impactcell.campaign import Campaign, naming, read
from impactcell.cli.free_slides import with_cell_mass
from impactcell.cli.paths import check_directory, note_damage, open_journal
from impactcell.cli.recorded_taps import campaign_of_taps
from impactcell.discrepancy.data import CellLimits
from impactcell.discrepancy.report import headline, machine_headline
from impactcell.discrepancy.search import Mapper
from impactcell.discrepancy.workflow import investigate
from impactcell.errors import CampaignError, DiscrepancyError
from impactcell.physics import Plant
from impactcell.prediction import Model
from impactcell.process.console import print_note, print_result
from impactcell.process.extras import how_to_install
from impactcell.process.progress import named_steps
from impactcell.records import MM_PER_MIN
from impactcell.settings import CellConfig, read_cell


def discrepancy(
    campaign: Path | None,
    output: Path,
    *,
    cell: Path | None = None,
    journal: Path | None = None,
    seed: int = 0,
    scheduler: str | None = None,
    title: str = "",
    as_json: bool = False,
) -> None:
    """Run the discrepancy workflow and write result.json, model.extended.yaml and report.html.

    Parameters
    ----------
    campaign : Path or None
        A campaign directory; None with `journal`.
    output : Path
        Directory for the results; what it holds of an earlier run is replaced only when all is done.
    cell : Path, optional
        Cell whose model is the nominal one, and whose mass free slides have that state none; with `journal`
        the one that recorded it, which states mass, stroke and noise where its module reports none.
    journal : Path, optional
        Journal whose recorded captures are used instead of a campaign.
    seed : int
        The same data and seed give the same result to the byte.
    scheduler : str, optional
        Address of a dask scheduler that is to do the fits.
    title : str, optional
        What the report calls it; the name of the campaign or the journal where it is not given.
    as_json : bool
        Print result.json instead of its verdict.

    Raises
    ------
    CampaignError, SettingsError, JournalError
        What was given cannot be read.
    DiscrepancyError
        The nominal model cannot be fitted to it.
    """
    if (campaign is None) == (journal is None):
        raise CampaignError("name either a campaign directory or --journal DB")
    check_directory(output, CampaignError)
    config = None if cell is None else read_cell(cell)
    model = None if config is None else config.model
    if model is None and journal is not None:
        model = _recording_model(journal)
    plant = None if model is None else model.plant
    name, data = _read(campaign, journal, plant, config)
    with named_steps() as report_step, _mapper(scheduler) as mapper:
        with naming(campaign or journal):
            result = investigate(
                data, seed=seed, mapper=mapper, plant=plant, limits=_limits(config), progress=report_step
            )
        report_step("writing the report")
        write_findings(result, data, output, title or name, model)
    _print_outcome(output, headline(result), as_json=as_json)


def discrepancy_of_machine(
    campaign: Path,
    output: Path,
    base: Path,
    *,
    patterns: tuple[str | None, str | None] = (None, None),
    seed: int = 0,
    title: str = "",
    as_json: bool = False,
) -> None:
    """Run the workflow with a base model, on a machine that is no cell.

    Parameters
    ----------
    campaign, output, base : Path
        Campaign directory, directory for the results, and the base model's YAML.
    patterns : tuple of str or None
        Shots that fit and shots that test, by number or batch.
    seed : int
    title : str, optional
        What the report calls it; the campaign's name where it is not given.
    as_json : bool
        Print result.json instead of its verdict.

    Raises
    ------
    CampaignError, SettingsError
        What was given cannot be read or used.
    """
    check_directory(output, CampaignError)
    data = read(campaign)
    with named_steps() as report_step:
        report_step("naming what the base model lacks")
        with naming(campaign):
            finding = investigate_with_base(data, base, patterns, seed)
        report_step("writing the report")
        write_machine_findings(finding, data, output, title or str(campaign.name))
    _print_outcome(output, machine_headline(finding), as_json=as_json)


def _print_outcome(output: Path, said: str, *, as_json: bool) -> None:
    """Print result.json, or its verdict, what was noted on the way, and where the report is."""
    text = (output / "result.json").read_text(encoding="utf-8")
    if as_json:
        sys.stdout.write(text)
        return
    for one in json.loads(text)["notes"]:
        print_note(f"note: {one}")
    print_result(f"{said}\n{output / 'report.html'}")


def _read(
    campaign: Path | None, journal: Path | None, plant: Plant | None, config: CellConfig | None
) -> tuple[str, Campaign]:
    if journal is None:
        assert campaign is not None  # noqa: S101 - one of them is given
        return str(campaign.name), with_cell_mass(read(campaign), config)
    with open_journal(journal, None if config is None else config.name) as store:
        gravity_m_s2 = plant.gravity_m_s2 if plant else 9.81
        data = campaign_of_taps(journal, store.captures(damaged=note_damage), gravity_m_s2, config)
    if math.isinf(data.stroke_m) and config is None:
        raise CampaignError(
            f"{journal}: the module did not report its stroke, after which the actuator halts; name the cell "
            "that recorded these taps, --cell CELL.yaml: it states `actuator.stroke_mm`"
        )
    return str(journal.name), data


def _limits(config: CellConfig | None) -> CellLimits:
    """Tell what the cell can strike: no next experiment goes beyond it."""
    if config is None:
        return CellLimits()
    actuator, mass_kg = config.settings.actuator, config.settings.part.mass_kg
    return CellLimits(
        max_velocity_m_s=actuator.max_velocity_mm_per_min * MM_PER_MIN,
        both_ends=actuator.both_ends,
        mass_kg=math.nan if mass_kg is None else mass_kg,
    )


def _recording_model(journal: Path) -> Model | None:
    """Model that the recording cell ran with; None in a journal that has none yet."""
    from impactcell.journal.stored_forms import MODEL

    with open_journal(journal) as store:
        try:
            return MODEL.loads(store.model) if store.model else None
        except ValueError as error:
            raise CampaignError(f"{journal}: {error}; name the model with --cell") from error


@contextmanager
def _mapper(scheduler: str | None) -> Iterator[Mapper]:
    """`map` on the machine's own cores, or on a dask cluster; the outcome is the same."""
    if scheduler is None:
        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            yield lambda function, items: list(pool.map(function, items))
        return
    try:
        from impactcell.cli.cluster import cluster_mapper
    except ImportError as error:
        raise DiscrepancyError(f"--scheduler needs dask: run {how_to_install('cluster')}") from error
    with cluster_mapper(scheduler) as mapper:
        yield mapper
