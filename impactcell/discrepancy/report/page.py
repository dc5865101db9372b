"""One self-contained page: verdict, map, traces, evidence, parameters, held-out gap, what to measure next."""

import math
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, select_autoescape

from impactcell.discrepancy.model.intervals import Estimate
from impactcell.discrepancy.report import figures
from impactcell.discrepancy.report.result import where
from impactcell.discrepancy.search.evidence import ALPHA
from impactcell.discrepancy.search.validation import Proof
from impactcell.discrepancy.workflow import NAMED, NO_GAP, TIED, Findings
from impactcell.physics.effects import LIBRARY

GUIDE = (Path(__file__).parents[1] / "README.md").as_uri() + "#a-new-effect"
LARGE = 1.25
"""RMS of a region's residuals, in noise floors, from which on it is shown as large."""
NAMES = {"ratio": "mu_s/mu_k"}
UNITS = {"stiffness_n_per_m": "N/m", "damping_n_s_per_m": "N s/m"}


def write_report(findings: Findings, source: str, file: Path) -> None:
    """Write the report; pictures and style are inside the page."""
    environment = Environment(
        loader=PackageLoader("impactcell.discrepancy.report", "templates"),
        autoescape=select_autoescape(default=True),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(zip=zip, number=number, grouped=grouped)
    page = environment.get_template("report.html.j2").render(**content(findings, source))
    file.write_text(page, encoding="utf-8")


def words(identifier: str) -> str:
    """Name of an effect as one would say it."""
    return identifier.replace("_", " ")


def number(value: float) -> str:
    """Five digits, and an exponent only where the number could not be read without."""
    text = f"{value:.5g}"
    return grouped(float(text), 0) if "e+" in text and abs(value) < 1e7 else text


def grouped(value: float, decimals: int) -> str:
    """Thousands apart."""
    return f"{value:,.{decimals}f}".replace(",", " ")


def verdict_sentence(findings: Findings) -> str:
    """Verdict in one sentence."""
    proof = findings.proof
    before, after = f"{proof.before.whole:.2f}", f"{proof.after.whole:.2f}"
    if findings.verdict == NO_GAP:
        return f"The nominal model explains these shots: the held-out gap is {before} noise floors."
    names = " and ".join(words(effect) for effect in findings.added)
    if findings.verdict == NAMED:
        return f"Missing: {names}; with it the held-out gap falls from {before} to {after} noise floors."
    if findings.verdict == TIED:
        ties = findings.search.ties
        groups = [" or ".join(map(words, (effect, *ties.get(effect, ())))) for effect in findings.added]
        return (
            f"Missing: {', and '.join(groups)}, which these shots cannot tell apart; "
            f"the held-out gap falls from {before} to {after} noise floors."
        )
    left = findings.unexplained
    phase = words(left.phase) if left else "some phase"
    if findings.added:
        return (
            f"Missing: {names}, and something that no known effect explains: with {names} the held-out gap "
            f"falls from {before} to {after} noise floors only; what is left is largest in phase {phase}."
        )
    return f"No known effect explains a held-out gap of {before} noise floors, largest in phase {phase}."


def apart(findings: Findings) -> str:
    """How far contact and slide of taps stay from the floor when each is fitted alone; empty if unknown."""
    alone = findings.unexplained.alone if findings.unexplained else None
    if alone is None or math.isnan(alone.contact + alone.slide):
        return ""
    return (
        f" Fitted apart from each other, the contacts stay at {alone.contact:.2f} noise floors, "
        f"the slides after them at {alone.slide:.2f}."
    )


def content(findings: Findings, source: str) -> dict[str, Any]:
    """Everything the template shows."""
    search = findings.search
    extended = findings.final is not findings.nominal
    return {
        "source": source,
        "verdict": findings.verdict,
        "sentence": verdict_sentence(findings),
        "shots": len(findings.material.shots),
        "training": len(findings.training),
        "held_out": len(findings.held_out),
        "excitation": str(findings.material.excitation),
        "notes": [*findings.material.notes, *findings.floor.notes],
        "map_before": figures.chart(search.nominal),
        "map_after": figures.chart(search.final) if search.final is not search.nominal else None,
        "traces": figures.traces(findings),
        "factors": figures.factors(findings),
        "shape": figures.shape(findings),
        "unexplained": findings.unexplained,
        "apart": apart(findings),
        "candidates": _candidates(findings),
        "alternatives": [
            {
                "effects": " + ".join(words(one) for one in alternative.effects),
                "behind": alternative.behind,
                "std": alternative.behind_std,
                "chosen": alternative.effects == findings.final.effects,
            }
            for alternative in search.alternatives[:15]
        ],
        "effects": [
            {
                "name": words(effect),
                "equation": LIBRARY[effect].equation,
                "reference": LIBRARY[effect].reference,
                "tied": [words(one) for one in search.ties.get(effect, ())],
                "p": search.p_values.get(effect, 1.0),
                "where": where(findings, effect),
            }
            for effect in findings.added
        ],
        "parameters": [
            {
                "effect": words(one.effect) if one.effect else "nominal plant",
                "name": NAMES.get(one.parameter, one.parameter)
                + (f" [batch {one.batch + 1}]" if one.batch else ""),
                "value": one.value,
                "low": one.low,
                "high": one.high,
                "unit": _unit(one),
            }
            for one in findings.parameters
        ],
        "proof": findings.proof,
        "regions": _regions(findings.proof),
        "large": LARGE,
        "uncertain": 1.0 / math.sqrt(2.0 * max(len(findings.held_out), 1)),
        "extended": extended,
        "change": lambda form, before, after: form % before + (f" → {form % after}" if extended else ""),
        "nominal_effects": [words(one) for one in findings.nominal.effects],
        "floor": findings.floor,
        "replicates": findings.replicates,
        "spread": findings.final.spread,
        "proposals": findings.proposals,
        "alpha": ALPHA,
        "seed": findings.seed,
        "guide": GUIDE,
        "words": words,
    }


def _unit(one: Estimate) -> str:
    """Return the unit of a parameter; empty for a pure number."""
    if not one.effect:
        return UNITS.get(one.parameter, "")
    unit = next(known.unit for known in LIBRARY[one.effect].parameters if known.name == one.parameter)
    return "" if unit == "1" else unit


def _regions(proof: Proof) -> dict[str, Any]:
    """Held-out RMS before and after, phases down and channels across; None where nothing was recorded."""
    values = {(phase, channel): (before, after) for phase, channel, before, after in proof.regions}
    channels = list(dict.fromkeys(channel for _, channel in values))
    return {
        "channels": channels,
        "rows": [
            (phase, [values.get((phase, channel)) for channel in channels])
            for phase in dict.fromkeys(phase for phase, _ in values)
        ],
    }


def _candidates(findings: Findings) -> list[dict[str, Any]]:
    """Evidence for every candidate against the nominal model."""
    evidence = findings.search.nominal
    gains = evidence.scan.gains()
    rows: list[dict[str, Any]] = []
    for number, effect in enumerate(evidence.scan.candidates.names):
        rows.append(
            {
                "name": words(effect),
                "statistic": float(evidence.scan.tests.statistic[number]),
                "single": float(evidence.scan.tests.single[number]),
                "adjusted": float(evidence.scan.tests.adjusted[number]),
                "gain": gains[effect],
                "added": effect in findings.added,
            }
        )
    unseen = [
        effect
        for effect in LIBRARY
        if effect not in evidence.scan.candidates.names and effect not in evidence.fit.effects
    ]
    rows.sort(key=lambda row: (row["adjusted"], -row["gain"]))
    rows += [{"name": words(effect), "unseen": True} for effect in unseen]
    return rows
