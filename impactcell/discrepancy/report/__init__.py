"""What the workflow hands over: `result.json`, figures and one page."""

from impactcell.discrepancy.report.page import write_report
from impactcell.discrepancy.report.result import json_text, result_document
from impactcell.discrepancy.report.sentences import headline

__all__ = [
    "headline",
    "json_text",
    "result_document",
    "write_report",
]
