"""Files that say something that cannot be: told with the place and the way out, and nothing written."""

import contextlib
import json
import warnings
import zipfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell import campaign
from impactcell.cli.app import run_verb
from impactcell.errors import CampaignError, MeasurementError
from impactcell.measurements import read_tables
from impactcell.web.texts.import_faults import page_fault
from tests.unit.measurements.records import sampled, taps

TIME, FORCE, PLACE = (values[::4] for values in sampled(taps((3000,), (18.9,))[0], np.random.default_rng(3)))
VELOCITY = ("--set", "velocity=3000 mm/min")


def text(head: str = "time_s,force_n,position_m", further: object = None, before: str = "") -> str:
    """One tap as CSV; `further` is the cell of one more column, or gives it by its row."""
    rows = [f"{t:.6g},{f:.6g},{x:.7g}" for t, f, x in zip(TIME, FORCE, PLACE, strict=True)]
    if further is not None:
        rows = [f"{row},{further(n) if callable(further) else further}" for n, row in enumerate(rows)]
    return "\n".join([*before.splitlines(), head, *rows]) + "\n"


def run(tmp_path: Path, content: str | bytes, *options: str, name: str = "a.csv") -> Path:
    file = tmp_path / name
    tmp_path.mkdir(exist_ok=True)
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    with contextlib.suppress(SystemExit):
        run_verb(["import", str(file), "-o", str(tmp_path / "out"), *options])
    return tmp_path / "out"


def refused(tmp_path: Path, content: str | bytes, *options: str, name: str = "a.csv") -> str:
    with pytest.raises(MeasurementError) as caught:
        run(tmp_path, content, *options, name=name)
    assert not (tmp_path / "out").exists()
    return str(caught.value)


HEAD = "time_s,force_n,position_m"


@pytest.mark.parametrize(
    ("content", "options", "told"),
    [
        (text(f"{HEAD},mass_kg", -20), VELOCITY, "column 'mass' (mass) is -20 kg; it has to be above 0"),
        (text(f"{HEAD},mass_kg", 0), VELOCITY, "give it for all shots with --set mass=18.9kg"),
        (text(f"{HEAD},dwell_s", -1), VELOCITY, "column 'dwell' (dwell) is -1 s; it has to be 0 or above"),
        (text(f"{HEAD},direction", 0), VELOCITY, "column 'direction' (direction) is 0; it has to be 1 or -1"),
        (text(before="Masse: -3 kg"), VELOCITY, "a.csv: mass is -3 kg; it has to be above 0"),
        (text(before="Vorschub: 1e400 mm/min"), (), "a.csv: velocity is inf m/s; it has to be finite"),
        (
            text(f"{HEAD},mass_kg", lambda row: 18 if row < 90 else 28), VELOCITY,
            "column 'mass' (mass) is 18 kg and 28 kg within one record, where a shot has one; number",
        ),
        (
            text(f"{HEAD},batch", lambda row: "a" if row < 90 else "b"), VELOCITY,
            "column 'batch' (batch) is 'a' and 'b' within one record",
        ),
        (
            text(f"{HEAD},velocity_m_per_s", lambda row: 1e-3 * row), (),
            "the velocity of the actuator is not known: its column changes within the record",
        ),
        (text("time_s,force_kg,position_m"), VELOCITY, "column 'force' is called as the force, but is in kg"),
        (text("time_s,force_m,position_n"), VELOCITY, "column 'position' is called as the position"),
        (text("time_s,force_n,force_n"), VELOCITY, "column 'force' may be the force"),
        (text(f"{HEAD},force_n", 1), VELOCITY, "confirm it with --column 'force=force'"),
        (text(), (*VELOCITY, "--column", "force=force", "--column", "position=force"), "as force and as pos"),
        (text(), (*VELOCITY, "--column", "force=force", "--column", "ignored=force"), "as force and as ign"),
        (text(), (*VELOCITY, "--sign", "time=-1"), "time cannot be turned; a sign is of force, posi"),
        (text(), (*VELOCITY, "--delay", "time=1ms"), "time cannot be moved; a delay is of force, posi"),
        (text(), (*VELOCITY, "--delay", "force=1"), "the delay of force is '1'; write it with its unit, as"),
        (text(), (*VELOCITY, "--delay", "force=0,5 ms"), "with its unit and a decimal point, without sep"),
        (text(), (*VELOCITY, "--delay", "force=5 mm"), "the delay of force is '5 mm'; write it with its"),
        (text(), (*VELOCITY, "--delay", "force=3 s"), "'3 s'; more than 1 s is no delay"),
        (text(), (*VELOCITY, "--delay", "force=1e999 ms"), "the delay of force is '1e999 ms'; write it"),
        (text(), (*VELOCITY, "--delay", "kraft=1 ms"), "'kraft' is no quantity; known:"),
        (text(), ("--encoding", "undefined"), "a.csv: is not undefined; give the file's encoding"),
        (text("force_n,position_m,x_v", before="sample rate: nan"), VELOCITY, "no column of time was found;"),
        (text("force_n,position_m,x_v", before="dt: 1e400 s"), VELOCITY, "no column of time was found;"),
        (
            text().replace("\n0.", "\n0.", 1).replace(f"{TIME[5]:.6g},", "0,", 1), VELOCITY,
            "a.csv:7: time does not increase",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_told_and_nothing_written(
    content: str, options: tuple[str, ...], told: str, tmp_path: Path
) -> None:
    assert told in refused(tmp_path, content, *options)


def test_a_time_that_stands_still_is_told_as_the_reason(tmp_path: Path) -> None:
    rows = [f"0,{f:.6g},{x:.7g}" for f, x in zip(FORCE, PLACE, strict=True)]
    told = refused(tmp_path, "\n".join([HEAD, *rows]), *VELOCITY)
    assert f"no column of time was found: 'time' goes forward in 0 of {len(rows) - 1} steps only" in told


def test_times_that_were_rounded_are_told_from_several_shots(tmp_path: Path) -> None:
    rounded = [f"{9e-4 * n:.3f},{f:.6g},{x:.7g}" for n, (f, x) in enumerate(zip(FORCE, PLACE, strict=True))]
    content = "\n".join([HEAD, *rounded])
    told = refused(tmp_path, content, *VELOCITY)
    assert f"a.csv:7: time does not increase: 0.004 after 0.004 ({len(rounded) // 10} such rows)" in told
    assert "rounded times do so: export them with more digits" in told
    assert "shots" not in told
    assert "--column 'ignored=time' --set rate=10kHz" in told, "the way out, which works"
    out = run(tmp_path, content, *VELOCITY, "--column", "ignored=time", "--set", "rate=1111.1 Hz")
    (shot,) = campaign.read(out).shots
    assert shot.force is not None
    assert np.diff(shot.force.time_s) == pytest.approx(9e-4, rel=1e-4)


@pytest.mark.parametrize("name", ["t [s]", "Zeit [s]"])
def test_rounded_times_of_which_few_go_forward_are_told_so_by_word_and_by_symbol(
    tmp_path: Path, name: str
) -> None:
    """Of `t` it was said that no column of time was found, and no more."""
    rows = [f"{1e-4 * n:.3f},{f:.6g},{x:.7g}" for n, (f, x) in enumerate(zip(FORCE, PLACE, strict=True))]
    content = "\n".join([f"{name},force [N],position [m]", *rows])
    told = refused(tmp_path, content, *VELOCITY)
    column, steps = name.split(maxsplit=1)[0], len(rows) - 1
    forward = sum(float(one.split(",")[0]) > float(other.split(",")[0]) for other, one in pairwise(rows))
    assert f"{column!r} goes forward in {forward} of {steps} steps and repeats in the others" in told
    assert "rounded times do so: export them with more digits" in told
    way = ("--column", f"ignored={column}", "--set", "rate=10 kHz")
    (shot,) = campaign.read(run(tmp_path, content, *VELOCITY, *way)).shots
    assert shot.force is not None
    assert np.diff(shot.force.time_s) == pytest.approx(1e-4, rel=1e-4)


@pytest.mark.parametrize("named", [(), ("--column", "time=t")])
@pytest.mark.parametrize("head", ["t [s],force [N],position [m]", HEAD.replace("time", "t")])
def test_a_file_whose_last_row_was_recorded_first_is_to_be_turned_round(
    tmp_path: Path, head: str, named: tuple[str, ...]
) -> None:
    """A rate, or a column that numbers shots, was the way out, and made taps that go backwards."""
    rows = [f"{t:.6g},{f:.6g},{x:.7g}" for t, f, x in zip(TIME, FORCE, PLACE, strict=True)]
    told = refused(tmp_path, "\n".join([head, *rows[::-1]]), *VELOCITY, *named)
    assert "runs backwards; turn the rows of the file round" in told
    assert "rate" not in told
    assert "shot=" not in told


def test_times_that_go_back_are_those_of_several_shots(tmp_path: Path) -> None:
    told = refused(tmp_path, "\n".join([text().rstrip(), *text().splitlines()[1:]]), *VELOCITY)
    assert f"a.csv:{len(TIME) + 2}: time does not increase: 0 after {TIME[-1]:.9g} (1 such rows)" in told
    assert "several shots in one file need a column that numbers them (--column shot=NAME)" in told


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ((50, 51), "line 53 is out of order: delete it, or sort the rows by their time"),
        ((50, 120), "line 52 is out of order: delete it, or sort the rows by their time"),
    ],
)
def test_a_row_in_a_wrong_place_is_no_other_shot(tmp_path: Path, rows: tuple[int, int], told: str) -> None:
    """A row that changed its place with the next, and one that was written too early."""
    lines, (here, there) = text().splitlines(), rows
    lines.insert(here + 1, lines.pop(there + 1))
    fault = refused(tmp_path, "\n".join(lines), *VELOCITY)
    assert "(1 such rows); " + told in fault
    assert "shot=" not in fault
    english, german = (page_fault(fault, language)[1] for language in ("en", "de"))
    assert english.endswith(told)
    assert german.endswith("löschen, oder die Zeilen nach der Zeit sortieren")


def test_what_is_given_for_all_shots_goes_before_a_column_that_cannot_be(tmp_path: Path) -> None:
    out = run(tmp_path, text(f"{HEAD},mass_kg", -20), *VELOCITY, "--set", "mass=18.9kg")
    assert campaign.read(out).shots[0].mass_kg == 18.9


def test_a_rate_beside_a_column_of_time_is_refused_and_counts_without_one(tmp_path: Path) -> None:
    rate = ("--set", "rate=500 Hz")
    told = refused(tmp_path, text(), *VELOCITY, *rate)
    assert "the times are those of column 'time', so that the rate has no use; take the rate away" in told
    assert "--column 'ignored=time'" in told
    (shot,) = campaign.read(run(tmp_path, text(), *VELOCITY, *rate, "--column", "ignored=time")).shots
    assert shot.force is not None
    assert np.diff(shot.force.time_s) == pytest.approx(2e-3)


def test_a_rate_counts_for_the_files_that_have_no_time(tmp_path: Path) -> None:
    without = "\n".join(line.partition(",")[2] for line in text().splitlines())
    (tmp_path / "b.csv").write_text(without, encoding="utf-8")
    out = run(
        tmp_path, text(), str(tmp_path / "b.csv"), *VELOCITY, "--set", f"rate={1.0 / np.diff(TIME)[0]:.0f} Hz"
    )
    first, second = campaign.read(out).shots
    assert first.force is not None
    assert second.force is not None
    np.testing.assert_allclose(np.diff(first.force.time_s), np.diff(second.force.time_s), rtol=1e-3)


def test_a_sign_of_what_was_not_recorded_is_refused(tmp_path: Path) -> None:
    told = refused(tmp_path, text(), *VELOCITY, "--sign", "actuator=-1")
    assert "no column is the actuator; name it with --column actuator=NAME, or take the sign away" in told
    told = refused(tmp_path, text(), *VELOCITY, "--delay", "actuator=1 ms")
    assert "name it with --column actuator=NAME, or take the delay away" in told


def test_a_late_channel_is_moved_back_to_when_it_happened(tmp_path: Path) -> None:
    step, late = float(np.diff(TIME)[0]), 7
    moved = np.concatenate([np.full(late, PLACE[0]), PLACE[:-late]])
    rows = [f"{t:.6g},{f:.6g},{x:.7g}" for t, f, x in zip(TIME, FORCE, moved, strict=True)]
    content = "\n".join([HEAD, *rows]) + "\n"
    delay = f"{1e3 * late * step:.6g} ms"
    (as_it_was,) = campaign.read(run(tmp_path / "one", text(), *VELOCITY)).shots
    (put_right,) = campaign.read(
        run(tmp_path / "two", content, *VELOCITY, "--delay", f"position={delay}")
    ).shots
    (tmp_path / "map.yaml").write_text(f"delays: {{position: {delay}}}\n", encoding="utf-8")
    (by_file,) = campaign.read(
        run(tmp_path / "three", content, *VELOCITY, "--mapping", str(tmp_path / "map.yaml"))
    ).shots
    for shot in (put_right, by_file):
        assert np.array_equal(shot.force.time_s, as_it_was.force.time_s)
        both = [
            (shot.position.time_s, shot.position.values),
            (as_it_was.position.time_s, as_it_was.position.values),
        ]
        (time, values), (expected_time, expected) = both
        assert time[0] == pytest.approx(expected_time[0] - late * step, abs=1e-9)
        np.testing.assert_allclose(
            np.interp(expected_time[:-late], time, values), expected[:-late], atol=1e-7
        )


def test_what_counts_for_taps_alone_is_told_where_there_are_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(
        tmp_path,
        text(),
        *VELOCITY,
        "--set",
        "stroke=1.5 mm",
        "--trigger",
        "5 N",
        "--excitation",
        "free_slide",
    )
    shown = capsys.readouterr()
    assert "given, and not used, for it is of taps: velocity, stroke, trigger" in shown.out + shown.err


def test_a_column_whose_noise_is_small_has_one_value(tmp_path: Path) -> None:
    out = run(tmp_path, text(f"{HEAD},mass_kg", lambda row: 18.9 + 1e-3 * (row % 2)), *VELOCITY)
    assert campaign.read(out).shots[0].mass_kg == pytest.approx(18.9005, abs=1e-4)


@pytest.mark.slow
@settings(max_examples=25)
@given(
    st.lists(
        st.one_of(
            st.sampled_from(
                ["mass_kg", "Mass [kg]", "mass (kg)", "batch", "shot", "velocity", "time_s", "温度"]
            ),
            st.text(st.characters(codec="utf-8", exclude_characters='",;|\t\n\r\0#%/'), max_size=8),
        ),
        min_size=1,
        max_size=5,
    )
)
def test_covariates_of_any_name_are_each_kept_and_read_back(
    tmp_path_factory: pytest.TempPathFactory, names: list[str]
) -> None:
    directory = tmp_path_factory.mktemp("names")
    file = directory / "a.json"
    columns = {"time_s": TIME.tolist(), "force_n": FORCE.tolist(), "position_m": PLACE.tolist()}
    further = {f"{name} {n}": n for n, name in enumerate(names, 1)}
    columns |= {name: [value] * len(TIME) for name, value in further.items()}
    file.write_text(json.dumps(columns), encoding="utf-8")
    said = [f"covariate={column.name}" for column in read_tables(file)[0].columns[3:]]
    options = [part for text in said for part in ("--column", text)]
    with contextlib.suppress(SystemExit):
        run_verb(["import", str(file), "-o", str(directory / "out"), *VELOCITY, *options])
    (shot,) = campaign.read(directory / "out").shots
    assert sorted(shot.covariates.values()) == sorted(further.values())


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ({"time_s": [10**400] * 5, "force_n": [1.0] * 5}, "'time' holds text, as '1000"),
        ({"time_s": [0.0, 1.0, 2.0], "force_n": [1.0, [2.0], 3.0]}, "item 2 of 'force_n' is no number"),
        ([{"time_s": 0.0, "force_n": 1.0}, 5], "item 2 of its 2 is no record"),
        ([5, {"time_s": 0.0, "force_n": 1.0}], "item 1 of its 2 is no record"),
        (
            {"time_s": TIME.tolist(), "force_n": [np.inf, *FORCE.tolist()[1:]], "position_m": PLACE.tolist()},
            "a.json: row 1: column 'force' is infinite, or beyond any measurement, in 1",
        ),
    ],
)
def test_json_that_is_no_record_is_told(content: object, told: str, tmp_path: Path) -> None:
    assert told in refused(tmp_path, json.dumps(content), *VELOCITY, name="a.json")


@pytest.mark.parametrize(
    ("members", "told"),
    [
        ([("a.csv", text()), ("a.csv", text())], "holds 'a.csv' twice; pack each file once"),
        ([(".", text())], "a file in it has no name"),
        ([("", text())], "cannot be unpacked, it is damaged"),
    ],
)
def test_an_archive_with_strange_names_is_refused(
    members: list[tuple[str, str]], told: str, tmp_path: Path
) -> None:
    file = tmp_path / "a.zip"
    with warnings.catch_warnings(action="ignore"), zipfile.ZipFile(file, "w") as archive:
        for name, content in members:
            archive.writestr(zipfile.ZipInfo(name), content)
    with pytest.raises(MeasurementError, match=told):
        read_tables(file)


def test_an_archive_whose_names_are_no_utf8_or_that_was_cut_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.zip"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("äb.csv", text())
    whole = file.read_bytes()
    file.write_bytes(whole.replace("äb".encode(), b"\xff\xfeb"))
    with pytest.raises(MeasurementError, match="cannot be unpacked, it is damaged: 'utf-8' codec"):
        read_tables(file)
    file.write_bytes(whole[:200])
    with pytest.raises(MeasurementError, match="cannot be unpacked, it is damaged: File is not a zip file"):
        read_tables(file)


def test_a_file_is_taken_once_by_whatever_name(tmp_path: Path) -> None:
    file, link = tmp_path / "a.csv", tmp_path / "b.csv"
    file.write_text(text(), encoding="utf-8")
    link.symlink_to(file)
    with pytest.raises(MeasurementError, match=r"b\.csv: is the file .*a\.csv, which is named already"):
        run_verb(["import", str(file), str(link), "-o", str(tmp_path / "out"), *VELOCITY])


def test_a_campaign_is_not_written_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "real")
    (tmp_path / "a.csv").write_text(text(), encoding="utf-8")
    with pytest.raises(CampaignError, match="is a symbolic link; name the directory itself"):
        run_verb(["import", str(tmp_path / "a.csv"), "-o", str(tmp_path / "out"), *VELOCITY])


def test_a_mark_of_the_byte_order_is_no_letter_of_a_name(tmp_path: Path) -> None:
    content = b"\xef\xbb\xbf" + text().encode()
    run(tmp_path, content, *VELOCITY, "--encoding", "utf-8", "--column", "time=time")


def test_the_sign_of_an_inch_opens_no_quote(tmp_path: Path) -> None:
    (table,) = read_tables_of(tmp_path, text('time [s],force [N],position ["]'))
    assert [column.unit for column in table.columns] == ["s", "N", '"']
    broken = "\n".join(f'{t:g},1,2,"a\nb"' for t in range(300))
    (table,) = read_tables_of(tmp_path, f"{HEAD},note\n{broken}")
    assert len(table) == 300


def read_tables_of(tmp_path: Path, content: str) -> tuple:
    (tmp_path / "t.csv").write_text(content, encoding="utf-8")
    return read_tables(tmp_path / "t.csv")
