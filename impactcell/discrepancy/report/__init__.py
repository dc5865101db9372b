"""What the workflow hands over: `result.json`, figures and one page."""

from impactcell.discrepancy.report.page import verdict_sentence, write_report
from impactcell.discrepancy.report.result import json_text, result_document

__all__ = [
    "json_text",
    "result_document",
    "verdict_sentence",
    "write_report",
]
