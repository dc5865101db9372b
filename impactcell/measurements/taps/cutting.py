"""Cuts records into taps: where contact begins is t = 0, what lay before is kept as pretrigger."""

import math
from collections.abc import Iterator, Sequence
from collections.abc import Mapping as AbstractMapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from impactcell.campaign import contacts
from impactcell.measurements.columns.given_values import Given
from impactcell.measurements.columns.recognition import CHANNELS, ColumnMeaning
from impactcell.measurements.faults import raise_faults
from impactcell.measurements.records.measured_records import Record
from impactcell.measurements.records.record_parts import end_of_tap, part_of
from impactcell.measurements.taps.captures import channel_of, described, direction_of, shot_numbers
from impactcell.measurements.taps.compression import in_compression
from impactcell.measurements.taps.force_zero import force_at_rest, notes_of_zeros, span, taps_in_words
from impactcell.measurements.taps.put_back import from_its_place
from impactcell.measurements.taps.soon_taps import SoonTaps, doubts_of, soon_taps
from impactcell.numerics.spikes import noise_of
from impactcell.records import MM_PER_MIN, Capture, Channel

START_STD = 10.0
"""Place of a part, in standard deviations of a sample, from which on the positions count from the table's
zero."""
NO_TRIGGER = "none"
"""Said of records whose t = 0 is the first contact already."""
MISSED = "the tap may have missed"
"""Why a force may show no contact."""


@dataclass(frozen=True, slots=True, eq=False)
class _TapRecord:
    """One tap of a record.

    `onset` is the index of the first force sample in contact; None where contact is at the record's own
    t = 0. The velocity may be `of_actuator`, from its own channel.
    """

    record: Record
    onset: int | None
    velocity_m_s: float
    of_actuator: bool


def taps_of(records: Sequence[Record], given: Given) -> tuple[list[Capture], list[str]]:
    """Give the taps of records as captures, and what was decided; a record without a contact is left out.

    Raises
    ------
    MeasurementError
        No record shows a contact, or the velocity of the actuator is not known.
    """
    notes: list[str] = []
    faults: list[str] = []
    taps: list[_TapRecord] = []
    left_out: list[str] = []
    struck: list[Record] = []
    missed: list[Record] = []
    soon: list[tuple[Record, SoonTaps]] = []
    for record in in_compression(records, given, notes, faults):
        onsets = _onsets(record, given)
        if onsets is not None and not onsets:
            missed.append(record)
            continue
        struck.append(record)
        leads = {}
        if onsets is not None:
            soon.append((record, _soon_taps(record, onsets, given)))
            onsets, leads = soon[-1][1].onsets, soon[-1][1].leads_s
        taps += _taps(record, onsets, leads, given, faults, left_out)
    faults += [] if struck else [_without_contact(record, given) for record in missed]
    raise_faults(faults)
    if len(taps) > len(struck):
        told = "1 record" if len(struck) == 1 else f"{len(struck)} records"
        notes.append(f"{told} cut into {len(taps)} taps where the force begins anew")
    notes += [*doubts_of(soon), *_of_actuator(taps)]
    taps = _from_their_places(taps, notes)
    if left_out:
        notes.append(f"taps left out whose beginning was not recorded: {_counted(left_out)}")
    if missed:
        told = _counted([record.place for record in missed])
        notes.append(f"records left out whose force shows no contact{_sought(given)}: {told}: {MISSED}")
    if not any(ColumnMeaning.POSITION in record.values for record in records):
        notes.append(
            "no position was recorded: such taps tell mu_s by peak force and the model of a cell, and no "
            "model by themselves (--column position=NAME if there is one)"
        )
    notes += notes_of_zeros([(tap.record.values[ColumnMeaning.FORCE], tap.onset) for tap in taps])
    numbers, starts = shot_numbers([tap.record for tap in taps]), _contact_times(taps, notes)
    return [_capture(*one, given) for one in zip(numbers, taps, starts, strict=True)], notes


def _counted(places: Sequence[str]) -> str:
    """Tell how many places there are, and the file of the first."""
    first = Path(places[0]).name
    return f"1, in {first}" if len(places) == 1 else f"{len(places)}, the first in {first}"


def _onsets(record: Record, given: Given) -> Sequence[int] | None:
    """Give the samples at which contacts begin; None where t = 0 is said to be the contact."""
    if given.trigger == NO_TRIGGER:
        return None
    time, force = record.times[ColumnMeaning.FORCE], record.values[ColumnMeaning.FORCE]
    if np.ptp(force) == 0.0:
        return []
    return contacts.contact_onsets(time, force, contacts.baseline_of(force, _threshold(given)))


def _soon_taps(record: Record, onsets: Sequence[int], given: Given) -> SoonTaps:
    velocity = given.constants.get("velocity", record.scalars.get("velocity"))
    if not isinstance(velocity, float):
        velocity = _slope(record, onsets[0]) if ColumnMeaning.ACTUATOR in record.values else math.nan
    baseline = contacts.baseline_of(record.values[ColumnMeaning.FORCE], _threshold(given))
    return soon_taps(record, onsets, baseline, given.constants.get("stroke", math.inf), velocity)


def _threshold(given: Given) -> float | None:
    return given.trigger if isinstance(given.trigger, float) else None


def _sought(given: Given) -> str:
    """Name the force of contact, where it was given."""
    threshold = _threshold(given)
    return "" if threshold is None else f" of {threshold:g} N"


def _without_contact(record: Record, given: Given) -> str:
    force = record.values[ColumnMeaning.FORCE]
    noise = contacts.baseline_of(force).noise_std
    way_out = "" if _sought(given) else "give its threshold with --trigger, "
    return (
        f"{record.place}: the force shows no contact{_sought(given)} (largest {force.max():.3g} N above "
        f"noise of {noise:.2g} N): {MISSED}; leave the record out, {way_out}or say --excitation driven"
    )


def _taps(
    record: Record,
    onsets: Sequence[int] | None,
    leads_s: AbstractMapping[int, float],
    given: Given,
    faults: list[str],
    left_out: list[str],
) -> list[_TapRecord]:
    time = record.times[ColumnMeaning.FORCE]
    if onsets is None:
        return _with_velocity([(record, None)], given, faults)
    if len(onsets) == 1:
        begins_at_contact = onsets[0] == 0 and 0.0 <= time[0] < contacts.REST_S
        return _with_velocity([(record, None if begins_at_contact else onsets[0])], given, faults)
    parts: list[tuple[Record, int]] = []
    for onset, after in zip(onsets, (*onsets[1:], None), strict=True):
        end_s = math.inf if after is None else float(time[after]) - leads_s.get(after, contacts.REST_S)
        end_s = end_of_tap(record, float(time[onset]), end_s)
        parts.append(part_of(record, onset, leads_s.get(onset, contacts.REST_S), end_s))
    if onsets[0] == 0 and any(onset >= contacts.CONFIRMING_SAMPLES for _, onset in parts):
        left_out.append(record.place)  # of the others the beginning was recorded
        del parts[0]
    return _with_velocity(parts, given, faults)


def _with_velocity(
    parts: Sequence[tuple[Record, int | None]], given: Given, faults: list[str]
) -> list[_TapRecord]:
    taps = []
    for record, onset in parts:
        velocity = given.constants.get("velocity", record.scalars.get("velocity"))
        varies = isinstance(velocity, float) and math.isnan(velocity)
        of_actuator = (varies or not isinstance(velocity, float)) and ColumnMeaning.ACTUATOR in record.values
        if of_actuator:
            velocity = _slope(record, onset)
        if not isinstance(velocity, float) or not abs(velocity) > 0.0:
            why = ": its column changes within the record, so it was measured" if varies else ""
            faults.append(
                f"{record.place}: the velocity of the actuator is not known{why}; name the column of the "
                f"commanded one with --column velocity=NAME, write it as {record.constant_as}, or give "
                "--set 'velocity=3000 mm/min'"
            )
            continue
        taps.append(_TapRecord(record, onset, abs(velocity), of_actuator))
    return taps


def _of_actuator(taps: Sequence[_TapRecord]) -> list[str]:
    """Tell velocities that nobody said."""
    found = [tap.velocity_m_s / MM_PER_MIN for tap in taps if tap.of_actuator]
    if not found:
        return []
    of = f"velocity {span(found, '.4g')} mm/min taken from the actuator channel about contact"
    return [f"{of}, in {taps_in_words(len(found))} (--set velocity=... says otherwise)"]


def _slope(record: Record, onset: int | None) -> float:
    """Velocity of the actuator about first contact, from its own channel."""
    time, position = record.times[ColumnMeaning.ACTUATOR], record.values[ColumnMeaning.ACTUATOR]
    t0 = record.times[ColumnMeaning.FORCE][onset or 0]
    near = (time >= t0 - 0.01) & (time <= t0 + 0.003)
    if near.sum() < 4:
        return math.nan
    return float(np.polyfit(time[near] - t0, position[near], 1)[0])


def _from_their_places(taps: Sequence[_TapRecord], notes: list[str]) -> list[_TapRecord]:
    """Leave out positions of before a part was put to where it is struck, and tell of it."""
    kept = [replace(tap, record=from_its_place(tap.record, tap.onset)) for tap in taps]
    if changed := sum(before.record is not after.record for before, after in zip(taps, kept, strict=True)):
        told = taps_in_words(changed)
        notes.append(f"positions left out of before the part was put to where it is struck, in {told}")
    return kept


def _contact_times(taps: Sequence[_TapRecord], notes: list[str]) -> list[float]:
    """Time of first contact of each tap in its record [s]."""
    triggered = [tap for tap in taps if tap.onset]
    if triggered:
        times, forces, onsets, velocities = [], [], [], []
        for tap in triggered:
            force = tap.record.values[ColumnMeaning.FORCE]
            times.append(tap.record.times[ColumnMeaning.FORCE])
            forces.append(force - force_at_rest(force, tap.onset))
            onsets.append(tap.onset or 0)
            velocities.append(tap.velocity_m_s)
        refined = iter(contacts.onset_within_sample(times, forces, onsets, velocities))
        step = float(np.median([np.median(np.diff(time)) for time in times]))
        notes.append(
            f"t = 0 put where the force begins, in {taps_in_words(len(triggered))}, good to a part of the "
            f"sampling step of {1e3 * step:.3g} ms; what lies before is kept as pretrigger"
        )
    else:
        refined = iter(())
    if cut_off := sum(tap.onset == 0 for tap in taps):
        told = taps_in_words(cut_off)
        notes.append(f"contact is there from the first sample on in {told}: that is taken for t = 0")
    if any(tap.onset is None for tap in taps):
        notes.append("no samples before contact: the records' own t = 0 is taken")
    return [_start_of(tap, refined) for tap in taps]


def _start_of(tap: _TapRecord, refined: Iterator[float]) -> float:
    if tap.onset is None:
        return 0.0
    return next(refined) if tap.onset else float(tap.record.times[ColumnMeaning.FORCE][0])


def _capture(number: int, tap: _TapRecord, t0: float, given: Given) -> Capture:
    record = tap.record
    channels: dict[str, Channel | None] = {str(q): channel_of(record, q, t0) for q in CHANNELS}
    force = channels["force"]
    if force is not None:
        offset = force_at_rest(force.values, tap.onset)
        channels["force"] = Channel(force.time_s, force.values - offset)
    position = channels["position"]
    start = 0.0
    if position is not None:
        start = _start(position)
        channels["position"] = Channel(position.time_s, position.values - start)
    actuator = channels["actuator"]
    if actuator is not None:
        touching = float(np.interp(0.0, actuator.time_s, actuator.values))
        channels["actuator"] = Channel(actuator.time_s, actuator.values - touching)
    return described(
        number, record, given, channels,
        velocity_m_s=tap.velocity_m_s, start_m=start, direction=direction_of(record, given, position, start),
    )  # fmt: skip


def _start(position: Channel) -> float:
    """Place where the part lay [m]; 0 where the positions count from there already."""
    before = position.values[position.time_s < 0.0]
    if len(before) < 3:
        before = position.values[:3]
    aside = (len(before) + 1) // 4
    place = float(np.sort(before)[aside : len(before) - aside].mean())  # no spike moves it, nor a raster
    noise = noise_of(position.values)
    return place if abs(place) > START_STD * noise / math.sqrt(len(before)) else 0.0
