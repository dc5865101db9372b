"""Force from one recorder and position from another: one record, or refused with the way out."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from impactcell.campaign import Excitation
from impactcell.errors import MeasurementError
from impactcell.measurements import Imported, guess, make_campaign, read_tables
from impactcell.measurements.given import read_given
from impactcell.web.texts.import_faults import page_fault
from impactcell.web.texts.import_notes import page_note
from tests.unit.measurements.records import FORCE_OFFSET_N, sampled, taps
from tests.unit.measurements.test_recorded_times import write as write_waveforms

TAPS = taps(velocities=(2500, 3500), masses=(18.9,))
MOTIONS = (3.0, 4.0, 5.0)
"""Angular frequencies of what is driven [rad/s]."""
DRIVEN = {"constants": ["mass=2kg"]}


def imported(files: Sequence[Path], **said: list[str]) -> Imported:
    tables = [table for file in files for table in read_tables(file)]
    return make_campaign(tables, guess(tables, read_given(said)))


def refused(files: Sequence[Path], **said: list[str]) -> str:
    with pytest.raises(MeasurementError) as caught:
        imported(files, **said)
    fault = str(caught.value)
    for language in ("en", "de"):
        assert page_fault(fault, language)[0] == language
        assert "name files" not in page_fault(fault, language)[1]
    return fault


def force_at(turn: float, time: np.ndarray) -> np.ndarray:
    return 7.0 * np.sin(turn * time) + 0.02 * turn


def place_at(turn: float, time: np.ndarray) -> np.ndarray:
    return 0.3 * np.sin(turn * time) - 0.01 * turn


def loggers(directory: Path, *, later_s: float = 0.0, begun: str = "") -> tuple[list[Path], list[Path]]:
    """Records of a force at 2 kHz and of a position at 1.5 kHz, which begins `later_s` after it.

    With `begun`, a format of hours, minutes and seconds, times are written as such.
    """

    def clock(seconds: float) -> str:
        return begun.format(f"10:00:{seconds + 1.0:09.6f}") if begun else f"{1e3 * seconds:.6f}"

    made: tuple[list[Path], list[Path]] = [], []
    for number, turn in enumerate(MOTIONS, 1):
        time = np.arange(0, 2.0, 5e-4)
        force = [f"{clock(t)},{f:.9f}" for t, f in zip(time, force_at(turn, time), strict=True)]
        time = np.arange(0, 2.2, 1 / 1500)
        place = [
            f"{clock(t + later_s if begun else t)};{x:.9f}"
            for t, x in zip(time, place_at(turn, time + later_s), strict=True)
        ]
        unit = "" if begun else " [ms]"
        made[0].append(directory / f"drive{number}.csv")
        made[0][-1].write_text("\n".join([f"Time{unit},Force [N]", *force]) + "\n", encoding="utf-8")
        made[1].append(directory / f"scale{number}.csv")
        made[1][-1].write_text("\n".join([f"Zeit{unit};Weg [m]", *place]) + "\n", encoding="utf-8")
    return made


def check(campaign: Imported, order: Sequence[float] = MOTIONS, later_s: float = 0.0) -> None:
    """Each shot is of one motion, at the rates of its recorders; times count from its first sample."""
    assert campaign.campaign.excitation is Excitation.DRIVEN
    for shot, turn in zip(campaign.campaign.shots, order, strict=True):
        assert shot.force is not None
        assert shot.position is not None
        assert len(shot.force.values) == 4000
        assert len(shot.position.values) == 3301
        np.testing.assert_allclose(shot.force.values, force_at(turn, shot.force.time_s), atol=1e-7)
        np.testing.assert_allclose(shot.position.values, place_at(turn, shot.position.time_s), atol=2e-6)
        assert shot.position.time_s[0] == pytest.approx(later_s, abs=1e-9)


@pytest.mark.slow
def test_the_first_of_each_recorder_belong_together_in_whatever_order_they_are_named(tmp_path: Path) -> None:
    force, position = loggers(tmp_path)
    side_by_side = [file for pair in zip(force, position, strict=True) for file in pair]
    for files in ([*force, *position], side_by_side, [*position, *force]):
        campaign = imported(files, **DRIVEN)
        check(campaign)
        first = " and ".join(("drive1.csv", "scale1.csv")[:: 1 if files[0] in force else -1])
        told = f"put together: {first}, their times are taken to begin at one moment; 2 more likewise"
        assert f"{told} (--delay moves a channel)" in campaign.notes
        assert page_note(told, "de")[1].startswith(f"zusammengefügt: {first.replace(' and ', ' und ')}, ihre")
    turned = imported([*force, *position[::-1]], **DRIVEN).campaign.shots[0]
    assert turned.position is not None
    np.testing.assert_allclose(turned.position.values, place_at(5.0, turned.position.time_s), atol=2e-6)


def test_a_delay_moves_one_recorder_against_the_other(tmp_path: Path) -> None:
    force, position = loggers(tmp_path)
    shot = imported([*force, *position], **DRIVEN, delays=["force=4ms"]).campaign.shots[0]
    assert shot.force is not None
    assert shot.position is not None
    assert shot.position.time_s[0] - shot.force.time_s[0] == pytest.approx(4e-3)


@pytest.mark.parametrize("begun", ["{}", "2026-11-28 {}", "28.11.2026 {}"])
@pytest.mark.parametrize("later_s", [0.25, 0.0])
def test_moments_set_the_times_of_two_recorders(tmp_path: Path, begun: str, later_s: float) -> None:
    force, position = loggers(tmp_path, later_s=later_s, begun=begun)
    campaign = imported([*force, *position], **DRIVEN)
    check(campaign, later_s=later_s)
    (told,) = [note for note in campaign.notes if note.startswith("put together")]
    assert f"drive1.csv and scale1.csv, by the moments that they say, {later_s:g} s apart; 2 more" in told
    german = page_note(told, "de")[1]
    assert f"nach den Zeitpunkten darin, {later_s:g} s auseinander".replace(".", ",") in german


def test_recorders_in_two_time_zones_are_set_by_the_moment(tmp_path: Path) -> None:
    force, _ = loggers(tmp_path, later_s=0.25, begun="2026-11-28T{}+01:00")
    kept = [file.read_bytes() for file in force]
    _, position = loggers(tmp_path, later_s=0.25, begun="2026-11-28T{}Z")
    for file, content in zip(force, kept, strict=True):
        file.write_bytes(content)
    for file in position:
        file.write_text(file.read_text(encoding="utf-8").replace("T10:", "T09:"), encoding="utf-8")
    check(imported([*force, *position], **DRIVEN), later_s=0.25)


def test_a_recorder_that_began_before_the_other_is_moved_back(tmp_path: Path) -> None:
    force, position = loggers(tmp_path, later_s=0.25, begun="2026-11-28 {}")
    check(imported([*position, *force], **DRIVEN), later_s=0.25)


@pytest.mark.parametrize("kind", ["tdms", "mf4"])
def test_binary_files_are_set_by_their_begin(tmp_path: Path, kind: str) -> None:
    time = np.arange(4000) * 5e-4
    began = datetime(2026, 11, 28, 10, 0, 0, 500_000, tzinfo=UTC)
    files = []
    for name, values, unit, later_s in (
        ("force", force_at(3.0, time), "N", 0.0),
        ("position", place_at(3.0, time + 0.125), "m", 0.125),
    ):
        files.append(tmp_path / f"{name}.{kind}")
        start = began + timedelta(seconds=later_s)
        if kind == "tdms":
            moment = np.datetime64(start.replace(tzinfo=None), "us")
            said = {"unit_string": unit, "wf_increment": 5e-4, "wf_start_time": moment}
            write_waveforms(files[-1], {"run": {name: (values, said)}})
        else:
            asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed")
            with asammdf.MDF(version="4.10") as file:
                file.append([asammdf.Signal(values, time, unit=unit, name=name)])
                file.header.start_time = start
                file.save(files[-1], overwrite=True)
    (shot,) = imported(files, **DRIVEN).campaign.shots
    assert shot.force is not None
    assert shot.position is not None
    assert shot.position.time_s[0] - shot.force.time_s[0] == pytest.approx(
        0.125, abs=1e-7
    )  # as asammdf rounds
    np.testing.assert_allclose(shot.position.values, place_at(3.0, shot.position.time_s), atol=1e-7)


def test_taps_of_two_recorders_give_the_friction_of_one(tmp_path: Path) -> None:
    """Time in one file only: the other says its rate beside its columns."""
    files, whole = [], []
    for number, tap in enumerate(TAPS, 1):
        time, force, place = sampled(tap, np.random.default_rng(number))
        rows = [f"{1e3 * t:.6f};{-f - FORCE_OFFSET_N:.6f}" for t, f in zip(time, force, strict=True)]
        head = [f"mass: {tap.mass_kg} kg", f"velocity: {tap.velocity_m_s * 6e4:.9g} mm/min", ""]
        files.append(tmp_path / f"f{number}.csv")
        files[-1].write_text("\n".join([*head, "t [ms];Force [N]", *rows]), encoding="utf-8")
        files.append(tmp_path / f"x{number}.csv")
        rows = [f"{1e6 * x:.6f}" for x in place]
        files[-1].write_text("\n".join(["Sample rate: 10 kHz", "", "Weg [µm]", *rows]), encoding="utf-8")
        rows = [
            f"{1e3 * t:.6f};{-f - FORCE_OFFSET_N:.6f};{1e6 * x:.6f}"
            for t, f, x in zip(time, force, place, strict=True)
        ]
        whole.append(tmp_path / f"w{number}.csv")
        whole[-1].write_text("\n".join([*head, "t [ms];Force [N];Weg [µm]", *rows]), encoding="utf-8")
    apart, together = (imported(one, constants=["stroke=1.5mm"]).campaign for one in (files, whole))
    assert apart.excitation is Excitation.TAP
    for one, other in zip(apart.shots, together.shots, strict=True):
        assert (one.mass_kg, one.velocity_m_s, one.direction) == (
            other.mass_kg,
            other.velocity_m_s,
            other.direction,
        )
        for channel in ("force", "position"):
            of_one, of_other = getattr(one, channel), getattr(other, channel)
            np.testing.assert_allclose(of_one.time_s, of_other.time_s, atol=1e-9)
            np.testing.assert_allclose(of_one.values, of_other.values, atol=1e-12)


def test_files_that_do_not_pair_are_refused(tmp_path: Path) -> None:
    force, position = loggers(tmp_path)
    fault = refused([*force, *position[:2]], **DRIVEN)
    assert fault == (
        "files: 3 with force, 2 with position; a record is put together of one of each, so name as many of "
        "each"
    )
    assert page_fault(fault, "de")[1].startswith("Dateien: 3 mit Kraft, 2 mit Position; eine Aufzeichnung")


def test_files_of_other_moments_are_refused(tmp_path: Path) -> None:
    force, position = loggers(tmp_path, later_s=30.0, begun="{}")
    fault = refused([force[0], position[0]], **DRIVEN)
    assert (
        "the force was recorded from 0 to 1.9995 s and the position from 30 to 32.2 s, so they are" in fault
    )
    assert (
        "„Kraft“ wurde von 0 bis 1.9995 s aufgezeichnet, „Position“ aber von 30" in page_fault(fault, "de")[1]
    )


def numbered(path: Path, shots: Sequence[int], header: str, beside: str = "") -> Path:
    rows = [f"{shot};{k * 1e-3:.3f};{np.sin(0.02 * k + shot):.6f}" for shot in shots for k in range(1000)]
    path.write_text("\n".join([beside, f"shot;t [s];{header}", *rows]).lstrip("\n"), encoding="utf-8")
    return path


def test_shots_of_two_files_are_paired_by_their_numbers(tmp_path: Path) -> None:
    force = numbered(tmp_path / "f.csv", (1, 2, 3), "Force [N]")
    assert (
        len(imported([force, numbered(tmp_path / "x.csv", (1, 2, 3), "Weg [mm]")], **DRIVEN).campaign.shots)
        == 3
    )
    fewer = refused([force, numbered(tmp_path / "x.csv", (1, 2), "Weg [mm]")], **DRIVEN)
    assert "holds 2 shots, where" in fewer
    assert "holds 3; name files of the same shots" in fewer
    other = refused([force, numbered(tmp_path / "x.csv", (1, 2, 4), "Weg [mm]")], **DRIVEN)
    assert "shot 4: holds shot 4, where" in other
    assert "shot 3, which it is put together with, holds shot 3; name files of the same shots" in other


def test_files_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    force = numbered(tmp_path / "f.csv", (1,), "Force [N]", "Masse: 2 kg")
    position = numbered(tmp_path / "x.csv", (1,), "Weg [mm]", "Masse: 2.5 kg")
    fault = refused([force, position])
    assert "says mass 2.5 and" in fault
    assert "which it is put together with, 2; correct one" in fault
    assert "sagt Masse 2.5, die dazugehörige" in page_fault(fault, "de")[1]
    alike = numbered(tmp_path / "y.csv", (1,), "Weg [mm]", "Masse: 2 kg")
    for files in ([force, alike], [force, numbered(tmp_path / "z.csv", (1,), "Weg [mm]")]):
        assert [shot.mass_kg for shot in imported(files).campaign.shots] == [2.0]


def test_a_spindle_turns_a_drives_speed_into_that_of_what_it_moves(tmp_path: Path) -> None:
    """A servo drive says turns a minute, and a load cell volts, each from its own recorder."""
    time = np.arange(3000) * 1e-3
    drive, cell = tmp_path / "drive.csv", tmp_path / "cell.csv"
    rows = [f"{1e3 * t:.3f},{1500.0 * np.sin(4.0 * t):.6f}" for t in time]
    drive.write_text("\n".join(["Time,Servo motor speed", "ms,rpm", *rows]), encoding="utf-8")
    rows = [f"{t:.4f},{0.2 * np.cos(4.0 * t):.9f}" for t in np.arange(6000) * 5e-4]
    cell.write_text("\n".join(["time [s],Force [V]", *rows]), encoding="utf-8")
    said = {"columns": ["position=Servo motor speed"], "constants": ["mass=24.7kg"]}
    gains = ["force=-200 N/V", "position=20 mm/rev"]
    (shot,) = imported([drive, cell], **said, gains=gains).campaign.shots
    assert shot.force is not None
    assert shot.position is not None
    np.testing.assert_allclose(shot.force.values, -40.0 * np.cos(4.0 * shot.force.time_s), atol=1e-6)
    expected = 1500.0 / 60.0 * 0.02 / 4.0 * (1.0 - np.cos(4.0 * time))
    np.testing.assert_allclose(shot.position.values, expected, atol=2e-6)
    fault = refused([drive, cell], **said, gains=gains[:1])
    assert (
        "some are of a rotation and some of a translation; give units that fit, or what a turn moves" in fault
    )
    drive.write_text(drive.read_text(encoding="utf-8").replace("ms,rpm", "ms,"), encoding="utf-8")
    assert "'Servo motor speed' (position) has no unit" in refused([drive, cell], **said, gains=gains)
