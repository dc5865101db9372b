"""What the numbers of a series say: runs whose cycles are counted anew, and numbers that are wrong.

A module says itself that it has restarted; a file says it only by its numbers. By these alone a run of up to
`TrackerSettings.reorder_limit` cycles would be the one before come twice, and be left out. A wrong number is
known by those around it: without them it would be cycles that were not measured, and a restart after them.
"""

import math
from bisect import bisect_right
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from impactcell.errors import SeriesError
from impactcell.tracking.wear_batch import FrictionObservation

FEWEST_REPEATS = 3
"""Cycles in a row that must come again before they are a run: one or two are measurements that came twice."""
MOST_OTHERS = 0.5
"""Share of them with another value from which on they are a run: a run has few values of the one before, by
rounding, a copy none of its own."""
CLOSE = 10
"""Cycles in a row among which `FEWEST_REPEATS` must come again otherwise for their rows to be of two things:
what was measured twice by chance is farther apart."""


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
        Cycles come again, some with the same value and some with another: no copy, and no run either. Or
        they do so one by one, with other values or batches: rows of two cells, say.
    """
    begins = [] if any(seen.session for seen in observations) else _begins(observations, reorder_limit)
    if not begins:
        return list(observations)
    return [replace(seen, session=1 + bisect_right(begins, at)) for at, seen in enumerate(observations)]


def _begins(observations: Sequence[FrictionObservation], reorder_limit: int) -> list[int]:
    """Places at which another run begins."""
    begins: list[int] = []
    seen: dict[int, FrictionObservation] = {}
    others: dict[tuple[int, int], int] = {}
    counted = 0
    previous = highest = -1
    for place, observation in enumerate(observations):
        cycle = observation.cycle
        if cycle < previous:
            is_far = highest - cycle > reorder_limit
            block = _ascending(observations, place, highest)
            if _is_run(block, seen, may_be_either=is_far):
                begins.append(place)
            if is_far or begins[-1:] == [place]:
                seen, highest = {}, cycle
        first = seen.setdefault(cycle, observation)
        counted += first is observation
        if _is_other(observation, first):
            others.setdefault((len(begins), cycle), counted)
        previous, highest = cycle, max(highest, cycle)
    _refuse_rows_of_two([cycle for _, cycle in others], list(others.values()))
    return begins


def _ascending(
    observations: Sequence[FrictionObservation], first: int, highest: int
) -> dict[int, FrictionObservation]:
    """Give the cycles from `first` on, up to `highest`, for as long as their numbers do not fall."""
    block: dict[int, FrictionObservation] = {}
    newest = observations[first].cycle
    for place in range(first, len(observations)):
        cycle = observations[place].cycle
        if not newest <= cycle <= highest:
            break
        newest = cycle
        block.setdefault(cycle, observations[place])
    return block


def _is_other(observation: FrictionObservation, first: FrictionObservation) -> bool:
    """Whether a cycle that came again is no copy: its value or its batch is another, where both have one."""
    batches = {observation.batch_id, first.batch_id} - {None}
    is_missing = math.isnan(observation.mu_s) or math.isnan(first.mu_s)
    return len(batches) > 1 or (observation.mu_s != first.mu_s and not is_missing)


def _refuse_rows_of_two(cycles: Collection[int], counted: Sequence[int]) -> None:
    """Refuse cycles that come again one by one, each with how many cycles there were by then."""
    if any(last - first < CLOSE for first, last in zip(counted, counted[FEWEST_REPEATS - 1 :], strict=False)):
        raise SeriesError(
            f"cycles come again, {len(cycles)} of those from {min(cycles)} to {max(cycles)} with another "
            "value or batch: where the rows are of several cells, track each alone; where each is a cycle of "
            "its own, number them on; where a cycle was measured again, keep one row of it"
        )


def _is_run(
    block: Mapping[int, FrictionObservation],
    seen: Mapping[int, FrictionObservation],
    *,
    may_be_either: bool,
) -> bool:
    """Whether cycles of which some were there before are another run, and no copy."""
    again = [
        cycle
        for cycle in block.keys() & seen.keys()
        if not (math.isnan(block[cycle].mu_s) or math.isnan(seen[cycle].mu_s))
    ]
    if len(again) < FEWEST_REPEATS:
        return False
    others = sum(_is_other(block[cycle], seen[cycle]) for cycle in again)
    if others >= MOST_OTHERS * len(again):
        return True
    if others and not may_be_either:
        raise SeriesError(
            f"cycles {min(again)} to {max(again)} come again, {others} of {len(again)} with another value or "
            "batch: leave out those that are copies, or, where they are another run, number them on from "
            f"{max(seen) + 1}"
        )
    return False
