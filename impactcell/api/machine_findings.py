"""The workflow with a base model: its findings and the files that it leaves."""

from dataclasses import replace
from pathlib import Path

from impactcell.api.finding_files import write_files
from impactcell.campaign import Campaign
from impactcell.discrepancy.machine import MachineFinding, investigate_machine
from impactcell.discrepancy.report import json_text, law_table_text, machine_document, write_machine_reports
from impactcell.errors import CampaignError
from impactcell.settings.base_model import base_model_text, read_base_model


def investigate_with_base(
    data: Campaign, base: Path, patterns: tuple[str | None, str | None], seed: int
) -> MachineFinding:
    """Find what a base model lacks; `patterns` say which shots fit and which are held out.

    Raises
    ------
    CampaignError, SettingsError
        What was given cannot be read or used.
    """
    model, excitation = read_base_model(base)
    if data.excitation is not excitation:
        raise CampaignError(
            f"{base}: is of excitation {excitation}, the campaign of {data.excitation}; change one of them"
        )
    train, test = patterns
    return investigate_machine(data, model, train=train, test=test, seed=seed)


def write_machine_findings(finding: MachineFinding, data: Campaign, output: Path, source: str) -> None:
    """Write result.json, the extended base model and the report.

    Raises
    ------
    CampaignError
        The directory cannot be written.
    """
    terms = tuple(term.choice for term in finding.final.terms)
    extended = replace(finding.base, terms=terms)
    provenance = {
        "made by": "impactcell discrepancy",
        "from": source,
        "seed": str(finding.seed),
        "verdict": finding.verdict,
        "held-out gap before": f"{finding.fall.before:.4g}",
        "held-out gap after": f"{finding.fall.after:.4g}",
    }

    document = machine_document(finding)

    def write(beside: Path) -> None:
        (beside / "result.json").write_text(json_text(document), encoding="utf-8")
        text = base_model_text(extended, data.excitation, provenance)
        (beside / "model.extended.yaml").write_text(text, encoding="utf-8")
        law = finding.law
        if law is not None and law.choice is not None:
            proposed = replace(law.model.base, terms=(*terms, law.choice))
            of_law = provenance | {"held-out gap after": f"{law.fall.after:.4g}"}
            text = base_model_text(proposed, data.excitation, of_law)
            (beside / f"{law.place}.yaml").write_text(text, encoding="utf-8")
        elif law is not None:
            (beside / f"{law.place}.csv").write_text(law_table_text(finding), encoding="utf-8")
        write_machine_reports(finding, document, source, beside)

    write_files(output, write)
