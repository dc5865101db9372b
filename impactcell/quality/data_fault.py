"""What is wrong with recorded data, as it is told before any physics is blamed."""

import enum
from dataclasses import dataclass


class Fault(enum.StrEnum):
    """Kinds of what can be wrong with a record."""

    OUTLIERS = "outliers"
    CLIPPING = "clipping"
    DROPOUTS = "dropouts"
    DRIFT = "drift"
    LATE_CHANNEL = "late channel"
    CONSTANT = "constant channel"
    NO_MOTION = "no motion"
    PRESLIDING_ONLY = "presliding only"
    COPY = "copy"


@dataclass(frozen=True, slots=True)
class DataFault:
    """One thing that is wrong.

    Attributes
    ----------
    fault : Fault
    channel : str
        `force`, `position` or `actuator`.
    message : str
        What, where, how many, and the way out; without the shot.
    shot : int or None
        None where it shows over all of them.
    end : float or None
        Value at which the channel is clipped; None of other faults.
    """

    fault: Fault
    channel: str
    message: str
    shot: int | None = None
    end: float | None = None
