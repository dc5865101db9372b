"""The model that the discrepancy workflow leaves: the nominal one, refitted, with what was missing."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from impactcell.api.friction import calibrated
from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.model import ParameterEstimate
from impactcell.discrepancy.search import Remaining
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.errors import PhysicsError, PredictionError
from impactcell.physics import Plant
from impactcell.prediction import REMAINS, Model
from impactcell.prediction.model import Prior
from impactcell.prediction.told_parameters import parameters_in_words, untold
from impactcell.settings.model_file import write_model, write_part_of_model

LEAST_SHARE = 0.005
"""Share of the held-out gap [1] below which a per cent is not told of what remains."""
SMALLEST_SHARE = 1e-4
"""Smallest standard deviation of a prior, relative to its value: a prior of none would stop any fit."""


def write_extended_model(
    result: DiscrepancyResult, data: Campaign, source: str, nominal: Model | None, path: Path
) -> None:
    """Write the extended model; only what is known of it where the shots tell of a part of the plant alone.

    Parameters
    ----------
    result : DiscrepancyResult
    data : Campaign
        What it was found in.
    source : str
        Where the data come from.
    nominal : Model or None
        Model whose plant the workflow was given.
    path : Path
        File to write.

    Raises
    ------
    SettingsError
        The file cannot be written.
    """
    if result.has_whole_plant:
        write_model(_extended_model(result, data, source, nominal), path)
        return
    shots = str(data.excitation).replace("_", " ")
    if result.per_kilogram:
        said = (
            f"no cell can run with it: {', '.join(result.per_kilogram)} is for a part of 1 kg, as no shot "
            "states its mass; state mass_kg in shots.csv, or name a cell that states part.mass_kg"
        )
    else:
        said = (
            f"no cell can run with it: {shots} shots tell nothing of {_unseen(result)}; name the cell whose "
            "model is to be extended, `impactcell discrepancy CAMPAIGN --cell CELL.yaml -o DIR`"
        )
    plant = {
        **{one.parameter: one.value for one in result.parameters if not one.effect},
        "gravity_m_s2": result.prepared.gravity_m_s2,
        "effects": _effects(result),
    }
    write_part_of_model(_name(result, nominal), said, plant, _provenance(result, source), path)


def _extended_model(result: DiscrepancyResult, data: Campaign, source: str, nominal: Model | None) -> Model:
    """Make the extended model as a model file holds it, calibrated so that a service can run with it."""
    plant = _extended_plant(result, None if nominal is None else nominal.plant)
    provenance = _provenance(result, source)
    if result.unseen:
        provenance["not seen in these shots, so as before"] = _unseen(result)
    model = Model(
        name=_name(result, nominal),
        plant=plant,
        prior=_prior(result, plant, None if nominal is None else nominal.prior),
        stroke_m=nominal.stroke_m if nominal is not None and result.unseen else data.stroke_m,
        intervals=_intervals(result),
        provenance=provenance,
    )
    if names := untold(model, None if nominal is None else nominal.prior):
        told = {"not told, so of no use in a cell": parameters_in_words(model, names)}
        model = replace(model, provenance={**provenance, **told})
    if data.excitation is not Excitation.TAP:
        return model
    fitted = {shot.number for shot in result.prepared.shots}
    try:
        return calibrated(model, [shot for shot in data.shots if shot.cycle in fitted])
    except (PredictionError, PhysicsError) as error:
        note = {**model.provenance, "not calibrated": str(error)}
        return replace(model, provenance=note)


def _name(result: DiscrepancyResult, nominal: Model | None) -> str:
    return " + ".join(("fitted" if nominal is None else nominal.name, *result.added))


def _unseen(result: DiscrepancyResult) -> str:
    return ", ".join("mu_s / mu_k" if name == "ratio" else name for name in result.unseen)


def _provenance(result: DiscrepancyResult, source: str) -> dict[str, str]:
    return {
        "made by": "impactcell discrepancy",
        "from": source,
        "seed": str(result.seed),
        "verdict": result.verdict,
        "held-out gap before": f"{result.validation.gap_before:.4g}",
        "held-out gap after": f"{result.validation.gap_after:.4g}",
        **({REMAINS: remains} if result.added and (remains := _remains(result.conclusion.remaining)) else {}),
    }


def _remains(remaining: Remaining) -> str:
    """Say what no established effect explains, and where; empty where that is nothing."""
    if remaining.explained:
        return ""
    share = f"{remaining.share:.0%} of the held-out gap" if remaining.share >= LEAST_SHARE else "a pattern"
    phases = dict.fromkeys(place.phase.replace("_", " ") for place in remaining.where)
    return f"{share}{', in ' if phases else ''}{', '.join(phases)}"


def _extended_plant(result: DiscrepancyResult, nominal: Plant | None) -> Plant:
    """Plant of the final model; what these shots tell nothing of is as it was given."""
    given = {}
    if nominal is not None:
        given = {
            "stiffness_n_per_m": nominal.stiffness_n_per_m,
            "damping_n_s_per_m": nominal.damping_n_s_per_m,
            "ratio": nominal.mu_s / nominal.mu_k,
        }
    values = given | {one.parameter: one.value for one in result.parameters if not one.effect}
    return Plant(
        stiffness_n_per_m=values["stiffness_n_per_m"],
        damping_n_s_per_m=values["damping_n_s_per_m"],
        mu_s=values["mu_k"] * values["ratio"],
        mu_k=values["mu_k"],
        gravity_m_s2=result.prepared.gravity_m_s2,
        effects=_effects(result),
    )


def _prior(result: DiscrepancyResult, plant: Plant, nominal: Prior | None) -> Prior:
    """Tell how well the plant is known; what these shots tell nothing of, as well as before.

    What has come to a bound beside something that no effect explains is not told: it went there for that.
    """
    remains = not result.conclusion.remaining.explained
    half = {
        one.parameter: math.inf if remains and _is_at_bound(one) else (one.high - one.low) / 4.0
        for one in result.parameters
        if not one.effect
    }
    ratio = plant.mu_k / plant.mu_s
    fitted = {
        "stiffness_std_n_per_m": (half.get("stiffness_n_per_m"), plant.stiffness_n_per_m),
        "damping_std_n_s_per_m": (half.get("damping_n_s_per_m"), max(plant.damping_n_s_per_m, 1.0)),
        "ratio_std": (half["ratio"] * ratio**2 if "ratio" in half else None, ratio),
    }
    return Prior(
        **{
            name: getattr(nominal, name) if std is None else _positive(std, magnitude)
            for name, (std, magnitude) in fitted.items()
        }
    )


def _intervals(result: DiscrepancyResult) -> Mapping[str, Mapping[str, tuple[float, float]]]:
    """Intervals of the effects' parameters, but of what has one value a batch."""
    intervals: dict[str, dict[str, tuple[float, float]]] = {}
    for one in result.parameters:
        if one.effect and not one.batch and math.isfinite(one.low) and math.isfinite(one.high):
            intervals.setdefault(one.effect, {})[one.parameter] = (one.low, one.high)
    return intervals


def _effects(result: DiscrepancyResult) -> dict[str, dict[str, float | Sequence[float]]]:
    """Parameters of the effects; a value a batch in a row."""
    effects: dict[str, dict[str, float | Sequence[float]]] = {}
    for one in result.parameters:
        if not one.effect:
            continue
        values = effects.setdefault(one.effect, {})
        if one.batch:
            before = values.get(one.parameter)
            values[one.parameter] = (*(before if isinstance(before, Sequence) else ()), one.value)
        else:
            values[one.parameter] = one.value
    return effects


def _is_at_bound(one: ParameterEstimate) -> bool:
    return one.at_bound and one.value in (one.low, one.high)


def _positive(std: float, magnitude: float) -> float:
    """Give a standard deviation that a prior can have; the magnitude itself where nothing tells it."""
    return max(std, SMALLEST_SHARE * magnitude) if math.isfinite(std) else magnitude
