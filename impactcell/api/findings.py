"""The discrepancy workflow on a campaign, its findings, and the files that it leaves."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from impactcell.api.finding_files import write_files
from impactcell.api.friction import calibrated
from impactcell.api.machine_findings import investigate_with_base, write_machine_findings
from impactcell.campaign import Campaign, Excitation, naming, read
from impactcell.discrepancy.report import json_text, machine_document, result_document, write_reports
from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from impactcell.errors import CampaignError, PhysicsError, PredictionError
from impactcell.physics import Plant
from impactcell.prediction import Model
from impactcell.prediction.model import Prior
from impactcell.settings.model_file import read_model, write_model

SMALLEST_SHARE = 1e-4
"""Smallest standard deviation of a prior, relative to its value: a prior of none would stop any fit."""


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
        Of the split and of every resampling: the same data and seed give the same findings.
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
    source = None if isinstance(campaign, Campaign) else Path(campaign)
    data = campaign if isinstance(campaign, Campaign) else read(Path(campaign))
    if base is not None:
        if model is not None:
            raise CampaignError("base is a whole model of a machine: leave model out, or base")
        with naming(source):
            return _of_machine(data, Path(base), (train, test), seed)
    if train is not None or test is not None:
        raise CampaignError("train and test go with base; without it the seed divides the shots")
    nominal = None if model is None else read_model(Path(model))
    with naming(source), _blas_as_in_the_service(), ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        result = investigate(
            data,
            seed=seed,
            mapper=lambda function, items: list(pool.map(function, items)),
            plant=None if nominal is None else nominal.plant,
        )
    name = "fitted" if nominal is None else nominal.name
    return _findings(
        result_document(result),
        lambda output, source: write_findings(result, data, output, source, name),
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
    result: DiscrepancyResult, data: Campaign, output: Path, source: str, nominal: str
) -> None:
    """Write result.json, the extended model, the report, and the law where one is proposed."""

    def write(beside: Path) -> None:
        (beside / "result.json").write_text(json_text(result_document(result)), encoding="utf-8")
        write_model(extended_model(result, data, source, nominal), beside / "model.extended.yaml")
        write_reports(result, source, beside)
        law = result.law.proposed if result.law else None
        if law is not None:
            (beside / f"{law.identifier}.py").write_text(law.text(), encoding="utf-8")

    write_files(output, write)


def extended_model(result: DiscrepancyResult, data: Campaign, source: str, nominal: str) -> Model:
    """Make the extended model as a model file holds it, calibrated so that a service can run with it."""
    plant = _extended_plant(result)
    half = {one.parameter: (one.high - one.low) / 4.0 for one in result.parameters if not one.effect}
    ratio = plant.mu_k / plant.mu_s
    intervals: dict[str, dict[str, tuple[float, float]]] = {}
    for one in result.parameters:
        if one.effect and not one.batch and math.isfinite(one.low) and math.isfinite(one.high):
            intervals.setdefault(one.effect, {})[one.parameter] = (one.low, one.high)
    model = Model(
        name=f"{nominal} + {' + '.join(result.added)}" if result.added else nominal,
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
            "seed": str(result.seed),
            "verdict": result.verdict,
            "held-out gap before": f"{result.validation.gap_before:.4g}",
            "held-out gap after": f"{result.validation.gap_after:.4g}",
        },
    )
    if data.excitation is not Excitation.TAP:
        return model
    fitted = {shot.number for shot in result.prepared.shots}
    try:
        return calibrated(model, [shot for shot in data.shots if shot.cycle in fitted])
    except (PredictionError, PhysicsError) as error:
        note = {**model.provenance, "not calibrated": str(error)}
        return replace(model, provenance=note)


def _extended_plant(result: DiscrepancyResult) -> Plant:
    """Plant of the final model."""
    values = {
        ("", estimate.parameter): estimate.value for estimate in result.parameters if not estimate.effect
    }
    effects: dict[str, dict[str, float | Sequence[float]]] = {}
    for estimate in result.parameters:
        if not estimate.effect:
            continue
        values_of_effect = effects.setdefault(estimate.effect, {})
        if estimate.batch:
            values_of_effect[estimate.parameter] = (
                *_batch_values(values_of_effect.get(estimate.parameter)),
                estimate.value,
            )
        else:
            values_of_effect[estimate.parameter] = estimate.value
    mu_k = values["", "mu_k"]
    ratio = values.get(("", "ratio"), 1.0)
    return Plant(
        stiffness_n_per_m=values.get(("", "stiffness_n_per_m"), 6e5),
        damping_n_s_per_m=values.get(("", "damping_n_s_per_m"), 0.0),
        mu_s=mu_k * ratio,
        mu_k=mu_k,
        gravity_m_s2=result.prepared.gravity_m_s2,
        effects=effects,
    )


def _batch_values(value: float | Sequence[float] | None) -> Sequence[float]:
    return value if isinstance(value, Sequence) else ()


def _positive(value: float, magnitude: float) -> float:
    return (
        value if math.isfinite(value) and value > SMALLEST_SHARE * magnitude else SMALLEST_SHARE * magnitude
    )
