"""What explains shots only if it goes with how they were made is no error of their records."""

from dataclasses import replace

import numpy as np
import pytest

from impactcell.discrepancy.data import prepare, sensor_noise, shot_set
from impactcell.discrepancy.model import Problem, dependence_notes, with_open_settings
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.report.german_notes import note
from impactcell.records import Samples
from tests.discrepancy.study import Job, campaign, name_effects

pytestmark = pytest.mark.slow

JOB = Job("none", (), 5_070_000, shots=30)


@pytest.fixture(scope="module")
def problem() -> Problem:
    prepared = prepare(campaign(JOB))
    shots = tuple(with_open_settings(prepared.shots, ("log_mass",)))
    prepared = replace(prepared, shots=shots)
    return Problem(shot_set(prepared, np.arange(30), sensor_noise(prepared).noise_std), len(prepared.batches))


def notes_of(problem: Problem, masses: Samples) -> tuple[str, ...]:
    fitted = fit_nominal(problem)
    moved = replace(fitted, shot_parameters=replace(fitted.shot_parameters, log_mass=masses))
    return dependence_notes(problem, moved, ["log_mass"])


def test_only_what_goes_with_something_and_matters_is_said(problem: Problem) -> None:
    rng = np.random.default_rng(4)
    directions = np.array([shot.direction for shot in problem.shots.items], dtype=float)
    by_itself = 0.01 * rng.standard_normal(30)
    assert notes_of(problem, by_itself) == ()
    assert notes_of(problem, np.full(30, 0.01)) == ()
    assert notes_of(problem, 0.01 + 1e-4 * directions) == ()
    (said,) = notes_of(problem, 0.01 * directions + 0.1 * by_itself)
    assert said.startswith("Nothing would remain if mass were off what is told, shot by shot, but so it goes")
    assert "goes with direction (correlation +0.99" in said or "(correlation +1.00" in said
    language, german = note(said)
    assert language == "de"
    assert "die Masse" in german
    assert "Richtung" in german


def test_what_was_not_weighed_is_told_as_it_is_and_not_as_what_no_record_does(problem: Problem) -> None:
    told = np.array([shot.mass_kg for shot in problem.shots.items])
    (said,) = notes_of(problem, np.log1p(0.9 / told))
    assert said.startswith("Nothing would remain if mass were +0.9 kg off in every shot")
    assert note(said)[1].startswith("Die Masse: nichts bliebe übrig, wenn sie in jedem Stoß um +0,9 kg")
    (steeper,) = notes_of(problem, 0.01 * (told - told.mean()))
    assert "from shot to shot, the more the larger or smaller it is" in steeper
    assert note(steeper)[0] == "de"


def test_a_mass_that_differs_by_direction_is_no_error_of_each_shot() -> None:
    """It was `no_gap`, each shot's mass open."""
    given = campaign(JOB)
    shots = tuple(
        replace(shot, mass_kg=1.02 * shot.mass_kg if shot.direction < 0 else shot.mass_kg)
        for shot in given.shots
    )
    found = name_effects(replace(given, shots=shots), seed=JOB.seed, library=("quadratic_drag",))
    assert found.verdict == "unknown"
    assert any("goes with direction" in one for one in found.prepared.notes)
