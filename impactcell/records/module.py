"""What a module says of itself and of what is to come, and the state of the link to it."""

from dataclasses import dataclass
from typing import Final

NOT_CONNECTED_YET: Final = "not connected yet (starting)"
"""Why there is no link before the first attempt has succeeded or failed."""


@dataclass(frozen=True, slots=True)
class CycleId:
    """A cycle in the module's life: the session (start) of the module and its number in it."""

    session: int
    cycle: int


@dataclass(frozen=True, slots=True)
class BatchAnnouncement:
    """A change of batch that the PLC announces through the module; `sequence` 0 before the first."""

    sequence: int = 0
    from_cycle: int = 0
    batch_id: str = ""


@dataclass(frozen=True, slots=True)
class ModuleStatus:
    """State of the link and what has come over it since the start of the service.

    Attributes
    ----------
    connected : bool
        Whether the right module answers.
    reason : str
        Why it does not.
    answered : bool
        Whether something answers in its place: another protocol, another module, or registers of another map.
    round_trip_s : float
        Of the last request; nan before the first.
    received, missed, unreadable : int
        Cycles received (unreadable ones among them), gone from the ring before they could be read (or never
        stored, as the service counts them), and received without content.
    discarded : int
        Readings thrown away because the capture changed meanwhile or its CRC did not fit.
    restarts, reconnects : int
        Starts of the module seen; connections made after the first.
    """

    connected: bool = False
    reason: str = NOT_CONNECTED_YET
    answered: bool = False
    round_trip_s: float = float("nan")
    received: int = 0
    missed: int = 0
    unreadable: int = 0
    discarded: int = 0
    restarts: int = 0
    reconnects: int = 0
