"""Turns forces so that compression is positive: all alike, or each contact by the motion after it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from impactcell.campaign import contacts
from impactcell.measurements.columns.given_values import Given
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.records.measured_records import Record
from impactcell.measurements.taps.captures import scalar
from impactcell.numerics.spikes import noise_of
from impactcell.records import Samples

MOVED_STD = 10.0
"""Way of a part, in standard deviations of a sample, from which on it is seen where it went."""
WITH_MOTION = ({(1, 1), (-1, -1)}, {(1, -1), (-1, 1)})
"""Signs of force and motion where taps to one side push a load cell and those to the other pull it."""


@dataclass(frozen=True, slots=True)
class _Contact:
    """A contact of a record: when it begins, the signs of its force and of the motion; 0 if none is seen."""

    onset_s: float
    sign: int
    motion: int


def in_compression(
    records: Sequence[Record], given: Given, notes: list[str], faults: list[str]
) -> list[Record]:
    """Turn the forces so that compression is positive, and tell of it; those that were given a sign stay.

    A force whose sign goes with the direction of motion is turned contact by contact; else all are turned
    alike, and a record whose force pulls all the same is a fault.
    """
    struck = [_contacts(record, given) for record in records]
    is_given = ColumnMeaning.FORCE in given.signs
    told = [contact for of_record in struck for contact in of_record]
    if not is_given and {(one.sign, one.motion) for one in told if one.motion} in WITH_MOTION:
        count = sum(contact.sign < 0 for contact in told)
        notes.append(
            f"force turned in {count} of {len(told)} contacts: its sign goes with the direction of motion "
            "(--sign force=1 leaves it)"
        )
        return [_by_contact(record, of) for record, of in zip(records, struck, strict=True)]
    forces = [record.values[ColumnMeaning.FORCE] for record in records]
    signs = [contacts.pulse_sign(force) for force, of in zip(forces, struck, strict=True) if of or not told]
    sign = 1 if sum(signs) >= 0 or is_given else -1
    if sign < 0:
        notes.append("force turned: it was negative in compression (--sign force=1 leaves it)")
    turned = [_with_force(record, sign * force) for record, force in zip(records, forces, strict=True)]
    pulling = [
        record.place
        for record, of in zip(turned, struck, strict=True)
        if of and all(contact.sign != sign for contact in of) and _begins_above(record)
    ]
    if pulling and is_given:
        first = Path(pulling[0]).name
        places = f"1 record, {first}" if len(pulling) == 1 else f"{len(pulling)} records, the first {first}"
        notes.append(f"force that pulls, by the sign that was given, in {places}")
    elif pulling:
        faults += [
            f"{place}: the force pulls, where that of others pushes, and its sign does not go with the "
            f"direction of motion; turn it in the file, leave the file out, or say --sign force=1 to take "
            f"all as they are"
            for place in pulling
        ]
    return turned


def _contacts(record: Record, given: Given) -> list[_Contact]:
    """Find the contacts of either sign."""
    time, force = record.times[ColumnMeaning.FORCE], record.values[ColumnMeaning.FORCE]
    if np.ptp(force) == 0.0:
        return []
    middle = float(np.median(force))
    size = np.abs(force - middle)
    threshold = given.trigger if isinstance(given.trigger, float) else None
    found = []
    for onset in contacts.contact_onsets(time, size, contacts.baseline_of(size, threshold)):
        begin_s = float(time[onset])
        push = force[(time >= begin_s) & (time < begin_s + contacts.SHOT_GAP_S)]
        found.append(_Contact(begin_s, contacts.pulse_sign(push, middle), _motion(record, given, begin_s)))
    return found


def _motion(record: Record, given: Given, begin_s: float) -> int:
    """Give +1 or -1: the direction that is said, else of the part's way; 0 where it did not move."""
    said = scalar(record, given, ColumnMeaning.DIRECTION)
    if said in (1.0, -1.0):
        return int(said)
    if ColumnMeaning.POSITION not in record.values:
        return 0
    time, position = record.times[ColumnMeaning.POSITION], record.values[ColumnMeaning.POSITION]
    before = position[(time >= begin_s - contacts.REST_S) & (time < begin_s)]
    after = position[(time >= begin_s) & (time < begin_s + contacts.SHOT_GAP_S)]
    if not after.size:
        return 0
    rest = float(np.median(before)) if before.size else float(after[0])
    low, high = contacts.extremes(after)
    if max(high - rest, rest - low) <= MOVED_STD * noise_of(position):
        return 0
    return contacts.pulse_sign(after, rest)


def _by_contact(record: Record, found: Sequence[_Contact]) -> Record:
    """Turn the force so that each contact pushes; about where it rests, where contacts of both signs are."""
    time, force = record.times[ColumnMeaning.FORCE], record.values[ColumnMeaning.FORCE]
    if len({contact.sign for contact in found}) < 2:
        return _with_force(record, force * found[0].sign) if found else record
    begins = [contact.onset_s - contacts.REST_S for contact in found]
    of_sample = np.maximum(np.searchsorted(begins, time, side="right") - 1, 0)
    middle = float(np.median(force))
    signs = np.array([contact.sign for contact in found])
    return _with_force(record, middle + signs[of_sample] * (force - middle))


def _with_force(record: Record, force: Samples) -> Record:
    return replace(record, values={**record.values, ColumnMeaning.FORCE: force})


def _begins_above(record: Record) -> bool:
    """Whether a force is in contact from its first sample on, as one that pulls seems to be."""
    time, force = record.times[ColumnMeaning.FORCE], record.values[ColumnMeaning.FORCE]
    return contacts.contact_onsets(time, force, contacts.baseline_of(force))[:1] == [0]
