"""What came of reading a capture: the capture, or why there is none."""

import enum
from dataclasses import dataclass

from impactcell.records import Capture


class NotFetched(enum.Enum):
    """Why a cycle was not read although the status block has it; none of these is a fault of the link."""

    OVERWRITTEN = "the module has put a newer cycle in its place"
    NOT_SHOWN = "its slot shows another cycle: the status block is wrong, or the window"
    TAKEN = "it has been taken before: the status block is old, or wrong"
    NOT_MADE = "the module has made no cycle since it was started"
    NOT_YET = "no reading of it was of use yet; the ring still holds it"


@dataclass(frozen=True, slots=True, eq=False)
class FetchedCapture:
    """What came of reading one cycle.

    Attributes
    ----------
    header : bytes
        Words of the header, for telling whether the same is read again; empty where there was none.
    readable : bool
        False if it has no content but its number.
    faults : tuple of str
        What is wrong; each names cell, cycle and register.
    """

    capture: Capture
    header: bytes
    readable: bool
    faults: tuple[str, ...]
