"""One tap of a record that has several."""

from dataclasses import replace

import numpy as np

from impactcell.campaign import contacts
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.records.measured_records import Record


def end_of_tap(record: Record, onset_s: float, next_s: float) -> float:
    """When the part has come to rest, and the record says no more of this tap."""
    if ColumnMeaning.POSITION not in record.values:
        return next_s
    time, position = record.times[ColumnMeaning.POSITION], record.values[ColumnMeaning.POSITION]
    stretch = (time >= onset_s) & (time < next_s)
    if stretch.sum() < 10:
        return next_s
    return min(contacts.rest_end(time[stretch], position[stretch], onset_s), next_s)


def part_of(record: Record, onset: int, lead_s: float, end_s: float) -> tuple[Record, int]:
    """Cut one tap out of a record that has several."""
    time = record.times[ColumnMeaning.FORCE]
    begin_s = time[onset] - lead_s
    kept = {q: (t >= begin_s) & (t <= end_s) for q, t in record.times.items()}
    part = replace(
        record,
        place=f"{record.place}: tap at {time[onset]:.6g} s",
        times={q: record.times[q][rows] for q, rows in kept.items()},
        values={q: record.values[q][rows] for q, rows in kept.items()},
    )
    return part, int(onset - np.count_nonzero(time[:onset] < begin_s))
