"""What the acquisition hands on: one cycle as received, and the state of the link."""

from dataclasses import dataclass

from impactcell.fieldbus.capture_ring import Mark
from impactcell.records import Capture


@dataclass(frozen=True, slots=True, eq=False)
class Reception:
    """One cycle as received.

    Attributes
    ----------
    capture : Capture
        In SI; without channels where they could not be read.
    mark : Mark
        Session and cycle: what to acknowledge once it is durable, and where to go on after a restart.
    missed : int
        Cycles right before it that the ring no longer had.
    restarted : bool
        Whether the module was started anew since the last one.
    faults : tuple of str
        What is wrong with it; each names cell, cycle and register.
    """

    capture: Capture
    mark: Mark
    missed: int = 0
    restarted: bool = False
    faults: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ModuleStatus:
    """State of the link and what has come over it since the start of the service.

    Attributes
    ----------
    connected : bool
        Whether the right module answers.
    reason : str
        Why it does not.
    round_trip_s : float
        Of the last request; nan before the first.
    received, missed, unreadable : int
        Cycles received (unreadable ones among them), gone from the ring before they could be read, and
        received without content.
    discarded : int
        Readings thrown away because the capture changed meanwhile or its CRC did not fit.
    restarts, reconnects : int
        Starts of the module seen; connections made after the first.
    """

    connected: bool = False
    reason: str = "not connected yet"
    round_trip_s: float = float("nan")
    received: int = 0
    missed: int = 0
    unreadable: int = 0
    discarded: int = 0
    restarts: int = 0
    reconnects: int = 0
