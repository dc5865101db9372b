"""`impactcell discrepancy`: where model and measurement disagree, and what is missing."""

import math
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from impactcell.campaign import Campaign, Excitation, read
from impactcell.campaign.recorded import from_captures
from impactcell.cli.paths import recorded as opened
from impactcell.discrepancy.report.page import write_report
from impactcell.discrepancy.report.result import result, text_of
from impactcell.discrepancy.search.candidate_fits import Mapper
from impactcell.discrepancy.workflow import Findings, investigate, plant_of
from impactcell.errors import CampaignError, DiscrepancyError, PhysicsError, PredictionError
from impactcell.physics import Plant
from impactcell.prediction import Model
from impactcell.prediction.model import Prior
from impactcell.process.console import tell
from impactcell.settings.model_file import write_model

FILES = ("result.json", "model.extended.yaml", "report.html")
SMALLEST_SHARE = 1e-4


def discrepancy(
    campaign: Path | None,
    output: Path,
    *,
    cell: Path | None = None,
    journal: Path | None = None,
    seed: int = 0,
    scheduler: str | None = None,
) -> None:
    """Run the discrepancy workflow and write result.json, model.extended.yaml and report.html.

    Parameters
    ----------
    campaign : Path or None
        A campaign directory; None with `journal`.
    output : Path
        Directory for the results; what it holds of an earlier run is replaced only when all is done.
    cell : Path, optional
        Cell whose model is the nominal one.
    journal : Path, optional
        Journal whose recorded captures are used instead of a campaign.
    seed : int
        The same data and seed give the same result to the byte.
    scheduler : str, optional
        Address of a dask scheduler that is to do the fits.

    Raises
    ------
    CampaignError, SettingsError, JournalError
        What was given cannot be read.
    DiscrepancyError
        The nominal model cannot be fitted to it.
    """
    if (campaign is None) == (journal is None):
        raise CampaignError("name either a campaign directory or --journal DB")
    if output.exists() and not output.is_dir():
        raise CampaignError(f"{output}: is a file; name a directory")
    plant = None
    name = "fitted"
    if cell is not None:
        from impactcell.settings import read_cell

        given = read_cell(cell)
        plant, name = given.model.plant, given.model.name
    elif journal is not None:
        recording = _recording_model(journal)
        if recording is not None:
            plant, name = recording.plant, recording.name
    source, data = _read(campaign, journal, plant)
    with _steps() as say, _mapper(scheduler) as mapper:
        findings = investigate(data, seed=seed, mapper=mapper, plant=plant, progress=say)
        say("writing the report")
        _write(findings, data, output, source, name)
    tell(f"{sentence(findings)}\n{output / 'report.html'}")


def sentence(findings: Findings) -> str:
    """Verdict in one sentence."""
    from impactcell.discrepancy.report.page import verdict_sentence

    return verdict_sentence(findings)


def _read(campaign: Path | None, journal: Path | None, plant: Plant | None) -> tuple[str, Campaign]:
    if journal is None:
        assert campaign is not None  # noqa: S101 - one of them is given
        return str(campaign.name), read(campaign)
    with opened(journal) as store:
        try:
            recorded = from_captures(store.captures(), plant.gravity_m_s2 if plant else 9.81)
        except CampaignError as error:
            raise CampaignError(f"{journal}: {error}") from error
    return str(journal.name), recorded.campaign


def _recording_model(journal: Path) -> Model | None:
    """Model that the recording cell ran with; None in a journal that has none yet."""
    from impactcell.serialization import json_text

    with opened(journal) as store:
        try:
            return json_text.loads(Model, store.model.encode()) if store.model else None
        except ValueError as error:
            raise CampaignError(
                f"{journal}: its model is of another version ({error}); name the model with --cell"
            ) from error


@contextmanager
def _steps() -> Iterator[Callable[[str], None]]:
    if not sys.stderr.isatty():
        yield lambda _step: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=None)
        yield lambda step: bar.update(task, description=step)


@contextmanager
def _mapper(scheduler: str | None) -> Iterator[Mapper]:
    """`map` on the machine's own cores, or on a dask cluster; the outcome is the same."""
    if scheduler is None:
        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            yield lambda function, items: list(pool.map(function, items))
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise DiscrepancyError("--scheduler needs dask: pip install 'impactcell[cluster]'") from error
    try:
        client: Any = Client(scheduler, timeout=10)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise DiscrepancyError(f"no dask scheduler answers at {scheduler}: {error}") from error
    with client:

        def on_cluster(function: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
            futures = [client.submit(function, item, pure=False) for item in items]
            return list(client.gather(futures))

        yield on_cluster


def _write(findings: Findings, data: Campaign, output: Path, source: str, nominal: str) -> None:
    """Write all three files beside the directory and move them in together at the end."""
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=f".{output.name}.", dir=output.parent))
    except OSError as error:
        raise CampaignError(f"{output}: cannot be written: {error.strerror}") from error
    try:
        (beside / "result.json").write_text(text_of(result(findings)), encoding="utf-8")
        write_model(extended_model(findings, data, source, nominal), beside / "model.extended.yaml")
        write_report(findings, source, beside / "report.html")
        output.mkdir(exist_ok=True)
        for name in FILES:
            (beside / name).replace(output / name)
    except OSError as error:
        raise CampaignError(f"{output}: cannot be written: {error.strerror}") from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def extended_model(findings: Findings, data: Campaign, source: str, nominal: str) -> Model:
    """Make the extended model as a model file holds it, calibrated so that a service can run with it."""
    plant = plant_of(findings)
    half = {one.parameter: (one.high - one.low) / 4.0 for one in findings.parameters if not one.effect}
    ratio = plant.mu_k / plant.mu_s
    intervals: dict[str, dict[str, tuple[float, float]]] = {}
    for one in findings.parameters:
        if one.effect and not one.batch and math.isfinite(one.low) and math.isfinite(one.high):
            intervals.setdefault(one.effect, {})[one.parameter] = (one.low, one.high)
    model = Model(
        name=f"{nominal} + {' + '.join(findings.added)}" if findings.added else nominal,
        plant=plant,
        prior=Prior(
            stiffness_std_n_per_m=_positive(half.get("stiffness_n_per_m", 0.0), plant.stiffness_n_per_m),
            damping_std_n_s_per_m=_positive(
                half.get("damping_n_s_per_m", 0.0), max(plant.damping_n_s_per_m, 1.0)
            ),
            ratio_std=_positive(half.get("ratio", 0.0) * ratio**2, ratio),
        ),
        stroke_m=data.stroke_m,
        intervals=intervals,
        provenance={
            "made by": "impactcell discrepancy",
            "from": source,
            "seed": str(findings.seed),
            "verdict": findings.verdict,
            "held-out gap before": f"{findings.proof.before.whole:.4g}",
            "held-out gap after": f"{findings.proof.after.whole:.4g}",
        },
    )
    if data.excitation is not Excitation.TAP:
        return model
    from impactcell.cli.estimate import calibrated

    try:
        return calibrated(model, data.shots)
    except (PredictionError, PhysicsError) as error:
        note = {**model.provenance, "not calibrated": str(error)}
        return replace(model, provenance=note)


def _positive(value: float, magnitude: float) -> float:
    return (
        value if math.isfinite(value) and value > SMALLEST_SHARE * magnitude else SMALLEST_SHARE * magnitude
    )
