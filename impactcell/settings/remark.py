"""What is said of a cell as a whole, before its file's lines are looked up."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Remark:
    """Something about a cell, by the keys of its file that say it.

    Attributes
    ----------
    place : tuple of str
        Keys that lead there; empty where it is about the whole.
    is_fault : bool
        The cell cannot do what it is for; else it can, but its user should know.
    """

    place: tuple[str, ...]
    message: str
    is_fault: bool = True
