"""What base model and shots.csv state of one machine: two masses, a text for a number, one fault a line."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import BaseModel, NumberPrior, TermChoice
from impactcell.discrepancy.machine.records.record_notes import notes_of_records
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.discrepancy.report.german_notes import note as german_note
from impactcell.errors import CampaignError, SettingsError
from impactcell.records import Capture, Channel
from impactcell.settings.base_model import read_base_model

BASE = """\
format: 1
coordinate: rotation
excitation: driven
%s
"""


def driven(masses_kg: tuple[float, ...]) -> tuple[Capture, ...]:
    """Records of so stated masses, under a force that is noise."""
    rng = np.random.default_rng(4)
    time = 0.01 * np.arange(300)
    return tuple(
        Capture(
            number,
            math.nan,
            mass,
            Channel(time, rng.normal(0.0, 1.0, time.size), 1.0),
            Channel(time, np.sin(time) + rng.normal(0.0, 1e-3, time.size), 1e-3),
        )
        for number, mass in enumerate(masses_kg, 1)
    )


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ("inertia_kg_m2: {value: 0.02, std: -1}", "should be greater than or equal to 0, not -1"),
        ("inertia_kg_m2: {value: 0.02, std: .inf}", "should be a finite number, not inf"),
        ("inertia_kg_m2: {value: 0.02, std: fre}", "should be 'free', not 'fre'"),
        ("inertia_kg_m2: {value: heavy, std: 1}", "should be a valid number"),
        ("inertia_kg_m2: heavy", "should be a valid number"),
        ("inertia_kg_m2: {value: 0.02}", "'inertia_kg_m2.std' is missing"),
    ],
)
def test_only_what_is_wrong_with_a_number_is_told(tmp_path: Path, stated: str, said: str) -> None:
    file = tmp_path / "base.yaml"
    file.write_text(BASE % stated)
    with pytest.raises(SettingsError) as caught:
        read_base_model(file)
    [line] = str(caught.value).splitlines()
    assert said in line


def test_a_column_of_texts_is_told_as_one() -> None:
    shots = [replace(shot, covariates={"oil": 20.0}) for shot in driven((2.0, 2.0, 2.0))]
    shots[2] = replace(shots[2], covariates={"oil": "thin"})
    base = BaseModel(terms=(TermChoice("covariate_friction", "oil"),))
    with pytest.raises(CampaignError, match=r"shot 3: 'oil' in shots.csv is 'thin', and .* goes by its num"):
        uniform_records(Campaign(Excitation.DRIVEN, tuple(shots)), base)


@pytest.mark.parametrize(
    ("base_kg", "shots_kg", "told"),
    [
        (NumberPrior(12.0), (12.0, 12.0, 24.0), "1 of 3 shots, first for shot 3 (24): leave mass_kg out"),
        (NumberPrior(12.0), (12.05, math.nan, 11.95), ""),
        (NumberPrior(12.0, 2.0), (12.0, 15.0, 16.5), "1 of 3 shots, first for shot 3 (16.5)"),
        (NumberPrior(1.0, math.inf), (12.0, 12.0, 24.0), "1 of 3 shots, first for shot 3 (24)"),
        (NumberPrior(1.0, math.inf), (12.0, 12.0, 12.05), ""),
        (NumberPrior(), (12.0, 12.0, 24.0), "3 of 3 shots, first for shot 1 (12)"),
        (NumberPrior(math.nan), (12.0, 12.0, 24.0), ""),
    ],
)
def test_a_mass_of_shots_that_the_base_model_passes_over_is_told(
    base_kg: NumberPrior, shots_kg: tuple[float, ...], told: str
) -> None:
    base = BaseModel(inertia=base_kg)
    notes = notes_of_records(base, uniform_records(Campaign(Excitation.DRIVEN, driven(shots_kg)), base))
    assert len(notes) == bool(told)
    assert all(told in note for note in notes)
    if told:
        language, said = german_note(notes[0])
        assert language == "de"
        assert said.startswith("mass_kg des Grundmodells gilt für alle Messungen; shots.csv gibt für ")
