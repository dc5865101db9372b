"""Columns that are numbered by the joints of one machine, of which a campaign holds one."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from impactcell.measurements.columns.recognition import (
    VOCABULARY,
    ColumnMeaning,
    name_score,
    normalised,
    rate_name,
)
from impactcell.measurements.table import AGAIN

OF_JOINT = (ColumnMeaning.POSITION, ColumnMeaning.FORCE)
"""Channels of which each joint has its own."""
SHOWN = 3
"""Joints whose options are told."""


@dataclass(frozen=True, slots=True)
class Joints:
    """What is numbered by joints, and which of them is looked at.

    Attributes
    ----------
    numbers : mapping
        Of each column that a joint has of its own, the joint's number.
    channels : mapping
        Of each joint the columns that its position and its force would be.
    chosen : int or None
        The joint of which a channel was named.
    """

    numbers: Mapping[str, int]
    channels: Mapping[int, Mapping[ColumnMeaning, str]]
    chosen: int | None

    def why_out(self, name: str) -> str:
        """Say why a column is left out; empty where it is not."""
        number = self.numbers.get(name)
        if number is None or number == self.chosen:
            return ""
        if self.chosen is None:
            return f"of joint {number}, one of {len(self.channels)}"
        return f"of joint {number}, not of joint {self.chosen}"

    def fault(self) -> str:
        """Say which options take which joint; empty where that was said."""
        if self.chosen is not None or not self.channels:
            return ""
        numbers = sorted(self.channels)
        shown = numbers if len(numbers) <= SHOWN + 1 else [*numbers[:SHOWN], numbers[-1]]
        ways = [f"for {number} {' '.join(_options(self.channels[number]))}" for number in shown]
        more = ", and so on" if len(shown) < len(numbers) else ""
        return (
            f"columns are numbered as of {len(numbers)} joints, and a campaign is of one; say which: "
            f"{', '.join(ways)}{more}; the columns of the others are then left out"
        )


def joints_of(names: Sequence[str], said: Mapping[ColumnMeaning, str]) -> Joints:
    """Tell the joints by whose numbers columns are named; none where fewer than two have a position.

    Parameters
    ----------
    names : sequence of str
        Columns of numbers.
    said : mapping
        Columns that were named for a quantity.
    """
    numbers = {name: number for name in names if (number := joint_number(name)) is not None}
    channels: dict[int, dict[ColumnMeaning, str]] = {}
    for number in sorted(set(numbers.values())):
        of_number = [name for name, of in numbers.items() if of == number]
        found = {meaning: best for meaning in OF_JOINT if (best := _best(of_number, meaning))}
        if ColumnMeaning.POSITION in found:
            channels[number] = found
    if len(channels) < 2 or not _is_of_joints(numbers, channels):
        return Joints({}, {}, None)
    named = (numbers.get(said[meaning]) for meaning in OF_JOINT if meaning in said)
    chosen = next((number for number in named if number is not None), None)
    elsewhere = chosen is None and ColumnMeaning.POSITION in said
    return Joints({}, {}, None) if elsewhere else Joints(_others(numbers, said), channels, chosen)


def joint_number(name: str) -> int | None:
    """Give the number of the joint that a column of position, force or speed is of.

    Examples
    --------
    >>> joint_number("q7"), joint_number("tau_meas2"), joint_number("joint_3_velocity"), joint_number("x1")
    (7, 2, 3, None)
    """
    text = normalised(AGAIN.sub("", name))
    found = re.findall(r"\d+", text)
    if len(found) != 1 or any(text in VOCABULARY[meaning].symbols.split() for meaning in OF_JOINT):
        return None
    is_of_motion = any(name_score(name, meaning)[0] > 0.0 for meaning in OF_JOINT) or rate_name(name)
    return int(found[0]) if is_of_motion else None


def _is_of_joints(numbers: Mapping[str, int], channels: Mapping[int, Mapping[ColumnMeaning, str]]) -> bool:
    """Whether there is more of each number than a position, or a sign that joints have: not two sensors."""
    words = {name_score(of[ColumnMeaning.POSITION], ColumnMeaning.POSITION)[1] for of in channels.values()}
    rates = {number for name, number in numbers.items() if rate_name(name)}
    forces = {number for number, of in channels.items() if ColumnMeaning.FORCE in of}
    signs = set(VOCABULARY[ColumnMeaning.POSITION].symbols.split())
    return bool(words <= signs) or len(rates & set(channels)) > 1 or len(forces) > 1


def _others(numbers: Mapping[str, int], said: Mapping[ColumnMeaning, str]) -> dict[str, int]:
    """Leave what was named for a quantity out of what is numbered."""
    return {name: number for name, number in numbers.items() if name not in said.values()}


def _best(names: Sequence[str], meaning: ColumnMeaning) -> str | None:
    """Give the column of a joint that is a channel: what was measured before what was filtered."""
    scored = [name for name in names if name_score(name, meaning)[0] > 0.0 and not rate_name(name)]
    return min(scored, key=_remoteness, default=None)


def _remoteness(name: str) -> int:
    text = normalised(name)
    return 0 if "meas" in text or "act" in text else 2 if "filt" in text else 1


def _options(channels: Mapping[ColumnMeaning, str]) -> Iterator[str]:
    for meaning, name in channels.items():
        yield f"--column '{meaning}={name}'"
