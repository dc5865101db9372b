"""Measurement files as people have them: read, understood, cut into shots, made a campaign."""

from impactcell.measurements.assembly import Imported, make_campaign, write_campaign
from impactcell.measurements.assignment import Assignment
from impactcell.measurements.dialect import Dialect
from impactcell.measurements.given_values import Given
from impactcell.measurements.limits import Limits
from impactcell.measurements.mapping import Mapping, guess
from impactcell.measurements.reading import read_tables
from impactcell.measurements.recognition import ColumnMeaning
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
