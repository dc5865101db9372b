"""`impactcell track`: series with known truth, and every fault of a file at its line."""

import json
import math

import numpy as np
import pytest
from typer.testing import CliRunner

import impactcell
from impactcell.cli.app import app
from impactcell.cli.track import track
from impactcell.errors import SeriesError
from impactcell.records import LARGEST_STATISTIC

STD = 0.002


def write(path, mu_s, std=STD, batch=None, cycles=None):
    cycles = range(len(mu_s)) if cycles is None else cycles
    lines = ["cycle,mu_s,mu_s_std" + (",batch" if batch is not None else "")]
    for i, (cycle, value) in enumerate(zip(cycles, mu_s, strict=True)):
        own = "" if std is None else f"{std:.6f}"
        lines.append(f"{cycle},{value:.7f},{own}" + (f",{batch[i]}" if batch is not None else ""))
    path.write_text("\n".join(lines) + "\n")
    return path


def refused(constant):
    raise ValueError(f"JSON has no {constant}")


def run(capsys, *args, **kwargs):
    track(*args, as_json=True, **kwargs)
    return json.loads(capsys.readouterr().out, parse_constant=refused)


def truth(n=1500, slope=2e-6, step=0.006, at=900, seed=1):
    mu_s = 0.2 + slope * np.arange(n) + STD * np.random.default_rng(seed).normal(size=n)
    mu_s[at:] += step
    mu_s[::101] += 0.02
    return mu_s


@pytest.mark.parametrize("batch", ["known", "unknown"])
def test_slope_and_shift_of_a_known_series(tmp_path, capsys, batch):
    ids = ["A" if i < 900 else "B" for i in range(1500)]
    found = run(capsys, write(tmp_path / "s.csv", truth(), batch=ids), batch)
    assert abs(found["slope_per_cycle"] - 2e-6) < 3.0 * found["slope_std"]
    (shift,) = found["alarms"]
    assert shift["alarm"] == "BatchShift"
    assert abs(shift["change_cycle"] - 900) <= 2
    assert 900 <= shift["cycle"] < 915
    assert abs(shift["size"] - 0.006) < 3.0 * shift["size_std"]


@pytest.mark.slow
def test_people_read_two_standard_deviations_and_data_hold_one(tmp_path, capsys):
    path = write(tmp_path / "s.csv", truth())
    data = run(capsys, path)
    track(path)
    text = capsys.readouterr().out
    (shift,) = data["alarms"]
    for value, std in ((data["level"], data["level_std"]), (shift["size"], shift["size_std"])):
        assert f"{value:.5f} ± {2.0 * std:.5f}" in text
    assert f"{1e3 * data['slope_per_cycle']:+.6f} ± {2e3 * data['slope_std']:.6f} per 1000 cycles" in text
    assert text.count("95 %") == 1


@pytest.mark.slow
def test_the_wear_limit(tmp_path, capsys):
    mu_s = truth(4000, slope=5e-6, step=0.0)
    found = run(capsys, write(tmp_path / "s.csv", mu_s), limit=0.21)
    warned, worn = found["alarms"]
    assert warned["alarm"] == "WearWarning"
    assert 0 <= warned["cycle"] < 2000
    assert worn["alarm"] == "WearLimit"
    assert 2000 <= worn["cycle"] < 2400
    assert abs(worn["change_cycle"] - 2000) < 250
    assert found["cycles_to_limit"] == 0.0
    track(tmp_path / "s.csv", limit=0.21)
    before, after = capsys.readouterr().out.splitlines()[-2:]
    assert before == (
        f"WearWarning at cycle {warned['cycle']}: "
        f"level {-warned['size']:.5f} ± {2.0 * warned['size_std']:.5f} below the limit"
    )
    assert after == (
        f"WearLimit at cycle {worn['cycle']}: passed at about {worn['change_cycle']}, "
        f"level {worn['size']:.5f} ± {2.0 * worn['size_std']:.5f} above the limit"
    )


def test_a_change_beyond_all_doubt_is_told_in_numbers(tmp_path, capsys):
    """That there was none is given up within a cycle: the evidence is infinite, which is no JSON."""
    mu_s = 0.2 + 0.1 * (np.arange(70) >= 50) + STD * np.random.default_rng(1).normal(size=70)
    (shift,) = run(capsys, write(tmp_path / "s.csv", mu_s))["alarms"]
    assert (shift["alarm"], shift["change_cycle"]) == ("BatchShift", 50)
    assert shift["statistic"] == LARGEST_STATISTIC > shift["threshold"]


def test_a_limit_that_was_passed_from_the_first_cycle_on_was_not_seen_to_be_passed(tmp_path, capsys):
    path = write(tmp_path / "s.csv", truth(60, at=0))
    track(path, limit=0.15)
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("WearLimit")]
    assert ": passed before the first cycle, level 0.05" in line
    assert "about" not in line


def test_an_alarm_of_wear_that_is_over_is_told_so(tmp_path, capsys):
    path = write(tmp_path / "s.csv", truth(300, slope=-1e-4, at=300) + 0.07)
    (alarm,) = run(capsys, path, limit=0.25)["alarms"]
    track(path, limit=0.25)
    line = capsys.readouterr().out.splitlines()[-1]
    assert line.startswith("WearLimit at cycle ")
    assert line.endswith(f" above the limit; gone since cycle {alarm['cleared_cycle']}")


@pytest.mark.slow
def test_a_warning_of_what_has_come_is_not_told_to_be_over(tmp_path, capsys):
    path = write(tmp_path / "s.csv", truth(1200, slope=3e-5, at=1200))
    warning, limit = run(capsys, path, limit=0.23)["alarms"]
    assert warning["cleared_cycle"] >= limit["cycle"]
    assert limit["cleared_cycle"] is None
    track(path, limit=0.23)
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("Wear")]
    assert [line.rpartition(" ± ")[2].split(" ", 1)[1] for line in told] == [
        "below the limit",
        "above the limit",
    ]


def test_a_surface_that_may_have_been_renewed_is_told_with_the_way_out(tmp_path, capsys):
    """It wears by 0.012 in 200 cycles, and is renewed: the limit is reached by both wears together only."""
    cycles = np.arange(340)
    mu_s = 0.2 + 6e-5 * (cycles % 200) + STD * np.random.default_rng(2).normal(size=340)
    path = write(tmp_path / "s.csv", mu_s)
    data = run(capsys, path, limit=0.218)
    (alarm,) = [alarm for alarm in data["alarms"] if alarm["alarm"] == "WearLimit"]
    assert alarm["may_be_renewed"]
    assert not any(one["may_be_renewed"] for one in data["alarms"] if one is not alarm)
    track(path, limit=0.218)
    (line,) = [one for one in capsys.readouterr().out.splitlines() if one.startswith("WearLimit")]
    told = (
        f"above the limit; mu_s with the present batch is {data['friction']:.5f}, below it: if the surface "
    )
    assert line.endswith(f"{told}was renewed, at 200 say, track the cycles from there on alone")
    since = run(capsys, write(tmp_path / "since.csv", mu_s[200:], cycles=cycles[200:]), limit=0.218)
    assert "WearLimit" not in [alarm["alarm"] for alarm in since["alarms"]]


def test_missing_stds_missing_cycles_and_missing_values(tmp_path, capsys):
    rng = np.random.default_rng(2)
    kept = np.sort(rng.choice(600, 450, replace=False))
    mu_s = 0.2 + STD * rng.normal(size=450) + 1e-5 * kept
    path = write(tmp_path / "s.csv", mu_s, std=None, cycles=kept)
    lines = path.read_text().splitlines()
    lines[50] = f"{kept[49]},,"
    path.write_text("\n".join(lines) + "\n")
    found = run(capsys, path)
    assert abs(found["slope_per_cycle"] - 1e-5) < 3.0 * found["slope_std"]
    assert found["alarms"] == []
    assert found["cycles"] == 449
    assert found["notes"] == [{"cycle": int(kept[49]), "note": "mu_s is missing, the cycle is not used"}]


@pytest.mark.slow
def test_the_text_says_what_friction_is_by_now(tmp_path, capsys):
    """The level is that of the first batch, which after a shift nobody measures any more."""
    path = write(tmp_path / "s.csv", truth())
    data = run(capsys, path)
    track(path)
    level, batch, now = capsys.readouterr().out.splitlines()[1:4]
    assert level.endswith(": mu_s with the first batch")
    assert batch.startswith(f"batch   {data['batch_offset']:+.5f} ± {2.0 * data['batch_offset_std']:.5f}: ")
    assert (
        now
        == f"now     {data['friction']:.5f} ± {2.0 * data['friction_std']:.5f}: mu_s with the present batch"
    )
    assert abs(data["friction"] - 0.209) < 3.0 * data["friction_std"]
    assert [alarm["withdrawn"] for alarm in data["alarms"]] == [False]
    # with the first batch there is no other
    track(write(tmp_path / "s.csv", truth(60, at=0), batch=["A"] * 60))
    assert "now" not in capsys.readouterr().out


def test_where_no_other_batch_was_found_there_is_one_level(tmp_path, capsys):
    """What the tracker holds possible of a batch that it has not found is no second level; data keep it."""
    path = write(tmp_path / "s.csv", truth(60, at=0))
    data = run(capsys, path)
    assert data["batch_offset"] != 0.0
    track(path)
    _, level, wear = capsys.readouterr().out.splitlines()
    assert level.endswith(": mu_s with the first batch; no other was found")
    assert wear.startswith("wear ")
    # of one that is named how it differs is told, also where it hardly does
    track(write(tmp_path / "s.csv", truth(60, at=0), batch=["A"] * 30 + ["B"] * 30))
    level, batch, now = capsys.readouterr().out.splitlines()[1:4]
    assert level.endswith(": mu_s with the first batch")
    assert (batch[:5], now[:3]) == ("batch", "now")
    # and of one that is far off before any would be reported
    track(write(tmp_path / "s.csv", truth(12, step=0.05, at=6)))
    assert "batch   +0.0" in capsys.readouterr().out


def test_a_shift_that_was_taken_back_is_told_so(tmp_path, capsys):
    noise = np.random.default_rng(12003).normal(0.0, 0.002, 800)
    path = write(tmp_path / "s.csv", 0.2 + 0.002 * (np.arange(800) // 100 % 2) + noise, cycles=range(1, 801))
    track(path)
    shifts = [line for line in capsys.readouterr().out.splitlines() if line.startswith("BatchShift")]
    withdrawn = [line.endswith("; withdrawn, by the cycles since it may be no change") for line in shifts]
    assert withdrawn == [False, False, False, True]


@pytest.mark.parametrize("n", [3, 24, 40])
def test_a_few_dozen_cycles(tmp_path, capsys, n):
    mu_s = 0.2 + STD * np.random.default_rng(n).normal(size=n)
    found = run(capsys, write(tmp_path / "s.csv", mu_s))
    assert abs(found["slope_per_cycle"]) < 3.5 * found["slope_std"]
    assert found["alarms"] == []
    assert math.isfinite(found["level_std"])


def test_the_text_form(tmp_path, capsys):
    track(write(tmp_path / "s.csv", truth()), limit=0.3)
    out = capsys.readouterr().out
    assert "1500 cycles used" in out
    assert "BatchShift at cycle 90" in out


def test_a_limit_that_is_not_reached_is_told_in_words(tmp_path, capsys):
    track(write(tmp_path / "s.csv", truth()[:4] * 0.0 + 0.2), limit=0.3)
    out = capsys.readouterr().out
    assert "never" in out
    assert "inf" not in out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", ":1: empty"),
        ("\n\n", ":1: empty"),
        ("Zyklus;Reibung\n1;0,2\n", ":1: no column `cycle`"),
        ("cycle,mu\n1,0.2\n", ":1: no column `mu_s`; if `mu` is meant, call it so; the first line is to"),
        ("Cycle No,mu_s\n1,0.2\n", ":1: no column `cycle`; if `Cycle No` is meant, call it so; the first"),
        ("cycle,mu_s [%]\n1,20\n", "; if `mu_s [%]` is meant, call it so, and write 0.2 for 20 %; the first"),
        ("cycle,mu_k\n1,0.2\n", ":1: no column `mu_s`; the first line is to be"),
        ("cycle,mu_s [-],mu_s\n1,0.2,0.2\n", ":1: column `mu_s` is there 2 times"),
        ("cycle,mu_s,mu_s_std\n-,1,1\n1,0.2,0.1\n", ":2: a line of units; leave it out"),
        ("cycle;mu_s;batch\n[#];[-];\n1;0,2;A\n", ":2: a line of units; leave it out"),
        ("cycle,mu_s,mu_s_std\n1,0.2,0.1\n-,1,1\n", ":3: cycle `-` is not a whole number"),
        ("cycle,mu_s\n1,20.0%\n2,0.2\n", ":2: mu_s `20.0%` is in percent; write 0.2"),
        ("cycle;mu_s;mu_s_std\n1;20,5 %;0,02\n", ":2: mu_s `20,5 %` is in percent; write 0,205"),
        (
            "cycle,mu_s,mu_s_std\n1,0.2,1%\n",
            ":2: mu_s_std `1%` is in percent; write 0.01, or 0.01 times mu_s where it is that of mu_s",
        ),
        ("cycle,mu_s\n1,%\n", ":2: mu_s `%` is not a number"),
        ("cycle,mu_s,mu_s\n1,0.2,0.2\n", ":1: column `mu_s` is there 2 times"),
        ("cycle,mu_s,mu_s_std\n", ":2: no cycles"),
        ("cycle,mu_s,mu_s_std\n1,0.2,0.1\n2,0.2\n3,0.2,0.1\n", ":3: 2 cells, but the header has 3"),
        ("cycle,mu_s,mu_s_std\n1.5,0.2,0.1\n", ":2: cycle `1.5` is not a whole number"),
        ("cycle,mu_s,mu_s_std\nx,0.2,0.1\n", ":2: cycle `x` is not a whole number"),
        (
            "cycle,mu_s,mu_s_std\n2024-01-01,0.2,0.1\n",
            ":2: cycle `2024-01-01` is not a whole number from 0 on; number the rows, leave out what",
        ),
        ("cycle,mu_s,mu_s_std\ninf,0.2,0.1\n", ":2: cycle `inf` is not a whole number"),
        ("cycle,mu_s,mu_s_std\n-,0.2,0.1\n", ":2: cycle `-` is not a whole number"),
        ("cycle,mu_s,mu_s_std\n1e300,0.2,0.1\n", ":2: cycle `1e300` is larger than"),
        ("cycle,mu_s,mu_s_std\n1,abc,0.1\n", ":2: mu_s `abc` is not a number"),
        (
            "cycle;mu_s;mu_s_std\n1;0,2;0,1\n2;0,2;0.002\n",
            ":3: mu_s_std `0.002` is not a number with decimal",
        ),
        ('cycle,mu_s\n1,0.2\n"2,0.2\n3,0.2\n', ":3: its quotes do not fit"),
        ('cycle,mu_s,batch\n1,0.2,"a\nb"\n2,x,c\n', ":4: mu_s `x` is not a number"),
        ("cycle,mu_s,mu_s_std\n1,0.2,0.1\n2,0.2,-1\n", ":3: mu_s_std `-1` is no standard deviation"),
        ("cycle,mu_s,mu_s_std\n1,0.2,inf\n", ":2: mu_s_std `inf` is no standard deviation"),
        (
            "cycle,mu_s,mu_s_std\n1,nan,0.1\n2,inf,0.1\n",
            "only 0 of 2 cycles can be used, it takes 2; mu_s is",
        ),
    ],
)
def test_faults_of_a_file(tmp_path, text, message):
    path = tmp_path / "s.csv"
    path.write_text(text)
    with pytest.raises(SeriesError) as error:
        track(path)
    assert str(error.value).startswith(str(path))
    assert message in str(error.value)


def test_decimal_commas_between_commas_are_told_with_the_way_out(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("cycle,mu_s,mu_s_std\n" + "1,0,2,0,002\n" * 30)
    with pytest.raises(SeriesError) as error:
        track(path)
    *_, last, more, way_out = str(error.value).splitlines()
    assert last == f"{path}:21: 5 cells, but the header has 3"
    assert more == f"{path}: and 10 more faults"
    assert way_out == (
        f"{path}: rows of more cells: with decimal commas, separate cells by `;`, or put such numbers "
        "in quotes"
    )
    # other separators, and rows that are too short, have nothing to do with it
    for text in ("cycle;mu_s\n1;0,2;3\n", "cycle,mu_s,mu_s_std\n1,0.2\n"):
        path.write_text(text)
        with pytest.raises(SeriesError, match=r"cells, but the header has \d$"):
            track(path)


def test_every_fault_of_a_file_is_told_at_once(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("cycle,mu_s,mu_s_std\n1,abc,xx\n2,0.2,0.002\nthree,0.2,0.002\n4,0.2\n" + "x,0.2,0\n" * 50)
    with pytest.raises(SeriesError) as error:
        track(path)
    told = str(error.value).splitlines()
    assert [line.removeprefix(f"{path}:").split(" ")[:2] for line in told[:4]] == [
        ["2:", "mu_s"],
        ["2:", "mu_s_std"],
        ["4:", "cycle"],
        ["5:", "2"],
    ]
    assert told[-1] == f"{path}: and 34 more faults"


@pytest.mark.parametrize(
    ("written", "encoding"),
    [
        (lambda text: text.replace(",", ";").replace(".", ","), "utf-8-sig"),
        (lambda text: text.replace(",", ";").replace(".", ",").replace("\n", "\r\n"), "cp1252"),
        (lambda text: text.replace(",", "\t"), "utf-16"),
        (lambda text: "sep=;\n" + text.replace(",", ";"), "utf-8"),
        (lambda text: "# a cell, last week\n" + text.replace("cycle,mu_s", "Cycle,MU_S"), "utf-8"),
        (lambda text: text.replace(",", " , ").replace("\n", ",,\n"), "utf-8"),
        (lambda text: text.replace("cycle,mu_s,mu_s_std", "Cycle [-],MU_S [1],mu_s_std (-)"), "utf-8"),
        (lambda text: text.replace("0.002000\n", "0.002000,,\n"), "utf-8"),
    ],
)
def test_a_file_as_people_have_it_says_the_same(tmp_path, capsys, written, encoding):
    path = write(tmp_path / "s.csv", truth(60, at=0))
    expected = run(capsys, path)
    path.write_bytes(written(path.read_text()).encode(encoding))
    assert run(capsys, path) == expected


def test_shots_of_a_campaign_are_cycles(tmp_path, capsys):
    """`impactcell estimate` writes them so."""
    path = write(tmp_path / "s.csv", truth(60, at=0))
    expected = run(capsys, path)
    path.write_text(path.read_text().replace("cycle,", "Shot,", 1))
    assert run(capsys, path) == expected
    path.write_text(path.read_text().replace("Shot,mu_s,", "shot,cycle,mu_s,", 1))
    with pytest.raises(SeriesError, match=r"s\.csv:2: 3 cells, but the header has 4"):
        track(path)


@pytest.mark.parametrize("word", ["NaN", "#N/A", "null", "-"])
def test_a_batch_is_missing_by_the_words_by_which_a_number_is(tmp_path, capsys, word):
    names = [name for name in ("A", "", "B") for _ in range(20)]
    expected = run(capsys, write(tmp_path / "s.csv", truth(60, at=0), batch=names))
    told = run(capsys, write(tmp_path / "s.csv", truth(60, at=0), batch=[name or word for name in names]))
    assert told == expected


@pytest.mark.parametrize("word", ["nan", "NA", "-", "#N/A", "null"])
def test_a_standard_deviation_is_missing_by_the_words_by_which_mu_s_is(tmp_path, capsys, word):
    rows = [f"{n},{0.2 + 0.001 * (n % 3):g},{{}}" for n in range(30)]
    written = ["\n".join(["cycle,mu_s,mu_s_std", *rows]).replace("{}", cell) for cell in (word, "")]
    said = []
    for text in written:
        path = tmp_path / "s.csv"
        path.write_text(text)
        said.append(run(capsys, path))
    assert said[0] == said[1]


def test_columns_that_are_not_read_are_told(tmp_path, capsys):
    path = write(tmp_path / "s.csv", truth(60, at=0))
    path.write_text(path.read_text().replace("mu_s_std", "mu_s_sd"))
    track(path)
    assert "not read: `mu_s_sd`; what is read is called cycle, mu_s, mu_s_std" in capsys.readouterr().err


@pytest.mark.parametrize("order", [np.arange(99, -1, -1), np.random.default_rng(4).permutation(100)])
def test_cycles_that_are_not_in_order_are_refused(tmp_path, order):
    path = write(tmp_path / "s.csv", truth(100, at=0)[order], cycles=order)
    with pytest.raises(SeriesError, match=r"s\.csv: .* sort them by cycle"):
        track(path)


def test_a_counter_that_begins_anew_and_a_late_cycle_are_in_order(tmp_path, capsys):
    cycles = [*range(100, 140), 142, 141, *range(143, 150), *range(40)]
    found = run(capsys, write(tmp_path / "s.csv", truth(len(cycles), at=0), cycles=cycles))
    assert found["cycles"] == len(cycles)


@pytest.mark.slow
def test_one_wrong_number_is_told_and_moves_neither_wear_nor_alarms(tmp_path, capsys):
    cycles = np.arange(600)
    values = 0.2 + 2e-5 * cycles + STD * np.random.default_rng(304).normal(size=600)
    right = run(capsys, write(tmp_path / "right.csv", np.delete(values, 150), cycles=np.delete(cycles, 150)))
    path = write(tmp_path / "wrong.csv", values, cycles=np.where(cycles == 150, 10_150, cycles))
    wrong = run(capsys, path)
    note = "stands between cycles 149 and 151, not used: correct its number"
    assert wrong.pop("notes") == [{"cycle": 10_150, "note": note}]
    assert right.pop("notes") == []
    assert wrong == right
    track(path)
    assert f"cycle 10150: {note}" in capsys.readouterr().out.splitlines()


def test_notes_that_are_alike_are_one_line(tmp_path, capsys):
    track(write(tmp_path / "s.csv", truth(60, at=0), std=0.0))
    (line,) = [line for line in capsys.readouterr().out.splitlines() if "standard deviation" in line]
    assert line.startswith("cycle 59: ")
    assert line.endswith("(and 59 more like this, the first at cycle 0)")


def test_values_that_are_rounded_too_coarsely_are_told_what_they_need(tmp_path, capsys):
    """They look like a stuck sensor, and are left out as its values are."""
    found = run(capsys, write(tmp_path / "s.csv", truth(60, at=0).round(2)))
    assert found["cycles"] < 60
    notes = {note["note"].partition(" in a row, ")[2] for note in found["notes"]}
    told = "or values are rounded coarser than they scatter and need more decimals"
    assert notes == {f"not used: a sensor is stuck, {told}"}


@pytest.mark.slow
def test_of_several_rates_the_one_in_force_is_shown(tmp_path, capsys):
    """A surface that runs in: its first change of rate says nothing of what it does now."""
    cycles = np.arange(800)
    values = 0.2 + 0.03 * -np.expm1(-cycles / 120.0) + np.random.default_rng(3).normal(0.0, 0.002, 800)
    path = write(tmp_path / "s.csv", values)
    told = [note for _, note in impactcell.track(cycles, values, np.full(800, 0.002)).notes]
    rates = [note for note in told if "in 1000 cycles" in note]
    assert len(rates) > 1
    track(path)
    assert rates[-1] in capsys.readouterr().out


@pytest.mark.parametrize("limit", [math.nan, math.inf, -1.0, 0.0])
def test_a_limit_that_is_no_friction_is_refused(tmp_path, limit):
    with pytest.raises(SeriesError, match="--limit"):
        track(write(tmp_path / "s.csv", truth(60, at=0)), limit=limit)


def test_a_limit_in_per_cent_is_refused_or_doubted(tmp_path, capsys):
    path = write(tmp_path / "s.csv", truth(60, at=0))
    with pytest.raises(
        SeriesError, match=r"--limit 25: no surface reaches it, .* 0\.25 if that was meant in %"
    ):
        track(path, limit=25.0)
    with pytest.raises(SeriesError, match=r"limit = 25: no surface reaches it, .* 0\.25 if that was meant"):
        impactcell.track([1, 2], [0.2, 0.2], limit=25.0)
    track(path, limit=8.0)
    assert "--limit: a friction coefficient of 8 is hardly meant" in capsys.readouterr().err
    track(path, limit=0.3)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("percent", [20, 5])
def test_friction_in_per_cent_is_told_as_a_limit_in_per_cent_is(tmp_path, capsys, percent):
    path = tmp_path / "s.csv"
    path.write_text("".join(["cycle,mu_s\n", *(f"{n},{percent + 0.1 * (n - 2):g}\n" for n in range(5))]))
    doubt = f"a friction coefficient of {percent} is hardly meant, where taps have 0.01 to 1.5: if that was "
    doubt += f"meant in %, write {0.01 * percent:g}"
    if percent > 10:
        with pytest.raises(SeriesError, match=r"only 0 of 5 cycles can be used, .* is outside 0") as refused:
            track(path)
        assert str(refused.value).endswith(f"; {doubt}")
    else:
        track(path)
        assert f"{path}: mu_s: {doubt}\n" in capsys.readouterr().err


@pytest.mark.parametrize("column", [True, False])
def test_what_stands_in_for_standard_deviations_is_told(tmp_path, capsys, column):
    path = write(tmp_path / "s.csv", truth(60, at=0), std=None)
    if not column:
        path.write_text("".join(f"{line.rpartition(',')[0]}\n" for line in path.read_text().splitlines()))
    track(path)
    told = capsys.readouterr().err
    assert told.startswith(
        f"{path}: no standard deviations (`mu_s_std`): 1 % of mu_s is taken, and learned from"
    )
    assert told.count("\n") == 1


def test_other_faults(tmp_path):
    with pytest.raises(SeriesError, match="cannot be read"):
        track(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SeriesError, match="not a CSV file"):
        track(tmp_path / "b.csv")
    path = write(tmp_path / "s.csv", truth(50, at=0))
    with pytest.raises(SeriesError, match="needs a column `batch`"):
        track(path, "known")
    with pytest.raises(SeriesError, match="say known or unknown"):
        track(path, "maybe")


@pytest.mark.parametrize(
    ("text", "way_out"),
    [("0,25", "decimals have a point: 0.25"), ("25%", "write digits"), ("", "write digits")],
)
def test_an_option_that_is_no_number_is_told_with_the_way_out(text, way_out):
    done = CliRunner(env={"COLUMNS": "300"}).invoke(app, ["track", "s.csv", "--limit", text])
    assert done.exit_code == 2
    assert f"Invalid value for '--limit': {text!r} is no number; {way_out}" in " ".join(done.output.split())


def test_a_standard_deviation_of_0_is_told_with_the_rows_that_have_it(tmp_path, capsys):
    path = write(tmp_path / "s.csv", truth(60, at=0))
    lines = path.read_text().splitlines()
    for at in (11, 31):
        lines[at] = lines[at].rpartition(",")[0] + ",0"
    path.write_text("\n".join(lines) + "\n")
    track(path)
    assert (
        "mu_s_std is 0 in 2 rows of 60, the first at cycle 10: no estimate is so sure"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("last", "told"),
    [
        ("60,0.2", "cut off after 2 of 3 cells: '60,0.2'"),
        ("the end\n", "no row of the table: 'the end'"),
        ("# end\n,,\n", "no row of the table: '# end'"),
        ("Mean,0.2,0.002\n", "the last line, and no row of the table: 'Mean,0.2,0.002'"),
    ],
)
def test_a_last_line_that_is_no_row_is_left_out_and_told(tmp_path, capsys, last, told):
    path = write(tmp_path / "s.csv", truth(60, at=0))
    expected = run(capsys, path)
    path.write_text(path.read_text() + last)
    track(path, as_json=True)
    seen = capsys.readouterr()
    assert json.loads(seen.out) == expected
    assert f"{path}:62: left out, " in seen.err
    assert told in seen.err


def test_lines_of_words_below_a_series_are_left_out_and_told(tmp_path, capsys):
    """Each was a fault of its own, and nothing was tracked; `import` leaves them out and names them."""
    path = write(tmp_path / "s.csv", truth(60, at=0))
    expected = run(capsys, path)
    path.write_text(path.read_text() + "\nMean,0.2,0.002\nMax,0.21,\n# by hand\nOperator: M. Meier\n")
    track(path, as_json=True)
    seen = capsys.readouterr()
    assert json.loads(seen.out) == expected
    assert (
        f"{path}: lines 63 to 66 left out, below the table and no rows of it: 'Mean,0.2,0.002', "
        "'Max,0.21,', '# by hand', ...\n" in seen.err
    )


@pytest.mark.parametrize(
    ("end", "fault"),
    [
        ("n/a,0.2,0.002\n", ":62: cycle `n/a` is not a whole number"),
        ("Mean,0.2,0.002\n61,0.2,0.002\n", ":62: cycle `Mean` is not a whole number"),
        ("Mean,0.2,0.002\n" * 31, ":62: cycle `Mean` is not a whole number"),
    ],
)
def test_no_cycle_is_taken_for_a_line_below_the_series(tmp_path, end, fault):
    path = write(tmp_path / "s.csv", truth(60, at=0))
    path.write_text(path.read_text() + end)
    with pytest.raises(SeriesError, match=fault):
        track(path)


def test_a_header_that_comes_again_is_one_fault(tmp_path):
    path = write(tmp_path / "s.csv", truth(60, at=0))
    text = path.read_text()
    path.write_text(text + text)
    with pytest.raises(SeriesError) as error:
        track(path)
    assert str(error.value) == f"{path}:62: the header again; delete the line"
