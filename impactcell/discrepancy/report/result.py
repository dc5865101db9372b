"""`result.json`: the outcome in a fixed format, the same bytes for the same data and seed."""

import json
import math
from typing import Any

from impactcell.discrepancy.model.intervals import Estimate
from impactcell.discrepancy.model.phases import BETWEEN_SHOTS
from impactcell.discrepancy.search.evidence import Evidence
from impactcell.discrepancy.search.validation import Gap
from impactcell.discrepancy.workflow import Findings
from impactcell.physics import Kind
from impactcell.physics.effects import LIBRARY

FORMAT = 1
DIGITS = 6
SHOWN = 0.05


def rounded(value: float) -> float | None:
    """Round to six significant digits: more would change with the machine's rounding."""
    if not math.isfinite(value):
        return None
    return float(f"{value:.{DIGITS}g}")


def text_of(result: dict[str, Any]) -> str:
    """JSON text of a result."""
    return json.dumps(result, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def result(findings: Findings) -> dict[str, Any]:
    """Outcome of the workflow as `result.json` has it."""
    proof = findings.proof
    left = findings.unexplained
    closed = rounded(proof.closed)
    return {
        "format": FORMAT,
        "verdict": findings.verdict,
        "effects": [_effect(findings, effect) for effect in findings.added],
        "unexplained": None
        if left is None
        else {"phase": left.phase, "depends_on": list(left.depends_on), "shape": left.shape},
        "gap": {
            "unit": "1 = noise floor",
            "train": {"before": rounded(proof.train_before.whole), "after": rounded(proof.train_after.whole)},
            "held_out": {
                "before": rounded(proof.before.whole),
                "after": rounded(proof.after.whole),
                "closed": closed,
                "closed_ci95": None if closed is None else [rounded(proof.low), rounded(proof.high)],
            },
            "parts": {
                "train": {"before": _parts(proof.train_before), "after": _parts(proof.train_after)},
                "held_out": {"before": _parts(proof.before), "after": _parts(proof.after)},
            },
        },
        "next_experiment": [
            {
                "separates": list(proposal.effects),
                "setting": proposal.setting,
                "shots": proposal.shots,
                "power": rounded(proposal.power),
            }
            for proposal in findings.proposals
        ],
        "nominal": _parameters([one for one in findings.parameters if not one.effect]),
        "noise_floor": {
            "noise_std": [rounded(value) for value in findings.floor.noise_std],
            "source": list(findings.floor.source),
            "replicate_spread": rounded(findings.replicates.spread),
            "friction_spread": rounded(findings.final.spread),
        },
        "notes": [*findings.material.notes, *findings.floor.notes],
        "seed": findings.seed,
        "model": "model.extended.yaml",
        "report": "report.html",
    }


def _parts(gap: Gap) -> dict[str, float | None]:
    return {"traces": rounded(gap.trace), "friction_factors": rounded(gap.factor)}


def _effect(findings: Findings, effect: str) -> dict[str, Any]:
    return {
        "effect": effect,
        "tied_with": list(findings.search.ties.get(effect, ())),
        "p_value": rounded(findings.search.p_values.get(effect, 1.0)),
        "where": where(findings, effect),
        "parameters": _parameters([one for one in findings.parameters if one.effect == effect]),
    }


def where(findings: Findings, effect: str) -> dict[str, Any]:
    """Phase in which the nominal model's residuals showed the effect, and what they changed with."""
    evidence = findings.search.nominal
    known = LIBRARY[effect]
    strength = _by_phase(evidence)
    possible = [phase.value for phase in known.phases if phase.value in strength]
    if known.kind is Kind.BETWEEN_SHOTS and BETWEEN_SHOTS in possible:
        possible = [BETWEEN_SHOTS] if len(known.phases) == 1 else possible
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
        and row * len(chart.columns) + column < len(evidence.map_tests.adjusted)
        and evidence.map_tests.adjusted[row * len(chart.columns) + column] <= SHOWN
    ]
    return {"phase": phase, "depends_on": depends}


def _by_phase(evidence: Evidence) -> dict[str, float]:
    """First-order gain of each row of the map, the largest over its cells."""
    chart = evidence.map
    gain = evidence.map_scores.gain
    made = {}
    for row, phase in enumerate(chart.rows):
        mine = chart.cell // len(chart.columns) == row
        per_column = [
            float(gain[mine & (chart.cell % len(chart.columns) == column)].sum())
            for column in range(len(chart.columns))
        ]
        made[phase] = max(per_column)
    return made


def _parameters(found: list[Estimate]) -> dict[str, Any]:
    made: dict[str, Any] = {}
    for one in found:
        value, ends = rounded(one.value), [rounded(one.low), rounded(one.high)]
        if one.batch:
            entry = made.setdefault(one.parameter, {"value": [], "ci95": []})
            entry["value"].append(value)
            entry["ci95"].append(ends)
        else:
            made[one.parameter] = {"value": value, "ci95": ends}
    return made
