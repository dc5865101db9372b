"""Parts that are put to where they are struck while it is recorded, as before each tap of a long record."""

from dataclasses import replace

import numpy as np

from impactcell.campaign import contacts
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.records.measured_records import Record
from impactcell.measurements.taps.captures import RESTING
from impactcell.numerics.spikes import noise_of
from impactcell.records import Samples

AWAY_STD, AWAY_SHARE = 8.0, 0.05
"""Distance from where the part lies at contact, in standard deviations of a sample and as a share of all its
way, from which on it lies elsewhere."""


def from_its_place(record: Record, onset: int | None) -> Record:
    """Leave out the positions of before the part was put to where it is struck; they are of the tap before.

    Parameters
    ----------
    record : Record
        Of one tap.
    onset : int or None
        First sample of the force in contact; None where the record begins there.
    """
    if not onset or ColumnMeaning.POSITION not in record.values:
        return record
    time, position = record.times[ColumnMeaning.POSITION], record.values[ColumnMeaning.POSITION]
    contact_s = record.times[ColumnMeaning.FORCE][onset]
    begin = _put_in_place(position, int(np.searchsorted(time, contact_s)))
    if not begin:
        return record
    return replace(
        record,
        times={**record.times, ColumnMeaning.POSITION: time[begin:]},
        values={**record.values, ColumnMeaning.POSITION: position[begin:]},
    )


def _put_in_place(position: Samples, contact: int) -> int:
    """Give the first sample from which on the part lies where it is at contact."""
    before = position[:contact]
    if len(before) <= RESTING:
        return 0
    reach = max(AWAY_STD * noise_of(position), AWAY_SHARE * float(np.ptp(position)))
    away = np.abs(before - np.median(before[-RESTING:])) > reach
    elsewhere = np.flatnonzero(away[:-2] & away[1:-1] & away[2:])  # a spike is no other place
    return int(elsewhere[-1]) + contacts.CONFIRMING_SAMPLES if elsewhere.size else 0
