"""The conditions of a cell and their states."""

import enum
import math
from dataclasses import dataclass, field

LARGEST_STATISTIC = 1000.0
"""Of a change, in nats, or of a miss, in standard deviations; more is told as this, infinity too: how certain
it is beyond cannot be told, and what is told has to be a number for JSON and those who draw it."""


class Shelving(enum.Enum):
    """Shelved states of OPC UA Part 9, ShelvedStateMachineType."""

    UNSHELVED = "unshelved"
    TIMED = "timed"
    ONE_SHOT = "one_shot"


@dataclass(frozen=True, slots=True)
class Evidence:
    """Why an alarm was raised; nan and 0 where a rule has no such figure.

    Attributes
    ----------
    statistic, threshold : float
        What was compared with what.
    change_cycle : int
        Estimated first cycle after the change.
    size, size_std : float
        Estimated size of the change, in the unit of what is watched.
    false_alarm_cycles, false_alarm_days : float
        Designed mean time between false alarms, in cycles and in days at the present rate.
    """

    statistic: float = float("nan")
    threshold: float = float("nan")
    change_cycle: int = 0
    size: float = float("nan")
    size_std: float = float("nan")
    false_alarm_cycles: float = float("nan")
    false_alarm_days: float = float("nan")

    @property
    def told_size(self) -> float:
        """Size as it is told to people: nan where its standard deviation is infinite, and it says nothing."""
        return float("nan") if math.isinf(self.size_std) else self.size


@dataclass(frozen=True, slots=True)
class Alarm:
    """State of one condition after ISA-18.2 / OPC UA Part 9; moved only by `impactcell.alarms`.

    Attributes
    ----------
    name : str
        Browse name of the condition, as its rule in `impactcell.alarms.rules` declares it.
    severity : int
        1-1000, as in OPC UA.
    message, message_de : str
        Of the last activation, and of what has changed since, for a shift worker: English and German; empty
        before the first.
    cycle, time_ns : int
        Cycle and time of the last transition.
    activation : int
        Tells the last activation from those before: its time, or more where that is not later; 0 before the
        first.
    active_ns, enabled_ns, comment_ns : int
        Time at which `active`, `enabled` and `comment` came to be what they are; 0 where it is not known.
    comment, comment_user : str
        The last comment since the alarm became active, and whose it is.
    user : str
        Who acted last since then, with a comment or without one.
    """

    name: str
    enabled: bool = True
    active: bool = False
    acknowledged: bool = True
    confirmed: bool = True
    shelving: Shelving = Shelving.UNSHELVED
    shelved_until_ns: int = 0
    suppressed: bool = False
    out_of_service: bool = False
    severity: int = 500
    message: str = ""
    message_de: str = ""
    cycle: int = 0
    time_ns: int = 0
    activation: int = 0
    evidence: Evidence = field(default_factory=Evidence)
    comment: str = ""
    user: str = ""
    active_ns: int = 0
    enabled_ns: int = 0
    comment_ns: int = 0
    comment_user: str = ""
