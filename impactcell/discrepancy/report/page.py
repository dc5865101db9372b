"""One self-contained page: verdict, map, traces, evidence, parameters, held-out gap, what to measure next."""

import math
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, select_autoescape

from impactcell.discrepancy.model import ParameterEstimate
from impactcell.discrepancy.report import figures, law_figures
from impactcell.discrepancy.report.result import locate_effect
from impactcell.discrepancy.report.sentences import (
    advice,
    headline,
    law_sentences,
    next_step,
    noise_floor_sentence,
    phrase,
)
from impactcell.discrepancy.search import ALPHA, Validation
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.physics.effects import LIBRARY
from impactcell.records.uncertainty import TOLD_STDS

EFFECT_GUIDE = (Path(__file__).parents[1] / "README.md").as_uri() + "#a-new-effect"
"""Where the report sends whoever wants to write a new effect."""
LARGE_REGION_RMS = 1.25
"""RMS of a region's residuals, in noise floors, from which on it is shown as large."""
MM_PER_M = 1e3
"""Millimetres in a metre: the page shows errors of positions in them."""
PARAMETER_LABELS = {"ratio": "mu_s/mu_k"}
PLANT_UNITS = {"stiffness_n_per_m": "N/m", "damping_n_s_per_m": "N s/m"}


def write_report(result: DiscrepancyResult, source: str, file: Path) -> None:
    """Write the report; pictures and style are inside the page."""
    environment = Environment(
        loader=PackageLoader("impactcell.discrepancy.report", "templates"),
        autoescape=select_autoescape(default=True),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(zip=zip, number=format_number, grouped=format_thousands)
    page = environment.get_template("report.html.j2").render(**page_context(result, source))
    file.write_text(page, encoding="utf-8")


def format_number(value: float) -> str:
    """Five digits, and an exponent only where the number could not be read without."""
    text = f"{value:.5g}"
    return format_thousands(float(text), 0) if "e+" in text and abs(value) < 1e7 else text


def format_thousands(value: float, decimals: int) -> str:
    """Thousands apart."""
    return f"{value:,.{decimals}f}".replace(",", " ")


def split_sentence(result: DiscrepancyResult) -> str:
    """How far contact and slide of taps stay from the floor when each is fitted alone; empty if unknown."""
    alone = result.unexplained.split_fits if result.unexplained else None
    if alone is None or math.isnan(alone.contact + alone.slide):
        return ""
    return (
        f" Fitted apart from each other, the contacts stay at {alone.contact:.2f} noise floors, "
        f"the slides after them at {alone.slide:.2f}."
    )


def page_context(result: DiscrepancyResult, source: str) -> dict[str, Any]:
    """Everything the template shows."""
    search = result.selection
    extended = result.final is not result.nominal
    return {
        "source": source,
        "verdict": result.verdict,
        "sentence": headline(result),
        "noise_floor": noise_floor_sentence(result),
        "advice": advice(result),
        "next_step": next_step(result),
        "shots": len(result.prepared.shots),
        "training": len(result.training),
        "held_out": len(result.held_out),
        "excitation": str(result.prepared.excitation.excitation),
        "notes": [*result.prepared.notes, *result.floor.notes],
        "map_before": figures.map_figure(search.nominal),
        "map_after": figures.map_figure(search.final) if search.final is not search.nominal else None,
        "traces": figures.trace_figure(result),
        "factors": figures.factor_figure(result),
        "shape": figures.shape_figure(result),
        "unexplained": result.unexplained,
        "law": law_sentences(result),
        "law_figure": law_figures.law_figure(result),
        "apart": split_sentence(result),
        "candidates": _candidates(result),
        "alternatives": [
            {
                "effects": " + ".join(phrase(item) for item in alternative.effects),
                "behind": alternative.deficit,
                "std": alternative.deficit_std,
                "chosen": alternative.effects == result.final.effects,
            }
            for alternative in search.alternatives[:15]
        ],
        "effects": [
            {
                "name": phrase(effect),
                "equation": LIBRARY[effect].equation,
                "reference": LIBRARY[effect].reference,
                "tied": [phrase(item) for item in search.ties.get(effect, ())],
                "p": result.validation.of_effects[effect].p_value,
                "change": result.validation.of_effects[effect],
                "where": locate_effect(result, effect),
            }
            for effect in result.added
        ],
        "parameters": [
            {
                "effect": phrase(item.effect) if item.effect else "nominal plant",
                "name": PARAMETER_LABELS.get(item.parameter, item.parameter)
                + (f" [batch {item.batch + 1}]" if item.batch else ""),
                "value": item.value,
                "low": item.low,
                "high": item.high,
                "at_bound": item.at_bound,
                "unit": _unit(item),
            }
            for item in result.parameters
        ],
        "proof": result.validation,
        "change_of_gap": result.validation.held_out,
        "remaining": result.conclusion.remaining,
        "simulation": result.simulation,
        "simulation_scale": MM_PER_M if result.simulation.unit == "m" else 1.0,
        "regions": _regions(result.validation),
        "large": LARGE_REGION_RMS,
        "uncertain": TOLD_STDS / math.sqrt(2.0 * max(len(result.held_out), 1)),
        "extended": extended,
        "change": lambda form, before, after: form % before + (f" → {form % after}" if extended else ""),
        "nominal_effects": [phrase(item) for item in result.nominal.effects],
        "floor": result.floor,
        "replicates": result.replicates,
        "spread": result.final.spread,
        "proposals": result.experiments,
        "alpha": ALPHA,
        "seed": result.seed,
        "guide": EFFECT_GUIDE,
        "words": phrase,
    }


def _unit(estimate: ParameterEstimate) -> str:
    """Return the unit of a parameter; empty for a pure number."""
    if not estimate.effect:
        return PLANT_UNITS.get(estimate.parameter, "")
    unit = next(
        parameter.unit
        for parameter in LIBRARY[estimate.effect].parameters
        if parameter.name == estimate.parameter
    )
    return "" if unit == "1" else unit


def _regions(proof: Validation) -> dict[str, Any]:
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


def _candidates(result: DiscrepancyResult) -> list[dict[str, Any]]:
    """Evidence for every candidate against the nominal model."""
    evidence = result.selection.nominal
    gains = evidence.candidate_scan.gains()
    rows: list[dict[str, Any]] = []
    for number, effect in enumerate(evidence.candidate_scan.candidates.names):
        rows.append(
            {
                "name": phrase(effect),
                "statistic": float(evidence.candidate_scan.tests.statistic[number]),
                "single": float(evidence.candidate_scan.tests.p_single[number]),
                "adjusted": float(evidence.candidate_scan.tests.p_adjusted[number]),
                "gain": gains[effect],
                "added": effect in result.added,
            }
        )
    unseen = [
        effect
        for effect in LIBRARY
        if effect not in evidence.candidate_scan.candidates.names and effect not in evidence.fit.effects
    ]
    rows.sort(key=lambda row: (row["adjusted"], -row["gain"]))
    rows += [{"name": phrase(effect), "unseen": True} for effect in unseen]
    return rows
