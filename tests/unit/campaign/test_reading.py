"""Campaign directories: every faulty file is reported with its line, every good one is read as written."""

import os
import re
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.campaign import Campaign, Excitation, Sensor, read, write
from impactcell.errors import CampaignError
from impactcell.records import Capture, Channel

HEADER = """\
format: 1
excitation: tap
gravity_m_s2: 9.81
actuator:
  stroke_m: 0.0015
sensors:
  force: {rate_hz: 10000, noise_std_n: 0.4}
  position: {rate_hz: 1000, noise_std_m: 1e-6}
"""
SHOTS = "shot,velocity_mm_per_min,mass_kg,direction,batch,dwell_s\n1,3000,18.9,1,A,5\n2,6000,,-1,B,\n"
TRACE = "time_s,force_n,position_m\n0,1,0\n0.1,2,\n0.2,3,1e-3\n0.9,4,2e-3\n"


def campaign(directory: Path, header: str = HEADER, shots: str = SHOTS, **traces: str) -> Path:
    (directory / "traces").mkdir(parents=True)
    (directory / "campaign.yaml").write_text(header)
    (directory / "shots.csv").write_text(shots)
    for name, text in ({"1": TRACE, "2": TRACE} | {key[1:]: text for key, text in traces.items()}).items():
        (directory / "traces" / f"{name}.csv").write_text(text)
    return directory


def test_reads_si_units_unequal_rates_gaps_and_empty_cells(tmp_path: Path) -> None:
    read_back = read(campaign(tmp_path / "c"))
    assert read_back.excitation is Excitation.TAP
    assert read_back.stroke_m == 0.0015
    assert read_back.sensors["position"].noise_std == 1e-6
    first, second = read_back.shots
    assert first.velocity_m_s == pytest.approx(0.05)
    assert (first.cycle, first.mass_kg, first.direction, first.batch_id, first.dwell_s) == (
        1,
        18.9,
        1,
        "A",
        5.0,
    )
    assert np.isnan(second.mass_kg)
    assert np.isnan(second.dwell_s)
    assert second.direction == -1
    assert first.force is not None
    assert first.position is not None
    assert first.actuator is None
    np.testing.assert_array_equal(first.force.time_s, [0, 0.1, 0.2, 0.9])
    np.testing.assert_array_equal(first.position.time_s, [0, 0.2, 0.9])
    np.testing.assert_array_equal(first.position.values, [0, 1e-3, 2e-3])
    assert first.force.noise_std == 0.4


def test_defaults_where_columns_are_missing(tmp_path: Path) -> None:
    header = "format: 1\nexcitation: free_slide\nsensors:\n  position: {rate_hz: 148, noise_std_m: null}\n"
    got = read(campaign(tmp_path / "c", header, "shot,heading_deg,note\n1,-12.5,left\n2,,\n"))
    assert got.gravity_m_s2 == 9.81
    assert got.stroke_m == np.inf
    assert got.sensors["position"].noise_std is None
    shot = got.shots[0]
    assert np.isnan(shot.velocity_m_s)
    assert (shot.direction, shot.batch_id, shot.start_m) == (1, None, 0.0)
    assert shot.covariates == {"heading_deg": -12.5, "note": "left"}


@pytest.mark.parametrize("on_table", [False, True])
def test_positions_count_from_where_the_part_lay(tmp_path: Path, *, on_table: bool) -> None:
    shots = "shot,velocity_mm_per_min,start_m\n1,3000,0.01\n2,3000,-0.02\n"
    traces = {
        f"_{shot}": "time_s,position_m,actuator_m\n"
        + "".join(
            f"{t},{on_table * start + 0.05 * t},{on_table * start + 0.06 * t}\n" for t in (0.01, 0.02, 0.03)
        )
        for shot, start in ((1, 0.01), (2, -0.02))
    }
    for shot in read(campaign(tmp_path / "c", shots=shots, **traces)).shots:
        assert shot.position is not None
        assert shot.actuator is not None
        np.testing.assert_allclose(shot.position.values, [0.0005, 0.001, 0.0015], atol=1e-12)
        np.testing.assert_allclose(shot.actuator.values, [0.0006, 0.0012, 0.0018], atol=1e-12)


def test_start_position_and_covariates_are_kept(tmp_path: Path) -> None:
    shots = "shot,velocity_mm_per_min,start_m,temperature_c\n1,3000,0.01,21.5\n2,3000,,22\n"
    got = read(campaign(tmp_path / "c", shots=shots))
    assert [shot.start_m for shot in got.shots] == [0.01, 0.0]
    assert got.shots[1].covariates["temperature_c"] == 22.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("header", "line", "message"),
    [
        ("excitation: tap\n", None, "format is missing"),
        ("format: 2\nexcitation: tap\n", 1, "format 2 is not known"),
        ("format: 1\n", None, "excitation is missing"),
        ("format: 1\nexcitation: push\n", 2, "write one of tap, free_slide, driven"),
        ("format: 1\nexcitation: tap\ngravity: 9.8\n", 3, "unknown key 'gravity'"),
        ("format: 1\nexcitation: tap\ngravity_m_s2: heavy\n", 3, "gravity_m_s2 is 'heavy'"),
        ("format: 1\nexcitation: tap\ngravity_m_s2: .nan\n", 3, "positive number"),
        (
            "format: 1\nexcitation: tap\ngravity_m_s2: 981\n",
            3,
            "gravity of 981 m/s² is hardly meant, where taps have 1 to 30 m/s²: if that",
        ),
        ("format: 1\nexcitation: tap\nactuator: {stroke_m: -1}\n", 3, "actuator.stroke_m is '-1'"),
        (
            "format: 1\nexcitation: tap\nactuator:\n  stroke_m: 1.5\n",
            4,
            "actuator.stroke_m: a stroke of 1.5 m is hardly meant, where taps have 1e-05 to 0.1 m: if that",
        ),
        ("format: 1\nexcitation: tap\nsensors: {sound: {}}\n", 3, "unknown key 'sound'"),
        ("format: 1\nexcitation: tap\nsensors:\n  force: {noise_std_n: 0}\n", 4, "positive number"),
        ("format: 1\nexcitation: tap\nformat: 1\n", 3, "appears twice"),
        ("format: [1\n", 2, "is not YAML"),
        ("[" * 5000, None, "is nested too deeply"),
        ("- 1\n", 1, "block of `key: value`"),
        ("", None, "block of `key: value`"),
    ],
)
def test_faults_of_the_header(tmp_path: Path, header: str, line: int | None, message: str) -> None:
    directory = campaign(tmp_path / "c", header)
    place = "campaign.yaml: " if line is None else f"campaign.yaml:{line}: "
    with pytest.raises(CampaignError, match=re.escape(place)) as caught:
        read(directory)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("shots", "line", "message"),
    [
        ("", None, "is empty"),
        ("shot,velocity_mm_per_min\n", 1, "has no shots"),
        ("number,velocity_mm_per_min\n1,2\n", 1, "no column 'shot'"),
        ("shot,mass_kg\n1,2\n", 1, "no column 'velocity_mm_per_min'"),
        ("shot,shot,velocity_mm_per_min\n1,1,2\n", 1, "appears twice"),
        ("shot,velocity_mm_per_min\n1,3000\n1,3000\n", 3, "shot 1 is in line 2 already"),
        ("shot,velocity_mm_per_min\none,3000\n2,3000\n", 2, "shot is 'one'"),
        ("shot,velocity_mm_per_min\n1.5,3000\n2,3000\n", 2, "whole number"),
        ("shot,velocity_mm_per_min\n1,\n2,3000\n", 2, "velocity_mm_per_min is empty"),
        ("shot,velocity_mm_per_min\n1,-5\n2,3000\n", 2, "positive number"),
        ("shot,velocity_mm_per_min,mass_kg\n1,3000,x\n2,3000,1\n", 2, "mass_kg is 'x'"),
        ("shot,velocity_mm_per_min,direction\n1,3000,0\n2,3000,1\n", 2, "+1 or -1"),
        ("shot,velocity_mm_per_min,dwell_s\n1,3000,nan\n2,3000,1\n", 2, "dwell_s is 'nan'"),
        ("shot,velocity_mm_per_min\n1,3000,7\n2,3000\n", 2, "3 cells where the header has 2"),
        ('shot,velocity_mm_per_min\n1,"3000\n', 2, "is not CSV"),
        (
            "shot,velocity_mm_per_min\n1,3000\n2,3000\n3,3000\n",
            None,
            "3.csv: is missing; take the shot out of shots.csv or record it again",
        ),
        ("shot,velocity_mm_per_min\n1,3000\n", None, "2.csv: has no shot 2 in shots.csv"),
    ],
)
def test_faults_of_the_shots(tmp_path: Path, shots: str, line: int | None, message: str) -> None:
    directory = campaign(tmp_path / "c", shots=shots)
    with pytest.raises(CampaignError) as caught:
        read(directory)
    assert message in str(caught.value)
    if line is not None:
        assert f"shots.csv:{line}: " in str(caught.value)


@pytest.mark.parametrize(
    ("trace", "line", "message"),
    [
        ("", None, "is empty"),
        ("time_s,position_m\n", 1, "has no samples"),
        ("force_n,position_m\n1,2\n", 1, "no column time_s"),
        ("time_s\n1\n", 1, "has no channel"),
        ("time_s,actuator_m\n1,2\n", 1, "needs force_n or position_m"),
        ("time_s,position_mm\n1,2\n", 1, "unknown column 'position_mm'"),
        ("time_s,force_n,force_n\n1,2,3\n", 1, "appears twice"),
        ("time_s,force_n\n0,1\n0.1,nan\n", 3, "'nan' is not a finite number"),
        ("time_s,force_n\n0,inf\n", 2, "'inf' is not a finite number"),
        ("time_s,force_n\n0,1_0\n", 2, "'1_0' is not a finite number"),
        ("time_s,force_n\n0,1\n0.1,x\n", 3, "'x' is not a finite number"),
        ("time_s,force_n\n0,1\n0.1\n", 3, "1 cells where the header has 2"),
        ("time_s,force_n\n0,1\n\n0.1,2\n", 3, "a blank line"),
        ("time_s,force_n\n0,1\n0,2\n", 3, "time_s does not increase"),
        ("time_s,force_n\n0,1\n0.2,2\n0.1,3\n", 4, "time_s does not increase"),
        ("time_s,force_n\n0,1\n,2\n", 3, "time_s is empty"),
        ("time_s,force_n,position_m\n0,1,\n1,2,\n", 1, "position_m has no sample"),
    ],
)
def test_faults_of_a_trace(tmp_path: Path, trace: str, line: int | None, message: str) -> None:
    directory = campaign(tmp_path / "c", _2=trace)
    with pytest.raises(CampaignError) as caught:
        read(directory)
    assert message in str(caught.value)
    assert ("2.csv: " if line is None else f"2.csv:{line}: ") in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("\n1,3000", "\ninf,3000", "shots.csv:2: shot is 'inf'; it has to be a whole number from 1"),
        ("\n1,3000", "\n1e300,3000", "shots.csv:2: shot is '1e300'; it has to be a whole number from 1"),
        ("\n1,3000", "\n1,1e300", "shots.csv:2: velocity_mm_per_min is '1e300'; it has to be a positive"),
        (",18.9,", ",1e-300,", "shots.csv:2: mass_kg is '1e-300'; it has to be a positive number or empty"),
        ("A,5\n", "A,1e300\n", "shots.csv:2: dwell_s is '1e300'; it has to be a number from 0 or empty"),
        ("dwell_s\n", "temperature\n", ""),
        ("A,5\n", "A,inf\n", "shots.csv:2: temperature is 'inf'; it has to be a text, a finite number or"),
        ("noise_std_n: 0.4", "noise_std_n: 1e-300", "campaign.yaml:7: sensors.force.noise_std_n is '1e-300'"),
        ("gravity_m_s2: 9.81", "gravity_m_s2: 1_0", "campaign.yaml:3: gravity_m_s2 is '1_0'; it has to be a"),
        ("0.1,2,\n", "0.1,2e300,\n", "1.csv:3: '2e300' is not a finite number"),
        ("0.1,2,\n", "0.1e300,2,1\n", "1.csv:3: '0.1e300' is not a finite number"),
    ],
)
def test_numbers_that_no_measurement_has(tmp_path: Path, old: str, new: str, told: str) -> None:
    header, trace = HEADER.replace(old, new), TRACE.replace(old, new)
    shots = SHOTS.replace("dwell_s", "temperature") if "temperature" in told else SHOTS
    directory = campaign(tmp_path / "c", header, shots.replace(old, new), _1=trace)
    if not told:
        assert read(directory).shots[0].covariates == {"temperature": 5.0}
        return
    with pytest.raises(CampaignError, match=re.escape(told)):
        read(directory)


@pytest.mark.parametrize("name", ["campaign.yaml", "shots.csv", "traces/1.csv"])
def test_what_is_no_file_is_not_waited_for(tmp_path: Path, name: str) -> None:
    directory = campaign(tmp_path / "c")
    (directory / name).unlink()
    os.mkfifo(directory / name)
    with pytest.raises(CampaignError, match=f"{name}: is not a file; put the data themselves there"):
        read(directory)
    (directory / name).unlink()
    (directory / name).symlink_to("/dev/zero")
    with pytest.raises(CampaignError, match=f"{name}: is not a file"):
        read(directory)


def test_a_file_of_many_gigabytes_is_not_read(tmp_path: Path) -> None:
    directory = campaign(tmp_path / "c")
    with (directory / "traces" / "1.csv").open("r+b") as file:
        file.truncate(5_000_000_000)  # a hole, which takes no room
    with pytest.raises(CampaignError, match=r"1\.csv: has more than the 500 MB that are read"):
        read(directory)


def test_all_faults_at_once(tmp_path: Path) -> None:
    directory = campaign(
        tmp_path / "c",
        HEADER.replace("tap", "push"),
        "shot,velocity_mm_per_min\n1,3000\n2,3000\n",
        _1="time_s,force_n\n0,nan\n",
        _2="",
        _7=TRACE,
    )
    with pytest.raises(CampaignError) as caught:
        read(directory)
    lines = str(caught.value).splitlines()
    assert len(lines) == 4
    assert all(str(directory) in line for line in lines)


def test_long_lists_of_faults_are_cut_short(tmp_path: Path) -> None:
    directory = campaign(tmp_path / "c", _1="time_s,force_n\n" + "0,nan\n" * 1000)
    with pytest.raises(CampaignError, match="the same in 997 more rows"):
        read(directory)


def test_missing_directory_and_files(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="is not a directory"):
        read(tmp_path / "absent")
    (tmp_path / "bare").mkdir()
    with pytest.raises(CampaignError) as caught:
        read(tmp_path / "bare")
    assert [line.rsplit("/", 1)[-1].split(":")[0] for line in str(caught.value).splitlines()] == [
        "campaign.yaml",
        "shots.csv",
        "traces",
    ]


def test_not_text(tmp_path: Path) -> None:
    directory = campaign(tmp_path / "c")
    (directory / "traces" / "1.csv").write_bytes(b"time_s,force_n\n0,\xff\n")
    with pytest.raises(CampaignError, match="is not UTF-8"):
        read(directory)


def test_driven_needs_both_channels(tmp_path: Path) -> None:
    directory = campaign(tmp_path / "c", "format: 1\nexcitation: driven\n", _1="time_s,force_n\n0,-5\n1,5\n")
    with pytest.raises(CampaignError, match=r"1\.csv:1: .*needs force_n and position_m"):
        read(directory)


@pytest.mark.shared_data
@pytest.mark.parametrize(
    ("name", "shots"),
    [("sample-campaigns/no-effect", 60), ("sample-campaigns/one-effect", 60), ("contactnets-slides", 467)],
)
def test_reads_the_recorded_campaigns(shared_data: Path, name: str, shots: int) -> None:
    began = time.process_time()
    got = read(shared_data / name)
    assert time.process_time() - began < 1.0
    assert len(got.shots) == shots
    first = got.shots[0].position
    assert first is not None
    expected = np.genfromtxt(
        shared_data / name / "traces" / f"{got.shots[0].cycle}.csv", delimiter=",", names=True
    )
    np.testing.assert_array_equal(first.values, expected["position_m"])
    np.testing.assert_array_equal(first.time_s, expected["time_s"])


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(body=st.text(alphabet="0123456789.,-+einfa_ \n\r\tx", max_size=60), width=st.integers(1, 3))
def test_any_trace_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, body: str, width: int
) -> None:
    directory = tmp_path_factory.mktemp("fuzz") / "c"
    names = ("time_s", "force_n", "position_m")[: width + 1]
    campaign(directory, _1=",".join(names) + "\n" + body)
    try:
        got = read(directory)
    except CampaignError:
        return
    for channel in (got.shots[0].force, got.shots[0].position):
        if channel is not None:
            assert np.isfinite(channel.values).all()
            assert (np.diff(channel.time_s) > 0).all()


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(text=st.text(max_size=80))
def test_any_header_or_table_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    directory = tmp_path_factory.mktemp("fuzz") / "c"
    campaign(directory)
    for name in ("campaign.yaml", "shots.csv"):
        kept = (directory / name).read_bytes()
        (directory / name).write_text(text, encoding="utf-8", errors="ignore")
        with pytest.raises(CampaignError):
            read(directory)
        (directory / name).write_bytes(kept)


def test_a_position_that_was_summed_up_has_the_noise_of_its_speed(tmp_path: Path) -> None:
    time = np.arange(5) * 0.1
    channel = Channel(time, time**2, None, summed_up=True, speed_noise_std=0.02)
    shots = (Capture(1, float("nan"), 1.0, None, channel),)
    sensors = {"position": Sensor(10.0, None, summed_up=True, speed_noise_std=0.02)}
    write(Campaign(Excitation.FREE_SLIDE, shots, sensors=sensors), tmp_path / "campaign")
    file = tmp_path / "campaign" / "campaign.yaml"
    text = file.read_text()
    assert "position: {rate_hz: 10, summed_up_from_speed: true, noise_std_m_per_s: 0.02}" in text
    got = read(tmp_path / "campaign")
    assert got.sensors == sensors
    assert got.shots[0].position is not None
    assert (got.shots[0].position.summed_up, got.shots[0].position.speed_noise_std) == (True, 0.02)
    assert got.shots[0].position.noise_std is None


@pytest.mark.parametrize(
    ("sensor", "said"),
    [
        ("summed_up_from_speed: true, noise_std_m: 1e-3", "noise of a speed adds up in the position"),
        ("noise_std_m_per_s: 0.02", "is of a speed that was summed up; write summed_up_from_speed: true"),
        ("summed_up_from_speed: maybe", "is 'maybe'; it has to be true or false"),
    ],
)
def test_what_is_said_of_a_summed_position_is_checked(tmp_path: Path, sensor: str, said: str) -> None:
    time = np.arange(5) * 0.1
    shots = (Capture(1, float("nan"), 1.0, None, Channel(time, time**2)),)
    write(Campaign(Excitation.FREE_SLIDE, shots), tmp_path / "campaign")
    with (tmp_path / "campaign" / "campaign.yaml").open("a") as file:
        file.write(f"sensors:\n  position: {{{sensor}}}\n")
    with pytest.raises(CampaignError, match=re.escape(said)):
        read(tmp_path / "campaign")
