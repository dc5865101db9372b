"""Values of a cell that are hardly meant are suspected, each with the unit in which it would be."""

import re
from pathlib import Path

import pytest

import impactcell
from impactcell.settings import read_cell
from impactcell.settings.judgement import CellFinding, judge_cell

CONFIG = Path(__file__).resolve().parents[3] / "config"
CELL, MODEL = CONFIG / "cells" / "prototype.yaml", CONFIG / "models" / "prototype.yaml"


def judged(directory: Path, of_cell: dict[str, str], of_model: dict[str, str]) -> list[CellFinding]:
    """Judge the prototype with some numbers of its cell file and of its model said otherwise."""
    texts = []
    for file, changed in ((CELL, of_cell), (MODEL, of_model)):
        text = file.read_text(encoding="utf-8")
        for key, value in changed.items():
            before, line, after = text.partition(f"  {key}: ")
            assert line, key
            text = f"{before}{line}{value}\n{after.partition(chr(10))[2]}"
        texts.append(text)
    cell, model = directory / "cell.yaml", directory / "model.yaml"
    maps = texts[0].replace("../maps", str(CONFIG / "maps")).replace("../models/prototype.yaml", str(model))
    cell.write_text(maps, encoding="utf-8")
    model.write_text(texts[1], encoding="utf-8")
    return judge_cell(read_cell(cell))


@pytest.mark.parametrize(
    ("of_cell", "of_model", "told"),
    [
        ({"mass_kg": "18900"}, {}, "a mass of 18900 kg is hardly meant.* meant in g, write 18.9"),
        ({"mass_kg": "0.0045"}, {}, "a mass of 0.0045 kg is hardly meant.* meant in t, write 4.5"),
        ({"stroke_mm": "0.0015"}, {}, "a stroke of 0.0015 mm is hardly meant.* meant in m, write 1.5"),
        ({"stroke_mm": "1500"}, {}, "a stroke of 1500 mm is hardly meant.* meant in µm, write 1.5"),
        (
            {"device_id": "1\n  timeout_ms: 0.5"},
            {},
            "a timeout of 0.5 ms is .* links have .* in s, write 500",
        ),
        ({"device_id": "1\n  timeout_ms: 5e+5"}, {}, "a timeout of 500000 ms is .* meant in µs, write 500"),
        (
            {"wear_limit": "0.25\npositioning: {travel_mm: 40000}"},
            {},
            "a travel of 40000 mm is .* parts have .* meant in µm, write 40",
        ),
        (
            {"wear_limit": "0.25\npositioning: {travel_mm: 0.09, tolerance_um: 1}"},
            {},
            "a travel of 0.09 mm is .* meant in m, write 90",
        ),
        ({"wear_limit": "25"}, {}, "coefficient of 25 is hardly meant.* meant in %, write 0.25"),
        ({}, {"stiffness_n_per_m": "650"}, "'prototype': a stiffness of 650 N/m .* N/mm, write 650000"),
        ({}, {"damping_n_s_per_m": "0.465"}, "'prototype': a damping of 0.465 .* N s/mm, write 465"),
        ({}, {"stiffness_n_per_m": "1e+20"}, "a stiffness of 1e.20 N/m is hardly meant.*: check its unit"),
    ],
)
def test_what_is_hardly_meant_is_told_with_the_unit_in_which_it_would_be(
    tmp_path: Path, of_cell: dict[str, str], of_model: dict[str, str], told: str
) -> None:
    findings = judged(tmp_path, of_cell, of_model)
    doubts = [finding for finding in findings if "hardly meant" in finding.message]
    assert [finding.is_fault for finding in doubts] == [False]
    assert re.search(told, doubts[0].message)


@pytest.mark.parametrize("noise_um", ["0.0015", "0.5", "100"])
def test_a_noise_that_may_be_is_not_doubted(tmp_path: Path, noise_um: str) -> None:
    """That of an interferometer, of an encoder, of a laser triangulator."""
    findings = judged(tmp_path, {"position_noise_std_um": noise_um}, {})
    assert not [finding.message for finding in findings if "a noise of" in finding.message]


USERS = "users: [{name: eva, role: engineer, password: x}]"


@pytest.mark.parametrize(
    ("text", "is_fault", "told"),
    [
        ("hello", True, "opcua.users_file: .*/users.yaml: not a users file; .* `impactcell users add /"),
        ('{"a": 1}', True, "users.yaml: not a users file; move it away, and make one with"),
        ("users: [", True, "users.yaml:1:9: .*; a users file is needed: correct it, or .* users add /"),
        ("", True, "users.yaml:1:1: the file is empty; a users file is needed: correct it, or"),
        ("users: [{name: eva, role: king, password: x}]", True, "users.yaml: user 1: the role is one of"),
        ("users: []", False, "users.yaml holds nobody: nobody can log in.*; run `impactcell users add /"),
        (USERS, None, ""),
    ],
)
def test_a_users_file_is_looked_into(tmp_path: Path, text: str, is_fault: bool | None, told: str) -> None:
    (tmp_path / "users.yaml").touch(0o600)
    (tmp_path / "users.yaml").write_text(text, encoding="utf-8")
    found = [finding for finding in judged(tmp_path, {}, {}) if "users" in finding.message]
    assert [finding.is_fault for finding in found] == ([] if is_fault is None else [is_fault])
    assert not found or re.search(told, found[0].message)


def test_a_directory_is_no_users_file(tmp_path: Path) -> None:
    (tmp_path / "users.yaml").mkdir()
    found = [finding for finding in judged(tmp_path, {}, {}) if "users" in finding.message]
    assert [finding.is_fault for finding in found] == [True]
    assert found[0].message.endswith(
        "users.yaml: is a directory, where a users file is needed; name a file in it"
    )


@pytest.mark.parametrize("cell", sorted((CONFIG / "cells").glob("*.yaml")), ids=lambda path: path.stem)
def test_the_cells_that_come_with_the_program_are_meant(cell: Path) -> None:
    said = [finding.message for finding in judge_cell(read_cell(cell))]
    assert not [text for text in said if "hardly meant" in text or "no tap moves" in text]


@pytest.mark.parametrize("heavier", [0.99, 1.01])
def test_a_part_that_the_integrator_does_not_move_is_told_to_be_too_heavy(
    tmp_path: Path, heavier: float
) -> None:
    plant = read_cell(CELL).model.plant
    pushes_n = 1.5e-3 * plant.stiffness_n_per_m + 0.1 * plant.damping_n_s_per_m
    mass_kg = heavier * pushes_n / (9.81 * plant.mu_s)
    of_model = {"stiffness_n_per_m": plant.stiffness_n_per_m, "damping_n_s_per_m": plant.damping_n_s_per_m}
    tap = impactcell.simulate_tap(
        0.1, mass_kg, 1.5e-3, plant={"mu_s": plant.mu_s, "mu_k": plant.mu_k, **of_model}
    )
    still = not tap.displacement_m
    findings = judged(tmp_path, {"mass_kg": f"{mass_kg:.6g}"}, {})
    assert [f.is_fault for f in findings if "no tap moves the part" in f.message] == [True] * still
    assert still is (heavier > 1.0)


@pytest.mark.parametrize(
    ("effect", "is_refused"),
    [
        ("surface_tilt: {tilt_rad: 0.001}", True),
        ("position_dependent_friction: {gradient_per_m: -10.0}", False),
    ],
)
def test_a_limit_is_not_compared_with_the_friction_of_a_place_where_no_tap_is(
    tmp_path: Path, effect: str, is_refused: bool
) -> None:
    """mu_s of a model whose friction goes with the place is that of x = 0."""
    found = judged(tmp_path, {}, {"mu_s": "0.26", "viscous_coefficient_n_s_per_m": f"85.0\n    {effect}"})
    told = [finding for finding in found if "not above the friction of the model itself" in finding.message]
    assert bool(told) == is_refused
