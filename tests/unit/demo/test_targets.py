"""The demo ends with what became of its parts."""

import io
import json
import math

from rich.console import Console

from impactcell.demo.targets import targets_json, targets_table
from impactcell.positioning.task_state_machine import TaskOutcome

OUTCOMES = (
    TaskOutcome(0.010, 0.0, 0.010021, 12.0, 3, settled=True, reason="in place"),
    TaskOutcome(0.025, 0.001, 0.0242, 30.0, 5, settled=False, reason="press-1: tap 5 moved nothing"),
)


def printed(outcomes: tuple[TaskOutcome, ...]) -> str:
    console = Console(file=io.StringIO(), width=140)
    console.print(targets_table(outcomes, 50e-6))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_the_table_says_target_taps_and_distance_of_every_part() -> None:
    lines = printed(OUTCOMES).splitlines()
    first = next(line for line in lines if "10.000 mm" in line)
    assert all(word in first for word in ("12.0 kg", "0.000 mm", " 3 ", "+21 µm", "inside"))
    second = next(line for line in lines if "25.000 mm" in line)
    assert all(word in second for word in ("-800 µm", " 5 ", "moved nothing"))
    assert lines[-1].strip() == "1 of 2 inside ± 50 µm, 8 taps, 4.0 a part, 33.2 mm travelled"


def test_what_is_off_by_less_than_a_micrometre_has_no_sign_of_a_fault() -> None:
    near = TaskOutcome(0.010, 0.0, 0.0099997, 12.0, 3, settled=True, reason="in place")
    assert "+0 µm" in printed((near,))


def test_where_a_part_lies_that_nobody_knows_is_no_number() -> None:
    lost = TaskOutcome(0.030, 0.010, math.nan, 12.0, 1, settled=False, reason="press-1: link lost")
    lines = printed((*OUTCOMES, lost)).splitlines()
    assert "–" in next(line for line in lines if "30.000 mm" in line)
    assert "33.2 mm" in lines[-1]
    row = targets_json((lost,))[0]
    assert (row["target_mm"], row["end_mm"], row["off_target_um"]) == (30.0, None, None)


def test_no_part_has_a_table_too() -> None:
    assert "0 of 0 inside" in printed(())


def test_json_has_a_row_a_part() -> None:
    rows = json.loads(json.dumps(targets_json(OUTCOMES)))
    assert [row["target_mm"] for row in rows] == [10.0, 25.0]
    assert [row["inside"] for row in rows] == [True, False]
    assert [row["taps"] for row in rows] == [3, 5]
    assert abs(rows[0]["off_target_um"] - 21.0) < 1e-6
