"""Faults of `impactcell import` as the page says them; made by import itself, so that none is missed here."""

from pathlib import Path

import numpy as np
import pytest

from impactcell.errors import MeasurementError
from impactcell.measurements import Given, Table, guess, make_campaign, read_tables
from impactcell.measurements.given import read_given
from impactcell.measurements.taps.excitation import SWAPPED
from impactcell.web.texts.import_faults import page_fault
from impactcell.web.texts.import_notes import page_note

ZEROS = "".join(f"{n};0;0;3000\n" for n in range(60))
"""A record in which nothing is struck."""
NOTHING_GIVEN = Given()
FILES = {
    "nothing named": "a;b\n1;2\n2;3\n3;5\n",
    "time as text": "Zeit;Kraft [N]\num eins;2\num zwei;3\num drei;5\n",
    "time to and fro": "Zeit [s];Kraft [N]\n1;2\n0;3\n3;5\n2;7\n",
    "rounded time": "t [s];Kraft [N]\n" + "".join(f"0,{n // 9:03d};{n % 7}\n" for n in range(60)),
    "time that repeats at times": "t [s];Kraft [N]\n"
    + "".join(f"0,{n - n // 10:03d};{n % 7}\n" for n in range(60)),
    "two records": "Zeit [s];Kraft [N]\n" + "".join(f"0,{n % 30:03d};{n % 7}\n" for n in range(60)),
    "last row first": "Zeit [s];Kraft [N]\n" + "".join(f"0,{60 - n:03d};{n % 7}\n" for n in range(60)),
    "no unit": "Zeit [ms];Kraft [N];Weg\n0;0;0\n1;1;1\n2;0;2\n3;0;3\n",
    "time without a name": "a;Kraft [N]\n0;2\n0,25;3\n0,5;5\n0,75;7\n",
    "unit of something else": "Zeit [ms];Kraft [mm];Weg [mm]\n0;0;0\n1;1;1\n2;0;2\n3;0;3\n",
    "no contact": f"Zeit [ms];Kraft [N];Weg [mm];Geschwindigkeit [mm/min]\n{ZEROS}",
    "two masses": "Zeit [ms];Kraft [N];Masse [kg]\n"
    + "".join(f"{n};{n % 7};{n % 2 + 1}\n" for n in range(60)),
    "masses beside": "Masse Teil: 2 kg\nMasse Greifer: 1 kg\n\nZeit [ms];Kraft [N]\n"
    + "".join(f"{n};{n % 7}\n" for n in range(60)),
    "channel as text": "Zeit [ms];Kraft [N];Weg [µm]\n"
    + "".join(f"{n};{n % 7};{'OVER' if n > 30 else n}\n" for n in range(60)),
    "units in cells": "Zeit [ms];Kraft [N];Weg\n" + "".join(f"{n};{n % 7};{n} µm\n" for n in range(60)),
    "no mass": "Zeit [ms];Kraft [N];Masse [kg]\n" + "".join(f"{n};{n % 7};-1\n" for n in range(60)),
}


def faults_of(directory: Path, text: str, given: Given = NOTHING_GIVEN) -> list[str]:
    path = directory / "x.csv"
    path.write_text(text, encoding="utf-8")
    tables = read_tables(path)
    mapping = guess(tables, given)
    if mapping.faults:
        return list(mapping.faults)
    with pytest.raises(MeasurementError) as error:
        make_campaign(tables, mapping)
    return str(error.value).splitlines()


def test_further_faults_are_counted_in_both_languages() -> None:
    assert page_fault("shots.csv: and 4 more faults", "en") == ("en", "shots.csv: and 4 more faults")
    assert page_fault("shots.csv: and 4 more faults", "de") == ("de", "shots.csv: und 4 weitere Fehler")


def test_a_stroke_that_no_actuator_has_is_said_in_both_languages() -> None:
    with pytest.raises(MeasurementError) as error:
        read_given({"constants": ["stroke=1.5 m"]})
    assert page_fault(str(error.value), "en")[1].endswith("correct it in the form below")
    assert page_fault(str(error.value), "de")[1].startswith("ein Hub von 1500 mm ist kaum gemeint")


@pytest.mark.parametrize(
    ("text", "german"),
    [
        ("", "ist leer; die Datei weglassen oder neu aufzeichnen"),
        ("Zeit [ms];Kraft [N]\n", "hat unter den Namen keine Messwerte; die Datei weglassen"),
    ],
)
def test_a_file_without_samples_is_said_in_both_languages(tmp_path: Path, text: str, german: str) -> None:
    path = tmp_path / "x.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(MeasurementError) as error:
        read_tables(path)
    fault = str(error.value).replace(str(path), "x.csv")
    assert page_fault(fault, "en") == ("en", fault)
    language, said = page_fault(fault, "de")
    assert (language, german in said) == ("de", True)


@pytest.mark.parametrize("case", FILES)
def test_a_fault_is_said_without_options_in_both_languages(tmp_path: Path, case: str) -> None:
    faults = faults_of(tmp_path, FILES[case])
    assert faults
    for fault in faults:
        for language in ("en", "de"):
            spoken, said = page_fault(fault, language)
            assert spoken == language, fault
            assert "--" not in said, said
            assert "form below" in said or "Formular" in said, said


SPEED = "Zeit [ms];v [m/s];Kraft [N]\n" + "".join(f"{n};{(n * n) % 7 - 3};{n % 5 - 2}\n" for n in range(60))


def test_a_speed_where_a_position_is_needed_is_told_in_both_languages(tmp_path: Path) -> None:
    (fault,) = faults_of(tmp_path, SPEED, read_given({}, excitation="driven"))
    assert page_fault(fault, "de")[1].endswith(
        "ohne „Position“, für Anregung „angetriebene Bewegung“ nötig; ist „v“ die Geschwindigkeit dessen, "
        "was sich bewegt, sie unten im Formular als Position wählen: sie wird aufsummiert"
    )
    assert page_fault(fault, "en")[1].endswith(
        "choose it as the position in the form below, and it is summed up"
    )
    given = read_given({"columns": ["force=a"], "units": ["a=N"]}, excitation="driven")
    (fault,) = faults_of(tmp_path, SPEED.replace("v [m/s];Kraft [N]", "a;b"), given)
    assert page_fault(fault, "de")[1].endswith(
        "ohne „Position“, für Anregung „angetriebene Bewegung“ nötig; die Spalte unten im Formular wählen"
    )


def test_the_speed_of_a_tap_is_refused_in_both_languages(tmp_path: Path) -> None:
    given = read_given({"columns": ["position=v"]}, excitation="tap")
    (fault,) = faults_of(tmp_path, SPEED, given)
    assert "deren Rauschen sich in der Position aufsummiert" in page_fault(fault, "de")[1]
    assert "whose noise adds up in a position" in page_fault(fault, "en")[1]
    assert "--" not in page_fault(fault, "en")[1]


def test_a_rate_beside_times_is_told_to_have_no_use(tmp_path: Path) -> None:
    rate = read_given({"constants": ["rate=10kHz"]})
    (fault,) = faults_of(tmp_path, "Zeit [s];Kraft [N]\n0;2\n1;3\n2;5\n", rate)
    assert page_fault(fault, "de") == (
        "de",
        "die Zeiten stehen in Spalte „Zeit“, die Abtastrate hat keinen Zweck; aus dem Formular nehmen",
    )


def test_what_a_second_file_lacks_is_said_in_both_languages(tmp_path: Path) -> None:
    heads = {
        "a": "Zeit [ms];Kraft [N];Weg [mm]",
        "b": "Zeit [ms];Kraft [N];Weg 1 [mm]",
        "c": "Zeit;Kraft;Weg",
    }
    for name, head in heads.items():
        rows = "".join(f"{n};{n % 7};{n * n}\n" for n in range(60))
        (tmp_path / f"{name}.csv").write_text(f"{head}\n{rows}", encoding="utf-8")
    first, second, third = (read_tables(tmp_path / f"{name}.csv") for name in heads)
    with pytest.raises(MeasurementError) as error:
        make_campaign((*first, *second), guess((*first, *second)))
    lacks = str(error.value)
    assert page_fault(lacks, "en")[1] == (
        f"{tmp_path / 'b.csv'}: has no position, which {tmp_path / 'a.csv'} has as column “Weg”; call it so "
        "here too, or drop the files one by one"
    )
    assert page_fault(lacks, "de")[1].startswith(f"{tmp_path / 'b.csv'}: ohne „Position“, in ")
    units = guess((*first, *third)).faults
    assert [page_fault(fault, "de")[1] for fault in units] == [
        f"{tmp_path / 'c.csv'}: Spalte „{name}“ ({meaning}) hat keine Einheit; unten im Formular angeben, "
        f"etwa {unit}"
        for name, meaning, unit in (("Zeit", "Zeit", "s"), ("Kraft", "Kraft", "N"), ("Weg", "Position", "m"))
    ]


def tap_files(directory: Path, *, is_swapped: bool, moves_m: float) -> list[Table]:
    """Three taps of a force of 100 N for 10 ms, of a part that is moved, or springs back where that is 0."""
    time = np.arange(0.0, 0.1, 1e-4)
    since = np.clip(time - 0.03, 0.0, 0.01)
    force = 100.0 * np.sin(np.pi * since / 0.01)
    position = moves_m * since / 0.01 if moves_m else 1e-5 * force
    for number in range(3):
        noise = np.random.default_rng(number).normal(size=(2, time.size))
        one, other = force + 0.4 * noise[0], position + 1e-6 * noise[1]
        columns = (time, other, one) if is_swapped else (time, one, other)
        rows = [f"{t:.4f},{a:.7f},{b:.7f}" for t, a, b in zip(*columns, strict=True)]
        head = "mass: 18.9 kg\nvelocity: 3000 mm/min\n\ntime [s],force [N],position [m]"
        (directory / f"{number}.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
    return [table for file in sorted(directory.iterdir()) for table in read_tables(file)]


def test_force_and_position_that_are_swapped_are_told(tmp_path: Path) -> None:
    """Such taps became those of a drive without a word, or were to be struck harder."""
    tables = tap_files(tmp_path, is_swapped=True, moves_m=2e-3)
    driven = read_given({}, None, "driven", None)
    assert SWAPPED in make_campaign(tables, guess(tables, driven)).notes
    said = {language: page_note(SWAPPED, language)[1] for language in ("en", "de")}
    assert said["en"].endswith("they look swapped")
    assert said["de"].endswith("beide scheinen vertauscht")
    with pytest.raises(MeasurementError) as refused:
        make_campaign(tables, guess(tables))
    assert SWAPPED in str(refused.value)
    assert page_fault(str(refused.value), "en")[1].endswith("in the form below")
    assert page_fault(str(refused.value), "de")[1].endswith("ihre Einheiten angeben")


def test_taps_as_they_are_do_not_look_swapped(tmp_path: Path) -> None:
    tables = tap_files(tmp_path, is_swapped=False, moves_m=2e-3)
    assert SWAPPED not in make_campaign(tables, guess(tables)).notes


def test_taps_of_which_none_can_be_used_are_refused_in_german(tmp_path: Path) -> None:
    tables = tap_files(tmp_path, is_swapped=False, moves_m=0.0)
    with pytest.raises(MeasurementError, match="the part never slides") as refused:
        make_campaign(tables, guess(tables))
    language, said = page_fault(str(refused.value), "de")
    assert language == "de"
    assert said.endswith("m und federt zurück (Vorgleiten); stärker stoßen (und so in allen 3 Stößen)")
    assert page_fault(str(refused.value), "en") == ("en", str(refused.value))


def test_a_time_that_was_named_and_runs_backwards_is_said_in_both_languages(tmp_path: Path) -> None:
    given = read_given({"columns": ["time=Zeit"]})
    (fault,) = faults_of(tmp_path, FILES["last row first"], given)
    for language, said in (("en", "runs backwards; turn the rows"), ("de", "läuft rückwärts; die Zeilen")):
        spoken, told = page_fault(fault, language)
        assert (spoken, said in told) == (language, True)
