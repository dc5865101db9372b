"""What a model leaves is a quantity: level and pieces, what stands out of it, how it widens intervals."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.discrepancy.model.intervals import SharedError, variances
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.search.model_error import (
    ModelError,
    estimate_model_error,
    largest_rival_excess,
    share_p_value,
)
from impactcell.discrepancy.workflow import investigate
from tests.discrepancy import study

SHOTS, SAMPLES = 40, 600


def left_by(residual: np.ndarray) -> ModelError:
    """Model error of residuals of one channel, shape (SHOTS, SAMPLES)."""
    bounds = SAMPLES * np.arange(SHOTS + 1)
    shots = SimpleNamespace(
        values=np.zeros(residual.size),
        channel=np.ones(residual.size, dtype=np.int64),
        samples_of=lambda shot: slice(int(bounds[shot]), int(bounds[shot + 1])),
    )
    problem: Any = SimpleNamespace(shots=shots, count=SHOTS)
    model: Any = SimpleNamespace(residual=residual.ravel())
    return estimate_model_error(problem, model)


def smooth(rng: np.random.Generator, rows: int, correlation: float) -> np.ndarray:
    """First-order autoregressions of unit variance, shape (rows, SAMPLES)."""
    made = np.empty((rows, SAMPLES))
    made[:, 0] = rng.standard_normal(rows)
    for place in range(1, SAMPLES):
        shock = math.sqrt(1.0 - correlation**2) * rng.standard_normal(rows)
        made[:, place] = correlation * made[:, place - 1] + shock
    return made


def test_white_noise_has_no_level_and_a_piece_a_sample() -> None:
    found = left_by(np.random.default_rng(1).standard_normal((SHOTS, SAMPLES)))
    assert found.level < 0.12
    assert found.pieces > SAMPLES


def test_level_and_pieces_are_those_that_went_in() -> None:
    rng = np.random.default_rng(2)
    each = smooth(rng, SHOTS, 0.95)
    found = left_by(rng.standard_normal(each.shape) + 2.0 * each)
    assert found.level == pytest.approx(2.0, rel=0.15)
    a_shot = SAMPLES * (1.0 - 0.95) / (1.0 + 0.95)  # samples over the integral of 0.95^|l|
    same = left_by(rng.standard_normal(each.shape) + 2.0 * smooth(rng, 1, 0.95))
    assert 0.7 * a_shot < same.pieces < 4.0 * a_shot  # all shots leave the same, but for the noise
    assert found.pieces > 5.0 * a_shot


def test_what_has_no_part_in_a_gap_stands_out_as_rarely_as_stated() -> None:
    rng = np.random.default_rng(3)
    pieces = 12
    p_values = []
    for _ in range(4000):
        left, direction = rng.standard_normal((2, pieces))
        taken = (left @ direction) ** 2 / (direction @ direction)
        rest = ModelError(float(left @ left - taken), 1.0, 1.0, float(pieces))
        p_values.append(share_p_value(float(left @ left), rest, 1))
    for level in (0.01, 0.05, 0.2):
        assert np.mean(np.array(p_values) <= level) == pytest.approx(level, rel=0.35)


def test_fewer_pieces_tell_fewer_rivals_apart() -> None:
    few, many = (largest_rival_excess(ModelError(1.0, 1.0, 1.0, pieces), 0.9) for pieces in (5.0, 100.0))
    assert few > 3.0
    assert 1.0 < many < 1.4


def test_an_error_that_all_shots_share_widens_intervals_by_its_size() -> None:
    rng = np.random.default_rng(4)
    gradient = rng.standard_normal((SHOTS, 1))
    linearisation: Any = SimpleNamespace(
        information=np.array([[float(SHOTS)]]),
        shot_gradient=gradient,
        mean_squared_residual=1.0,
        shot_information=np.ones((SHOTS, 1, 1)),
    )
    shared = SharedError(np.array([[3.0], [1.0]]), np.array([0.5, 0.0]))
    widened = variances(linearisation, shared) - variances(linearisation)
    assert widened[0] == pytest.approx(3.0**2 * 0.5 / SHOTS**2)


def test_a_penalty_adds_to_what_the_shots_know() -> None:
    gradient = np.random.default_rng(5).standard_normal((SHOTS, 1))
    linearisation: Any = SimpleNamespace(
        information=np.array([[float(SHOTS)]]),
        shot_gradient=gradient,
        mean_squared_residual=1.0,
        shot_information=np.zeros((SHOTS, 1, 1)),
    )
    free = variances(linearisation)
    held = variances(linearisation, None, np.array([[3.0 * SHOTS]]))
    assert held[0] == pytest.approx(free[0] / 4.0**2)


def test_what_no_shot_tells_of_has_no_end_and_leaves_the_others_alone() -> None:
    """Rounding of a derivative that is nought made every interval of a report garbage."""
    rng = np.random.default_rng(6)
    seen = np.array([[2.0, 0.5], [0.5, 1.0]])
    gradient = rng.standard_normal((SHOTS, 2))
    alone: Any = SimpleNamespace(
        information=SHOTS * seen,
        shot_gradient=gradient,
        shot_information=np.repeat(seen[None], SHOTS, 0),
        mean_squared_residual=1.0,
    )
    H = np.zeros((3, 3))
    H[:2, :2] = seen
    H[2, :2] = H[:2, 2] = 1e-17
    beside: Any = SimpleNamespace(
        information=SHOTS * H,
        shot_gradient=np.column_stack([gradient, 1e-17 * gradient[:, 0]]),
        shot_information=np.repeat(H[None], SHOTS, 0),
        mean_squared_residual=1.0,
    )
    found = variances(beside)
    assert found[:2] == pytest.approx(variances(alone))
    assert found[2] == np.inf


def _seen_by(shots: int, seed: int) -> float:
    """Number that so many of 40 shots tell of, over the standard deviation that is stated for it."""
    seen = np.arange(SHOTS) < shots
    gradient = np.where(seen, np.random.default_rng(seed).standard_normal(SHOTS), 0.0)
    off = gradient.sum() / shots
    linearisation: Any = SimpleNamespace(
        information=np.array([[float(shots)]]),
        shot_information=seen.astype(np.float64)[:, None, None],
        shot_gradient=(gradient - seen * off)[:, None],
        mean_squared_residual=1.0,
    )
    return float(off / np.sqrt(variances(linearisation)[0]))


@pytest.mark.slow
@pytest.mark.parametrize("shots", [1, 2, 4, 40])
def test_what_few_shots_tell_of_is_as_uncertain_as_their_noise(shots: int) -> None:
    ratios = np.array([_seen_by(shots, seed) for seed in range(400)])
    assert np.sqrt(np.mean(ratios**2)) == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
def test_an_effect_is_established_although_something_remains(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "RATE_HZ", 2000.0)
    for later, idle in (("find_law", lambda *_: None), ("hold_against_free_forms", lambda _, found: found)):
        monkeypatch.setattr(f"impactcell.discrepancy.workflow.{later}", idle)  # have tests of their own
    job = study.Job("model_error", ("viscous_friction", "wandering_force"), 11, shots=24)
    library = ("viscous_friction", "quadratic_drag", "stribeck_friction", "friction_drift")
    outcome = result_document(investigate(study.campaign(job, (0.3, 0.15)), seed=11, library=library))
    assert "viscous_friction" in {outcome["effects"][0]["effect"], *outcome["effects"][0]["tied_with"]}
    assert outcome["effects"][0]["held_out"]["closed_ci95"][0] > 0.0
    assert outcome["gap"]["held_out"]["after"] > 1.2
    assert not outcome["remaining"]["explained"]
    assert outcome["remaining"]["model_error"]["level"] > 0.5
    assert "It leaves" in outcome["headline"]
