"""What the acquisition hands on: one cycle as received, and the state of the link."""

from dataclasses import dataclass

from impactcell.records import Capture, CycleId


@dataclass(frozen=True, slots=True, eq=False)
class ReceivedCycle:
    """One cycle as received.

    Attributes
    ----------
    capture : Capture
        In SI; without channels where they could not be read.
    cycle_id : CycleId
        Session and cycle: what to acknowledge once it is durable, and where to go on after a restart.
    missed : int
        Cycles right before it that the ring no longer had.
    restarted : bool
        Whether the module was started anew since the last one.
    faults : tuple of str
        What is wrong with it; each names cell, cycle and register.
    """

    capture: Capture
    cycle_id: CycleId
    missed: int
    restarted: bool
    faults: tuple[str, ...]
