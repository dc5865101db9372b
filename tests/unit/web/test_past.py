"""The past on the page: trends from the journal, alarms as files that a spreadsheet may open."""

import csv
import io
import sqlite3
import time
from dataclasses import replace
from pathlib import Path

import openpyxl
import pytest

from impactcell.journal.store import Journal
from impactcell.journal.trend import CYCLES_PER_COLUMN, Finished, trend
from impactcell.records import Alarm, Evidence
from impactcell.scada import Role
from impactcell.web.alarm_export import HEADER, to_csv, to_xlsx
from impactcell.web.alarm_pages import SHOWN_HISTORY
from tests.snapshots import make_capture, make_snapshot
from tests.unit.web.page import CELL, make_page, raised

SECOND = 10**9


def store(path: Path, times_ns: list[int], batches: dict[int, str], alarms: tuple[Alarm, ...] = ()) -> None:
    """Write cycles whose mu_s is a thousandth of their number."""
    with Journal(path, CELL) as journal:
        for number, time_ns in enumerate(times_ns, 1):
            capture = replace(make_capture(number, samples=10), time_ns=time_ns)
            snapshot = make_snapshot(capture, mu_s=number / 1e3)
            batch_id = batches[max(first for first in batches if first <= number)]
            snapshot = replace(snapshot, batch=replace(snapshot.batch, batch_id=batch_id))
            journal.append(capture, snapshot, b"", alarms if number == 1 else ())


def test_columns_are_what_their_cycles_were(tmp_path: Path) -> None:
    times = [i * SECOND for i in range(60)]
    store(tmp_path / "j.sqlite", times, {1: "A", 31: "B"})
    columns = trend(tmp_path / "j.sqlite", 0, 60 * SECOND, 6)
    assert [column.cycles for column in columns] == [10] * 6
    assert [column.mu_s_low for column in columns] == pytest.approx([0.001 + 0.01 * i for i in range(6)])
    assert [column.mu_s_high for column in columns] == pytest.approx([0.010 + 0.01 * i for i in range(6)])
    assert [column.level for column in columns] == pytest.approx([0.0055 + 0.01 * i for i in range(6)])
    assert [column.batch_id for column in columns] == ["A"] * 3 + ["B"] * 3
    assert [column.time_ns for column in columns] == times[::10]


def test_a_short_past_fills_the_chart_too(tmp_path: Path) -> None:
    times = [1000 * SECOND + i * SECOND for i in range(60)]
    store(tmp_path / "j.sqlite", times, {1: "A"})
    columns = trend(tmp_path / "j.sqlite", 0, 1060 * SECOND, 60)
    assert 30 <= len(columns) <= 61
    assert sum(column.cycles for column in columns) == 60


def test_what_is_over_is_read_once_and_what_comes_is_seen(tmp_path: Path) -> None:
    path = tmp_path / "j.sqlite"
    store(path, [i * SECOND for i in range(60)], {1: "A"})
    finished = Finished()
    before = trend(path, 0, 60 * SECOND, 6, finished)
    with sqlite3.connect(path) as database:  # nobody does this; it shows what is read again
        database.execute("UPDATE cycles SET mu_s = mu_s + 1, crc = NULL")
    after = trend(path, 0, 60 * SECOND, 6, finished)
    assert after[:5] == before[:5]
    assert after[5].mu_s_low == pytest.approx(1.051)
    assert next(column.mu_s_low for column in trend(path, 0, 60 * SECOND, 6)) == pytest.approx(1.001)


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0, 25, 100, 1000])
def test_cycles_that_come_late_are_seen_where_they_belong(tmp_path: Path, late_s: int) -> None:
    """The clock of a module is behind the service's; 24 cycles come from its ring after an outage."""
    path, finished = tmp_path / "j.sqlite", Finished()
    with Journal(path, CELL) as journal:
        waiting = []
        for second in range(2000, 4000, 10):
            capture = replace(make_capture(second, samples=10), time_ns=(second - late_s) * SECOND)
            waiting.append((capture, make_snapshot(capture)))
            if not 3000 <= second < 3240:
                for came in waiting:
                    journal.append(*came, b"")
                waiting = []
            shown = trend(path, (second - 1999) * SECOND, second * SECOND, 100, finished)
    assert shown == trend(path, 1991 * SECOND, 3990 * SECOND, 100)
    within = sum(1991 <= second - late_s < 3990 for second in range(2000, 4000, 10))
    assert sum(column.cycles for column in shown) in (within, within + 1), "the first column begins earlier"


def test_a_journal_that_is_begun_anew_has_nothing_of_the_one_before(tmp_path: Path) -> None:
    path, finished = tmp_path / "j.sqlite", Finished()
    store(path, [i * SECOND for i in range(60)], {1: "A"})
    trend(path, 0, 60 * SECOND, 6, finished)
    path.unlink()
    store(path, [i * SECOND for i in range(30)], {1: "B"})
    columns = trend(path, 0, 60 * SECOND, 6, finished)
    assert [(column.cycles, column.batch_id) for column in columns] == [(10, "B")] * 3


@pytest.mark.slow
def test_a_clock_that_steps_back_hides_nothing(tmp_path: Path) -> None:
    path, finished = tmp_path / "j.sqlite", Finished()
    with Journal(path, CELL) as journal:
        for number, now_s in enumerate((*range(1000, 3000, 10), *range(2600, 3000, 10))):
            capture = replace(make_capture(number, samples=10), time_ns=now_s * SECOND)
            journal.append(capture, make_snapshot(capture), b"")
            shown = trend(path, (now_s - 999) * SECOND, (now_s + 1) * SECOND, 100, finished)
    assert shown == trend(path, 1991 * SECOND, 2991 * SECOND, 100)


def test_a_damaged_row_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "j.sqlite"
    store(path, [i * SECOND for i in range(20)], {1: "A"})
    with sqlite3.connect(path) as database:
        database.execute("UPDATE cycles SET mu_s = 7.0 WHERE cycle = 15")
        database.execute("UPDATE cycles SET batch_id = 'Z' WHERE cycle = 20")
    first, second = trend(path, 0, 20 * SECOND, 2)
    assert (first.cycles, second.cycles) == (10, 8)
    assert second.mu_s_high == pytest.approx(0.019)
    assert second.batch_id == "A"


def test_empty_stretches_are_left_out(tmp_path: Path) -> None:
    store(tmp_path / "j.sqlite", [*(SECOND * i for i in range(1, 11)), 10_000 * SECOND], {1: "A"})
    columns = trend(tmp_path / "j.sqlite", 0, 10_001 * SECOND, 4)
    assert trend(tmp_path / "j.sqlite", 20_000 * SECOND, 30_000 * SECOND, 4) == ()
    assert [column.cycles for column in columns] == [10, 1]


@pytest.mark.slow
def test_the_band_of_a_full_stretch_is_of_all_its_cycles_and_the_level_of_its_whole_time(
    tmp_path: Path,
) -> None:
    """Only the first 60 counted, though nothing said so."""
    count, path = 5 * CYCLES_PER_COLUMN + 7, tmp_path / "j.sqlite"
    store(path, [SECOND * i for i in range(1, count + 1)], {1: "A"})
    (whole,) = trend(path, 0, 10_000 * SECOND, 1)
    assert (whole.cycles, whole.mu_s_low, whole.mu_s_high) == (count, 0.001, count / 1e3)
    assert whole.level == pytest.approx((1 + count) / 2e3, abs=CYCLES_PER_COLUMN / 1e4)
    with sqlite3.connect(path) as database:  # the highest, the lowest, and the largest gap, are damaged
        database.execute("UPDATE cycles SET mu_s = 7.0 WHERE cycle = 101")
        database.execute("UPDATE cycles SET mu_s = -7.0 WHERE cycle IN (103, 104)")
        database.execute("UPDATE cycles SET gap = 1e9 WHERE cycle = 109")
    (rest,) = trend(path, 0, 10_000 * SECOND, 1)
    assert rest.cycles == count - 4
    assert (rest.mu_s_low, rest.mu_s_high, rest.gap) == (whole.mu_s_low, whole.mu_s_high, whole.gap)


async def test_the_trend_of_a_cell(tmp_path: Path) -> None:
    now = time.time_ns()
    store(
        tmp_path / "j.sqlite",
        [now - 7200 * SECOND, *(now - i * SECOND for i in (600, 400, 200))],
        {1: "A", 4: "B"},
    )
    page = make_page(tmp_path, tmp_path / "j.sqlite")
    async with page.logged_in(Role.OBSERVER) as client:
        hour = (await client.get(f"/cells/{CELL}/trend?span=hour")).json()
        shift = (await client.get(f"/cells/{CELL}/trend?span=shift")).json()
        assert (await client.get(f"/cells/{CELL}/trend?span=year")).status_code == 400
        assert (await client.get("/cells/press-2/trend")).status_code == 404
    assert hour["mu_s_high"] == pytest.approx([0.002, 0.003, 0.004])
    assert [batch for _, batch in hour["batches"]] == ["A", "B"]
    # after two hours in which it stood still, line and band begin anew
    assert [shift[name][1] for name in ("mu_s_low", "mu_s_high", "level", "level_std")] == [None] * 4
    assert [value is None for value in shift["mu_s_low"]] == [False, True] + [False] * (
        len(shift["mu_s_low"]) - 2
    )
    assert shift["mu_s_low"][0] == pytest.approx(0.001)
    assert None not in hour["mu_s_low"]
    assert shift["time_ms"] == sorted(shift["time_ms"])
    assert [batch for _, batch in shift["batches"]] == ["A", "B"]


def shifted(cycle: int, time_ns: int, size: float) -> Alarm:
    evidence = Evidence(statistic=9.0, threshold=5.0, change_cycle=cycle, size=size, size_std=0.002)
    return Alarm("BatchShift", active=True, time_ns=time_ns, activation=time_ns, evidence=evidence)


async def test_a_change_that_was_found_has_its_mark_where_it_began(tmp_path: Path) -> None:
    now = time.time_ns()
    times = [now - (100 - i) * SECOND for i in range(80)]
    store(tmp_path / "j.sqlite", times, {1: "A"})
    first, second = shifted(21, times[24], 0.03), shifted(51, times[52], -0.01)
    beyond = shifted(4_000, times[70], 0.02)
    told = (
        Alarm("BatchShift", suppressed=True, time_ns=times[10]),
        first,
        replace(first, acknowledged=True, time_ns=times[30]),
        replace(first, active=False, time_ns=times[40]),
        second,
        replace(shifted(31, times[60], 0.1), name="ModelGap"),
        beyond,
    )
    with Journal(tmp_path / "j.sqlite", CELL) as journal:
        journal.record(b"", told)
    async with make_page(tmp_path, tmp_path / "j.sqlite").logged_in(Role.OBSERVER) as client:
        trend = (await client.get(f"/cells/{CELL}/trend?span=hour")).json()
    assert [batch for _, batch in trend["batches"]] == ["A"]
    began = (times[20], times[50], times[70])  # the last is told, and not there
    assert trend["shifts"] == [
        {"time_ms": began[0] // 10**6, "cycle": 21, "size": 0.03, "size_std": 0.002},
        {"time_ms": began[1] // 10**6, "cycle": 51, "size": -0.01, "size_std": 0.002},
        {"time_ms": began[2] // 10**6, "cycle": 4000, "size": 0.02, "size_std": 0.002},
    ]


async def test_a_journal_that_cannot_be_read_is_said(tmp_path: Path) -> None:
    page = make_page(tmp_path, tmp_path / "gone.sqlite")
    async with page.logged_in(Role.OBSERVER) as client:
        assert (await client.get(f"/cells/{CELL}/trend")).status_code == 503
        assert (await client.get("/alarms")).status_code == 200
        assert (await client.get("/system")).status_code == 200


async def test_the_history_is_shown_and_can_be_taken_home(tmp_path: Path) -> None:
    store(tmp_path / "j.sqlite", [10**18], {1: "A"}, (raised("the reason"), raised("again")))
    page = make_page(tmp_path, tmp_path / "j.sqlite")
    async with page.logged_in(Role.OBSERVER) as client:
        assert "the reason" in (await client.get("/alarms")).text
        assert (await client.get("/alarms?cell=press-2")).status_code == 404
        text = await client.get(f"/alarms/history.csv?cell={CELL}")
        book = await client.get("/alarms/history.xlsx")
    assert text.headers["content-disposition"] == 'attachment; filename="alarms.csv"'
    rows = list(csv.DictReader(io.StringIO(text.content.decode("utf-8-sig"))))
    assert [row["message"] for row in rows] == ["again", "the reason"]
    assert rows[0]["time_utc"] == "2001-09-09T01:46:40.000Z"
    sheet = openpyxl.load_workbook(io.BytesIO(book.content)).active
    assert next([cell.value for cell in row] for row in sheet.iter_rows()) == list(HEADER)
    assert sheet.max_row == 3


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", '=HYPERLINK("http://x")'])
def test_no_text_becomes_a_formula(text: str) -> None:
    history = [(CELL, raised(text, comment=text, user=text, comment_user=text))]
    [row] = list(csv.DictReader(io.StringIO(to_csv(history).decode("utf-8-sig"))))
    assert row["message"] == row["comment"] == row["user"] == row["comment_user"] == f"'{text}"
    sheet = openpyxl.load_workbook(io.BytesIO(to_xlsx(history))).active
    cells = {cell.value: cell.data_type for cell in sheet[2]}
    assert all(kind != "f" for kind in cells.values())
    assert text in cells


def test_control_characters_do_not_break_a_workbook() -> None:
    history = [(CELL, Alarm("JournalFault", message="a\x00b\x1bc", time_ns=1))]
    sheet = openpyxl.load_workbook(io.BytesIO(to_xlsx(history))).active
    assert sheet[2][HEADER.index("message")].value == "abc"


async def test_an_alarm_that_is_held_back_says_why_and_has_not_been(tmp_path: Path) -> None:
    """A change that was announced suppresses the alarm; it has neither come nor gone."""
    at_rest = Alarm("BatchShift", time_ns=10**18, suppressed=True)
    store(tmp_path / "j.sqlite", [10**18], {1: "A"}, (at_rest, replace(at_rest, suppressed=False)))
    async with make_page(tmp_path, tmp_path / "j.sqlite").logged_in(Role.OBSERVER) as client:
        history = (await client.get("/alarms?lang=en")).text.partition("<tbody>")[2]
        text = (await client.get("/alarms/history.csv")).content.decode("utf-8-sig")
    assert [row["suppressed"] for row in csv.DictReader(io.StringIO(text))] == ["0", "1"]
    assert history.count("suppressed</span>") == 1
    assert "Not watched: the batch or the model is new" in history
    assert "Watched again." in history
    assert "over</span>" not in history


@pytest.mark.parametrize("more", [0, 1])
async def test_a_long_history_says_where_it_is_cut(tmp_path: Path, more: int) -> None:
    alarms = tuple(raised(f"reason {i}") for i in range(SHOWN_HISTORY - 1 + more))
    store(tmp_path / "j.sqlite", [10**18], {1: "A"}, alarms)
    async with make_page(tmp_path, tmp_path / "j.sqlite").logged_in(Role.OBSERVER) as client:
        text = (await client.get("/alarms?lang=en")).text
    assert ("The newest 200; the files hold up to 10000 of each cell." in text) == bool(more)
