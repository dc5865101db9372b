"""Taps that follow each other sooner than a pause tells: struck again when the actuator had long halted.

Within one tap the actuator may catch up with a part that lies still already, but not later than it takes for
its stroke. With the stroke and the velocity stated, a contact after that is another tap.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from impactcell.campaign import contacts
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.records.measured_records import Record
from impactcell.numerics.spikes import noise_of

STILL_S = 0.02
"""Time [s] without force, and for which the part lies still, before a contact that may be of another tap: in
it a part that slides to rest goes some 0.3 mm."""
STILL_STD, STILL_SHARE = 8.0, 0.005
"""Range of the positions of a part that lies still, in standard deviations of a sample and as a share of all
its way."""
SURELY_HALTED = 1.5
"""Time after first contact, in times of the stroke, after which the actuator has surely halted: stroke and
velocity may be stated a little wrong, and what comes to a halt takes a while."""


@dataclass(frozen=True, slots=True)
class SoonTaps:
    """Where the taps of a record begin.

    Attributes
    ----------
    onsets : tuple of int
        Samples of the force.
    leads_s : dict
        Time [s] to keep before those of them that follow a part's rest of less than usual.
    doubted : tuple of (float, float) or None
        Times [s] of a first contact, and of one after the part lay still that may be of another tap.
    is_told : bool
        Whether stroke and velocity are known, so that nobody can say more.
    """

    onsets: tuple[int, ...]
    leads_s: dict[int, float]
    doubted: tuple[float, float] | None
    is_told: bool


def soon_taps(
    record: Record, onsets: Sequence[int], baseline: contacts.Baseline, stroke_m: float, velocity_m_s: float
) -> SoonTaps:
    """Find the taps that begin between those that a pause tells apart; inf or nan where one is not stated."""
    time, force = record.times[ColumnMeaning.FORCE], record.values[ColumnMeaning.FORCE]
    takes_s = stroke_m / abs(velocity_m_s) if velocity_m_s else math.nan
    is_told = math.isfinite(takes_s)
    found, leads, doubted = [onsets[0]], {}, None
    for onset in contacts.contact_onsets(time, force, baseline, STILL_S):
        since = float(time[onset] - time[found[-1]])
        if onset <= onsets[0]:
            continue
        if onset in onsets:
            found.append(onset)
            continue
        still = still_s(record, float(time[onset]))
        if still < STILL_S or (is_told and since <= takes_s):
            continue
        if is_told and since > SURELY_HALTED * takes_s:
            found.append(onset)
            leads[onset] = min(0.5 * still, contacts.REST_S)
        else:
            doubted = doubted or (float(time[found[-1]]), float(time[onset]))
    return SoonTaps(tuple(found), leads, doubted, is_told)


def still_s(record: Record, until_s: float) -> float:
    """How long the part has lain still before a time [s]; 0 where no position says that it has."""
    if ColumnMeaning.POSITION not in record.values:
        return 0.0
    time, position = record.times[ColumnMeaning.POSITION], record.values[ColumnMeaning.POSITION]
    before = np.flatnonzero(time < until_s)
    last = before[time[before] >= until_s - STILL_S]
    if len(last) <= 2 * contacts.CONFIRMING_SAMPLES:
        return 0.0
    reach = 0.5 * max(STILL_STD * noise_of(position), STILL_SHARE * float(np.ptp(position)))
    away = np.abs(position[before] - np.median(position[last])) > reach
    away[:-2] &= away[1:-1] & away[2:]  # a spike is no motion
    moving = np.flatnonzero(away[:-2])
    return until_s - float(time[moving[-1]] if moving.size else time[0])


def doubts_of(records: Sequence[tuple[Record, SoonTaps]]) -> list[str]:
    """Tell contacts after a rest that are taken for the same tap as the one before, and what tells more."""
    notes = []
    for is_told, what in (
        (False, "with the stroke, two taps are cut where the actuator had halted (--set stroke=1.5mm)"),
        (
            True,
            "the actuator may still have been under way; if these are two taps, cut the file between them",
        ),
    ):
        told = [(r.place, soon.doubted) for r, soon in records if soon.doubted and soon.is_told is is_told]
        for place, (first, second) in told[:1]:
            count = "1 record" if len(told) == 1 else f"{len(told)} records"
            notes.append(
                f"{Path(place).name}: contact at {first:.4g} s and, after the part lay still, at "
                f"{second:.4g} s, taken for one tap, in {count}: {what}"
            )
    return notes
