"""Formats of the files that people write and share, by the number at their head."""

from typing import Final

NEWEST: Final = 1
"""Of cell files, models, register maps and base models alike: there has been no other yet."""
WAY_OUT: Final = "it was written for a newer version of impactcell: run that"
"""What to do with a file of a later format; another one would lose what only that version knows."""


def newer_format(number: object) -> str:
    """Say what to do with a file of this format where it is a later one than ours, else nothing.

    >>> newer_format(9), newer_format(1), newer_format("9")
    ('it was written for a newer version of impactcell: run that', '', '')
    """
    is_newer = isinstance(number, int) and not isinstance(number, bool) and number > NEWEST
    return WAY_OUT if is_newer else ""


def newer_file(number: object) -> str:
    """Say of a file what its format is and what to do, where it is a later one than ours, else nothing.

    >>> newer_file(9), newer_file(1)
    ('is of format 9; it was written for a newer version of impactcell: run that', '')
    """
    way_out = newer_format(number)
    return f"is of format {number}; {way_out}" if way_out else ""
