"""Rows that stand twice in a file: the same samples with the same times, and no times that were rounded."""

from pathlib import Path

import numpy as np
import pytest

from impactcell.errors import MeasurementError
from impactcell.measurements import Imported, guess, make_campaign, read_tables
from impactcell.measurements.given import read_given
from impactcell.web.texts.import_notes import page_note
from tests.unit.measurements.records import sampled, taps

RNG = np.random.default_rng(6)
RECORDS = [sampled(tap, RNG) for tap in taps((3000,), (18.9,))]


def imported(directory: Path, rows_of: list[list[str]]) -> Imported:
    files = []
    for number, rows in enumerate(rows_of, 1):
        file = directory / f"{number}.csv"
        file.write_text("\n".join(["time [s],force [N],position [mm]", *rows]), encoding="utf-8")
        files.append(file)
    tables = [table for file in files for table in read_tables(file)]
    given = read_given({"constants": ["mass=18.9kg", "velocity=3000mm/min", "stroke=1.5mm"]})
    return make_campaign(tables, guess(tables, given))


def rows(record: tuple[np.ndarray, ...], digits: int = 6) -> list[str]:
    return [f"{t:.{digits}f},{f:.4f},{1e3 * x:.5f}" for t, f, x in zip(*record, strict=True)]


@pytest.mark.parametrize("twice", [(500, 501, 502, 800), range(10_000)])
def test_rows_that_stand_twice_are_left_out_with_a_word(tmp_path: Path, twice: range | tuple[int]) -> None:
    """They were told to be rounded times; all of them twice made that there was no time."""
    once = [rows(record) for record in RECORDS]
    again = [[row for i, one in enumerate(of) for row in [one] * (1 + (i in twice))] for of in once]
    (tmp_path / "once").mkdir()
    whole, found = imported(tmp_path / "once", once), imported(tmp_path, again)
    count = sum(map(len, again)) - sum(map(len, once))
    note = f"rows left out that stand twice: {count}, the first in 1.csv"
    assert note in found.notes
    assert page_note(note, "de") == (
        "de",
        f"weggelassene Zeilen, die doppelt stehen: {count}, zuerst in 1.csv",
    )
    for shot, truth in zip(found.campaign.shots, whole.campaign.shots, strict=True):
        assert shot.force is not None
        assert truth.force is not None
        np.testing.assert_array_equal(shot.force.time_s, truth.force.time_s)
        np.testing.assert_array_equal(shot.force.values, truth.force.values)
    assert not any("stand twice" in note for note in whole.notes)


def test_rounded_times_are_no_rows_that_stand_twice(tmp_path: Path) -> None:
    """Some rows of a part at rest are alike, too."""
    coarse = [(time, np.round(force), np.round(position, 5)) for time, force, position in RECORDS]
    with pytest.raises(MeasurementError, match="rounded times do so: export them with more digits"):
        imported(tmp_path, [rows(record, 3) for record in coarse])
