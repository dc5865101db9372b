"""The page of an investigation with a base model, in the style of the report of shots."""

import re
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, select_autoescape

from impactcell.discrepancy.machine import CATALOGUE, MachineFinding
from impactcell.discrepancy.report.machine_result import phrase
from impactcell.discrepancy.report.page import format_number

SHOWN_TRIALS = 15
"""Terms that the page lists [1]."""


def write_machine_report(finding: MachineFinding, document: dict[str, Any], source: str, file: Path) -> None:
    """Write the report of a finding and its `result.json`; the style is inside the page."""
    loader = PackageLoader("impactcell.discrepancy.report", "templates")
    environment = Environment(
        loader=loader, autoescape=select_autoescape(default=True), trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["number"] = format_number
    text, _, _ = loader.get_source(environment, "report.html.j2")
    style = re.search(r"<style>(.*?)</style>", text, re.DOTALL)
    context = machine_page_context(finding, document, source) | {"style": style.group(1) if style else ""}
    page = environment.get_template("machine.html.j2").render(**context)
    file.write_text(page, encoding="utf-8")


def machine_page_context(finding: MachineFinding, document: dict[str, Any], source: str) -> dict[str, Any]:
    """Everything the template shows."""
    first = finding.steps[0] if finding.steps else None
    return {
        "source": source,
        "result": document,
        "verdict": finding.verdict,
        "words": phrase,
        "equations": {name: CATALOGUE[name].equation for name in CATALOGUE},
        "references": {name: CATALOGUE[name].reference for name in CATALOGUE},
        "records": len(finding.records),
        "established": finding.established,
        "extended": bool(finding.established),
        "excess": first.excess if first else 0.0,
        "trials": first.trials[:SHOWN_TRIALS] if first else (),
        "free_gains": dict(first.free_gains) if first else {},
        "gain_of_all": first.gain_of_all if first else 0.0,
        "reason": finding.steps[-1].reason if finding.steps else "",
        "base": [term.choice.name for term in finding.nominal.terms],
    }
