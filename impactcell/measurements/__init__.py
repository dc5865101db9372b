"""Measurement files as people have them: read, understood, cut into shots, made a campaign."""

from impactcell.measurements.assembly import Imported, make_campaign, write_campaign
from impactcell.measurements.columns.assignment import Assignment
from impactcell.measurements.columns.given_values import Given
from impactcell.measurements.columns.mapping import Mapping, guess
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.files.dialect import Dialect
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.files.reading import read_tables
from impactcell.measurements.table import MeasuredColumn, Table

__all__ = [
    "Assignment",
    "ColumnMeaning",
    "Dialect",
    "Given",
    "Imported",
    "Limits",
    "Mapping",
    "MeasuredColumn",
    "Table",
    "guess",
    "make_campaign",
    "read_tables",
    "write_campaign",
]
