"""The discrepancy workflow on a campaign, its findings, and the files that it leaves."""

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from impactcell.api.extended_model import write_extended_model
from impactcell.api.finding_files import write_files
from impactcell.api.machine_findings import investigate_with_base, write_machine_findings
from impactcell.api.stated_tap import a_path
from impactcell.campaign import Campaign, naming, read
from impactcell.discrepancy.report import json_text, machine_document, result_document, write_reports
from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from impactcell.errors import CampaignError, SettingsError
from impactcell.prediction import Model
from impactcell.settings.model_file import read_model


@dataclass(frozen=True, slots=True, eq=False)
class DiscrepancyFindings:
    """What the workflow found in a campaign.

    Attributes
    ----------
    verdict : str
        `no_gap`, `named`, `tied`, `unknown` or `untested`, as in `result.json`.
    headline : str
        The verdict in a sentence.
    effects : tuple of str
        Effects that joined the nominal model, in the order in which they were added.
    tied_with : mapping
        For each of them the effects that this data cannot tell from it.
    parameters : mapping
        Of each effect, by name: value, and lower and upper end of the 95 % interval; a list a batch where
        there is one value a batch.
    gap_before, gap_after : float
        Gap of nominal and extended model on the held-out shots, 1 = noise floor.
    result : mapping
        All of it as `result.json` has it.
    """

    verdict: str
    headline: str
    effects: tuple[str, ...]
    tied_with: Mapping[str, tuple[str, ...]]
    parameters: Mapping[str, Mapping[str, tuple[Any, Any]]]
    gap_before: float
    gap_after: float
    result: Mapping[str, Any]
    _write: Callable[[Path, str], None] = field(repr=False)

    def write(self, directory: str | PathLike[str], source: str = "campaign") -> Path:
        """Write result.json, model.extended.yaml and report.html; return the path of the report.

        Parameters
        ----------
        directory : path
            What it holds of an earlier run is replaced only when all is done.
        source : str
            Where the data come from, as the report and the model's provenance name it.

        Raises
        ------
        CampaignError
            The directory cannot be written.
        """
        output = Path(directory)
        self._write(output, source)
        return output / "report.html"


def discrepancy(
    campaign: str | PathLike[str] | Campaign,
    *,
    model: str | PathLike[str] | None = None,
    seed: int = 0,
    base: str | PathLike[str] | None = None,
    train: str | None = None,
    test: str | None = None,
) -> DiscrepancyFindings:
    """Find where model and measurement disagree, name what is missing, add it, and prove the gap shrinks.

    Parameters
    ----------
    campaign : path or `impactcell.campaign.Campaign`
        A campaign directory, or a campaign read or made elsewhere.
    model : path, optional
        Model file whose plant is the nominal one; without it equations (1)-(3) with Coulomb friction, all of
        it fitted.
    seed : int
        Of the split and of every resampling, at least 0: the same data and seed give the same findings.
    base : path, optional
        Base model of a machine that is no cell, in place of `model`.
    train, test : str, optional
        With `base`: patterns of the shots or batches that fit and that are held out; one of them leaves the
        rest to the other.

    Returns
    -------
    DiscrepancyFindings

    Raises
    ------
    CampaignError, SettingsError
        What was given cannot be read, or the data cannot be used; the message says why and what to do.
    DiscrepancyError
        The nominal model cannot be fitted at all.
    """
    if seed < 0:
        raise CampaignError(f"seed is {seed}: a seed is a whole number of at least 0")
    source = None if isinstance(campaign, Campaign) else a_path("campaign", campaign, CampaignError)
    data = campaign if isinstance(campaign, Campaign) else read(Path(campaign))
    if base is not None:
        if model is not None:
            raise CampaignError("base is a whole model of a machine: leave model out, or base")
        with naming(source):
            return _of_machine(data, a_path("base", base, SettingsError), (train, test), seed)
    if train is not None or test is not None:
        raise CampaignError("train and test go with base; without it the seed divides the shots")
    nominal = None if model is None else read_model(a_path("model", model, SettingsError))
    with naming(source), _blas_as_in_the_service(), ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        result = investigate(
            data,
            seed=seed,
            mapper=lambda function, items: list(pool.map(function, items)),
            plant=None if nominal is None else nominal.plant,
        )
    return _findings(
        result_document(result),
        lambda output, source: write_findings(result, data, output, source, nominal),
    )


def _blas_as_in_the_service() -> threadpool_limits:
    """Give BLAS the threads that this package asks for, also where numpy was imported before it.

    A second one costs several times what it gives, and may change last digits.
    """
    return threadpool_limits(int(os.environ["OPENBLAS_NUM_THREADS"]), "blas")


def _of_machine(
    data: Campaign, base: Path, patterns: tuple[str | None, str | None], seed: int
) -> DiscrepancyFindings:
    with _blas_as_in_the_service():
        finding = investigate_with_base(data, base, patterns, seed)
    return _findings(
        machine_document(finding),
        lambda output, source: write_machine_findings(finding, data, output, source),
    )


def _findings(outcome: Mapping[str, Any], write: Callable[[Path, str], None]) -> DiscrepancyFindings:
    """Give what `result.json` has as attributes; an effect by a column of the shots is named with it."""
    effects = {
        f"{entry['effect']}({entry['covariate']})" if "covariate" in entry else entry["effect"]: entry
        for entry in outcome["effects"]
    }
    return DiscrepancyFindings(
        verdict=outcome["verdict"],
        headline=outcome["headline"],
        effects=tuple(effects),
        tied_with={name: tuple(entry["tied_with"]) for name, entry in effects.items()},
        parameters={
            name: {key: (value["value"], value["ci95"]) for key, value in entry["parameters"].items()}
            for name, entry in effects.items()
        },
        gap_before=outcome["gap"]["held_out"]["before"],
        gap_after=outcome["gap"]["held_out"]["after"],
        result=outcome,
        _write=write,
    )


def write_findings(
    result: DiscrepancyResult, data: Campaign, output: Path, source: str, nominal: Model | None = None
) -> None:
    """Write result.json, the extended model, the report, and the law where one is proposed.

    `nominal` is the model whose plant the workflow was given.
    """

    def write(beside: Path) -> None:
        (beside / "result.json").write_text(json_text(result_document(result)), encoding="utf-8")
        write_extended_model(result, data, source, nominal, beside / "model.extended.yaml")
        write_reports(result, source, beside)
        law = result.law.proposed if result.law else None
        if law is not None:
            (beside / f"{law.identifier}.py").write_text(law.text(), encoding="utf-8")

    write_files(output, write)
