"""Model files: written and read back to the bit, and refused with a place where they are wrong."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.errors import SettingsError
from impactcell.physics import Plant
from impactcell.prediction.model import Model, Prior, printed_predictor
from impactcell.settings.model_file import read_model, write_model

PROTOTYPE = Path(__file__).resolve().parents[3] / "config" / "models" / "prototype.yaml"

PRINTED = printed_predictor()
MODEL = Model(
    name="a model",
    plant=Plant(
        6.5e5, 465.0, 0.2, 0.152, effects={"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.1}}
    ),
    prior=Prior(6500.0, 9.3, 0.03),
    predictors=(
        replace(
            PRINTED, force=replace(PRINTED.force, rms=0.001), distance=replace(PRINTED.distance, rms=0.002)
        ),
        replace(PRINTED, mass_kg=25.2),
    ),
    stroke_m=1.5e-3,
    intervals={"viscous_friction": {"viscous_coefficient_n_s_per_m": (80.0, 1 / 3)}},
    provenance={"made by": "a test"},
)


def test_a_model_comes_back_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    write_model(MODEL, path)
    assert read_model(path) == MODEL
    first = path.read_bytes()
    write_model(read_model(path), path)
    assert path.read_bytes() == first
    assert list(tmp_path.iterdir()) == [path]


def test_a_parameter_of_one_value_a_batch_is_a_list(tmp_path: Path) -> None:
    effects = {"batch_shift": {"relative_change": (0.02, -0.01)}}
    model = replace(MODEL, plant=replace(MODEL.plant, effects=effects), intervals={})
    write_model(model, tmp_path / "model.yaml")
    assert read_model(tmp_path / "model.yaml") == model


def test_an_actuator_that_halts_at_separation_has_no_stroke(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    write_model(replace(MODEL, stroke_m=math.inf), path)
    assert read_model(path).stroke_m == math.inf


def test_the_prototype_is_the_reference_plant() -> None:
    model = read_model(PROTOTYPE)
    assert (model.plant.stiffness_n_per_m, model.plant.damping_n_s_per_m) == (6.5e5, 465.0)
    assert model.ratio == pytest.approx(0.76)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "stiffness_n_per_m: 650000.0",
            "stiffness: 1",
            "unknown key 'plant.stiffness'; did you mean 'stiffness_n_per_m'?",
        ),
        ("mu_s: 0.2", "mu_s: -0.2", "plant.mu_s: should be greater than 0, not -0.2"),
        ("mu_s: 0.2", "mu_s: .nan", "plant.mu_s: should be a finite number"),
        (
            "format: 1",
            "format: 7",
            "format: should be 1, not 7; it was written for a newer version of impactcell: ",
        ),
        ("mass_kg: 25.2", "mass_kg: 18.9", "two predictors for 18.9 kg have velocities in common"),
        (
            "viscous_friction",
            "viscous_fricton",
            "no effect 'viscous_fricton'; did you mean 'viscous_friction'?",
        ),
        (
            "viscous_coefficient",
            "viscous_koefficient",
            "viscous_friction has no parameter 'viscous_koefficient",
        ),
        ("mu_s: 0.2", "mu_k: 0.2", "key 'mu_k' is given twice"),
    ],
)
def test_a_wrong_file_is_refused_with_its_place(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "model.yaml"
    write_model(MODEL, path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(SettingsError) as caught:
        read_model(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{path}:")


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="cannot be written"):
        write_model(MODEL, tmp_path / "nowhere" / "model.yaml")
