"""Numbers of the lines beside the columns whose one separator may be of thousands or of decimals."""

import math
import re
from pathlib import Path

import pytest

from impactcell.errors import MeasurementError
from impactcell.measurements import Imported, guess, make_campaign, read_tables
from impactcell.measurements.given import read_given
from impactcell.web.texts.import_faults import page_fault


def driven(path: Path, line: str, decimal: str = ",", further: str = "", head: str = "Zeit [ms];") -> Path:
    """A record of what is driven, in this decimal mark, below a line."""
    rows = []
    for n in range(300):
        cells = [f"{n}.5"] if head else []
        cells += [f"{7.0 * math.sin(0.1 * n):.2f}", f"{90.0 * math.cos(0.1 * n):.4f}"]
        rows.append(";".join(cells).replace(".", decimal))
    path.write_text("\n".join([line, further, f"{head}Kraft [N];Weg [mm]", *rows]), encoding="utf-8")
    return path


def imported(*files: Path, said: str = "") -> Imported:
    tables = [table for file in files for table in read_tables(file)]
    constants = {"constants": [said]} if said else {}
    return make_campaign(tables, guess(tables, read_given(constants, excitation="driven")))


@pytest.mark.parametrize(
    ("line", "decimal", "one", "other"),
    [
        ("Masse: 12.600 kg", ",", "12,6", "12600"),
        ("Masse: 1,250 kg", ".", "1.25", "1250"),
        ("Masse;3.000;kg", ",", "3", "3000"),
        ("Masse [g]: 18.900", ",", "18,9", "18900"),
    ],
)
def test_a_number_that_may_be_of_thousands_is_refused_and_can_be_given(
    tmp_path: Path, line: str, decimal: str, one: str, other: str
) -> None:
    """12.600 kg beside decimal commas were twelve tons."""
    path = driven(tmp_path / "a.csv", line, decimal)
    with pytest.raises(MeasurementError) as refused:
        imported(path)
    shown = line.replace("Masse;3.000;kg", "Masse: 3.000 kg")
    assert str(refused.value) == (
        f"{path}: the line '{shown}' may say {one} or {other}; write it so, or give it for all shots with "
        f"--set mass=18.9kg"
    )
    language, german = page_fault(str(refused.value), "de")
    assert language == "de"
    assert german.startswith(
        f"{path}: die Zeile „{shown}“ kann {one} oder {other} heißen; so schreiben oder "
    )
    assert page_fault(str(refused.value), "en")[1].endswith("or give it for all shots in the form below")
    (shot,) = imported(path, said="mass=12.6kg").campaign.shots
    assert shot.mass_kg == 12.6
    unit = 1e-3 if "[g]" in line else 1.0
    for number in (one, other):
        (shot,) = imported(driven(path, re.sub(r"\d+[.,]\d+", number, line), decimal)).campaign.shots
        assert shot.mass_kg == pytest.approx(unit * float(number.replace(",", ".")))


@pytest.mark.parametrize(
    ("line", "decimal", "mass_kg"),
    [
        ("Masse: 12,600 kg", ",", 12.6),
        ("Masse: 12.600 kg", ".", 12.6),
        ("Masse: 12.60 kg", ",", 12.6),
        ("Masse: 0.600 kg", ",", 0.6),
        ("Masse: 1.234,5 kg", ",", 1234.5),
        ("Masse: 1,234.5 kg", ".", 1234.5),
        ("Masse: 1.234.500 g", ",", 1234.5),
        ("Masse: 12'600 g", ".", 12.6),
        ("Masse: 1234 kg", ",", 1234.0),
        ("Masse: 12.600 kg\nMasse genau: 7 kg", ".", 12.6),
    ],
)
def test_a_number_that_says_one_thing_is_taken(
    tmp_path: Path, line: str, decimal: str, mass_kg: float
) -> None:
    (shot,) = imported(driven(tmp_path / "a.csv", line, decimal)).campaign.shots
    assert shot.mass_kg == pytest.approx(mass_kg)


def test_a_line_that_counts_for_nothing_may_say_what_it_likes(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.csv", "Masse: 2 kg", further="Masse Greifer: 12.600 kg")
    assert imported(path).campaign.shots[0].mass_kg == 2.0
    path = driven(tmp_path / "b.csv", "Masse: 2 kg", further="Charge: 12.600")
    assert imported(path).campaign.shots[0].batch_id == "12.600"


def test_a_rate_that_may_be_of_thousands_is_told_as_the_reason(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.csv", "Masse: 2 kg", further="Abtastrate: 10.000 Hz", head="")
    with pytest.raises(MeasurementError) as refused:
        imported(path)
    reason = "the line 'Abtastrate: 10.000 Hz' may say 10 or 10000"
    assert f"no column of time was found: {reason}; name it" in str(refused.value)
    german = "die Zeile „Abtastrate: 10.000 Hz“ kann 10 oder 10000 heißen"
    assert german in page_fault(str(refused.value), "de")[1]
    (shot,) = imported(path, said="rate=10 Hz").campaign.shots
    assert shot.force is not None
    assert shot.force.time_s[1] == pytest.approx(0.1)
    timed = driven(tmp_path / "b.csv", "Masse: 2 kg", further="Abtastrate: 10.000 Hz")
    imported(timed)  # its times are those of a column
    with pytest.raises(MeasurementError) as refused:
        imported(timed, path)
    assert f"a.csv: has no column of time: {reason}; name it, or give the rate" in str(refused.value)
    assert page_fault(str(refused.value), "de")[1].endswith(
        f"a.csv: hat keine Zeitspalte: {german}; unten im Formular wählen, oder dort die Abtastrate angeben"
    )
    twice = "Abtastrate: 10.000 Hz\nAbtastintervall: 0,1 ms"
    (shot,) = imported(driven(path, "Masse: 2 kg", further=twice, head="")).campaign.shots
    assert shot.force is not None
    assert shot.force.time_s[1] == pytest.approx(1e-4)
