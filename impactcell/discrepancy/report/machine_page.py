"""The page of an investigation with a base model, in the style of the report of shots."""

import math
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from impactcell.discrepancy.machine import CATALOGUE, MIN_NEED, VALUES, ChosenTerm, MachineFinding, motions
from impactcell.discrepancy.report import german_machine_sentences, machine_sentences
from impactcell.discrepancy.report.law_figures import function_figure, slices_figure
from impactcell.discrepancy.report.machine_parameters import SYMBOLS, law_covariates, parameter_rows
from impactcell.discrepancy.report.page import report_environment
from impactcell.german.findings import REPORTS

SHOWN_FORMS = 5
"""Forms alike that the page lists [1]."""
SHOWN_TRIALS = 15
"""Terms that the page lists [1]."""
SHOWN_PLACES = (0.1, 0.5, 0.9)
"""Where a force of velocity and position is shown, in shares of the range of positions [1]."""
WHOLE = 100.0
"""Logarithms from which on no decimal says anything [1]."""
PREFIXES = ("", "m", "µ", "n")
"""Of units, each a thousandth of the one before."""
MACHINE_SENTENCES: Mapping[str, ModuleType] = {"en": machine_sentences, "de": german_machine_sentences}
"""What is said beside the templates, by language: functions of the same names."""


def write_machine_reports(
    finding: MachineFinding, document: dict[str, Any], source: str, directory: Path
) -> None:
    """Write the report of a finding and its `result.json` in every language; the style is inside."""
    for language, name in REPORTS.items():
        said = MACHINE_SENTENCES[language]
        environment = report_environment(said)
        environment.filters["share"] = lambda part, whole, said=said: said.written(format_share(part, whole))
        environment.filters["need"] = lambda need, said=said: said.written(format_need(need))
        template = environment.get_template(f"{name.replace('report', 'machine')}.j2")
        page = template.render(**machine_page_context(finding, document, source, language))
        (directory / name).write_text(page, encoding="utf-8")


def format_need(need: float | None) -> str:
    """Write a logarithm of how much likelier records are with a term; empty where nobody asked.

    >>> format_need(12.34), format_need(-0.01), format_need(4196.2), format_need(-math.inf), format_need(None)
    ('12.3', '0.0', '4196', '-', '')
    """
    if need is None:
        return ""
    if math.isinf(need):
        return "-"
    return f"{need:.0f}" if abs(need) >= WHOLE else f"{round(need, 1) + 0.0:.1f}"


def format_share(part: float, whole: float) -> str:
    """Write a share in per cent, without a sign where it is none; what does more harm than good is all alike.

    >>> format_share(0.123, 1.0), format_share(-1e-5, 1.0), format_share(1.0, 0.0), format_share(-7e9, 1.0)
    ('12.3 %', '0.0 %', '0.0 %', '< -100 %')
    """
    share = 100.0 * part / whole if whole else 0.0
    return "< -100 %" if share < -100.0 else f"{round(share, 1) + 0.0:.1f} %"


def with_prefix(simulation: Mapping[str, Any]) -> dict[str, Any]:
    """Give errors of a simulation before and after to three digits, in a unit with the prefix that fits.

    >>> with_prefix({"unit": "m", "rmse": {"before": 7.9017e-6, "after": 5.7941e-7}})
    {'before': 7.9, 'after': 0.579, 'unit': 'µm'}
    >>> with_prefix({"unit": "N", "rmse": {"before": 12.345, "after": 0.0}})
    {'before': 12.3, 'after': 0.0, 'unit': 'N'}
    """
    largest = max(simulation["rmse"].values())
    step = 0 if largest <= 0.0 else min(max(math.ceil(-math.log10(largest) / 3.0), 0), len(PREFIXES) - 1)
    scaled = {name: float(f"{value * 1e3**step:.3g}") for name, value in simulation["rmse"].items()}
    return {**scaled, "unit": PREFIXES[step] + simulation["unit"]}


def machine_page_context(
    finding: MachineFinding, document: dict[str, Any], source: str, language: str
) -> dict[str, Any]:
    """Everything the template shows."""
    said, coordinate = MACHINE_SENTENCES[language], finding.base.coordinate
    first = finding.steps[0] if finding.steps else None
    return {
        "source": source,
        "result": document,
        "verdict": finding.verdict,
        "sentence": said.headline(finding),
        "notes": [said.note(note) for note in document["notes"]],
        "law_refused": said.reason(finding.law_refused),
        "setting": said.setting,
        "simulated": with_prefix(document["simulation"]),
        "with_prefix": with_prefix,
        "equation": said.equation,
        "equations": {name: said.equation(term.equation) for name, term in CATALOGUE.items()},
        "references": {name: said.reference(term.reference) for name, term in CATALOGUE.items()},
        "found": parameter_rows(
            ((effect["effect"], effect["parameters"]) for effect in document["effects"]), coordinate, language
        ),
        "instead": parameter_rows(
            (
                (rival, parameters)
                for effect in document["effects"]
                for rival, parameters in effect["tied_parameters"].items()
            ),
            coordinate,
            language,
        ),
        "stated": parameter_rows((("", document["nominal"]),), coordinate, language),
        "of_law": parameter_rows(
            (("", (document["law"] or {}).get("parameters", {})),), coordinate, language
        ),
        "records": len(finding.records),
        "established": finding.established,
        "extended": bool(finding.established),
        "excess": first.excess if first else 0.0,
        "trials": first.trials[:SHOWN_TRIALS] if first else (),
        "free_gains": dict(first.free_gains) if first else {},
        "needs": dict(first.needs) if first else {},
        "min_need": MIN_NEED,
        "gain_of_all": first.gain_of_all if first else 0.0,
        "reason": said.reason(finding.steps[-1].reason if finding.steps else ""),
        "base": [term.choice.name for term in finding.nominal.terms],
        "law_figure": _law_figure(finding, said),
        "shown_forms": SHOWN_FORMS,
    }


def _law_figure(finding: MachineFinding, said: ModuleType) -> str:
    """Spline of what remains, and the law beside it; empty where nothing is proposed."""
    law = finding.law
    if law is None:
        return ""
    units, force = law_covariates(finding), SYMBOLS[finding.base.coordinate]["force"]
    if law.slices:
        shown = [law.slices[int(share * (len(law.slices) - 1))] for share in SHOWN_PLACES]
        first, second = units.items()
        return slices_figure(shown, ((), ""), first, second, force, less_mean=True, said=said)
    ((covariate, unit),) = units.items()
    low, high = law.tested[covariate]
    values = None
    if law.choice is not None and law.choice.law is not None:
        chosen = ChosenTerm(law.choice, 0.0)
        functions = [
            item.values(law.spline.covariate, law.choice.law.reference) for item in law.choice.law.terms
        ]
        sizes = [law.model.value(column) for column in chosen.columns]
        values = sum(size * function for size, function in zip(sizes, functions, strict=True))
    name = "" if law.choice is None or law.choice.law is None else law.choice.law.name
    met = np.concatenate([VALUES[covariate](motion) for motion in motions(finding)])
    return function_figure(
        law.spline,
        None if values is None else (np.asarray(values), name),
        met[(met >= low) & (met <= high)],
        (covariate, unit, force),
        less_mean=True,
        said=said,
    )
