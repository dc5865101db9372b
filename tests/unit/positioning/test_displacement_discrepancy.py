"""What the model lacks: which share of a tap it acts on, and how sure one may be that there is something."""

import math

import numpy as np
import pytest

from impactcell.positioning.displacement_discrepancy import (
    FEATURES,
    PRIOR_STD,
    discrepancy_features,
    log_bayes_factor,
)


def features(stroke: float, displacement: float, position: float = 0.0, direction: float = 1.0) -> np.ndarray:
    out = np.empty(FEATURES)
    tap, part = np.array([0.03, stroke, 40e-6]), np.array([15.0, 9.81])
    discrepancy_features(tap, displacement, part, np.array([position, direction]), out)
    return out


def test_a_push_has_no_slide_and_a_strike_hardly_anything_else() -> None:
    push, strike = features(200e-6, 160e-6), features(1e-3, 20e-3)
    assert push[0] == pytest.approx(0.0, abs=1e-12)
    assert push[5] == pytest.approx(40.0 / 160.0)
    assert strike[0] == pytest.approx(1.0 - 0.96e-3 / 20e-3)
    assert abs(strike[5]) < 1e-3


def test_position_counts_from_halfway_along_the_slide_and_direction_by_its_sign() -> None:
    there, back = features(1e-3, 20e-3, 5e-3, 1.0), features(1e-3, 20e-3, 5e-3, -1.0)
    assert there[3] / back[3] == pytest.approx(15.0 / -5.0)
    assert there[9] == -back[9]


def test_a_tap_that_moves_nothing_and_one_without_a_stroke() -> None:
    assert (features(1e-3, 0.0) == 0.0).all()
    assert features(math.inf, 5e-3)[0] == 1.0


def test_with_nothing_missing_the_evidence_stays_small() -> None:
    # 2000 cells, 40 observations each of weights that are zero: Ville's inequality
    rng = np.random.default_rng(4)
    prior = np.diag(PRIOR_STD**2)
    exceeded, design = 0, rng.standard_normal((40, FEATURES)) * 0.6
    precision = np.linalg.inv(prior) + design.T @ design / 0.03**2
    cov = np.linalg.inv(precision)
    final = []
    for _ in range(2000):
        observed = 0.03 * rng.standard_normal(40)
        evidence = log_bayes_factor(cov @ design.T @ observed / 0.03**2, cov)
        final.append(evidence)
        exceeded += evidence > math.log(100.0)
    assert exceeded <= 0.01 * 2000 + 3.0 * math.sqrt(20.0)
    assert np.median(final) < 0.0


def test_what_is_missing_is_told() -> None:
    weights = np.zeros(FEATURES)
    weights[1] = 0.06
    assert log_bayes_factor(weights, np.diag(np.full(FEATURES, 0.01**2))) > math.log(1e3)
