"""`result.json`: the outcome in a fixed format, the same bytes for the same data and seed."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from impactcell.discrepancy.data import BETWEEN_SHOTS
from impactcell.discrepancy.model import ParameterEstimate
from impactcell.discrepancy.report.sentences import headline, next_step
from impactcell.discrepancy.search import (
    Gap,
    GapChange,
    ModelEvidence,
    Outdone,
    Proposal,
    Remaining,
    Simulation,
)
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY, find_effect

FORMAT = 2
"""Version of `result.json`."""
SPLINE_ONLY = "spline only"
"""Form of a term that no functional form does as well as."""
DIGITS = 6
"""Significant digits written: more would change with the machine's rounding."""
MAX_P_DEPENDS_ON = 0.05
"""p-value over the whole map up to which an effect is said to depend on a covariate."""


def round_digits(value: float) -> float | None:
    """Round to six significant digits: more would change with the machine's rounding."""
    if not math.isfinite(value):
        return None
    return float(f"{value:.{DIGITS}g}")


def json_text(result: dict[str, Any]) -> str:
    """JSON text of a result."""
    return json.dumps(result, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def result_document(result: DiscrepancyResult) -> dict[str, Any]:
    """Outcome of the workflow as `result.json` has it."""
    proof, change = result.validation, result.validation.held_out
    gap = result.unexplained
    return {
        "format": FORMAT,
        "verdict": result.verdict,
        "headline": headline(result),
        "effects": [_effect(result, effect) for effect in result.added],
        "unconfirmed": list(result.conclusion.unconfirmed),
        "outdone": _outdone(result.selection.outdone),
        "remaining": _remaining(result.conclusion.remaining),
        "unexplained": None
        if gap is None
        else {"phase": gap.phase, "depends_on": list(gap.depends_on), "shape": gap.shape},
        "gap": {
            "unit": "1 = noise floor",
            "train": {
                "before": round_digits(proof.whole(proof.train_before)),
                "after": round_digits(proof.whole(proof.train_after)),
            },
            "held_out": {
                **_change(change),
                "closed": round_digits(change.closed),
                "expected_without_gap": [round_digits(proof.whole(bound)) for bound in proof.expected],
            },
            "parts": {
                "train": {"before": _parts(proof.train_before), "after": _parts(proof.train_after)},
                "held_out": {"before": _parts(change.before), "after": _parts(change.after)},
                "expected_without_gap": [_parts(bound) for bound in proof.expected],
            },
        },
        "per_kilogram": list(result.per_kilogram),
        "simulation": _simulation(result.simulation),
        **_law(result),
        "next_experiment": experiments(result.experiments),
        "measure_next": None if result.experiments else next_step(result),
        "nominal": _nominal([estimate for estimate in result.stated_parameters if not estimate.effect]),
        "noise_floor": {
            "noise_std": [round_digits(value) for value in result.floor.noise_std],
            "source": list(result.floor.source),
            "replicate_spread": round_digits(result.replicates.spread),
            "friction_spread": round_digits(result.final.spread),
        },
        "batches": list(result.prepared.batches),
        "notes": [*result.prepared.notes, *result.floor.notes],
        "seed": result.seed,
        "model": "model.extended.yaml",
        "report": "report.html",
    }


def _outdone(outdone: Outdone | None) -> dict[str, Any] | None:
    """Write which name fell to which free form."""
    if outdone is None:
        return None
    form = find_effect(outdone.form).equation if outdone.form else ""
    return {"effect": outdone.effect, "form": form, "same_place": outdone.same_place}


def _parts(gap: Gap) -> dict[str, float | None]:
    return {"traces": round_digits(gap.trace), "friction_factors": round_digits(gap.factor)}


def _change(change: GapChange) -> dict[str, Any]:
    """Gap before and after, and the interval of the share that is closed; null where there was no gap."""
    closed = None if math.isnan(change.closed) else [round_digits(change.low), round_digits(change.high)]
    return {
        "before": round_digits(change.before.of(change.parts)),
        "after": round_digits(change.after.of(change.parts)),
        "closed_ci95": closed,
    }


def _remaining(remaining: Remaining) -> dict[str, Any]:
    return {
        "explained": remaining.explained,
        "share": round_digits(remaining.share),
        "where": [{"phase": place.phase, "depends_on": list(place.depends_on)} for place in remaining.where],
        "model_error": {"level": round_digits(remaining.level), "unit": "1 = noise floor"},
    }


def _simulation(simulation: Simulation) -> dict[str, Any]:
    errors = {"before": simulation.before, "after": simulation.after}
    return {
        "channel": simulation.channel,
        "unit": simulation.unit,
        "rmse": {when: round_digits(error.rmse) for when, error in errors.items()},
        "fit_percent": {when: round_digits(error.fit_percent) for when, error in errors.items()},
        "relative_force_error": {when: round_digits(error.relative_force) for when, error in errors.items()},
    }


def experiments(proposals: Sequence[Proposal]) -> list[dict[str, Any]]:
    """Write down what would tell tied effects apart; of a measurement that is no shot no power is known."""
    return [
        {
            "separates": list(proposal.effects),
            "setting": proposal.setting,
            "shots": proposal.shots,
            "power": round_digits(proposal.power),
        }
        for proposal in proposals
    ]


def _law(result: DiscrepancyResult) -> dict[str, Any]:
    """Write what is proposed where something remains; null, with the reason, where nothing is."""
    finding = result.law
    if finding is None or finding.refused:
        return {"law": None, "law_refused": finding.refused if finding else None}
    form, law = finding.term.form, finding.proposed
    document = {
        "place": form.effect.equation,
        "covariates": list(form.covariates),
        "form": SPLINE_ONLY if law is None else law.functional_form,
        "equation": form.effect.equation if law is None else law.equation,
        "term": (law.listed or None) if law else None,
        "parameters": _parameters(list(finding.estimates)),
        "equivalents": [item.law.functional_form for item in finding.equivalents],
        "rival_places": [find_effect(place).equation for place in finding.rival_places],
        "tested_range": {
            name: {"low": round_digits(low), "high": round_digits(high), "unit": unit}
            for name, unit, (low, high) in finding.term.tested
        },
        "held_out": {**_change(finding.change), "p_value": round_digits(finding.change.p_value)},
        "file": None if law is None else f"{law.identifier}.py",
    }
    return {"law": document, "law_refused": None}


def _effect(result: DiscrepancyResult, effect: str) -> dict[str, Any]:
    change = result.validation.of_effects[effect]
    return {
        "effect": effect,
        "meaning": LIBRARY[effect].meaning,
        "look_at": LIBRARY[effect].look_at,
        "tied_with": list(result.selection.ties.get(effect, ())),
        "p_value": round_digits(change.p_value),
        "p_search": round_digits(result.selection.p_values.get(effect, 1.0)),
        "held_out": _change(change) | {"parts": [str(part) for part in change.parts]},
        "where": locate_effect(result, effect),
        "parameters": _parameters([one for one in result.stated_parameters if one.effect == effect]),
    }


def locate_effect(result: DiscrepancyResult, effect: str) -> dict[str, Any]:
    """Phase in which the nominal model's residuals showed the effect, and what they changed with."""
    evidence = result.selection.nominal
    library_effect = LIBRARY[effect]
    strength = _by_phase(evidence)
    possible = [phase.value for phase in library_effect.phases if phase.value in strength]
    if library_effect.kind is Kind.BETWEEN_SHOTS and BETWEEN_SHOTS in possible:
        possible = [BETWEEN_SHOTS] if len(library_effect.phases) == 1 else possible
    phase = (
        max(possible, key=lambda name: strength[name])
        if possible
        else max(strength, key=strength.__getitem__)
    )
    chart = evidence.map
    row = chart.rows.index(phase)
    depends = [
        name
        for column, name in enumerate(chart.columns)
        if column
        and row * len(chart.columns) + column < len(evidence.map_tests.p_adjusted)
        and evidence.map_tests.p_adjusted[row * len(chart.columns) + column] <= MAX_P_DEPENDS_ON
    ]
    return {"phase": phase, "depends_on": depends}


def _by_phase(evidence: ModelEvidence) -> dict[str, float]:
    """First-order gain of each row of the map, the largest over its cells."""
    chart = evidence.map
    gain = evidence.map_scores.gain
    gains = {}
    for row, phase in enumerate(chart.rows):
        in_row = chart.cell // len(chart.columns) == row
        per_column = [
            float(gain[in_row & (chart.cell % len(chart.columns) == column)].sum())
            for column in range(len(chart.columns))
        ]
        gains[phase] = max(per_column)
    return gains


def _nominal(parameter_estimates: list[ParameterEstimate]) -> dict[str, Any]:
    """Write the plant's parameters; of `ratio`, mu_s/mu_k, the inverse too, as models and cells have it."""
    inverse = [
        replace(
            one, parameter="mu_k_over_mu_s", value=1.0 / one.value, low=1.0 / one.high, high=1.0 / one.low
        )
        for one in parameter_estimates
        if one.parameter == "ratio"
    ]
    return _parameters([*parameter_estimates, *inverse])


def _parameters(parameter_estimates: list[ParameterEstimate]) -> dict[str, Any]:
    document: dict[str, Any] = {}
    for estimate in parameter_estimates:
        value, ends = round_digits(estimate.value), [round_digits(estimate.low), round_digits(estimate.high)]
        if estimate.batch:
            entry = document.setdefault(estimate.parameter, {"value": [], "ci95": [], "at_bound": []})
            entry["value"].append(value)
            entry["ci95"].append(ends)
            entry["at_bound"].append(estimate.at_bound)
        else:
            document[estimate.parameter] = {"value": value, "ci95": ends, "at_bound": estimate.at_bound}
    return document
