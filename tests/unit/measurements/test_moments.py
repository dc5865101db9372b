"""Dates in a column of time are read where they say one thing, and else told with what to do about them."""

from pathlib import Path

import numpy as np
import pytest

from impactcell.measurements import guess, read_tables
from impactcell.measurements.notation.moments import read_moments, unread_moments
from impactcell.web.texts.import_faults import page_fault

CLOCK = "10:00:00.{:03d}"


def column_of_time(directory: Path, cells: list[str], name: str = "time") -> Path:
    path = directory / "a.csv"
    rows = "".join(f"{cell};{n % 7};{n * n}\n" for n, cell in enumerate(cells))
    path.write_text(f"{name};force [N];position [mm]\n{rows}", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("2024-01-05 23:59:59.5", "2024-01-06T00:00:00.5Z"),
        ("2024/01/05 23:59:59.5", "2024/01/06 00:00:00.5"),
        ("05.01.2024 23:59:59,5", "06.01.2024 00:00:00,5"),
        ("05.01.24 23:59:59,5", "06.01.24 00:00:00,5"),
        ("13/01/2024 23:59:59.5", "14/01/2024 00:00:00.5"),
        ("01/13/2024 23:59:59.5", "01/14/2024 00:00:00.5"),
        ("31/01/2024 23:59:59.5", "01/02/2024 00:00:00.5"),
        ("1/31/2024 11:59:59.5 PM", "2/1/2024 12:00:00.5 AM"),
        ("31-01-2024 23:59:59.5", "01-02-2024 00:00:00.5"),
        ("05/01/2024 10:00:00", "05/01/2024 10:00:01"),
        ("05/01/24 10:00:00", "05/01/24 10:00:01"),
        ("11:59:59.5", "12:00:00.5"),
        ("2024-03-31T01:59:59.5+01:00", "2024-03-31T03:00:00.5+02:00"),
        ("2024-03-31 01:59:59.5+01", "2024-03-31 03:00:00.5+02"),
        ("2024-10-27T02:59:59.5+0200", "2024-10-27T02:00:00.5+0100"),
        ("2024-01-05T23:59:59.5-05:30", "2024-01-06T05:30:00.5Z"),
        ("05.01.2024 23:59:59,5+02:00", "05.01.2024 22:00:00,5Z"),
        ("01/05/2024 00:30:00.5+02:00", "30/04/2024 22:30:01.5Z"),
        ("23:59:59.5", "00:00:00.5"),
    ],
)
def test_dates_that_say_one_thing_are_seconds_from_the_first(first: str, second: str) -> None:
    moments = read_moments([first, second])
    assert moments is not None
    np.testing.assert_allclose(moments.seconds, [0.0, 1.0], atol=1e-9)


def test_a_moment_is_the_same_in_every_zone() -> None:
    """Two recorders of which one says UTC and the other its own time were two hours apart."""
    said = (
        "2024-07-01T10:00:00Z",
        "2024-07-01 12:00:00+02:00",
        "01.07.2024 06:30:00-03:30",
        "2024-07-01 10:00:00",
    )
    begun = {moments.begun for cell in said if (moments := read_moments([cell])) is not None}
    assert begun == {np.datetime64("2024-07-01T10:00:00")}


def test_a_clock_goes_over_every_midnight_and_back_by_less_than_half_a_day() -> None:
    cells = ["18:00:00", "23:00:00", "04:00:00", "03:00:00", "15:00:00", "02:00:00"]
    moments = read_moments(cells)
    assert moments is not None
    np.testing.assert_array_equal(moments.seconds / 3600.0, [0.0, 5.0, 10.0, 9.0, 21.0, 32.0])
    assert moments.begun == np.datetime64("1970-01-01T18:00:00")


def test_one_day_above_twelve_tells_the_order_of_all() -> None:
    cells = ["11/01/2024 10:00:00", "12/01/2024 10:00:00", "13/01/2024 10:00:00"]
    moments = read_moments(cells)
    assert moments is not None
    np.testing.assert_array_equal(moments.seconds, [0.0, 86_400.0, 172_800.0])
    assert read_moments(cells[:2]) is None


@pytest.mark.parametrize(
    "cells",
    [
        ["32/13/2024 10:00:00"],
        ["13/13/2024 10:00:00"],
        ["2024-02-30 10:00:00"],
        ["05.01.2024 10:00:00", ""],
        [],
    ],
)
def test_what_is_no_date_is_none(cells: list[str]) -> None:
    assert read_moments(cells) is None
    assert unread_moments(cells) == ("", "")


def test_dates_are_read_from_a_file(tmp_path: Path) -> None:
    path = column_of_time(tmp_path, [f"05/01/2024 {CLOCK.format(n)}" for n in range(60)])
    (table,) = read_tables(path)
    assert table.columns[0].unit == "s"
    np.testing.assert_allclose(table.columns[0].values, 1e-3 * np.arange(60), atol=1e-9)


@pytest.mark.parametrize(
    ("name", "cells", "told", "german"),
    [
        (
            "time",
            [f"0{1 + n // 30}/06/2024 {CLOCK.format(n)}" for n in range(60)],
            "where the time is needed; write them all as 2024-01-31 10:00:00.000, or leave the column out",
            "überall wie 2024-01-31 10:00:00.000 schreiben",
        ),
        (
            "time",
            ["05.01.2024"] * 60,
            "'time' holds days without a time of day, as '05.01.2024', where the time is needed; export",
            "Tage ohne Uhrzeit",
        ),
        (
            "Datum",
            [f"0{1 + n // 30}/06/2024 {CLOCK.format(n)}" for n in range(60)],
            "no column of time was found: 'Datum' holds dates of which day and month can be either, as",
            "können Tag und Monat vertauscht sein",
        ),
        (
            "Datum",
            ["05.01.2024"] * 60,
            "no column of time was found: 'Datum' holds days without a time of day, as '05.01.2024'",
            "„Datum“ enthält Tage ohne Uhrzeit",
        ),
    ],
)
def test_dates_that_are_no_time_are_told_with_what_to_do(
    tmp_path: Path, name: str, cells: list[str], told: str, german: str
) -> None:
    """It was said that one cell is to be corrected, of a column whose cells are all alike."""
    (fault,) = guess(read_tables(column_of_time(tmp_path, cells, name))).faults
    assert told in fault
    for language in ("en", "de"):
        spoken, said = page_fault(fault, language)
        assert spoken == language
        assert "--" not in said
        assert "form below" in said or "Formular" in said
    assert german in page_fault(fault, "de")[1]
