"""LabVIEW measurement files: steps or columns of times, segments that go on or begin anew, comments."""

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

STEP_S = 1e-3
DAY = "2026/11/28"


@dataclass(frozen=True)
class Segment:
    """Channels by name, their values, and when they began: seconds after 10 o'clock, and X0."""

    values: dict[str, np.ndarray]
    clock_s: float = 0.0
    first_s: float = 0.0
    units: Sequence[str] = ()


def write(
    path: Path,
    segments: Sequence[Segment],
    *,
    how: str = "No",
    mark: str = ".",
    separator: str = "Tab",
    told: bool = True,
    headings: bool = True,
) -> Path:
    """Write segments as LabVIEW does; `how` is what the file says of its columns of X."""
    between = {"Tab": "\t", "Comma": ","}[separator]

    def number(value: float) -> str:
        return f"{value:.9E}".replace(".", mark)

    def spread(cells: Sequence[str]) -> str:
        return between.join(cell + (between if how == "Multi" else "") for cell in cells)

    lines = [f"LabVIEW Measurement{between}", f"Writer_Version{between}2", f"Separator{between}{separator}"]
    lines += [f"Decimal_Separator{between}{mark}"] if told else []
    lines += [f"Multi_Headings{between}{'Yes' if headings else 'No'}", f"X_Columns{between}{how}"]
    lines += [f"Time_Pref{between}Absolute", f"***End_of_Header***{between}", between]
    for number_of, segment in enumerate(segments):
        names = list(segment.values)
        length = len(next(iter(segment.values.values())))
        count = len(names)
        if headings or number_of == 0:
            clock = f"10:{int(segment.clock_s // 60):02d}:{segment.clock_s % 60:013.10f}".replace(".", mark)
            lines += [f"Channels{between}{count}{between}"]
            lines += [f"Samples{between}{spread([str(length)] * count)}"]
            lines += [f"Date{between}{spread([DAY] * count)}", f"Time{between}{spread([clock] * count)}"]
            if segment.units:
                lines += [f"Y_Unit_Label{between}{spread(segment.units)}"]
            lines += [f"X_Dimension{between}{spread(['Time'] * count)}"]
            lines += [f"X0{between}{spread([number(segment.first_s)] * count)}"]
            lines += [f"Delta_X{between}{spread([number(STEP_S)] * count)}", f"***End_of_Header***{between}"]
            heads = between.join(f"X_Value{between}{name}" for name in names)
            lines += [
                heads + f"{between}Comment"
                if how == "Multi"
                else between.join(["X_Value", *names, "Comment"])
            ]
        for row in range(length):
            x = number(segment.first_s + row * STEP_S)
            cells = [number(values[row]) for values in segment.values.values()]
            if how == "Multi":
                lines.append(between.join(f"{x}{between}{cell}" for cell in cells))
            else:
                lines.append(between.join([x if how == "One" else "", *cells]))
        lines.append("")
    path.write_text("\r\n".join(lines) + "\r\n", encoding="cp1252")
    return path


NUMBERS = st.floats(-1e6, 1e6).map(lambda value: float(f"{value:.8E}"))


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_every_layout_is_read_back(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    names = ["Force", "Position", "Temperature"][: data.draw(st.integers(1, 3))]
    separator = data.draw(st.sampled_from(("Tab", "Comma")))
    how = data.draw(st.sampled_from(("No", "One", "Multi")))
    count = data.draw(st.integers(2, 10))
    segments = [
        Segment(
            {name: np.array(data.draw(st.lists(NUMBERS, min_size=count, max_size=count))) for name in names},
            clock_s=10.0 * place,
            units=["N", "mm", "g"][: len(names)] if data.draw(st.booleans()) else (),
        )
        for place in range(data.draw(st.integers(1, 3)))
    ]
    path = write(
        tmp_path_factory.mktemp("lvm") / "a.lvm",
        segments,
        how=how,
        mark="." if separator == "Comma" else data.draw(st.sampled_from(".,")),
        separator=separator,
        told=separator == "Tab" and data.draw(st.booleans()),
    )
    tables = read_tables(path)
    groups = len(names) if how == "Multi" else 1
    assert len(tables) == groups * len(segments)
    for place, segment in enumerate(segments):
        own = tables[groups * place : groups * (place + 1)]
        read = {column.name: column for table in own for column in table.columns[1:]}
        assert list(read) == names
        for (name, values), unit in zip(segment.values.items(), segment.units or [None] * 3, strict=False):
            np.testing.assert_allclose(read[name].values, values, rtol=1e-9)
            assert read[name].unit == unit
        for table in own:
            np.testing.assert_allclose(table.columns[0].values, STEP_S * np.arange(count), atol=1e-9)
            begun = np.datetime64(f"2026-11-28T10:00:{10 * place:02d}", "ns")
            assert abs(table.columns[0].begun - begun) < np.timedelta64(1, "us")


@pytest.mark.parametrize("how", ["No", "One", "Multi"])
@pytest.mark.parametrize("by_clock", [True, False])
def test_packets_of_one_recording_are_put_together(tmp_path: Path, how: str, *, by_clock: bool) -> None:
    """A recorder that writes as it goes begins a segment with each packet; where the next is late, anew."""
    values = np.arange(400.0)
    packets = [
        Segment(
            {"Force": values[k : k + 100], "Position": -values[k : k + 100]},
            clock_s=STEP_S * k if by_clock else 0.0,
            first_s=0.0 if by_clock else STEP_S * k,
        )
        for k in (0, 100, 200)
    ]
    late = Segment({"Force": values[300:], "Position": -values[300:]}, clock_s=7.0)
    tables = read_tables(write(tmp_path / "a.lvm", [*packets, late], how=how))
    assert [len(table) for table in tables] == ([300, 300, 100, 100] if how == "Multi" else [300, 100])
    first = tables[0]
    np.testing.assert_allclose(first.columns[0].values, STEP_S * np.arange(300), atol=1e-9)
    np.testing.assert_array_equal(first.columns[1].values, values[:300])
    assert first.lines is not None
    assert len(first.lines) == 300


def test_packets_without_headings_are_told(tmp_path: Path) -> None:
    packets = [Segment({"Force": np.arange(100.0) + k}) for k in (0, 100)]
    path = write(tmp_path / "a.lvm", packets, headings=False)
    lines = path.read_text(encoding="cp1252").splitlines()
    blank = [row for row, line in enumerate(lines) if not line]
    path.write_text(
        "\n".join(line for row, line in enumerate(lines) if row not in blank[:1]), encoding="cp1252"
    )
    (table,) = read_tables(path)
    assert len(table) == 200
    assert any(
        "200 rows from line 19 under a header of 100 samples: taken to follow" in n for n in table.notes
    )


def test_comments_and_channels_without_samples_are_left_out(tmp_path: Path) -> None:
    path = write(tmp_path / "a.lvm", [Segment({"Force": np.arange(9.0), "Idle": np.arange(9.0)})], how="One")
    lines = path.read_text(encoding="cp1252").splitlines()
    first = next(row for row, line in enumerate(lines) if line.startswith("X_Value")) + 1
    for row in range(first, first + 9):
        x, force, _ = lines[row].split("\t")
        lines[row] = f"{x}\t{force}\t\tLOST COMMUNICATION"
    path.write_text("\n".join(lines), encoding="cp1252")
    (table,) = read_tables(path)
    assert [column.name for column in table.columns] == ["time", "Force"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            lambda text: text.partition("***End")[0],
            ": is cut off in its header: ***End_of_Header*** is missing",
        ),
        (
            lambda text: text.replace("X_Value\t", "Value\t"),
            ":10: a row of names that begins with 'X_Value' is mis",
        ),
        (
            lambda text: text.replace("\t3.0", "\t3.x0"),
            ":22: column 'Force': '3.x000000000E+00' is not a number",
        ),
        (
            lambda text: text.replace("Delta_X", "Delta"),
            ":10: channel 'Force' says no step of its times (Delta",
        ),
        (lambda text: text.partition("Channels")[0], ": holds no samples"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path: Path, change: object, told: str) -> None:
    assert callable(change)
    path = write(tmp_path / "a.lvm", [Segment({"Force": np.arange(9.0)})])
    path.write_text(change(path.read_text(encoding="cp1252")), encoding="cp1252")
    with pytest.raises(MeasurementError) as refused:
        read_tables(path)
    assert f"{path}{told}" in str(refused.value)


def test_segments_of_a_trigger_are_a_shot_each(tmp_path: Path) -> None:
    time = STEP_S * np.arange(2000)
    segments = [
        Segment(
            {"Excitation force": 5.0 * np.sin(turn * time), "Laser position": 0.2 * np.cos(turn * time)},
            clock_s=30.0 * place,
            units=("Newtons", "mm"),
        )
        for place, turn in enumerate((4.0, 5.0, 6.0))
    ]
    tables = read_tables(write(tmp_path / "a.lvm", segments, mark=","))
    given_values = read_given({"constants": ["mass=2kg"]}, None, "driven")
    shots = make_campaign(tables, guess(tables, given_values)).campaign.shots
    assert len(shots) == 3
    for shot, turn in zip(shots, (4.0, 5.0, 6.0), strict=True):
        assert shot.position is not None
        np.testing.assert_allclose(
            shot.position.values, 2e-4 * np.cos(turn * shot.position.time_s), atol=1e-10
        )


def test_units_as_labview_writes_them_are_known(tmp_path: Path) -> None:
    segment = Segment({"Force": np.arange(9.0), "Current": np.arange(9.0)}, units=("Volts", "Amps"))
    (table,) = read_tables(write(tmp_path / "a.lvm", [segment]))
    assert [column.unit for column in table.columns] == ["s", "V", "A"]


def test_words_for_lost_values_are_taken_as_they_were_said(tmp_path: Path) -> None:
    values = np.arange(40.0)
    path = write(tmp_path / "a.lvm", [Segment({"Force": values, "Position": values + 100.0})])
    text = path.read_text()
    path.write_text(text.replace("7.000000000E+00", "Over", 1).replace("1.090000000E+02", "OVER", 1))
    with pytest.raises(MeasurementError, match=r"'Over' is not a number with decimal point.*`lost: "):
        read_tables(path)
    (table,) = read_tables(path, dialect=Dialect(lost=frozenset({"over"})))
    force, position = (column.values for column in table.columns[1:])
    assert np.flatnonzero(np.isnan(force)).tolist() == [7]
    assert np.flatnonzero(np.isnan(position)).tolist() == [9]
    assert np.array_equal(np.delete(force, 7), np.delete(values, 7))
