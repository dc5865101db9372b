"""Puts a capture together from the channels of a record and what is constant in it."""

import math
import re
from collections.abc import Sequence

import numpy as np

from impactcell.campaign.shots import LARGEST_SHOT
from impactcell.measurements.columns.given_values import Given
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.notation.numbers import number_text
from impactcell.measurements.records.measured_records import Record
from impactcell.records import Capture, Channel

RESTING = 5
"""Samples at the end of a position by whose mean is told where the part came to rest."""


def channel_of(record: Record, meaning: ColumnMeaning, shift_s: float = 0.0) -> Channel | None:
    """Give a channel of a record with its times counted from `shift_s`, None where it was not recorded."""
    if meaning not in record.values:
        return None
    return Channel(record.times[meaning] - shift_s, record.values[meaning])


def scalar(record: Record, given: Given, meaning: ColumnMeaning, default: float = math.nan) -> float:
    """Value of what is constant in a record: as given for all, else as the record says."""
    value = given.constants.get(str(meaning), record.scalars.get(str(meaning), default))
    return value if isinstance(value, float | int) else default


def direction_of(record: Record, given: Given, position: Channel | None, start_m: float) -> float:
    """Give +1 or -1: as said, else to which side of `start_m` the part came to rest; else +1."""
    said = scalar(record, given, ColumnMeaning.DIRECTION)
    if math.isnan(said) and position is not None:
        said = float(np.median(position.values[-RESTING:])) - start_m
    return -1.0 if said < 0.0 else 1.0


def shot_numbers(records: Sequence[Record]) -> list[int]:
    """Give the numbers of shots: as the records have them where those can be, else counted from 1.

    A campaign has whole numbers from 1, each once, in whatever order.
    """
    said = [int(record.shot) if re.fullmatch("[0-9]{1,16}", record.shot) else 0 for record in records]
    if len(set(said)) == len(said) and all(0 < number < LARGEST_SHOT for number in said):
        return said
    return list(range(1, len(records) + 1))


def described(
    number: int, record: Record, given: Given, channels: dict[str, Channel | None], **known: float
) -> Capture:
    """Put a capture together from its channels and what is constant in its record."""
    covariates = {name: value for name, value in record.scalars.items() if name not in set(ColumnMeaning)}
    batch = record.scalars.get(str(ColumnMeaning.BATCH))
    return Capture(
        cycle=number,
        velocity_m_s=known.get("velocity_m_s", math.nan),
        mass_kg=scalar(record, given, ColumnMeaning.MASS),
        force=channels.get("force"),
        position=channels.get("position"),
        actuator=channels.get("actuator"),
        direction=int(known.get("direction", 1)),
        stroke_m=given.constants.get("stroke", math.inf),
        batch_id=number_text(batch) if isinstance(batch, float) else batch,
        dwell_s=scalar(record, given, ColumnMeaning.DWELL),
        start_m=scalar(record, given, ColumnMeaning.START, known.get("start_m", 0.0)),
        covariates=covariates,
    )
