"""Puts a capture together from the channels of a record and what is constant in it."""

import math

from impactcell.measurements.mapping import Given
from impactcell.measurements.recognition import Quantity
from impactcell.measurements.recorded import Record
from impactcell.records import Capture, Channel


def channel_of(record: Record, quantity: Quantity, shift_s: float = 0.0) -> Channel | None:
    """Give a channel of a record with its times counted from `shift_s`, None where it was not recorded."""
    if quantity not in record.values:
        return None
    return Channel(record.times[quantity] - shift_s, record.values[quantity])


def scalar(record: Record, given: Given, quantity: Quantity, default: float = math.nan) -> float:
    """Value of what is constant in a record: as given for all, else as the record says."""
    value = given.constants.get(str(quantity), record.scalars.get(str(quantity), default))
    return value if isinstance(value, float | int) else default


def described(
    number: int, record: Record, given: Given, channels: dict[str, Channel | None], **known: float
) -> Capture:
    """Put a capture together from its channels and what is constant in its record."""
    covariates = {name: value for name, value in record.scalars.items() if name not in set(Quantity)}
    batch = record.scalars.get(str(Quantity.BATCH))
    return Capture(
        cycle=number,
        velocity_m_s=known.get("velocity_m_s", math.nan),
        mass_kg=scalar(record, given, Quantity.MASS),
        force=channels.get("force"),
        position=channels.get("position"),
        actuator=channels.get("actuator"),
        direction=int(known.get("direction", 1)),
        stroke_m=given.constants.get("stroke", math.inf),
        batch_id=None if batch is None else (f"{batch:g}" if isinstance(batch, float) else batch),
        dwell_s=scalar(record, given, Quantity.DWELL),
        start_m=scalar(record, given, Quantity.START, known.get("start_m", 0.0)),
        covariates=covariates,
    )
