"""What TwinCAT Scope exports: groups of channels behind their times, in every layout that can be chosen."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.errors import MeasurementError
from impactcell.measurements import guess, make_campaign, read_tables
from impactcell.measurements.files.dialect import Dialect
from impactcell.measurements.given import read_given
from impactcell.measurements.table import Table

BEGUN_TICKS = 132_959_733_843_760_000
BEGUN = np.datetime64("2022-05-02T13:56:24.376", "ns")
"""The same moment, as the begin of an export says it."""


@dataclass(frozen=True)
class Group:
    """Channels of one sampling time [ms]: names, and values by channel."""

    step_ms: float
    names: Sequence[str]
    values: np.ndarray
    first_ms: float = 0.0

    @property
    def times(self) -> np.ndarray:
        return np.round(self.first_ms + self.step_ms * np.arange(self.values.shape[1]), 6)


def export(
    path: Path,
    groups: Sequence[Group],
    *,
    mark: str = "\t",
    decimal: str = ",",
    units: str = "(None)",
    header: bool = True,
    blank: str = " ",
    ends: bool = False,
    ticks: bool = False,
    filled: bool = False,
    scaling: str = "1",
) -> Path:
    """Write groups as the Scope does: short ones end in blanks, or repeat their last row where `filled`."""

    def number(value: float) -> str:
        return f"{value:.10g}".replace(".", decimal)

    def line(key: str, cells: Sequence[Sequence[str]]) -> str:
        return mark.join(cell for group in cells for cell in (key, *group))

    rows = [f"Name{mark}Scope", f"File{mark}C:\\scope.csv"]
    rows += [f"Starttime of export{mark}{BEGUN_TICKS}{mark}Montag{mark}15:56:24.376"]
    rows += [f"Endtime of export{mark}{BEGUN_TICKS + 10**7}{mark}Montag{mark}15:56:25.376", "", ""]
    rows += [line("Name", [group.names for group in groups])]
    if header:
        rows += [line("SymbolComment", [["" for _ in group.names] for group in groups])]
        rows += [line("SampleTime[ms]", [[number(group.step_ms)] * len(group.names) for group in groups])]
        rows += [line("ScaleFactor", [[scaling] * len(group.names) for group in groups])]
        rows += [line("Offset", [["0"] * len(group.names) for group in groups])]
        rows += [line("Unit", [[units] * len(group.names) for group in groups])]
    rows += [""]
    for row in range(max(group.values.shape[1] for group in groups)):
        cells = []
        for group in groups:
            at = min(row, group.values.shape[1] - 1) if filled else row
            if at >= group.values.shape[1]:
                cells += [blank] * (1 + len(group.names))
                continue
            time = group.times[at]
            cells.append(str(BEGUN_TICKS + round(1e4 * time)) if ticks else number(time))
            cells += [number(value) for value in group.values[:, at]]
        rows.append(mark.join(cells))
    path.write_text("\r\n".join([*rows, *(["EOF"] if ends else [])]) + "\r\n", encoding="utf-8")
    return path


def check(tables: Sequence[Table], groups: Sequence[Group], unit: str | None = None) -> None:
    assert len(tables) == len(groups)
    for table, group in zip(tables, groups, strict=True):
        time, *channels = table.columns
        assert time.unit in ("ms", "s")
        factor = 1.0 if time.unit == "ms" else 1e3
        np.testing.assert_allclose(
            factor * time.values, group.times - (factor - 1.0) / 999.0 * group.times[0]
        )
        assert [channel.name for channel in channels] == list(group.names)
        assert {channel.unit for channel in channels} == {unit}
        for channel, values in zip(channels, group.values, strict=True):
            np.testing.assert_allclose(channel.values, values, rtol=1e-9)


NUMBERS = st.floats(-1e6, 1e6).map(lambda value: float(f"{value:.9g}"))


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_every_layout_is_read_back(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    groups = []
    for place in range(data.draw(st.integers(1, 4))):
        names = [f"MAIN.v{place}_{k}" for k in range(data.draw(st.integers(1, 3)))]
        count = data.draw(st.integers(2, 12))
        values = np.array(data.draw(st.lists(st.lists(NUMBERS, min_size=count, max_size=count),
                                             min_size=len(names), max_size=len(names))))  # fmt: skip
        step = data.draw(st.sampled_from((0.05, 0.2, 1.0, 4.0)))
        groups.append(Group(step, names, values, data.draw(st.sampled_from((0.0, 2.0)))))
    mark = data.draw(st.sampled_from("\t;:,|"))
    path = export(
        tmp_path_factory.mktemp("scope") / "a.csv",
        groups,
        mark=mark,
        decimal="." if mark == "," else data.draw(st.sampled_from(".,")),
        header=data.draw(st.booleans()),
        blank=data.draw(st.sampled_from(("", " "))),
        ends=data.draw(st.booleans()),
        ticks=data.draw(st.booleans()),
    )
    tables = read_tables(path)
    check(tables, groups)
    assert all(abs(table.columns[0].begun - BEGUN) < np.timedelta64(1, "s") for table in tables)


def test_rows_that_fill_up_a_slow_group_are_left_out(tmp_path: Path) -> None:
    fast = Group(1.0, ["fForce"], np.arange(40.0)[None])
    slow = Group(4.0, ["fPos", "fTemp"], np.array([np.arange(10.0) ** 2, np.full(10, 21.0)]))
    path = export(tmp_path / "a.csv", [fast, slow], filled=True)
    tables = read_tables(path)
    check(tables, [fast, slow])
    assert "30 repeated rows left out" in tables[1].notes


def test_a_channel_that_was_drawn_twice_is_read_once(tmp_path: Path) -> None:
    force = np.sin(np.arange(50.0))
    again = Group(1.0, ["fForce (1)"], force[None])
    other = Group(1.0, ["fForce (2)"], force[None] + 1.0)
    tables = read_tables(export(tmp_path / "a.csv", [Group(1.0, ["fForce"], force[None]), again, other]))
    assert [column.name for table in tables for column in table.columns[1:]] == ["fForce", "fForce (2)"]
    assert "1 copies of channels left out" in tables[0].notes


def test_units_and_scalings_are_told(tmp_path: Path) -> None:
    group = Group(1.0, ["fForce"], np.arange(50.0)[None])
    path = export(tmp_path / "a.csv", [group], units="dV (Voltage)", scaling="-10")
    (table,) = read_tables(path)
    assert table.columns[1].unit == "dV"
    assert "'fForce' has a scaling of -10 and 0 in the Scope: taken as exported" in table.notes


@pytest.mark.parametrize("ticks", ["9" * 18, "9" * 40, "1" + 16 * "0", "12", "-1", "²"])
def test_a_begin_that_no_clock_shows_is_none(tmp_path: Path, ticks: str) -> None:
    path = export(tmp_path / "a.csv", [Group(1.0, ["fForce"], np.arange(9.0)[None])])
    path.write_text(path.read_text(encoding="utf-8").replace(str(BEGUN_TICKS), ticks), encoding="utf-8")
    (table,) = read_tables(path)
    assert table.columns[0].begun is None


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            lambda text: text.replace("\t", " "),
            ":1: its cells are separated by spaces, as the words of a name",
        ),
        (lambda text: text.replace("\n3\t3\t", "\n3\t3x\t"), ":17: column 'fForce': '3x' is not a number"),
        (lambda text: text[: text.index("SampleTime")], ": holds no samples"),
        (lambda text: text[: text.index("Name\tfForce")], ": has no row of names below its begin"),
        (
            lambda text: text.replace("\n0\t0\t0\t0", "\n0\t0\t0"),
            ":14: 3 cells where the header names 4 colu",
        ),
        (lambda text: text.replace("\n0\t0\t", "\n0\t0\t7\t7\t7\t"), ":14: 7 cells where the header names 4"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path: Path, change: object, told: str) -> None:
    assert callable(change)
    groups = [Group(1.0, [name], np.arange(20.0)[None]) for name in ("fForce", "fPos")]
    path = export(tmp_path / "a.csv", groups)
    path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(MeasurementError) as refused:
        read_tables(path)
    assert f"{path}{told}" in str(refused.value)


@pytest.mark.slow
def test_force_and_position_of_a_plc_are_one_record_at_their_own_rates(tmp_path: Path) -> None:
    time = 1e-3 * np.arange(3000)
    cover = Group(5.0, ["GVL.fTemperature"], np.full((1, 600), 21.5))
    position = Group(1.0, ["Axis.ActPos"], 40.0 * np.sin(3.0 * time)[None])
    force = Group(0.2, ["GVL.fForce"], 7.0 * np.cos(3.0 * 2e-4 * np.arange(15_000))[None])
    path = export(tmp_path / "a.csv", [cover, position, force])
    tables = read_tables(path)
    said = {
        "units": ["Axis.ActPos=mm", "GVL.fForce=N"],
        "constants": ["mass=2kg"],
    }
    imported = make_campaign(tables, guess(tables, read_given(said)))
    (shot,) = imported.campaign.shots
    assert shot.force is not None
    assert shot.position is not None
    np.testing.assert_allclose(shot.force.values, 7.0 * np.cos(3.0 * shot.force.time_s), atol=1e-8)
    np.testing.assert_allclose(shot.position.values, 0.04 * np.sin(3.0 * shot.position.time_s), atol=1e-10)
    assert list(shot.covariates.values()) == [21.5]
    assert (len(shot.force.values), len(shot.position.values)) == (15_000, 3000)


@pytest.mark.parametrize("name", ["Time", "Zeit", "X_Value"])
def test_pairs_of_time_and_value_go_by_their_own_times(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{k};{k * k};{5 * k if k < 100 else ''};{3 * k if k < 100 else ''}" for k in range(500)]
    path.write_text("\n".join([f"{name} [ms];Force [N];{name} [ms];Weg [mm]", *rows]), encoding="utf-8")
    force, position = read_tables(path)
    assert force.columns[0].values.tolist() == list(range(500))
    assert position.columns[0].values.tolist() == list(range(0, 500, 5))
    assert position.columns[1].values.tolist() == list(range(0, 300, 3))
    imported = make_campaign(
        [force, position], guess([force, position], read_given({"constants": ["mass=2kg"]}, None, "driven"))
    )
    (shot,) = imported.campaign.shots
    assert shot.position is not None
    assert shot.position.time_s[-1] == pytest.approx(0.495)


def test_times_that_are_all_the_same_are_one(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{k};{k * k};{k};{3 * k};{k % 2}" for k in range(500)]
    path.write_text("\n".join(["Time [ms];Force [N];Time [ms];Weg [mm];shot", *rows]), encoding="utf-8")
    (table,) = read_tables(path)
    assert [column.name for column in table.columns] == ["Time", "Force", "Weg", "shot"]


@pytest.mark.parametrize("later_s", [0.35, 0.0])
def test_pairs_of_moments_stand_to_each_other_as_they_say(tmp_path: Path, later_s: float) -> None:
    """Two channels of one length and step, of which the second begins later: their seconds look the same."""
    path = tmp_path / "a.csv"
    rows = [
        f"28.11.2026 10:00:{1 + 1e-3 * k:06.3f};{k};28.11.2026 10:00:{1 + later_s + 1e-3 * k:06.3f};{2 * k}"
        for k in range(900)
    ]
    path.write_text("\n".join(["Zeit;Force [N];Zeit;Weg [mm]", *rows]), encoding="utf-8")
    tables = read_tables(path)
    assert len(tables) == (2 if later_s else 1)
    imported = make_campaign(tables, guess(tables, read_given({"constants": ["mass=2kg"]}, None, "driven")))
    (shot,) = imported.campaign.shots
    assert shot.force is not None
    assert shot.position is not None
    assert shot.position.time_s[0] - shot.force.time_s[0] == pytest.approx(later_s, abs=1e-9)


def test_words_for_lost_values_are_taken_as_they_were_said(tmp_path: Path) -> None:
    """In the first row, too, which has to be a row of numbers to be told from the header."""
    values = np.vstack([np.arange(20.0) + 0.5, np.arange(20.0) + 100.5])
    path = export(tmp_path / "a.csv", [Group(1.0, ["Force", "Position"], values)], decimal=".")
    text = path.read_text()
    path.write_text(text.replace("\t0.5", "\tOVER", 1).replace("\t108.5", "\tOver", 1))
    (table,) = read_tables(path, dialect=Dialect(lost=frozenset({"over"})))
    force, position = (column.values for column in table.columns[1:])
    assert np.flatnonzero(np.isnan(force)).tolist() == [0]
    assert np.flatnonzero(np.isnan(position)).tolist() == [8]
    assert np.array_equal(force[1:], values[0, 1:])
