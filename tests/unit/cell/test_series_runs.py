"""Cycles that come again in a series: another run of the counter, a copy, or what nobody can tell."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.cell.series_replay import replay
from impactcell.cell.series_runs import misnumbered, told_apart
from impactcell.errors import SeriesError
from impactcell.tracking.wear_batch import FrictionObservation, TrackerSettings

LIMIT = TrackerSettings().reorder_limit


def rows(*runs: list[int], seed: int = 6, digits: int = 6) -> list[FrictionObservation]:
    """Give each cycle a value of its own."""
    cycles = [cycle for run in runs for cycle in run]
    values = np.random.default_rng(seed).normal(0.2, 0.002, len(cycles)).round(digits).tolist()
    return [FrictionObservation(cycle, mu_s, 0.002) for cycle, mu_s in zip(cycles, values, strict=True)]


def sessions(observations: list[FrictionObservation]) -> list[int]:
    return [observation.session for observation in told_apart(observations, LIMIT)]


def counted(last: int, first: int = 1) -> list[int]:
    return list(range(first, last + 1))


@pytest.mark.parametrize(
    "runs",
    [
        (counted(60), counted(60)),
        (counted(60), counted(20), counted(60)),
        (counted(5), counted(60)),
        (counted(60), counted(70, first=50)),
        (counted(60), [1, 2, 4, 3, *counted(60, first=5)]),
        (list(range(10, 610, 10)), list(range(10, 610, 10))),
        (counted(60)[::2], counted(60)),
    ],
)
def test_cycles_that_come_again_with_other_values_are_another_run(runs: tuple[list[int], ...]) -> None:
    series = rows(*runs)
    assert sessions(series) == [number for number, run in enumerate(runs, 1) for _ in run]
    tracked = replay(TrackerSettings(), series)
    assert tracked.used == len(series)
    restarts = [note for _, note in tracked.notes if "restarted" in note]
    assert restarts == [f"cycle numbers restarted at {run[0]}" for run in runs[1:]]


def test_values_that_are_alike_by_rounding_are_another_run_still() -> None:
    series = rows(counted(60), counted(60), digits=3)
    assert sum(a.mu_s == b.mu_s for a, b in zip(series[:60], series[60:], strict=True)) > 3
    assert replay(TrackerSettings(), series).used == 120


@pytest.mark.parametrize(
    "series",
    [
        rows(counted(60)),
        rows(counted(60)) * 2,
        rows(counted(60)) + rows(counted(60))[40:],
        rows(counted(60), [59, 60]),
        rows(counted(20), counted(40, first=25), counted(24, first=21)),
        [one for one in rows(counted(60)) for _ in "ab"],
        [FrictionObservation(cycle, math.nan, 0.002) for cycle in counted(60)] * 2,
        rows(counted(300), counted(300, first=1)[:2]),
        [one for one in rows(counted(60)) for _ in "abc"],
        # measured again here and there, and one of them five times
        rows(sorted([*counted(300), *range(10, 300, 25), 35, 35, 35, 35])),
        [FrictionObservation(c, mu_s, 0.002) for c in counted(60) for mu_s in (math.nan, 0.2 + 1e-4 * c)],
    ],
)
def test_copies_lone_repeats_and_late_cycles_are_no_run(series: list[FrictionObservation]) -> None:
    assert told_apart(series, LIMIT) == series


def test_what_is_neither_a_copy_nor_a_run_is_refused_with_the_way_out() -> None:
    first = rows(counted(60))
    again = first[:50] + rows(counted(60), seed=7)[50:]
    told = (
        r"cycles 1 to 60 come again, 10 of 60 with another value or batch: leave out those that are copies, "
        r"or, where they are another run, number them on from 61$"
    )
    with pytest.raises(SeriesError, match=told):
        replay(TrackerSettings(), first + again)


@pytest.mark.parametrize(
    ("cycles", "told"),
    [
        ([cycle for cycle in counted(100) for _ in "ab"], "100 of those from 1 to 100"),
        ([cycle for cycle in counted(20) for _ in "abc"], "20 of those from 1 to 20"),
        ([*counted(5_000), 5_000, 5_001, 5_001, 5_002, 5_002], "3 of those from 5000 to 5002"),
        (sorted([*counted(100), *counted(100)[::3]]), "34 of those from 1 to 100"),
        (sorted([*counted(100), *counted(100)[::4]]), "25 of those from 1 to 97"),
        ([1, 2, 1, 2, 3, 4, 3, 4, *range(5, 60)], "4 of those from 1 to 4"),
    ],
)
def test_rows_of_two_things_side_by_side_are_refused_with_the_way_out(cycles: list[int], told: str) -> None:
    """Else the second is left out, and with it up to half of the series and more."""
    way_out = (
        "with another value or batch: where the rows are of several cells, track each alone; where each is a "
        "cycle of its own, number them on; where a cycle was measured again, keep one row of it"
    )
    with pytest.raises(SeriesError, match=rf"^cycles come again, {told} {way_out}$"):
        replay(TrackerSettings(), rows(cycles))


def test_copies_that_are_said_to_be_of_another_batch_are_none() -> None:
    first = rows(counted(60))
    named = [[replace(one, batch_id=name) for one in first] for name in "AB"]
    assert [one.session for one in told_apart([*named[0], *named[1]], LIMIT)] == [1] * 60 + [2] * 60
    with pytest.raises(SeriesError, match="60 of those from 1 to 60 with another value or batch"):
        told_apart([one for pair in zip(*named, strict=True) for one in pair], LIMIT)
    side_by_side = [one for pair in zip(named[0], first, strict=True) for one in pair]
    assert told_apart(side_by_side, LIMIT) == side_by_side


def test_who_has_said_which_session_it_is_is_believed() -> None:
    series = [FrictionObservation(o.cycle, o.mu_s, 0.002, session=7) for o in rows(counted(60), counted(60))]
    assert told_apart(series, LIMIT) == series
    assert replay(TrackerSettings(), series).used == 60


def test_a_late_cycle_of_a_run_is_late_still() -> None:
    series = rows(counted(60), [1, 2, 3, 5, 4, *counted(60, first=6)])
    tracked = replay(TrackerSettings(), series)
    assert tracked.used == 120
    assert "cycle 4 came 1 cycle late" in [note for _, note in tracked.notes]


@pytest.mark.parametrize(
    ("cycles", "note"),
    [
        ([*counted(49), 10_050, *counted(99, first=51)], "stands between cycles 49 and 51"),
        ([*counted(49), 10_050, *counted(99, first=50)], "stands between cycles 49 and 50"),
        ([*counted(148), 15, *counted(400, first=150)], "stands between cycles 148 and 150"),
        ([*range(0, 50_000, 1_000), 520_000, *range(51_000, 90_000, 1_000)], "stands between cycles 49000"),
    ],
)
def test_a_number_that_is_far_from_both_beside_it_is_left_out_and_told(cycles: list[int], note: str) -> None:
    """All else is as if its row were not there."""
    series = rows(cycles)
    ((place, told),) = misnumbered(series, LIMIT).items()
    assert told.startswith(note)
    tracked, without = (
        replay(TrackerSettings(wear_limit=0.25), s) for s in (series, series[:place] + series[place + 1 :])
    )
    assert (tracked.used, tracked.notes) == (len(series) - 1, ((cycles[place], told),))
    assert repr((tracked.wear, tracked.alarms)) == repr((without.wear, without.alarms))
    assert tracked.cycle.tolist() == cycles
    assert tracked.level[place] == tracked.level[place - 1]


def test_several_wrong_numbers_are_told_each() -> None:
    series = rows([*counted(49), 10_050, 51, 9_052, *counted(99, first=53)])
    assert sorted(misnumbered(series, LIMIT)) == [49, 51]


@pytest.mark.parametrize(
    "cycles",
    [
        counted(60),
        [*counted(60), *counted(60)],
        [*counted(60), *counted(60, first=5_000)],
        [*counted(500), *counted(3), *counted(500)],
        [*counted(30), 32, 31, *counted(60, first=33)],
        [*counted(60), 10_061],
        [0, 1_000, 2_000, 500_000, 501_000],
    ],
)
def test_gaps_restarts_and_late_cycles_are_no_wrong_numbers(cycles: list[int]) -> None:
    assert not misnumbered(rows(cycles), LIMIT)


def test_cycles_of_a_series_that_are_not_there_have_passed_from_the_first_after_them_on() -> None:
    """Those that come after it are known, so that nothing is in doubt."""
    cycles = [*counted(60), *counted(5_060, first=5_000)]
    tracked = replay(TrackerSettings(), rows(cycles))
    longer = replay(TrackerSettings(), rows([*cycles, 5_061]))
    at = cycles.index(5_000)
    assert tracked.level_std[at] > 10.0 * tracked.level_std[at - 1]
    assert tracked.level[:-1].tolist() == longer.level[: len(cycles) - 1].tolist()
