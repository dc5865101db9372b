"""Channels of one file keep the times at which each was recorded, or the file is refused."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from impactcell.cli.app import run_verb
from impactcell.errors import MeasurementError
from impactcell.measurements import ColumnMeaning, guess, read_tables
from impactcell.measurements.given import read_given
from impactcell.measurements.records.recorders import records_of
from impactcell.web.texts.import_faults import page_fault

COUNT = 60
START = np.datetime64("2024-05-01T10:00:00.000000")
MS = np.timedelta64(1, "ms")
RAMP = np.linspace(0.0, 1.0, COUNT)
Group = Mapping[str, tuple[Any, Mapping[str, object]]]


def waveform(unit: str, step_s: float, start: np.datetime64 | None = START, offset_s: float = 0.0) -> Any:
    said = {"unit_string": unit, "wf_increment": step_s, "wf_start_offset": offset_s}
    return RAMP, said if start is None else {**said, "wf_start_time": start}


def write(path: Path, groups: Mapping[str, Group]) -> Path:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed")
    with nptdms.TdmsWriter(path) as writer:
        for group, channels in groups.items():
            writer.write_segment(
                [nptdms.ChannelObject(group, name, *channel) for name, channel in channels.items()]
            )
    return path


def times(path: Path, *said: str) -> list[dict[str, tuple[float, float]]]:
    """Give first time and step of each channel of each record [s]."""
    tables = read_tables(path)
    mapping = guess(tables, read_given({"constants": said}))
    assert not mapping.faults
    return [
        {str(name): (float(t[0]), float(np.diff(t).mean())) for name, t in record.times.items()}
        for record in records_of(tables, mapping)[0]
    ]


def close(first_s: float, step_s: float) -> Any:
    return pytest.approx((first_s, step_s), rel=1e-6, abs=1e-9)


def test_waveforms_of_one_length_go_by_their_own_steps(tmp_path: Path) -> None:
    group = {"force": waveform("N", 1e-4), "position": waveform("m", 2e-4)}
    path = write(tmp_path / "a.tdms", {"g": group})
    assert times(path) == [{"force": close(0.0, 1e-4), "position": close(0.0, 2e-4)}]


def test_waveforms_of_one_clock_share_a_table_with_what_is_no_waveform(tmp_path: Path) -> None:
    group = {
        "force": waveform("N", 1e-4),
        "position": waveform("m", 1e-4),
        "pressure": (RAMP, {"unit_string": "bar"}),
    }
    (table,) = read_tables(write(tmp_path / "a.tdms", {"g": group}))
    assert [column.name for column in table.columns] == ["time", "force", "position", "pressure"]


@pytest.mark.parametrize("within_one_group", [True, False])
def test_waveforms_begin_when_they_say(within_one_group: bool, tmp_path: Path) -> None:
    force = {"force": waveform("N", 1e-4, START, -1e-3)}
    position = {"position": waveform("m", 1e-4, START + 5 * MS, 1e-3)}
    groups = {"g": {**force, **position}} if within_one_group else {"a": force, "b": position}
    path = write(tmp_path / "a.tdms", groups)
    assert times(path) == [{"force": close(-1e-3, 1e-4), "position": close(6e-3, 1e-4)}]


def stamps(start: np.datetime64) -> tuple[Any, dict[str, object]]:
    return start + 100 * np.arange(COUNT) * np.timedelta64(1, "us"), {}


def test_moments_count_from_the_first_of_what_was_recorded_together(tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.tdms",
        {
            "a": {"time": stamps(START + 5 * MS), "force": (RAMP, {"unit_string": "N"})},
            "b": {"time": stamps(START), "position": (RAMP, {"unit_string": "m"})},
            "c": {"actuator": waveform("m", 1e-4, START + 2 * MS)},
        },
    )
    (record,) = times(path)
    assert record == {
        "force": close(5e-3, 1e-4),
        "position": close(0.0, 1e-4),
        "actuator": close(2e-3, 1e-4),
    }


@pytest.mark.parametrize("as_moments", [True, False])
def test_recordings_one_after_the_other_have_a_zero_each(as_moments: bool, tmp_path: Path) -> None:
    groups: dict[str, Group] = {}
    for number in range(3):
        start = START + 60_000 * number * MS
        if as_moments:
            groups[f"run {number}"] = {"time": stamps(start), "force": (RAMP, {"unit_string": "N"})}
        else:
            groups[f"run {number}"] = {"force": waveform("N", 1e-4, start)}
    assert times(write(tmp_path / "a.tdms", groups)) == [{"force": close(0.0, 1e-4)}] * 3


def test_a_channel_that_both_have_makes_no_two_recordings_of_what_was_at_one_time(tmp_path: Path) -> None:
    later = START + 2 * MS
    path = write(
        tmp_path / "a.tdms",
        {
            "a": {"force": waveform("N", 1e-4), "sync": waveform("V", 1e-4)},
            "b": {"position": waveform("m", 1e-4, later), "sync": waveform("V", 1e-4, later)},
        },
    )
    assert times(path) == [{"force": close(0.0, 1e-4), "position": close(2e-3, 1e-4)}]


@pytest.mark.parametrize("unset", [None, np.datetime64("1904-01-01T00:00:00")])
def test_a_waveform_without_a_moment_is_refused_where_others_differ(
    unset: np.datetime64 | None, tmp_path: Path
) -> None:
    known = {"force": waveform("N", 1e-4), "actuator": waveform("m", 1e-4, START + MS)}
    path = write(tmp_path / "a.tdms", {"g": {**known, "position": waveform("m", 1e-4, unset)}})
    with pytest.raises(MeasurementError, match="'position' of group 'g' does not say at which") as caught:
        read_tables(path)
    assert str(caught.value).startswith(f"{path}: ")
    for language, word in (("en", "wf_start_time"), ("de", "sagt nicht, wann")):
        assert word in page_fault(str(caught.value), language)[1]
    assert page_fault(str(caught.value), "de")[0] == "de"
    del known["actuator"]
    path = write(tmp_path / "b.tdms", {"g": {**known, "position": waveform("m", 1e-4, unset)}})
    assert times(path) == [{"force": close(0.0, 1e-4), "position": close(0.0, 1e-4)}]


def test_a_numeric_time_beside_differing_moments_is_refused(tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.tdms",
        {
            "a": {"force": waveform("N", 1e-4), "actuator": waveform("m", 1e-4, START + MS)},
            "b": {"time": (RAMP, {"unit_string": "s"}), "position": (RAMP, {"unit_string": "m"})},
        },
    )
    with pytest.raises(MeasurementError, match="'time' of group 'b' does not say at which moment"):
        read_tables(path)


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_invalid_samples_of_mdf_are_left_out_at_their_times(version: str, tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed")
    path = tmp_path / ("a.mf4" if version[0] == "4" else "a.mdf")
    invalid = np.zeros(COUNT, dtype=bool)
    invalid[10:15] = version[0] == "4"  # version 3 knows no invalid samples
    t = np.arange(COUNT) * 1e-3 - 0.03
    counts = np.arange(COUNT, dtype=np.int16)
    with asammdf.MDF(version=version) as file:
        file.append(
            [
                asammdf.Signal(RAMP, t, name="position", unit="m"),
                asammdf.Signal(counts, t, name="force", unit="N", invalidation_bits=invalid),
            ]
        )
        file.save(path, overwrite=True)
    (table,) = read_tables(path)
    force = table.column("force")
    assert force is not None
    np.testing.assert_array_equal(force.values, np.where(invalid, np.nan, counts))
    assert ("force: 5 samples flagged invalid left out" in table.notes[0]) == bool(invalid.any())
    assert times(path) == [{"position": close(-0.03, 1e-3), "force": pytest.approx((-0.03, 1e-3), rel=0.2)}]


def test_a_rate_is_not_taken_for_one_table_of_a_file_alone(tmp_path: Path) -> None:
    timed = {"time": (1e-3 * np.arange(COUNT) - 0.03, {"unit_string": "s"}), "force": (RAMP, {"unit": "N"})}
    path = write(tmp_path / "a.tdms", {"a": timed, "b": {"position": (RAMP, {"unit": "m"})}})
    with pytest.raises(MeasurementError, match=r"a\.tdms: b: has no column of time, where .*a\.tdms: a has"):
        run_verb(["import", str(path), "--dry-run", "--set", "rate=1kHz"])
    tables = read_tables(path)
    with pytest.raises(MeasurementError) as caught:
        records_of(tables, guess(tables, read_given({"constants": ["rate=1kHz"]})))
    for language in ("en", "de"):
        spoken, said = page_fault(str(caught.value), language)
        assert spoken == language
        assert "--" not in said
        assert "form below" in said or "Formular" in said
    both = read_given({"constants": ["rate=1kHz"], "columns": ["ignored=time"]})
    ((record,), _) = records_of(tables, guess(tables, both))
    np.testing.assert_array_equal(record.times[ColumnMeaning.FORCE], record.times[ColumnMeaning.POSITION])


def test_a_rate_counts_beside_a_table_without_any_channel(tmp_path: Path) -> None:
    group = {"force": (RAMP, {"unit": "N"}), "position": (RAMP, {"unit": "m"})}
    trend = {"time": (RAMP[:20], {"unit": "s"}), "temperature": (RAMP[:20], {"unit": "K"})}
    path = write(tmp_path / "a.tdms", {"a": group, "slow": trend})
    (record,) = times(path, "rate=1kHz")
    assert record == {"force": close(0.0, 1e-3), "position": close(0.0, 1e-3)}
