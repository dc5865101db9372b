"""What the workflow hands over: `result.json`, figures and one page."""

from impactcell.discrepancy.report.law_table import law_table_text
from impactcell.discrepancy.report.machine_page import write_machine_reports
from impactcell.discrepancy.report.machine_result import machine_document
from impactcell.discrepancy.report.machine_sentences import headline as machine_headline
from impactcell.discrepancy.report.page import write_reports
from impactcell.discrepancy.report.result import json_text, result_document
from impactcell.discrepancy.report.sentences import headline

__all__ = [
    "headline",
    "json_text",
    "law_table_text",
    "machine_document",
    "machine_headline",
    "result_document",
    "write_machine_reports",
    "write_reports",
]
