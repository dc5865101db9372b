"""From files as people have them to a campaign: meaning of columns, trigger, cuts, what is told."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell import campaign
from impactcell.api.friction import calibrated, with_masses
from impactcell.campaign import Coordinate, Excitation
from impactcell.cli.app import run_verb
from impactcell.errors import CampaignError, MeasurementError
from impactcell.features import extract
from impactcell.measurements import (
    ColumnMeaning,
    Given,
    MeasuredColumn,
    Table,
    guess,
    make_campaign,
    read_tables,
    write_campaign,
)
from impactcell.measurements.columns.scalars import said_beside, scalars_of
from impactcell.measurements.given import read_given
from impactcell.measurements.notation.units import split_unit
from impactcell.prediction import estimate_from_features
from impactcell.prediction.joint_plant_fit import fit_plant
from impactcell.web.texts.import_notes import page_note
from tests.unit.measurements.records import PLACE_M, PRETRIGGER_S, RATE_HZ, sampled, taps, write_logger_file


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    directory, rng = tmp_path_factory.mktemp("logger"), np.random.default_rng(5)
    paths = []
    for number, tap in enumerate(taps(), 1):
        paths.append(directory / f"shot{number:02d}.csv")
        write_logger_file(paths[-1], tap, rng)
    return paths


def read(paths: list[Path]) -> tuple[Table, ...]:
    return tuple(table for path in paths for table in read_tables(path))


def table(**columns: tuple[str | None, np.ndarray]) -> Table:
    return Table(
        "a.csv", tuple(MeasuredColumn(name, unit, values) for name, (unit, values) in columns.items())
    )


@pytest.mark.slow
def test_a_loggers_files_become_taps_with_the_right_friction(files: list[Path], tmp_path: Path) -> None:
    tables = read(files)
    imported = write_campaign(tables, guess(tables), tmp_path / "campaign")
    back = campaign.read(tmp_path / "campaign")
    assert back.excitation is Excitation.TAP
    for shot, tap in zip(back.shots, taps(), strict=True):
        assert shot.velocity_m_s == pytest.approx(tap.velocity_m_s, rel=1e-9)
        assert (shot.mass_kg, shot.direction) == (tap.mass_kg, tap.direction)
        assert shot.start_m == pytest.approx(PLACE_M, abs=1e-6)
        assert shot.force is not None
        assert shot.force.time_s[0] == pytest.approx(-0.03, abs=2e-4)
        assert abs(float(np.median(shot.force.values[:200]))) < 0.1
    assert any("force turned" in note for note in imported.notes)
    features = with_masses([extract(shot) for shot in back.shots])
    fitted = fit_plant(features, back.gravity_m_s2)
    model = calibrated(fitted.model, [feature.capture for feature in features])
    for feature in features:
        friction = estimate_from_features(feature, model, fitted.gap)
        assert friction.mu_k.value == pytest.approx(0.152, rel=0.01)


def test_a_long_record_is_cut_into_its_taps(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    parts = [sampled(tap, rng, tail_s=0.5) for tap in taps((3000, 4000), (18.9,))]
    time = np.arange(sum(len(part[0]) for part in parts)) * 1e-4
    force, position = (np.concatenate([part[i] for part in parts]) for i in (1, 2))
    tables = [table(Time=("s", time), Force=("N", force), Position=("m", position))]
    given = Given(constants={"mass": 18.9, "velocity": 0.05})
    imported = make_campaign(tables, guess(tables, given))
    shots = imported.campaign.shots
    assert [shot.direction for shot in shots] == [1, -1, 1, -1]
    assert "1 record cut into 4 taps where the force begins anew" in imported.notes
    for shot in shots:
        assert shot.position is not None
        assert shot.position.time_s[0] < -0.02
        assert shot.position.time_s[-1] < 0.4
        assert np.ptp(shot.position.values[-50:]) < 2e-5


def test_a_spike_before_contact_hides_no_tap() -> None:
    rng = np.random.default_rng(6)
    time, force, position = sampled(taps((3000,), (18.9,))[0], rng)
    force[50] += 12.0  # of one sample, 25 ms before contact
    tables = [table(Time=("s", time), Force=("N", force), Position=("m", position))]
    given = Given(constants={"mass": 18.9, "velocity": 0.05})
    (shot,) = make_campaign(tables, guess(tables, given)).campaign.shots
    assert shot.force is not None
    assert shot.force.time_s[0] == pytest.approx(-0.03, abs=2e-4)


@pytest.mark.parametrize("spiked", [100, -3])
def test_a_spike_of_the_position_moves_neither_place_nor_direction(spiked: int) -> None:
    """Before contact the part lies at 0 of a table that it never left; it slides 5 mm along +1."""
    time, force, position = sampled(taps((3000,), (18.9,))[0], np.random.default_rng(6))
    position = position - np.mean(position[time < PRETRIGGER_S])
    spikes = position.copy()
    spikes[spiked] -= 0.05 if spiked > 0 else 0.5
    given = Given(constants={"mass": 18.9, "velocity": 0.05})
    (clean,), (shot,) = (
        make_campaign(tables, guess(tables, given)).campaign.shots
        for tables in (
            [table(Time=("s", time), Force=("N", force), Position=("m", values))]
            for values in (position, spikes)
        )
    )
    assert (clean.start_m, clean.direction) == (0.0, 1.0)
    assert (shot.start_m, shot.direction) == (0.0, 1.0)
    assert shot.position is not None
    assert clean.position is not None
    unlike = shot.position.values != clean.position.values
    assert np.count_nonzero(unlike) == 1


def test_lines_beside_the_columns_are_told_and_a_count_of_rows_is_no_covariate(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    paths = []
    for mass, tap in zip((12.5, 15.0), taps((3000,), (18.9,)), strict=False):
        time, force, position = sampled(tap, rng)
        rows = zip(time, 1e-3 * force, 1e3 * position, strict=True)
        lines = [f"Teilemasse;{mass};kg", "Geschwindigkeit;3000;mm/min", "Massenträger;7;kg", ""]
        lines += ["lfd. Nr.;Zeit / s;Kraft / kN;Weg / mm"]
        lines += [f"{n};{t:.5f};{f:.6f};{x:.5f}".replace(".", ",") for n, (t, f, x) in enumerate(rows, 1)]
        paths.append(tmp_path / f"{mass}.csv")
        paths[-1].write_text("\n".join(lines), encoding="utf-8")
    tables = read(paths)
    mapping = guess(tables)
    assert [str(item.meaning) for item in mapping.assignments] == ["ignored", "time", "force", "position"]
    imported = make_campaign(tables, mapping)
    assert [shot.mass_kg for shot in imported.campaign.shots] == [12.5, 15.0]
    assert not any(shot.covariates for shot in imported.campaign.shots)
    assert imported.notes[0] == "the lines beside the columns say: mass 12.5 to 15 kg, velocity 3000 mm/min"


def test_an_abbreviated_line_says_the_velocity_and_a_temperature_is_in_kelvin(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    rows = zip(*sampled(taps((3000,), (18.9,))[0], rng), strict=True)
    lines = ["Vorschubgeschw.: 50.0 mm/s", "Teilegewicht: 18.9 kg", "Kraftbereich: 20 kg", ""]
    lines += ["Zeit [s],Kraft [N],Weg [m],Temp [°C],Oil [degF]"]
    lines += [f"{t:.5f},{f:.6f},{x:.8f},23.5,86" for t, f, x in rows]
    path = tmp_path / "tap.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    tables = read([path])
    imported = make_campaign(tables, guess(tables))
    (shot,) = imported.campaign.shots
    assert shot.velocity_m_s == pytest.approx(0.05)
    assert shot.mass_kg == 18.9
    assert shot.covariates == pytest.approx({"temp_k": 296.65, "oil_k": 303.15})
    assert "no stroke is stated: the actuator is taken to halt as it loses contact" in imported.notes[-1]


def test_a_column_numbers_the_shots_and_a_word_is_the_batch() -> None:
    rng = np.random.default_rng(7)
    parts = [sampled(tap, rng) for tap in taps((3000,), (18.9, 25.2))]
    numbers = np.concatenate([np.full(len(part[0]), 10.0 + n) for n, part in enumerate(parts)])
    columns = {
        "t": ("s", np.concatenate([part[0] for part in parts])),
        "F": ("N", np.concatenate([part[1] for part in parts])),
        "x": ("m", np.concatenate([part[2] for part in parts])),
        "Versuch": (None, numbers),
        "Druck": ("bar", numbers),
    }
    batch = MeasuredColumn("Charge", None, np.full(len(numbers), np.nan), tuple(f"B{n:g}" for n in numbers))
    made = table(**columns)
    tables = [Table("a.csv", (*made.columns, batch))]
    given = Given(constants={"mass": 18.9, "velocity": 0.05}, units={}, columns={})
    shots = make_campaign(tables, guess(tables, given)).campaign.shots
    assert [shot.batch_id for shot in shots] == ["B10", "B11", "B12", "B13"]
    assert [shot.covariates["druck_pa"] for shot in shots] == pytest.approx([1e6, 1.1e6, 1.2e6, 1.3e6])


TIME = np.arange(200) * 1e-3
WAVE = np.sin(40.0 * TIME)


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        (
            {"t": (None, TIME), "F": ("N", WAVE), "x": ("m", WAVE)},
            "column 't' (time) has no unit; say --unit 't=s'",
        ),
        ({"t": ("s", TIME), "F": ("N", WAVE), "x": (None, WAVE)}, "column 'x' (position) has no unit"),
        ({"F": ("N", WAVE), "x": ("m", WAVE)}, "no column of time was found; name it"),
        (
            {"a": (None, TIME), "n": (None, 1e3 * TIME), "F": ("N", WAVE), "x": ("m", WAVE)},
            "no column of time was found: 'a' goes up by 0.001 a row and may be it, in a unit to be said",
        ),
        (
            {"n": (None, np.arange(0.0, 2000.0, 10.0)), "F": ("N", WAVE), "x": ("m", WAVE)},
            "'n' goes up by 10 a row and may be it, in a unit to be said, as --unit 'n=ms'; name it",
        ),
        (
            {"t": ("s", TIME), "torque": (None, WAVE), "position": ("m", WAVE)},
            "column 'torque' (force) has no unit; say --unit 'torque=N', or which it is",
        ),
        (
            {"t": ("s", TIME), "torque": (None, WAVE), "position": (None, WAVE)},
            "column 'position' (position) has no unit; say --unit 'position=rad', or which it is",
        ),
        ({"n": (None, np.round(1e3 * TIME)), "F": ("N", WAVE)}, "no column of time was found; name it"),
        ({"t": ("s", TIME), "u": ("V", WAVE)}, "neither position nor force was found among 't', 'u'"),
        ({"t": ("s", TIME), "a": ("m", WAVE), "b": ("m", WAVE)}, "may be the position"),
        ({"t": ("s", TIME % 0.1), "F": ("N", WAVE), "x": ("m", WAVE)}, "time does not increase"),
    ],
)
def test_what_cannot_be_understood_is_told_and_nothing_written(
    columns: dict, told: str, tmp_path: Path
) -> None:
    tables = [table(**columns)]
    with pytest.raises(MeasurementError) as caught:
        write_campaign(tables, guess(tables), tmp_path / "out")
    assert told in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_what_is_given_goes_before_what_is_guessed() -> None:
    tables = [table(t=("s", TIME), F=("N", WAVE), Fx=("N", WAVE), x=("mm", -WAVE))]
    with pytest.raises(MeasurementError, match="there is no column 'G'"):
        guess(tables, Given(columns={ColumnMeaning.FORCE: "G"}))
    mapping = guess(tables, Given(columns={ColumnMeaning.FORCE: "Fx"}, units={"x": "um"}))
    force, position = mapping.of(ColumnMeaning.FORCE), mapping.of(ColumnMeaning.POSITION)
    assert force is not None
    assert position is not None
    assert (force.column, force.confidence) == ("Fx", 1.0)
    assert position.unit is not None
    assert position.unit.factor == 1e-6
    made = make_campaign(tables, mapping)
    assert made.campaign.excitation is Excitation.DRIVEN
    [note] = [note for note in made.notes if note.startswith("no mass is stated")]
    assert "a base model has to say it (mass_kg)" in note
    assert page_note(note, "de")[0] == "de"


@pytest.mark.slow
def test_the_verb_shows_what_it_guessed_and_writes(
    files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    named = [str(path) for path in files]

    def run(*arguments: str) -> None:
        with pytest.raises(SystemExit) as ended:
            run_verb(["import", *named, *arguments])
        assert ended.value.code == 0

    run("--dry-run", "--json")
    said = json.loads(capsys.readouterr().out)
    assert said["shots"] == len(files)
    assert [(c["column"], c["quantity"], c["unit"]) for c in said["columns"]] == [
        ("Zeit", "time", "ms"), ("Kraft", "force", "N"), ("Weg", "position", "µm"),
    ]  # fmt: skip
    run("--quiet", "--out", str(tmp_path / "q"))
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", "")
    run("--out", str(tmp_path / "c"), "--set", "mass=12.6kg", "--set", "stroke=1.5mm", "--sign", "force=-1")
    told = capsys.readouterr()
    assert f"{len(files)} shots of excitation tap, in {tmp_path / 'c'}" in told.out
    back = campaign.read(tmp_path / "c")
    assert back.stroke_m == pytest.approx(1.5e-3)
    assert {shot.mass_kg for shot in back.shots} == {12.6}
    with pytest.raises(MeasurementError, match="time"):
        run_verb(["import", *named, "--dry-run", "--json", "--column", "time=Kraft"])
    understood = json.loads(capsys.readouterr().out)
    assert understood["faults"]
    assert [c["column"] for c in understood["columns"]] == ["Zeit", "Kraft", "Weg"]
    with pytest.raises(MeasurementError, match="mass is '12'; write it with its unit"):
        run_verb(["import", *named, "--dry-run", "--set", "mass=12"])
    with pytest.raises(MeasurementError, match="say where to write"):
        run_verb(["import", *named])


@pytest.mark.slow
def test_a_file_with_the_samples_of_another_is_told_and_kept(files: list[Path]) -> None:
    copy = files[1].with_name(f"{files[1].stem} (2){files[1].suffix}")
    copy.write_bytes(files[1].read_bytes())
    tables = [table for file in (*files, copy) for table in read_tables(file)]
    constants = ["mass=12.6kg", "velocity=4000mm/min", "stroke=1.5mm"]
    imported = make_campaign(tables, guess(tables, read_given({"constants": constants})))
    assert len(imported.campaign.shots) == len(files) + 1
    (note,) = (note for note in imported.notes if "noise and all" in note)
    assert note.startswith(f"{copy}: has the samples of {files[1]}, noise and all")
    language, said = page_note(note, "de")
    assert (language, said.endswith("ist es eine Kopie, weglassen")) == ("de", True)


@pytest.mark.slow
def test_a_unit_that_is_wrong_by_far_is_told_before_other_verbs_refuse_it(
    files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    constants = [
        item for name in ("mass=12.6kg", "velocity=4000mm/min", "stroke=1.5mm") for item in ("--set", name)
    ]

    def notes(*arguments: str) -> list[str]:
        with pytest.raises(SystemExit):
            run_verb(["import", *map(str, files), "--dry-run", "--json", *constants, *arguments])
        told: list[str] = json.loads(capsys.readouterr().out)["notes"]
        return [note for note in told if "check the unit" in note]

    assert notes() == []
    (note,) = notes("--unit", "Kraft=kN")
    assert "check the unit of force_n or mass_kg (off by a factor of about 1e+3)" in note
    assert note.endswith("it will be refused as it stands (--unit NAME=UNIT says another)")
    language, german = page_note(note, "de")
    assert language == "de"
    assert german.startswith("Einheit prüfen: force_n oder mass_kg (um etwa den Faktor 1e+3 daneben)")


def test_of_a_driven_machine_nothing_is_refused_that_a_base_model_takes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time = np.arange(0.0, 20.0, 0.01)
    phase = 2.0 * np.pi * time / 4.0
    force, position = 5.0 * np.sign(np.cos(phase)) + 4.0 * np.sin(phase), 20.0 * np.sin(phase)
    file = tmp_path / "driven.csv"
    np.savetxt(
        file, np.column_stack([time, force, position]), delimiter=";",
        header="time [s];force [N];position [mm]", comments="",
    )  # fmt: skip
    with pytest.raises(SystemExit) as ended:
        run_verb(["import", str(file), "--dry-run", "--json"])
    assert ended.value.code == 0
    told = json.loads(capsys.readouterr().out)
    assert told["excitation"] == "driven"
    assert not any("refused" in note for note in told["notes"])


@pytest.mark.slow
def test_a_mapping_file_says_the_same(files: list[Path], tmp_path: Path) -> None:
    mapping = tmp_path / "map.yaml"
    mapping.write_text(
        "columns: {force: Kraft}\nunits: {Kraft: kN}\nconstants: {mass: 5 kg}\ntrigger: 5 kN\n",
        encoding="utf-8",
    )
    with pytest.raises(SystemExit):
        run_verb(["import", str(files[0]), "--mapping", str(mapping), "-o", str(tmp_path / "c")])
    (shot,) = campaign.read(tmp_path / "c").shots
    assert shot.force is not None
    assert shot.force.values.max() > 1e4
    mapping.write_text("colums: {}\n", encoding="utf-8")
    with pytest.raises(MeasurementError, match="unknown key 'colums'"):
        run_verb(["import", str(files[0]), "--mapping", str(mapping), "-o", str(tmp_path / "d")])


def test_a_measured_speed_beside_the_position_is_no_covariate(tmp_path: Path) -> None:
    """Without a name of its own; one that is set for a shot is kept."""
    time = np.arange(0.0, 2.0, 0.01)
    rows = [f"{t:.2f},{np.sin(t):.6f},{np.cos(t):.6f},0.25" for t in time]
    (tmp_path / "swing.csv").write_text("\n".join(rows), encoding="utf-8")
    given = Given(
        columns={ColumnMeaning.TIME: "column 1", ColumnMeaning.POSITION: "column 2"},
        units={"column 1": "s", "column 2": "rad", "column 3": "rad/s", "column 4": "rad/s"},
        excitation=Excitation.FREE_SLIDE,
    )
    tables = read([tmp_path / "swing.csv"])
    mapping = guess(tables, given)
    assert [str(item.meaning) for item in mapping.assignments[2:]] == ["ignored", "covariate"]
    assert mapping.assignments[2].why == "a speed, as the position has it"
    assert page_note(mapping.assignments[2].why, "de")[0] == "de"
    assert make_campaign(tables, mapping).campaign.shots[0].covariates == {"column_4_rad_per_s": 0.25}


def test_columns_are_left_out_or_kept_as_covariates(tmp_path: Path) -> None:
    tables = [
        table(
            t=("s", TIME),
            F=("N", WAVE),
            x=("m", -WAVE),
            Speed=(None, WAVE),
            torque_enable=(None, WAVE),
            p=("bar", WAVE),
        )
    ]
    speed = next(item for item in guess(tables).assignments if item.column == "Speed")
    # measured beside the position, so that nobody needs its unit
    assert (speed.meaning, speed.why) == (ColumnMeaning.IGNORED, "a speed, as the position has it")
    given = read_given({"columns": ["velocity=Speed"]})
    with pytest.raises(MeasurementError, match="column 'Speed' \\(velocity\\) has no unit"):
        make_campaign(tables, guess(tables, given))
    given = read_given({"columns": ["ignored=Speed", "ignored=torque_enable"]})
    imported = make_campaign(tables, guess(tables, given))
    assert set(imported.campaign.shots[0].covariates) == {"p_pa"}
    said = tmp_path / "map.yaml"
    said.write_text("columns: {ignored: [Speed, torque_enable], covariate: [p]}\n", encoding="utf-8")
    assert read_given({}, said).others == {
        "Speed": ColumnMeaning.IGNORED, "torque_enable": ColumnMeaning.IGNORED, "p": ColumnMeaning.COVARIATE,
    }  # fmt: skip
    with pytest.raises(MeasurementError, match="there is no column 'gone'"):
        guess(tables, read_given({"columns": ["ignored=gone"]}))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("columns: {covariate: [[p]]}\n", "map.yaml:1:11: columns.covariate has to be a text or a number"),
        ("columns:\n  force:\n", "map.yaml:2:3: columns.force has to be a text or a number"),
        ("units: {x: [mm]}\n", "map.yaml:1:9: units.x has to be a text or a number"),
        ("delays: [1 ms]\n", "map.yaml:1:1: delays has to be a block of `name: value`"),
        ("signs: 3\n", "map.yaml:1:1: signs has to be a block of `name: value`"),
        ("units: {x: !!timestamp 2026-13-45}\n", "map.yaml:1:12: '2026-13-45' cannot be read as timestamp"),
        ("", "map.yaml:1:1: the file is empty"),
    ],
)
def test_what_a_mapping_file_cannot_say_is_told_with_its_place(text: str, told: str, tmp_path: Path) -> None:
    said = tmp_path / "map.yaml"
    said.write_text(text, encoding="utf-8")
    with pytest.raises(MeasurementError, match=re.escape(told)):
        read_given({}, said)


def test_one_column_of_a_mapping_file_needs_no_list(tmp_path: Path) -> None:
    said = tmp_path / "map.yaml"
    said.write_text("columns: {covariate: Druck, ignored: 7}\n", encoding="utf-8")
    assert read_given({}, said).others == {"Druck": ColumnMeaning.COVARIATE, "7": ColumnMeaning.IGNORED}


def test_what_rotates_is_asked_for_its_inertia_and_what_slides_for_its_mass() -> None:
    sliding = table(t=("s", TIME), Kraft=("N", 100.0 * WAVE), Weg=("mm", -90.0 * WAVE))
    rotating = table(t=("s", TIME), Drehmoment=("Ncm", 100.0 * WAVE), Winkel=("deg", -90.0 * WAVE))
    for records, asked, example in (
        (sliding, "mass", "mass=18.9kg"),
        (rotating, "inertia", "mass=0.02 kg m²"),
    ):
        (note,) = [n for n in make_campaign([records], guess([records])).notes if "is stated" in n]
        assert note.startswith(f"no {asked} is stated")
        assert example in note
        assert page_note(note, "de")[0] == "de"
        read_given({"constants": [example]})


def test_what_rotates_is_a_campaign_of_torque_angle_and_inertia(tmp_path: Path) -> None:
    rotating = table(t=("s", TIME), Drehmoment=("Ncm", 100.0 * WAVE), Winkel=("deg", -90.0 * WAVE))
    given = read_given({"constants": ["mass=49 kgcm2"]})
    write_campaign([rotating], guess([rotating], given), tmp_path / "c")
    assert "coordinate: rotation" in (tmp_path / "c" / "campaign.yaml").read_text(encoding="utf-8")
    head = (tmp_path / "c" / "traces" / "1.csv").read_text(encoding="utf-8").splitlines()[0]
    assert head == "time_s,torque_n_m,angle_rad"
    back = campaign.read(tmp_path / "c")
    (shot,) = back.shots
    assert back.coordinate is Coordinate.ROTATION
    assert shot.mass_kg == pytest.approx(0.0049)
    assert shot.force is not None
    assert shot.position is not None
    np.testing.assert_allclose(shot.force.values, WAVE)
    np.testing.assert_allclose(shot.position.values, -0.5 * np.pi * WAVE)
    mixed = table(t=("s", TIME), Drehmoment=("Nm", WAVE), Weg=("mm", -WAVE))
    with pytest.raises(MeasurementError, match="some are of a rotation and some of a translation"):
        make_campaign([mixed], guess([mixed], given))
    with pytest.raises(MeasurementError, match="a tap goes along a line"):
        make_campaign([rotating], guess([rotating], replace(given, excitation=Excitation.TAP)))
    yaml = tmp_path / "c" / "campaign.yaml"
    yaml.write_text(yaml.read_text(encoding="utf-8").replace("rotation", "spin"), encoding="utf-8")
    with pytest.raises(CampaignError, match=r"campaign\.yaml:4: coordinate 'spin' is not known"):
        campaign.read(tmp_path / "c")


def test_a_swing_that_ends_where_it_began_is_imported() -> None:
    time = np.arange(0.0, 24.0 * np.pi, 0.01)
    angle = 0.1 * np.exp(-0.002 * time) * np.cos(3.0 * time)
    angle += np.random.default_rng(7).normal(0.0, 1e-4, time.size)
    swing = table(t=("s", time), Winkel=("rad", angle))
    imported = make_campaign([swing], guess([swing]))
    assert imported.campaign.excitation is Excitation.FREE_SLIDE
    assert not any("slides" in note for note in imported.notes)


VOLTS = {"mass": 18.9, "velocity": 0.05}
"""Constants of a tap whose force was recorded in volts, 12.5 N each."""


def volts(unit: str | None = "V", name: str = "Kraft", factor: float = 12.5) -> list[Table]:
    time, force, position = sampled(taps((3000,), (18.9,))[0], np.random.default_rng(9))
    return [table(**{"Zeit": ("s", time), name: (unit, force / factor), "Weg": ("m", position)})]


@pytest.mark.parametrize(
    ("unit", "factor", "gain"),
    [
        ("V", 12.5, "12.5 N/V"),
        ("V", 12.5, "80 mV/N"),
        ("mV", 0.0125, "12.5N/V"),
        (None, 12.5, "12.5 N/V"),
        ("mA", 40.0, "0.04 kN/mA"),
        (None, 0.5, "0.5 N"),
        ("V", -12.5, "-12.5 N/V"),
    ],
)
def test_a_force_in_volts_is_one_in_newtons_with_its_gain(
    unit: str | None, factor: float, gain: str, tmp_path: Path
) -> None:
    said = tmp_path / "map.yaml"
    said.write_text(f"gains: {{force: {gain}}}\n", encoding="utf-8")
    tables = volts(unit, factor=factor)
    (plain,) = make_campaign(volts("N", factor=1.0), guess(volts("N"), Given(constants=VOLTS))).campaign.shots
    for given in (read_given({"gains": [f"force={gain}"]}), read_given({}, said)):
        mapping = guess(tables, replace(given, constants=VOLTS))
        assert mapping.faults == ()
        (shot,) = make_campaign(tables, mapping).campaign.shots
        assert shot.force is not None
        assert plain.force is not None
        np.testing.assert_allclose(shot.force.values, plain.force.values, atol=1e-9)


@pytest.mark.parametrize(
    ("said", "unit", "told"),
    [
        (
            {},
            "V",
            "is called as the force, but is in V; say what that stands for with --gain 'force=12.5 N/V'",
        ),
        ({"columns": ["force=Kraft"]}, "V", "'Kraft' (force) is in V; say what that stands for with --gain"),
        ({"units": ["Kraft=V"]}, "N", "is called as the force, but is in V; say what that stands for with"),
        ({"units": ["Kraft=1"]}, "N", "(force) is in 1; say what that stands for with --gain 'force=12.5 N'"),
        ({"columns": ["force=Kraft"], "units": ["Kraft=bar"]}, "N", "(force) is in bar; give its unit with"),
        ({"gains": ["force=12.5 N/V"]}, "N", "(force) is in N, of which a gain of 12.5 N/V says nothing"),
        ({"gains": ["actuator=2 mm/V"]}, "N", "a gain of the actuator was given, and no column is the actu"),
    ],
)
def test_a_signal_without_its_gain_is_refused(said: dict[str, list[str]], unit: str, told: str) -> None:
    tables = volts(unit)
    mapping = guess(tables, replace(read_given(said), constants=VOLTS))
    with pytest.raises(MeasurementError, match=re.escape(told)):
        make_campaign(tables, mapping)


@pytest.mark.parametrize("gain", ["force=12.5", "force=0 N/V", "force=2 mm/V", "force=N/V", "force=2 mV/V/N"])
def test_a_gain_that_is_none_is_told(gain: str) -> None:
    with pytest.raises(MeasurementError, match=r"the gain of force is .* write it with its units"):
        read_given({"gains": [gain]})
    with pytest.raises(MeasurementError, match="mass has no gain; one is of force, position, actuator"):
        read_given({"gains": ["mass=2 kg/V"]})


def test_one_column_in_two_units_is_refused_unless_one_was_given() -> None:
    tables = [*volts("N"), replace(volts("kN")[0], source="b.csv")]
    with pytest.raises(
        MeasurementError, match=re.escape("column 'Kraft' is in N in a.csv and in kN in b.csv")
    ):
        make_campaign(tables, guess(tables, Given(constants=VOLTS)))
    given = Given(constants=VOLTS, units={"Kraft": "N"})
    assert len(make_campaign(tables, guess(tables, given)).campaign.shots) == 2


def test_what_goes_in_is_not_in_inches() -> None:
    time = 1e-3 * np.arange(200)
    tables = [table(time_s=("s", time), u_in=(None, np.sin(time)), torque=(None, np.cos(time)))]
    mapping = guess(tables)
    assert mapping.of(ColumnMeaning.POSITION) is None
    assert split_unit("u_in") == ("u_in", None)
    assert split_unit("pos_inch") == ("pos", "inch")
    assert any("--unit 'torque=N m'" in fault for fault in mapping.faults)


def test_one_more_time_is_no_covariate() -> None:
    time = 1e-3 * np.arange(200)
    mapping = guess([table(t=("s", time), clock=(None, 7.0 + 3.0 * time), x=("mm", np.cos(time)))])
    assert [item.meaning for item in mapping.assignments if item.column == "clock"] == [ColumnMeaning.IGNORED]


def beside(directory: Path, *lines: str) -> Table:
    path = directory / "x.csv"
    rows = "\n".join(f"{n},5;{n % 7},25" for n in range(40))
    path.write_text("\n".join(lines) + f"\n\nZeit [ms];Kraft [N]\n{rows}", encoding="utf-8")
    (table,) = read_tables(path)
    return table


def test_a_quantity_beside_the_columns_is_that_of_the_name_that_fits_best(tmp_path: Path) -> None:
    lines = (
        "Masse: 18,900 kg",
        "Masse Greifer: 4,2 kg",
        "Vorschub: 3.000 mm/min",
        "Max. Vorschub: 4000 mm/min",
    )
    said = said_beside(beside(tmp_path, *lines, "Rückzugsgeschwindigkeit: 12000 mm/min"))
    assert said[ColumnMeaning.MASS] == pytest.approx(18.9)
    assert said[ColumnMeaning.VELOCITY] == pytest.approx(0.05)


def test_two_masses_beside_the_columns_are_refused_unless_one_is_given(tmp_path: Path) -> None:
    table = beside(tmp_path, "Masse Teil: 18,9 kg", "Masse mit Greifer: 23,1 kg", "Vorschub: 3000 mm/min")
    with pytest.raises(MeasurementError, match=r"say mass 18.9 kg and 23.1 kg; give it .* --set mass=18.9kg"):
        make_campaign((table,), guess((table,)))
    faults: list[str] = []
    mapping = guess((table,), Given(constants={"mass": 23.1}))
    assert str(ColumnMeaning.MASS) not in scalars_of(table, "x.csv", mapping, faults)
    assert not faults


def test_a_stroke_that_no_actuator_has_is_refused() -> None:
    with pytest.raises(MeasurementError, match=r"stroke of 1500 mm is hardly meant, where .* 0.01 to 100 mm"):
        read_given({"constants": ["stroke=1.5m"]})
    assert read_given({"constants": ["stroke=90deg"]}).constants["stroke"] == pytest.approx(np.pi / 2.0)
    assert read_given({"constants": ["stroke=100mm"]}).constants["stroke"] == pytest.approx(0.1)


@pytest.mark.parametrize("text", ["mass=18,900kg", "stroke=1,500 mm", "mass=1,5kg"])
def test_a_comma_in_what_is_set_is_neither_a_decimal_mark_nor_a_separator(text: str) -> None:
    with pytest.raises(MeasurementError, match=r"with its unit and a decimal point, without separators"):
        read_given({"constants": [text]})
    with pytest.raises(MeasurementError, match="is neither a force"):
        read_given({}, trigger="1,500 N")
    with pytest.raises(MeasurementError, match="the gain of force is"):
        read_given({"gains": ["force=1,500 N/V"]})


@pytest.mark.parametrize("head", ["", "velocity: 3000 mm/min\n\n"])
def test_a_velocity_that_only_the_actuator_shows_is_told(tmp_path: Path, head: str) -> None:
    """It was taken without a word, as no other guess is."""
    struck = taps((2500, 4500), (18.9,))[::2]
    for number, tap in enumerate(struck):
        rng = np.random.default_rng(number)
        onset = PRETRIGGER_S + np.random.default_rng(number).uniform(0.0, 1.0) / RATE_HZ
        time, force, position = sampled(tap, rng)
        ram = np.minimum(tap.velocity_m_s * (time - onset), tap.stroke_m)
        rows = [
            f"{t:.5f},{f:.4f},{x:.8f},{y:.9f}" for t, f, x, y in zip(time, force, position, ram, strict=True)
        ]
        text = "\n".join(["time [s],force [N],position [m],actuator [m]", *rows])
        (tmp_path / f"{number}.csv").write_text(f"{head}{text}", encoding="utf-8")
    tables = [table for file in sorted(tmp_path.iterdir()) for table in read_tables(file)]
    imported = make_campaign(tables, guess(tables))
    told = [note for note in imported.notes if "from the actuator channel" in note]
    velocities = [shot.velocity_m_s * 6e4 for shot in imported.campaign.shots]
    if head:
        assert (velocities, told) == (pytest.approx([3000.0, 3000.0]), [])
        return
    assert velocities == pytest.approx([2500.0, 4500.0], rel=1e-5)
    (note,) = told
    assert note.startswith(
        "velocity 2500 to 4500 mm/min taken from the actuator channel about contact, in 2 taps (--set "
    )
    german = "Geschwindigkeit 2500 bis 4500 mm/min, aus dem Weg des Aktors um den Kontakt (Stöße: 2)"
    assert page_note(note, "de") == ("de", german)


@pytest.mark.parametrize(("zero_n", "told"), [(2.0, "force of 1.9"), (-3.0, "force of -3.0"), (0.02, "")])
def test_a_zero_of_the_force_is_taken_off_and_told(zero_n: float, told: str) -> None:
    rng, tables = np.random.default_rng(7), []
    for tap in taps((3000, 4000), (18.9,)):
        time, force, position = sampled(tap, rng)
        tables.append(table(Time=("s", time), Force=("N", force + zero_n), Position=("m", position)))
    given = Given(constants={"mass": 18.9, "velocity": 0.05})
    imported = make_campaign(tables, guess(tables, given))
    notes = [note for note in imported.notes if "without contact" in note]
    assert len(notes) == (1 if told else 0)
    for note in notes:
        assert note.startswith(told)
        assert note.endswith("N without contact taken off, in 4 taps")
        assert page_note(note, "de")[1].startswith("Kraft von ")
    for shot in imported.campaign.shots:
        assert shot.force is not None
        assert abs(float(np.median(shot.force.values[shot.force.time_s < 0.0]))) < 0.1
