"""What was written in any dialect is read back exactly; what cannot be read is told with its line."""

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from impactcell.errors import MeasurementError
from impactcell.measurements import Dialect, Limits, Table, read_tables
from impactcell.measurements.columns.sampling_step import sampling_step_s
from impactcell.measurements.given import read_given

DIALECTS = [(";", "."), (";", ","), ("\t", "."), ("\t", ","), (",", "."), ("|", ","), (" ", "."), (" ", ",")]
HEADERS = [("Time", "Force", "Position"), ("Zeit", "Kraft", "Weg"), ("Größe t", "Schlag µ", "x°")]
PREAMBLES = ["", "Measured by hand\n", "Messung: 12\nDatum: 22.11.2026\n\n", "# exported\n# Masse: 18,9 kg\n"]


def one(path: Path, dialect: Dialect | None = None, limits: Limits | None = None) -> Table:
    (table,) = read_tables(path, limits, dialect)
    return table


def grouped(text: str, separator: str) -> str:
    whole, point, rest = text.partition(".")
    sign, digits = ("-", whole[1:]) if whole.startswith("-") else ("", whole)
    if "e" in text or len(digits) < 4:
        return text
    head = len(digits) % 3 or 3
    parts = [digits[:head], *(digits[i : i + 3] for i in range(head, len(digits), 3))]
    return sign + separator.join(parts) + point + rest


def localised(value: float, decimal: str, thousands: str | None) -> str:
    text = repr(value)
    if thousands:
        text = grouped(text, "\0")
    return text.replace(".", decimal).replace("\0", thousands or "")


@given(data=st.data())
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_round_trip_over_dialects(data: st.DataObject, tmp_path: Path) -> None:
    delimiter, decimal = data.draw(st.sampled_from(DIALECTS))
    encoding = data.draw(st.sampled_from(["utf-8", "utf-8-sig", "cp1252", "utf-16"]))
    ending = data.draw(st.sampled_from(["\n", "\r\n", "\r"]))
    preamble = data.draw(st.sampled_from(PREAMBLES))
    names = data.draw(st.sampled_from(HEADERS))
    units = data.draw(st.sampled_from([None, "header", "row"])) if delimiter != " " else None
    quoted = data.draw(st.booleans()) and delimiter != " "
    separators = [None] if delimiter == " " else [None, "'", ","] if decimal == "." else [None, "'", "."]
    thousands = data.draw(st.sampled_from([s for s in separators if s != delimiter]))
    trailing = data.draw(st.booleans()) and not quoted and delimiter in ";\t"
    count = data.draw(st.integers(8, 60))
    finite = st.floats(-1e7, 1e7, allow_nan=False).map(lambda value: value + 0.0)
    columns = [
        [0.1 * i + 0.05 for i in range(count)],
        data.draw(st.lists(finite, min_size=count, max_size=count)),
        data.draw(st.lists(finite, min_size=count, max_size=count)),
    ]
    header = [name.replace(" ", "_") if delimiter == " " else name for name in names]
    if units == "header":
        header = [f"{name} [{unit}]" for name, unit in zip(header, ("s", "N", "mm"), strict=True)]
    rows = [header] + ([["s", "N", "mm"]] if units == "row" else [])
    rows += [[localised(value, decimal, thousands) for value in row] for row in zip(*columns, strict=True)]
    if quoted:
        out = io.StringIO()
        csv.writer(out, delimiter=delimiter, quoting=csv.QUOTE_ALL, lineterminator="\n").writerows(rows)
        body = out.getvalue()
    else:
        body = "".join(delimiter.join(row) + (delimiter if trailing else "") + "\n" for row in rows)
    path = tmp_path / "record.csv"
    path.write_bytes((preamble + body).replace("\n", ending).encode(encoding))
    table = one(path)
    assert [column.name for column in table.columns] == [
        name.replace(" ", "_") if delimiter == " " else name for name in names
    ]
    if units:
        assert [column.unit for column in table.columns] == ["s", "N", "mm"]
    for column, values in zip(table.columns, columns, strict=True):
        np.testing.assert_array_equal(column.values, values)


@given(content=st.binary(max_size=400))
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_are_read_or_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "any.csv"
    path.write_bytes(content)
    try:
        table = one(path)
    except MeasurementError as error:
        told = str(error)
    else:
        told = str(path)
        assert len({len(column.values) for column in table.columns}) == 1
    assert str(path) in told


def rows(count: int, form: str = "{0};{1}") -> str:
    return "".join(form.format(i, 2 * i + 1) + "\n" for i in range(count))


def test_lines_of_rows_and_what_is_beside_them(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        "Masse: 18,9 kg\nAnlage;7\n\nZeit;Kraft\n[ms];[kN]\n" + rows(30) + "\n# end\n", encoding="utf-8"
    )
    table = one(path)
    assert table.attributes == {"Masse": "18,9 kg", "Anlage": "7"}
    assert [(c.name, c.unit) for c in table.columns] == [("Zeit", "ms"), ("Kraft", "kN")]
    assert table.place(0) == f"{path}:6"
    assert "header in line 4, units in line 5, numbers from line 6" in table.notes


@pytest.mark.parametrize("below", [",\n", ", \t\n", ";;\n", "\n"])
def test_rows_without_a_cell_below_a_table_are_no_rows(below: str, tmp_path: Path) -> None:
    """A spreadsheet saves as many as its sheet once had."""
    path = tmp_path / "a.csv"
    path.write_text(rows(40, "{0}.5,{1}.25") + 16_600 * below, encoding="utf-8")
    table = one(path)
    assert [len(column.values) for column in table.columns] == [40, 40]
    assert table.columns[1].values[-1] == 79.25


def test_dates_and_clock_times_become_seconds(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        "Datum;F\n" + "".join(f"22.11.2026 23:59:{58 + i},5;{i}\n" for i in range(2)) * 1, encoding="utf-8"
    )
    path.write_text(
        "Uhrzeit;F\n" + "".join(f"2026-11-22T10:00:{i:02d}.250;{i}\n" for i in range(30)), encoding="utf-8"
    )
    column = one(path).columns[0]
    assert column.unit == "s"
    np.testing.assert_allclose(column.values, np.arange(30.0), atol=1e-6)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("t;F\n" + rows(20) + "7;x\n" + rows(20), ":22: column 'F': 'x' is not a number with decimal point"),
        ("t;F\n1;x\n" + rows(40), ":2: '1;x' is neither a header nor a row of numbers"),
        ("t;F\n" + rows(20) + "7\n" + rows(20), ":22: 1 cells where the table has 2"),
        ("t;F\n" + rows(20) + "7;8;9\n" + rows(20), ":22: 3 cells where the table has 2"),
        ("t;F\n" + rows(20) + "7;1e999\n" + rows(20), ":22: column 'F' is infinite"),
        ("a;b;c;d\n" + rows(40, "{0};{1};{0}"), ":1: 4 cells where the rows below have 3"),
        ("t;F\n" + rows(40).replace(";21\n", ";1_000\n"), ":12: column 'F': '1_000' is not a number"),
        ("nothing here\nat all\n", "no table of numbers"),
        ("\n\n \n", "is empty; leave the file out, or record it again"),
        (
            "Messung 5\nMasse: 18,9 kg\nVorschub: 3000 mm/min\n\nZeit [ms];Kraft [N];Weg [mm]\n",
            ":5: has no samples below its names; leave the file out",
        ),
        ("Messung;5\nDatum;2026-01-07\nt [s];F [N];x [m]\n", ":3: has no samples below its names"),
        ("time_s,force_n,position_m", ":1: has no samples below its names"),
        (
            '{"t": 0.0, "F": 1.5}\n{"t": 0.1, "F": 2.5}\n',
            ": has a JSON object in each line, which is not read",
        ),
    ],
)
def test_faults_name_their_line(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(MeasurementError) as caught:
        one(path)
    assert str(caught.value).startswith(str(path))
    assert told in str(caught.value)


def test_a_record_cut_off_in_its_last_line_is_read_without_it(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;F\n" + rows(20) + "20", encoding="utf-8")
    table = one(path)
    assert len(table) == 20
    assert "1 blank or comment lines left out" in table.notes[-1] or "cut off" in table.notes[-1]


def test_a_number_that_may_be_thousands_is_told_and_can_be_given(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;F\n" + "".join(f"{i};{i + 1},250\n" for i in range(20)), encoding="utf-8")
    table = one(path)
    assert table.columns[1].values[0] == 1.25
    assert "could be thousands" in table.notes[0]
    assert one(path, Dialect(decimal=".")).columns[1].values[0] == 1250.0


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        (Limits(file_bytes=100), "more than the 0 MB that are read"),
        (Limits(rows=10), "rows, more than the 10"),
        (Limits(columns=1), "has 2 columns, more than the 1"),
        (Limits(cells=50), "cells, more than the 50"),
    ],
)
def test_what_is_too_large_is_refused(tmp_path: Path, limits: Limits, told: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;F\n" + rows(40), encoding="utf-8")
    with pytest.raises(MeasurementError, match=told):
        one(path, limits=limits)


def test_two_gigabytes_are_refused_without_being_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.csv"
    with path.open("wb") as file:
        file.truncate(2_000_000_000)  # a sparse file: nothing of it is on the disk
    with pytest.raises(MeasurementError, match="has 2000 MB, more than the 500 MB"):
        one(path)


def test_ten_thousand_columns_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "wide.csv"
    line = ";".join("1" * 10_000) + "\n"
    path.write_text(";".join(f"c{i}" for i in range(10_000)) + "\n" + line * 5, encoding="utf-8")
    with pytest.raises(MeasurementError, match="has 10000 columns, more than the 1000"):
        one(path)


@pytest.mark.parametrize(
    ("content", "told"),
    [(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" * 9, "is neither text nor"), (b"", "is empty; leave the file out")],
)
def test_what_is_no_text_is_refused(tmp_path: Path, content: bytes, told: str) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(MeasurementError, match=told):
        one(path)
    with pytest.raises(MeasurementError, match="No such file"):
        one(tmp_path / "missing.csv")
    with pytest.raises(MeasurementError, match="is not a file"):
        one(tmp_path)


def test_a_number_in_a_comment_is_no_row_of_the_table(tmp_path: Path) -> None:
    path = tmp_path / "record.csv"
    rows = "".join(f"{k},0 0,0 0,0\n" for k in range(8))
    path.write_text(f"# exported\n# Masse: 18,9 kg\nTime Force Position\n{rows}", encoding="utf-8")
    table = one(path)
    assert [column.name for column in table.columns] == ["Time", "Force", "Position"]
    assert table.attributes["Masse"] == "18,9 kg"


def test_a_preamble_with_figures_above_names_and_units(tmp_path: Path) -> None:
    """One pair of columns a channel, and rows that say themselves what they are."""
    path = tmp_path / "a.csv"
    head = "Timestamp,2020-03-16 17:04:51,Timestamp,2020-03-16 17:04:51\nInterval,0.0005,Interval,0.0005\n"
    head += 'Channel name,"Force",Channel name,"Input 1"\nUnit,"V",Unit,"V"\n'
    rows = [f"{5e-4 * i:g},{0.1 * i},{5e-4 * i:g},{-0.2 * i}" for i in range(40)]
    path.write_text(head + "\n".join(rows), encoding="utf-8")
    table = one(path)
    assert [(column.name, column.unit) for column in table.columns] == [
        ("column 1", None), ("Force", "V"), ("column 3", None), ("Input 1", "V"),
    ]  # fmt: skip
    assert table.attributes["Interval"] == "0.0005"
    assert sampling_step_s(table, {}) == 5e-4
    assert table.columns[1].values == pytest.approx(0.1 * np.arange(40))


def test_names_and_units_mixed_over_two_lines(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    head = "Axis1\nNumber of sampling data,40\nSampling time interval(ms),0.667\n"
    head += "Time,Analog 1,Analog 2\nms,Servo motor speed,Torque\n"
    path.write_text(head + "\n".join(f"{0.667 * i:g},{i},{-i}" for i in range(40)), encoding="utf-8")
    table = one(path)
    assert [(column.name, column.unit) for column in table.columns] == [
        ("Time", "ms"), ("Servo motor speed", None), ("Torque", None),
    ]  # fmt: skip
    assert sampling_step_s(table, {}) == pytest.approx(6.67e-4)


def test_a_broken_first_row_is_no_preamble(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,F\n0.0,oops\n" + "\n".join(f"{i},{i}" for i in range(1, 40)), encoding="utf-8")
    with pytest.raises(MeasurementError, match=r":2: '0.0,oops' is neither"):
        one(path)


@pytest.mark.parametrize(
    ("said", "step_s"),
    [
        ("Abtastrate: 0,01 MHz", 1e-4), ("Abtastrate: 10.000 Hz", None), ("Abtastrate: 10 kS/s", 1e-4),
        ("Abtastrate: 10kHz", 1e-4), ("Abtastrate: 20000", 5e-5), ("Abtastrate [kHz]: 10", 1e-4),
        ("Abtastrate: 10 Umdrehungen", None), ("Abtastrate: 10 ms", None),
        ("Abtastintervall: 0,1 Millisekunde", 1e-4), ("Abtastintervall: 100 µs", 1e-4),
        ("Abtastintervall: 0,001", 1e-3), ("Abtastintervall: 10 Takte", None),
    ],
)  # fmt: skip
def test_a_rate_beside_the_columns_is_taken_in_its_unit_or_not_at_all(
    tmp_path: Path, said: str, step_s: float | None
) -> None:
    """In the decimal mark of the file; nothing that is not known counts as Hz or s."""
    path = tmp_path / "a.csv"
    rows = "\n".join(f"{i},25;{i},5" for i in range(40))
    path.write_text(f"Messung 7\n{said}\n\nKraft [N];Weg [mm]\n{rows}", encoding="utf-8")
    table = one(path)
    assert table.decimal == ","
    step = sampling_step_s(table, {})
    assert step is None if step_s is None else step == pytest.approx(step_s, rel=1e-12)


def test_no_group_of_thousands_begins_with_nought(tmp_path: Path) -> None:
    """Times with a decimal point beside a decimal comma are no whole numbers."""
    path = tmp_path / "a.csv"
    rows = [f"{i / 1000:.3f};{0.5 * i:.2f};{-0.25 * i:.3f}".split(";") for i in range(999)]
    lines = [";".join([time, force.replace(".", ","), way.replace(".", ",")]) for time, force, way in rows]
    path.write_text("Zeit [s];Kraft [N];Weg [mm]\n" + "\n".join(lines), encoding="utf-8")
    time = one(path).columns[0]
    assert time.text is not None
    assert time.text[:2] == ("0.000", "0.001")


def test_a_quote_that_is_never_closed_swallows_no_row(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{i};{2 * i};" + ('"contact' if i in (7, 20) else "") for i in range(40)]
    path.write_text("t [s];F [N];remark\n" + "\n".join(rows), encoding="utf-8")
    table = one(path)
    assert table.columns[1].values == pytest.approx(2.0 * np.arange(40))
    assert table.columns[2].text is not None
    assert table.columns[2].text[7] == "contact"


@pytest.mark.parametrize("sign", ["#NV", "#N/A"])
def test_a_row_whose_first_cell_has_no_value_is_no_comment(tmp_path: Path, sign: str) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{sign if i % 9 == 4 else i};{i / 8:g}" for i in range(40)]
    path.write_text("# by hand\nF [N];t [s]\n" + "\n".join(rows), encoding="utf-8")
    table = one(path)
    assert table.columns[1].values == pytest.approx(np.arange(40) / 8)
    assert np.flatnonzero(np.isnan(table.columns[0].values)).tolist() == [4, 13, 22, 31]


@pytest.mark.parametrize(
    ("head", "rows", "columns"),
    [
        (
            ["Weg [µm]"],
            [f"{k},{k % 10}" for k in range(50)],
            {"Weg": [k + 0.1 * (k % 10) for k in range(50)]},
        ),
        (["rate: 1 kHz", "", "Weg"], ["-0,5"] * 9 + ["3,25"] * 9, {"Weg": [-0.5] * 9 + [3.25] * 9}),
        (["a,b"], [f"{k},7" for k in range(50)], {"a": list(range(50)), "b": [7] * 50}),
        ([], [f"{k},7" for k in range(50)], {"column 1": list(range(50)), "column 2": [7] * 50}),
        (["a"], [f"{k},7.5" for k in range(50)], {"column 1": list(range(50)), "column 2": [7.5] * 50}),
    ],
)
def test_a_column_of_its_own_with_decimal_commas_is_one(
    tmp_path: Path, head: list[str], rows: list[str], columns: dict[str, list[float]]
) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join([*head, *rows]), encoding="utf-8")
    (table,) = read_tables(path)
    assert {column.name: column.values.tolist() for column in table.columns} == columns


@pytest.mark.parametrize(
    ("head", "row", "columns"),
    [
        pytest.param(
            ["HBM_CATMAN_DATAFILE_50", "", "T0\t28.11.2026 10:00:00", "",
             "Time 1 - default sample rate [s]\tForce [N]\tWeg [mm]",
             "SampleRate=1000.0 Hz\tSampleRate=1000.0 Hz\tSampleRate=1000.0 Hz",
             "Format=Default\tFormat=2\tFormat=2", "\t\t"],
            "{k:.6f}\t{f:.6f}\t{x:.6f}", {"Time 1 - default sample rate": "s", "Force": "N", "Weg": "mm"},
            id="catman",
        ),
        pytest.param(
            ["# imc", "Kraft;Weg", "x0=0;x0=0", "dx=0,001 s;dx=0,001 s", "N;mm"],
            "{f:.6f};{x:.6f}", {"Kraft": "N", "Weg": "mm"}, id="imc",
        ),
        pytest.param(
            ["x-axis,1,2", "second,Volt,Volt"], "{k:.6f},{f:.6f},{x:.6f}",
            {"column 1": "second", "column 2": "Volt", "column 3": "Volt"}, id="Keysight",
        ),
        pytest.param(
            ["X,CH1,CH2,Start,Increment,", "Sequence,Volt,Volt,-2e-1,1e-3,"], "{k:.1f},{f:.6f},{x:.6f},,",
            {"Sequence": None, "CH1": "Volt", "CH2": "Volt", "-2e-1": None, "1e-3": None}, id="Rigol",
        ),
        pytest.param(
            ["Time,Channel A,Channel B", "(ms),(V),(mV)", ""], "{k:.6f},{f:.6f},{x:.6f}",
            {"Time": "ms", "Channel A": "V", "Channel B": "mV"}, id="PicoScope",
        ),
        pytest.param(
            ["Data Header:\t0\tTime:\t0.123\tSec", "Station Name:\tx",
             "Time\tAxial Displacement\tAxial Force", "Sec\tmm\tN"],
            "{k:.6f}\t{x:.6f}\t{f:.6f}", {"Time": "Sec", "Axial Displacement": "mm", "Axial Force": "N"},
            id="MTS",
        ),
        pytest.param(
            ["sep=;", "Time [ms];r[21] Actual speed [1/min];r[80] Torque [Nm]"], "{k:.6f};{f:.6f};{x:.6f}",
            {"Time": "ms", "r[21] Actual speed": "1/min", "r[80] Torque": "Nm"}, id="drive",
        ),
    ],
)  # fmt: skip
def test_what_loggers_and_oscilloscopes_write(
    tmp_path: Path, head: list[str], row: str, columns: dict[str, str | None]
) -> None:
    wanted = {"k": [float(k) for k in range(40)], "f": [7.5 - k for k in range(40)]}
    path = tmp_path / "a.csv"
    for decimal in "." if "," in row else ".,":
        rows = [row.format(k=k, f=7.5 - k, x=0.25 * k).replace(".", decimal) for k in range(40)]
        path.write_text("\r\n".join([*head, *rows]) + "\r\n", encoding="utf-8")
        (table,) = read_tables(path)
        assert {column.name: column.unit for column in table.columns} == columns
        read = [column.values.tolist() for column in table.columns]
        assert all(values in read for key, values in wanted.items() if "{" + key in row)


def test_a_trend_of_a_plc_with_days_and_clock_times_apart(tmp_path: Path) -> None:
    rows = [f"Data,28/11/2026,10:00:00;{k:03d},{k * 0.5},{k * k}" for k in range(300)]
    head = ['Header: ,"trend"', "Sample Period: ,1,ms", 'Header:,"Date","Time","Force","Pos"']
    path = tmp_path / "a.csv"
    path.write_text("\n".join([*head, *rows]), encoding="utf-8")
    (table,) = read_tables(path)
    time = table.column("Time")
    assert time is not None
    np.testing.assert_allclose(time.values, 1e-3 * np.arange(300), atol=1e-9)


@pytest.mark.parametrize(
    ("last", "told"),
    [
        ("20", "line 22 left out, cut off after 1 of 2 cells: '20'"),
        (f"End of {'a ' * 30}measurement\n", "the last line, and no row of the table: 'End of" + " a" * 17),
    ],
)
def test_a_last_line_that_is_left_out_is_named(tmp_path: Path, last: str, told: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;F\n" + rows(20) + last, encoding="utf-8")
    table = one(path)
    assert len(table) == 20
    assert told in table.notes[-1]
    assert not any("blank or comment" in note for note in table.notes)


@pytest.mark.parametrize(
    ("footer", "told"),
    [
        (
            "\nStatistics\nMax;6\n# by hand\nMin;0\nOperator: M. Meier\n",
            "lines 403 to 407 left out, below the table and no rows of it: 'Statistics', 'Max;6', 'Min;",
        ),
        ("Recorded;Meier\nDevice;7", "lines 402 to 403 left out, below the table and no rows of it: 'Rec"),
    ],
)
def test_lines_of_words_below_the_table_are_left_out_and_named(
    tmp_path: Path, footer: str, told: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;F\n" + rows(400) + footer, encoding="utf-8")
    table = one(path)
    assert len(table) == 400
    assert table.notes[-1].startswith(told)


@pytest.mark.parametrize(
    ("end", "fault"),
    [
        ("20;OVER\n21;OVER\n", "a.csv:4002: column 'F': 'OVER' is not a number"),
        ("Max;6\n21;3\n", "a.csv:4002: column 't': 'Max' is not a number"),
        ("Max;6\nt;F\n", "a.csv:4003: the header again; delete the line"),
        ("Max;6\n" * 31, "a.csv:4002: column 't': 'Max' is not a number"),
        ("1.5.2026;Meier\nDevice;7\n", "a.csv:4002: column 't': '1.5.2026' is not a number"),
    ],
)
def test_no_row_is_taken_for_a_footer(tmp_path: Path, end: str, fault: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;F\n" + rows(4000) + end, encoding="utf-8")
    with pytest.raises(MeasurementError) as caught:
        one(path)
    assert fault in str(caught.value)


def test_a_header_that_comes_again_is_one_fault(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;F\n" + rows(20) + "t;F\n" + rows(20), encoding="utf-8")
    with pytest.raises(MeasurementError) as caught:
        one(path)
    assert str(caught.value) == f"{path}:22: the header again; delete the line"
    path.write_text(("t;F\n" + rows(20)) * 4, encoding="utf-8")
    with pytest.raises(MeasurementError) as caught:
        one(path)
    assert str(caught.value) == f"{path}:22: the header again; delete the line (and 2 more like this)"


def test_a_word_for_a_lost_value_is_told_once_and_can_be_said(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;F\n" + rows(40) + "41;OVER\n42;Error\n" * 12 + rows(400), encoding="utf-8")
    with pytest.raises(MeasurementError) as caught:
        one(path)
    first, second = str(caught.value).splitlines()
    assert first.startswith(f"{path}:42: column 'F': 'OVER' is not a number")
    assert first.endswith("with `lost: ['over']` in a --mapping file (and 11 more like this)")
    assert second.startswith(f"{path}:43: column 'F': 'Error' is not a number")
    file = tmp_path / "map.yaml"
    file.write_text("lost: [over, Error]\n")
    (table,) = read_tables(path, dialect=Dialect(lost=read_given({}, file).lost))
    assert int(np.isnan(table.columns[1].values).sum()) == 24
    path.write_text("t;F\n" + rows(40) + "41;OVER\n42;Error\n" * 40, encoding="utf-8")
    (table,) = read_tables(path, dialect=Dialect(lost=read_given({}, file).lost))
    assert int(np.isnan(table.columns[1].values).sum()) == 80, "a column of numbers, however many are lost"
    path.write_text("t;F\n" + rows(400) + "401;inf\n" * 5, encoding="utf-8")
    with pytest.raises(
        MeasurementError, match=r"csv:402: column 'F' is infinite; .* \(and 4 more like this\)$"
    ):
        one(path)
    file.write_text("lost: inf\n")
    (table,) = read_tables(path, dialect=Dialect(lost=read_given({}, file).lost))
    assert int(np.isnan(table.columns[1].values).sum()) == 5
    file.write_text("lost: {a: b}\n")
    with pytest.raises(MeasurementError, match="lost has to be a list of words"):
        read_given({}, file)
