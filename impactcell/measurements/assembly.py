"""Makes a campaign of records: excitation, shots, t = 0, directions, and what is constant in each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from impactcell.campaign import COLUMNS, Campaign, Coordinate, Excitation, Sensor
from impactcell.campaign import write as write_directory
from impactcell.errors import CampaignError, MeasurementError
from impactcell.measurements.columns.given_values import Given
from impactcell.measurements.columns.mapping import Mapping
from impactcell.measurements.columns.motion_signals import note_of_drive, ways_from_signals
from impactcell.measurements.columns.recognition import CHANNELS, ColumnMeaning
from impactcell.measurements.columns.repeated_rows import without_repeats
from impactcell.measurements.faults import raise_faults
from impactcell.measurements.notation.units import Dimension
from impactcell.measurements.records.alike import check_channels_alike, check_scalars_alike, left_empty
from impactcell.measurements.records.measured_records import Record
from impactcell.measurements.records.recorders import of_one_recording, records_of
from impactcell.measurements.records.stated_constants import (
    has_unread_mass,
    notes_of_stated,
    refuse_unread_velocity,
)
from impactcell.measurements.table import Table
from impactcell.measurements.taps.captures import channel_of, described, direction_of, shot_numbers
from impactcell.measurements.taps.cutting import taps_of
from impactcell.measurements.taps.excitation import SWAPPED, excitation_of, looks_swapped, notes_of_swings
from impactcell.quality import Fault, copies, inspect_campaign, notes_of, refuse_unusable
from impactcell.records import Capture, Channel, Samples

STANDARD_GRAVITY_M_S2 = 9.81
"""Acceleration of free fall where nothing is given; the campaign format's own default."""
ROTATING = (Dimension.TORQUE, Dimension.ANGLE, Dimension.ANGULAR_VELOCITY, Dimension.INERTIA)
"""Units of force, position and mass where the coordinate is an angle."""


@dataclass(frozen=True, slots=True, eq=False)
class Imported:
    """A campaign made of measurement files, and what was decided on the way.

    Attributes
    ----------
    campaign : Campaign
    notes : tuple of str
        What was guessed of shots and of what is constant in them, and what that leaves uncertain.
    """

    campaign: Campaign
    notes: tuple[str, ...]


def make_campaign(tables: Sequence[Table], mapping: Mapping) -> Imported:
    """Make a campaign of tables whose columns have been understood.

    Raises
    ------
    MeasurementError
        What is missing or wrong, by file and line or column, and the way out.
    """
    if mapping.faults:
        raise MeasurementError("\n".join(mapping.faults))
    given = mapping.given
    tables, notes_of_rows = without_repeats(tables, given)
    tables = of_one_recording(tables, mapping)
    records, notes_of_recorders = records_of(tables, mapping)
    check_channels_alike(records, mapping)
    notes = [*notes_of_rows, *notes_of_recorders, *notes_of_stated(tables, records, mapping)]
    excitation = given.excitation or excitation_of(records, notes)
    _check_channels(records, mapping, excitation)
    coordinate = _coordinate(mapping, excitation)
    notes += _of_sums(mapping, excitation)
    notes += note_of_drive(mapping.assignments) if excitation is Excitation.FREE_SLIDE else []
    notes += (of_swings := notes_of_swings(records, excitation, coordinate))
    check_scalars_alike(tables, mapping, excitation)
    notes += left_empty(tables, records, mapping)
    if excitation is Excitation.TAP:
        refuse_unread_velocity(tables, records, mapping)
        captures, notes_of_taps = taps_of(records, given)
        notes += notes_of_taps
    else:
        numbered = zip(shot_numbers(records), records, strict=True)
        captures = [_whole(number, record, given, excitation) for number, record in numbered]
        notes += _of_taps_only(given, excitation)
    notes += (of_copies := _of_copies(records))
    is_swapped = looks_swapped(records)
    notes += [SWAPPED] if is_swapped else []
    if (position := mapping.of(ColumnMeaning.POSITION)) is not None and position.summed_up:
        captures = [_with_summed_position(capture) for capture in captures]
    if all(math.isnan(capture.mass_kg) for capture in captures):
        notes.append(_without_mass(coordinate, excitation, tables))
    if excitation is Excitation.TAP and "stroke" not in given.constants:
        notes.append(
            "no stroke is stated: the actuator is taken to halt as it loses contact; give --set stroke=1.5mm"
        )
    campaign = Campaign(
        excitation,
        tuple(captures),
        gravity_m_s2=given.constants.get("gravity", STANDARD_GRAVITY_M_S2),
        stroke_m=given.constants.get("stroke", math.inf) if excitation is Excitation.TAP else math.inf,
        sensors=_sensors(captures),
        columns=_columns(captures, excitation, coordinate),
        coordinate=coordinate,
    )
    data_faults = inspect_campaign(campaign)
    if of_copies:
        data_faults = tuple(one for one in data_faults if one.fault is not Fault.COPY)
    if coordinate is Coordinate.ROTATION:  # whether it swings back by its weight the base model says
        data_faults = tuple(one for one in data_faults if one.fault is not Fault.PRESLIDING_ONLY)
    try:
        refuse_unusable(campaign, data_faults)
    except CampaignError as error:
        told = [SWAPPED] if is_swapped else [str(error), *of_swings]
        raise MeasurementError("\n".join(f"{records[0].place}: {fault}" for fault in told)) from error
    return Imported(campaign, (*notes, *notes_of(data_faults)))


def write_campaign(tables: Sequence[Table], mapping: Mapping, directory: Path) -> Imported:
    """Make a campaign and write it to a directory that does not exist yet, complete or not at all.

    Raises
    ------
    MeasurementError, CampaignError
        Nothing has been written.
    """
    imported = make_campaign(tables, mapping)
    write_directory(imported.campaign, directory)
    return imported


def _of_copies(records: Sequence[Record]) -> list[str]:
    """Tell records that have the samples of another: the files, where each is one."""
    return [
        f"{records[place].place}: has the samples of {records[first].place}, noise and all, and counts as "
        f"shots of its own; where it is a copy, leave it out"
        for place, first in copies([list(record.values.values()) for record in records])
    ]


def _without_mass(coordinate: Coordinate, excitation: Excitation, tables: Sequence[Table]) -> str:
    if coordinate is Coordinate.ROTATION:
        return (
            "no inertia is stated: the base model has to say it (inertia_kg_m2); "
            'give --set "mass=0.02 kg m²" where it is not one for all'
        )
    stated = "stated in its unit" if has_unread_mass(tables) else "stated"
    way = "give --set mass=18.9kg"
    if excitation is Excitation.DRIVEN:
        return f"no mass is {stated}: a base model has to say it (mass_kg), else it is fitted; {way}"
    return f"no mass is {stated}: it is fitted, and only friction over mass is seen; {way}"


def _of_taps_only(given: Given, excitation: Excitation) -> list[str]:
    """Tell what was given and counts for taps alone, where there are none; a slide has a direction too."""
    of_taps = (
        ("velocity", "stroke", "direction") if excitation is Excitation.DRIVEN else ("velocity", "stroke")
    )
    names = [name for name in of_taps if name in given.constants]
    names += [] if given.trigger is None else ["trigger"]
    if not names:
        return []
    return [f"given, and not used, for it is of taps: {', '.join(names)} (--excitation tap says otherwise)"]


def _of_sums(mapping: Mapping, excitation: Excitation) -> list[str]:
    """Tell a position that was summed up from a speed, which a tap is too short and exact for.

    Raises
    ------
    MeasurementError
        The records are of taps.
    """
    position = mapping.of(ColumnMeaning.POSITION)
    if position is None or not position.summed_up:
        return []
    name = position.column
    if excitation is Excitation.TAP:
        raise MeasurementError(
            f"column {name!r} is a speed, whose noise adds up in a position; of a tap the position has to be "
            f"measured: leave the column out with --column 'ignored={name}', or say --excitation driven for "
            f"what is no tap"
        )
    begun = "from 0 at the first sample of each record: where that was is not known"
    return [f"position summed up from the speed {name!r}, {begun}"]


def _with_summed_position(capture: Capture) -> Capture:
    position = capture.position
    return replace(capture, position=None if position is None else replace(position, summed_up=True))


def _check_channels(records: Sequence[Record], mapping: Mapping, excitation: Excitation) -> None:
    needed = {
        Excitation.TAP: {ColumnMeaning.FORCE},
        Excitation.FREE_SLIDE: {ColumnMeaning.POSITION},
        Excitation.DRIVEN: {ColumnMeaning.FORCE, ColumnMeaning.POSITION},
    }[excitation]
    lacking = [
        f"{record.place}: has no {' and no '.join(sorted(needed - set(record.values)))}, which a campaign of "
        f"excitation {excitation} needs; {_way_to_channel(mapping)}"
        for record in records
        if needed - set(record.values)
    ]
    raise_faults(lacking)


def _way_to_channel(mapping: Mapping) -> str:
    """Say how what is needed can be given."""
    channels = (ColumnMeaning.POSITION, ColumnMeaning.FORCE)
    lacking = [meaning for meaning in channels if mapping.of(meaning) is None]
    if lacking and (ways := ways_from_signals(mapping.assignments, lacking)):
        return f"{'; '.join(ways)}; else name the column, as with --column {lacking[0]}=NAME"
    return "name the column, as with --column force=NAME, or say another --excitation"


def _whole(number: int, record: Record, given: Given, excitation: Excitation) -> Capture:
    """Give a record as it is, times counted from its first sample; what is driven goes either way."""
    first = min(float(time[0]) for time in record.times.values())
    channels = {str(q): channel_of(record, q, first) for q in CHANNELS}
    position = channels["position"]
    if excitation is Excitation.DRIVEN or position is None:
        return described(number, record, given, channels)
    direction = direction_of(record, given, position, float(np.median(position.values[:3])))
    return described(number, record, given, channels, direction=direction)


def _coordinate(mapping: Mapping, excitation: Excitation) -> Coordinate:
    """Rotation where the units of the channels are of one: N m, rad, kg m²."""
    dimensions = {
        str(item.meaning): item.unit.dimension
        for item in mapping.assignments
        if item.unit is not None and item.meaning in (*CHANNELS, ColumnMeaning.MASS)
    }
    rotating = {name for name, dimension in dimensions.items() if dimension in ROTATING}
    if not rotating:
        return Coordinate.TRANSLATION
    if rotating != set(dimensions):
        told = ", ".join(f"{name} in {dimension.value}" for name, dimension in dimensions.items())
        raise MeasurementError(
            f"{told}: some are of a rotation and some of a translation; give units that fit, or what a turn "
            f"moves, as --gain 'position=20 mm/rev'"
        )
    if excitation is Excitation.TAP:
        raise MeasurementError("a tap goes along a line; say --excitation driven for what rotates")
    return Coordinate.ROTATION


def _columns(captures: Sequence[Capture], excitation: Excitation, coordinate: Coordinate) -> tuple[str, ...]:
    names = ["shot"]
    if excitation is Excitation.TAP:
        names += ["velocity_mm_per_min"]
    names += [COLUMNS[coordinate]["mass"]]
    if excitation is not Excitation.DRIVEN:
        names += ["direction"]
    if any(capture.batch_id is not None for capture in captures):
        names.append("batch")
    if any(math.isfinite(capture.dwell_s) for capture in captures):
        names.append("dwell_s")
    if any(capture.start_m != 0.0 for capture in captures):
        names.append(COLUMNS[coordinate]["start"])
    return (*names, *dict.fromkeys(name for capture in captures for name in capture.covariates))


def _sensors(captures: Sequence[Capture]) -> dict[str, Sensor]:
    sensors = {}
    for name in ("force", "position", "actuator"):
        channels: list[Channel] = [c for capture in captures if (c := getattr(capture, name)) is not None]
        if channels:
            steps: list[Samples] = [
                np.diff(channel.time_s) for channel in channels if len(channel.time_s) > 1
            ]
            step = float(np.median(np.concatenate(steps))) if steps else math.nan
            rate_hz = float(f"{1.0 / step:.6g}") if step > 0.0 else None
            sensors[name] = Sensor(rate_hz, None, any(channel.summed_up for channel in channels))
    return sensors
