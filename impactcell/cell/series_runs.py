"""What the numbers of a series say: runs whose cycles are counted anew, and numbers that are wrong.

A module says itself that it has restarted; a file says it only by its numbers. By these alone a run of up to
`TrackerSettings.reorder_limit` cycles would be the one before come twice, and be left out. A wrong number is
known by those around it: without them it would be cycles that were not measured, and a restart after them.
"""

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from impactcell.errors import SeriesError
from impactcell.tracking.wear_batch import FrictionObservation

FEWEST_REPEATS = 3
"""Cycles in a row that must come again before they are a run: one or two are measurements that came twice."""
MOST_OTHERS = 0.5
"""Share of them with another value from which on they are a run: a run has few values of the one before, by
rounding, a copy none of its own."""


def misnumbered(observations: Sequence[FrictionObservation], reorder_limit: int) -> dict[int, str]:
    """Places at which one number is far from both beside it, which go on in their order; each with a note."""
    found: dict[int, str] = {}
    before = observations[0].cycle if observations else 0
    for place, (here, following) in enumerate(pairwise(observations[1:]), 1):
        cycle, after = here.cycle, following.cycle
        if before < after and not before - reorder_limit <= cycle <= after + reorder_limit:
            found[place] = f"stands between cycles {before} and {after}, not used: correct its number"
        else:
            before = cycle
    return found


def told_apart(observations: Sequence[FrictionObservation], reorder_limit: int) -> list[FrictionObservation]:
    """Give each run a session of its own, where there are several and nobody has said so.

    Raises
    ------
    SeriesError
        Cycles come again, some with the same value and some with another: no copy, and no run either.
    """
    begins = [] if any(seen.session for seen in observations) else _begins(observations, reorder_limit)
    if not begins:
        return list(observations)
    return [replace(seen, session=1 + bisect_right(begins, at)) for at, seen in enumerate(observations)]


def _begins(observations: Sequence[FrictionObservation], reorder_limit: int) -> list[int]:
    """Places at which another run begins."""
    begins: list[int] = []
    values: dict[int, float] = {}
    previous = highest = -1
    for place, observation in enumerate(observations):
        cycle = observation.cycle
        if cycle < previous:
            is_far = highest - cycle > reorder_limit
            block = _ascending(observations, place, highest)
            if _is_run(block, values, may_be_either=is_far):
                begins.append(place)
            if is_far or begins[-1:] == [place]:
                values, highest = {}, cycle
        values.setdefault(cycle, observation.mu_s)
        previous, highest = cycle, max(highest, cycle)
    return begins


def _ascending(observations: Sequence[FrictionObservation], first: int, highest: int) -> dict[int, float]:
    """Values of the cycles from `first` on, up to `highest`, for as long as their numbers do not fall."""
    block: dict[int, float] = {}
    newest = observations[first].cycle
    for place in range(first, len(observations)):
        cycle = observations[place].cycle
        if not newest <= cycle <= highest:
            break
        newest = cycle
        block.setdefault(cycle, observations[place].mu_s)
    return block


def _is_run(block: Mapping[int, float], values: Mapping[int, float], *, may_be_either: bool) -> bool:
    """Whether cycles of which some were there before are another run, and no copy."""
    again = [
        cycle
        for cycle in block.keys() & values.keys()
        if not (math.isnan(block[cycle]) or math.isnan(values[cycle]))
    ]
    if len(again) < FEWEST_REPEATS:
        return False
    others = sum(block[cycle] != values[cycle] for cycle in again)
    if others >= MOST_OTHERS * len(again):
        return True
    if others and not may_be_either:
        raise SeriesError(
            f"cycles {min(again)} to {max(again)} come again, {others} of {len(again)} with another value: "
            "leave out those that are copies, or, where they are another run, number them on from "
            f"{max(values) + 1}"
        )
    return False
