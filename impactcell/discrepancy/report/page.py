"""One self-contained page: verdict, map, traces, evidence, parameters, held-out gap, what to measure next."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from jinja2 import Environment, PackageLoader, select_autoescape

from impactcell.discrepancy.report import figures, german_sentences, law_figures, sentences
from impactcell.discrepancy.report.planned_experiments import lacks_limits, planned_experiments
from impactcell.discrepancy.report.result import locate_effect
from impactcell.discrepancy.search import ALPHA, Validation
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.german.findings import REPORTS
from impactcell.german.parameters import parameter_words
from impactcell.physics.effect_names import as_title
from impactcell.physics.effects import LIBRARY
from impactcell.records.uncertainty import TOLD_STDS

EFFECT_GUIDE = (Path(__file__).parents[1] / "README.md").as_uri() + "#a-new-effect"
"""Where the report sends whoever wants to write a new effect."""
LARGE_REGION_RMS = 1.25
"""RMS of a region's residuals, in noise floors, from which on it is shown as large."""
ALL_CLOSED = 0.99
"""Share of a gap from which on more digits would say nothing more."""
LEAST_TOLD_P = 1e-4
"""p-value below which none is told: a tail so far out is that of the test's assumptions."""
MM_PER_M = 1e3
"""Millimetres in a metre: the page shows errors of positions in them."""
SENTENCES: Mapping[str, ModuleType] = {"en": sentences, "de": german_sentences}
"""What is said beside the templates, by language: functions of the same names."""


def write_reports(result: DiscrepancyResult, source: str, directory: Path) -> None:
    """Write the report in every language."""
    for language, name in REPORTS.items():
        write_report(result, source, directory / name, language)


def write_report(result: DiscrepancyResult, source: str, file: Path, language: str = "en") -> None:
    """Write the report in one language; pictures and style are inside the page."""
    environment = report_environment(SENTENCES[language])
    template = environment.get_template(f"{REPORTS[language]}.j2")
    page = template.render(**page_context(result, source, language))
    file.write_text(page, encoding="utf-8")


def report_environment(said: ModuleType) -> Environment:
    """Templates, with the filters that write numbers and words as a language does."""
    environment = Environment(
        loader=PackageLoader("impactcell.discrepancy.report", "templates"),
        autoescape=select_autoescape(default=True),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        zip=zip,
        words=said.phrase,
        format=lambda form, *values: said.written(form % values),
        number=lambda value: said.written(format_number(value)),
        p_value=lambda value: said.written(format_p_value(value)),
        grouped=lambda value, decimals: said.written(format_thousands(value, decimals)),
    )
    environment.globals["percent_closed"] = percent_closed
    environment.globals["percent_range"] = lambda *interval: said.written(percent_range(*interval))
    return environment


def format_number(value: float) -> str:
    """Five digits, and an exponent only where the number could not be read without; no minus before nought.

    >>> [format_number(value) for value in (-0.0, 1234567.0, 2.5e-7)]
    ['0', '1 234 600', '2.5e-07']
    """
    text = f"{value + 0.0:.5g}"
    return format_thousands(float(text), 0) if "e+" in text and abs(value) < 1e7 else text


def format_p_value(value: float) -> str:
    """Write a p-value; none is nought, and no test is sure of its tail beyond the last that is told.

    >>> [format_p_value(value) for value in (0.0123, 0.0001, 3e-17, 0.0)]
    ['p = 0.012', 'p = 0.0001', 'p < 0.0001', 'p < 0.0001']
    """
    return f"p = {value:.2g}" if value >= LEAST_TOLD_P else f"p < {LEAST_TOLD_P:.4f}"


def format_thousands(value: float, decimals: int) -> str:
    """Thousands apart."""
    return f"{value:,.{decimals}f}".replace(",", " ")


def percent_closed(closed: float) -> str:
    """Write the share of a gap that is closed in per cent: of one that falls below its floor, all.

    >>> percent_closed(0.953), percent_closed(1.82)
    ('95 %', '100 %')
    """
    return f"{100.0 * min(closed, 1.0):.0f} %"


def percent_range(low: float, high: float, to: str, more_than: str) -> str:
    """Write an interval of shares in per cent, with a decimal where its ends would look the same.

    No more than all is closed: a gap that falls below its floor says nothing more.

    >>> shares = ((0.4, 0.92), (0.951, 0.953), (0.998, 1.0), (0.82, 4.25))
    >>> [percent_range(*share, "to", "more than") for share in shares]
    ['40 to 92', '95.1 to 95.3', 'more than 99', '82 to 100']
    """
    if low >= ALL_CLOSED:
        return f"{more_than} {100.0 * ALL_CLOSED:.0f}"
    high = min(high, 1.0)
    decimals = 0 if round(100.0 * low) != round(100.0 * high) else 1
    return f"{100.0 * low:.{decimals}f} {to} {100.0 * high:.{decimals}f}"


def page_context(result: DiscrepancyResult, source: str, language: str = "en") -> dict[str, Any]:
    """Everything the template shows."""
    said = SENTENCES[language]
    phrase, label = said.phrase, said.label
    search = result.selection
    extended = result.final is not result.nominal
    names = [name or "–" for name in result.prepared.batches]
    return {
        "source": source,
        "verdict": result.verdict,
        "sentence": said.headline(result),
        "noise_floor": said.noise_floor_sentence(result),
        "advice": said.advice(result),
        "next_step": said.next_step(result),
        "shots": len(result.prepared.shots),
        "training": len(result.training),
        "held_out": len(result.held_out),
        "units": result.prepared.excitation.unit,
        "one_unit": result.prepared.excitation.unit.removesuffix("s"),
        "excitation": str(result.prepared.excitation.excitation),
        "notes": [said.note(note) for note in (*result.prepared.notes, *result.floor.notes)],
        "map_before": figures.map_figure(search.nominal, said),
        "map_after": figures.map_figure(search.final, said) if search.final is not search.nominal else None,
        "traces": figures.trace_figure(result, said),
        "factors": figures.factor_figure(result, said),
        "shape": figures.shape_figure(result, said),
        "unexplained": result.unexplained,
        "law": said.law_sentences(result),
        "law_figure": law_figures.law_figure(result, said),
        "apart": said.split_sentence(result),
        "candidates": _candidates(result, phrase),
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
                "reference": said.reference(LIBRARY[effect].reference),
                "tied": [phrase(item) for item in search.ties.get(effect, ())],
                "p": result.validation.of_effects[effect].p_value,
                "change": result.validation.of_effects[effect],
                "where": locate_effect(result, effect),
            }
            for effect in result.added
        ],
        "parameters": [
            {
                "effect": phrase(item.effect) if item.effect else label("nominal plant"),
                "name": f"{words} [{phrase('batch')} {names[item.batch]}]" if item.batch else words,
                "value": item.value,
                "low": item.low,
                "high": item.high,
                "at_bound": item.at_bound,
                "unit": unit,
            }
            for item in result.stated_parameters
            for words, unit in [parameter_words(item.effect, item.parameter, language)]
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
        "per_kilogram": [phrase(item) for item in result.per_kilogram],
        "unseen": []
        if result.has_whole_plant
        else [parameter_words("", name, language)[0] for name in result.unseen],
        "change": lambda form, before, after: said.written(
            form % before + (f" → {form % after}" if extended else "")
        ),
        "nominal_effects": [phrase(item) for item in result.nominal.effects],
        "floor": result.floor,
        "replicates": result.replicates,
        "own": result.held_problem.shot_parameter_names,
        "spread": result.final.spread,
        "proposals": planned_experiments(result, said.told_apart),
        "lacks_limits": lacks_limits(result),
        "alpha": ALPHA,
        "seed": result.seed,
        "guide": EFFECT_GUIDE,
        "words": phrase,
        "as_title": as_title,
        "setting": said.setting,
        "shape_in_words": said.shape,
    }


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


def _candidates(result: DiscrepancyResult, phrase: Callable[[str], str]) -> list[dict[str, Any]]:
    """Evidence for every candidate against the nominal model, and which of them cannot be seen."""
    evidence = result.selection.nominal
    gains, seen = evidence.candidate_scan.gains(), evidence.candidate_scan.seen()
    rows: list[dict[str, Any]] = []
    for number, effect in enumerate(evidence.candidate_scan.candidates.names):
        if effect not in seen:
            continue
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
    unseen = [effect for effect in LIBRARY if effect not in seen and effect not in evidence.fit.effects]
    rows.sort(key=lambda row: (row["adjusted"], -row["gain"]))
    rows += [{"name": phrase(effect), "unseen": True} for effect in unseen]
    return rows
