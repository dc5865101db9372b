"""Names of columns with their units, as people write them in a header."""

from pathlib import Path

import numpy as np
import pytest

from impactcell.measurements import ColumnMeaning, Dialect, guess, make_campaign, read_tables
from impactcell.measurements.given import read_given
from impactcell.measurements.notation.units import parse_unit, split_unit
from impactcell.web.texts.import_faults import page_fault
from tests.unit.measurements.records import sampled, taps

NAMES = (
    "F",
    "v",
    "Kraft",
    "Weg x",
    "p1",
    "dx/dt",
    "Ein/Aus",
    "x (links)",
    "Weg/Zeit-Kurve",
    "Größe_2",
    "T-Öl",
)
UNITS = (
    "s", "ms", "min", "h", "m", "mm", "µm", "in", "N", "kN", "lbf", "N m", "kg", "kg m²", "kg·m²", "bar", "V",
    "mA", "m/s", "mm/s", "mm/min", "m/min", "mm / min", "in/s", "m/s²", "m / s²", "rad/s", "deg/s", "U/min",
    "1/min", "1/s", "rpm", "°", "°C", "%", "Hz",
)  # fmt: skip
WRITINGS = ("{} / {}", "{} /{}", "{}/{}", "{} [{}]", "{} ({})", "{} in {}", "{}, {}")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("writing", WRITINGS)
def test_a_name_and_its_unit_come_apart_in_every_writing(name: str, writing: str) -> None:
    for unit in UNITS:
        assert parse_unit(unit) is not None, unit
        assert split_unit(writing.format(name, unit)) == (name, unit)


@pytest.mark.parametrize(
    ("header", "parts"),
    [
        ("Weg mm", ("Weg", "mm")),
        ("Zeit ms", ("Zeit", "ms")),
        ("Zeit s", ("Zeit s", None)),
        ("v mm/min", ("v", "mm/min")),
        ("Speed m/s", ("Speed", "m/s")),
        ("Drehzahl 1/min", ("Drehzahl", "1/min")),
        ("Zeit 1 / s", ("Zeit 1", "s")),
        ("Zeit 1/s", ("Zeit 1", "s")),
        ("Kanal 1 / min", ("Kanal 1", "min")),
        ("Weg s / mm", ("Weg s", "mm")),
        ("Geschwindigkeit v / mm/s", ("Geschwindigkeit v", "mm/s")),
        ("t/s", ("t", "s")),
        ("s/mm", ("s", "mm")),
        ("F/N", ("F", "N")),
        ("m/kg", ("m", "kg")),
        ("t/min", ("t", "min")),
        ("m/s", ("m/s", "m/s")),
        ("1/min", ("1/min", "1/min")),
        ("v_m/s", ("v_m", "s")),
        ("velocity_mm/s", ("velocity", "mm/s")),
        ("position_mm", ("position", "mm")),
        ("velocity_mm_per_min", ("velocity", "mm/min")),
        ("vel_mm_min", ("vel", "mm/min")),
        ("velocity_m_min", ("velocity", "m/min")),
        ("v_mm_s", ("v", "mm/s")),
        ("omega_rad_s", ("omega", "rad/s")),
        ("t_min", ("t", "min")),
        ("Druck mPa", ("Druck", "mPa")),
        ("Ch 1/2", ("Ch 1/2", None)),
        ("Ch 1/2 / V", ("Ch 1/2", "V")),
        ("A/B", ("A/B", None)),
        ("Kraft (oben)", ("Kraft (oben)", None)),
        ("Weg/Zeit", ("Weg/Zeit", None)),
        ("Force", ("Force", None)),
    ],
)
def test_headers_that_may_be_read_in_two_ways(header: str, parts: tuple[str, str | None]) -> None:
    assert split_unit(header) == parts


@pytest.mark.parametrize(
    ("unit", "si"),
    [
        ("mPa", 1e-3), ("MPa", 1e6), ("mpa", 1e6), ("Mpa", 1e6), ("kPa", 1e3), ("mN", 1e-3), ("MN", 1e6),
        ("mNm", 1e-3), ("MNm", 1e6), ("mbar", 100.0), ("MHz", 1e6), ("khz", 1e3), ("ms", 1e-3), ("mm", 1e-3),
        ("nm", 1e-9), ("Nm", 1.0), ("pA", 1e-12), ("Pa", 1.0), ("mV", 1e-3), ("kN", 1e3), ("kn", 1e3),
    ],
)  # fmt: skip
def test_prefixes_that_differ_in_case_alone_are_told_apart(unit: str, si: float) -> None:
    """`mPa` was read as `MPa`, and `pA` as `Pa`; in lower case alone a megapascal is meant."""
    known = parse_unit(unit)
    assert known is not None
    assert known.factor == pytest.approx(si, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("unit", ["Mm", "MS", "mHz", "Mbar", "MV", "NM"])
def test_a_prefix_that_no_record_has_is_not_taken_for_another(unit: str) -> None:
    assert parse_unit(unit) is None


def test_a_column_called_by_the_unit_of_velocities_says_the_velocity(tmp_path: Path) -> None:
    """`velocity_mm_min` was a column `velocity_mm` of minutes, and the velocity was not known."""
    tap, rng = taps((3000,), (18.9,))[0], np.random.default_rng(3)
    rows = [f"{t:.5f},{f:.5f},{1e3 * x:.6f},3000" for t, f, x in zip(*sampled(tap, rng), strict=True)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["time_s,force_n,position_mm,velocity_mm_min", *rows]), encoding="utf-8")
    tables = read_tables(path)
    mapping = guess(tables, read_given({"constants": ["mass=18.9kg", "stroke=1.5mm"]}))
    (shot,) = make_campaign(tables, mapping).campaign.shots
    assert shot.velocity_m_s == pytest.approx(0.05)


def test_a_column_in_the_notation_of_din_says_the_velocity(tmp_path: Path) -> None:
    """`v / mm/min` was a column `v / mm` of minutes, and the velocity was not known."""
    tap, rng = taps((3000,), (18.9,))[0], np.random.default_rng(3)
    rows = [f"{t:.5f};{f:.5f};{1e3 * x:.6f};3000" for t, f, x in zip(*sampled(tap, rng), strict=True)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["t / s;F / N;x / mm;v / mm/min", *rows]), encoding="utf-8")
    tables = read_tables(path)
    mapping = guess(tables, read_given({"constants": ["mass=18.9kg", "stroke=1.5mm"]}))
    velocity = mapping.of(ColumnMeaning.VELOCITY)
    assert velocity is not None
    assert velocity.column == "v"
    (shot,) = make_campaign(tables, mapping).campaign.shots
    assert shot.velocity_m_s == pytest.approx(0.05)


def test_names_in_an_encoding_that_was_not_told_say_so(tmp_path: Path) -> None:
    """They were asked to be named as they were misread."""
    rows = ["时间(毫秒),力(牛),位移(毫米)", *(f"{0.1 * i:.1f},{i % 7}.5,{i % 5}.25" for i in range(50))]
    path = tmp_path / "a.csv"

    def faults(written: str, given: str | None) -> list[str]:
        path.write_text("\n".join(rows), encoding=written)
        return [
            fault
            for fault in guess(read_tables(path, dialect=Dialect(encoding=given))).faults
            if fault.startswith("neither position nor force was found")
        ]

    (told,) = faults("gb18030", None)
    assert told.endswith("give the encoding of the file, which was read as cp1252: --encoding gb18030, say")
    assert page_fault(told, "de")[1].endswith(
        "heißen die Spalten anders, die Datei als UTF-8 speichern, sonst sie unten im Formular wählen"
    )
    for written, given in (("gb18030", "gb18030"), ("utf-8", None)):
        (told,) = faults(written, given)
        assert "力(牛)" in told
        assert "--encoding" not in told
