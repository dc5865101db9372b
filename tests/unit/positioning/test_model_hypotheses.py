"""Hypotheses of what the model lacks: told apart by what they foretold, and never by one tap alone."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.positioning.displacement_discrepancy import FEATURES
from impactcell.positioning.model_hypotheses import (
    GAP_EVIDENCE,
    LEAST_PROBABILITY,
    MOST_EVIDENCE_OF_A_TAP,
    PROBABILITIES,
    WEIGHTS_STD,
    join,
    log_bayes_factor,
    parts_of,
    prior,
    reweighted,
    tap_predictions,
    with_evidence_of_a_tap,
    with_model_accepted,
    with_score,
)
from impactcell.positioning.planner_posterior import FRICTION, PARAMETERS, PlannerPosterior
from impactcell.positioning.posterior_update import update_posterior
from impactcell.positioning.scatter_hypotheses import GRID, PRIOR_WEIGHTS
from impactcell.positioning.tap_model import TapModel

SLIDE_M = 5e-3
START = prior(6.5e5, 465.0, 0.2, 0.152, 0.0, friction_std=0.01)


def slide(features: np.ndarray) -> TapModel:
    """A tap that slides as far as friction lets it, with this phi."""
    return TapModel(
        lambda states: SLIDE_M * np.exp(math.log(0.152) - states[:, 0]) * (1.0 - states[:, PARAMETERS]),
        features,
    )


def taught(
    weights: np.ndarray, taps: int, seed: int, scatter: float = 0.03
) -> tuple[PlannerPosterior, list[float]]:
    """Posterior after taps of a cell that lacks phi · weights, and the evidence after each."""
    rng, posterior, evidence = np.random.default_rng(seed), START, []
    for _ in range(taps):
        features = np.zeros(FEATURES)
        features[:3] = rng.standard_normal(3)
        moved = SLIDE_M * math.exp(features @ weights) * (1.0 + scatter * rng.standard_normal())
        posterior = update_posterior(posterior, slide(features), moved)
        evidence.append(log_bayes_factor(posterior))
    return posterior, evidence


def test_hypotheses_come_apart_and_together_again() -> None:
    parts = parts_of(START)
    assert [part.probabilities.size for part in parts] == [1] * WEIGHTS_STD.size
    for part, std in zip(parts, WEIGHTS_STD, strict=True):
        np.testing.assert_allclose(np.sqrt(np.diag(part.cov)[PARAMETERS:]), std)
    again = join(parts, START.probabilities, START)
    np.testing.assert_allclose(again.probabilities, PROBABILITIES)
    np.testing.assert_allclose(again.cov, START.cov)
    np.testing.assert_array_equal(again.hypotheses, START.hypotheses)
    assert log_bayes_factor(START) == pytest.approx(0.0, abs=1e-12)


def scattering(axis: int, above: float, shift: float = 1e12) -> PlannerPosterior:
    """Start, but for the first hypothesis, which believes in scatters above this on one axis of the grid."""
    weights = np.where(GRID[:, axis] > above, shift, 1.0) * PRIOR_WEIGHTS
    return replace(START, scatter_weights=np.vstack([weights / weights.sum(), START.scatter_weights[1:]]))


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [0.005, 0.03, 0.08])
def test_with_nothing_missing_the_evidence_stays_small(scatter: float) -> None:
    most = [max(taught(np.zeros(FEATURES), 15, seed, scatter)[1]) for seed in range(12)]
    # Ville: a factor of 100 comes in one cell of a hundred at the most
    assert sum(evidence > math.log(100.0) for evidence in most) <= 1
    assert np.median(most) < math.log(3.0)


def test_what_is_missing_is_learned_and_told() -> None:
    weights = np.zeros(FEATURES)
    weights[1] = 0.12
    posterior, evidence = taught(weights, 25, 3)
    assert evidence[-1] > GAP_EVIDENCE
    predictions = tap_predictions(posterior)
    assert predictions.lacking
    assert predictions.depends_on == "velocity"
    assert predictions.evidence.size == pytest.approx(0.12, abs=4.0 * predictions.evidence.size_std)
    assert posterior.scatter < 0.05  # not taken for scatter


def test_a_contact_that_is_another_at_each_tap_is_not_the_models() -> None:
    posterior = scattering(axis=2, above=0.1)
    assert log_bayes_factor(posterior) > GAP_EVIDENCE
    predictions = tap_predictions(posterior)
    assert predictions.lacking
    assert predictions.depends_on == "contact"
    assert 0.2 <= predictions.evidence.size <= 0.4


@pytest.mark.parametrize(("axis", "above"), [(0, 0.07), (1, 0.05)])
def test_a_large_scatter_of_friction_or_displacement_is_not_told_as_missing(axis: int, above: float) -> None:
    posterior = scattering(axis, above)
    assert log_bayes_factor(posterior) < 0.5
    # a tenth of its probability is no evidence either, where so large a scatter was as unlikely beforehand
    unlikely = join(parts_of(posterior), np.array([0.072, 0.2, 0.5, 0.228]), posterior)
    assert not tap_predictions(unlikely).lacking


def test_what_one_tap_says_beyond_its_share_is_taken_back_first() -> None:
    outlier = with_evidence_of_a_tap(scattering(axis=2, above=0.1), START)
    assert log_bayes_factor(outlier) == pytest.approx(MOST_EVIDENCE_OF_A_TAP)
    assert not tap_predictions(outlier).lacking
    again = with_evidence_of_a_tap(outlier, outlier)  # a tap that says nothing
    assert log_bayes_factor(again) == pytest.approx(MOST_EVIDENCE_OF_A_TAP)
    fewer = with_evidence_of_a_tap(scattering(axis=2, above=0.1, shift=1e6), again)
    assert log_bayes_factor(fewer) == pytest.approx(MOST_EVIDENCE_OF_A_TAP)
    nothing = with_evidence_of_a_tap(START, fewer)
    assert log_bayes_factor(nothing) == pytest.approx(0.0, abs=1e-9)
    assert nothing.uncounted_evidence == 0.0


def test_one_tap_is_no_proof() -> None:
    after = reweighted(PROBABILITIES, np.array([-900.0, -10.0, -5.0, 0.0]))
    assert after[0] / after[3] == pytest.approx(
        PROBABILITIES[0] / PROBABILITIES[3] * math.exp(-MOST_EVIDENCE_OF_A_TAP)
    )


def test_no_hypothesis_is_ever_given_up() -> None:
    sure = join(parts_of(START), np.array([1.0, 0.0, 0.0, 0.0]), START)
    assert (sure.probabilities >= 0.99 * LEAST_PROBABILITY).all()


def test_doubt_brings_the_hypotheses_back_halfway() -> None:
    sure = join(parts_of(START), np.array([1.0, 1e-6, 1e-6, 1e-6]), START)
    for _ in range(6):
        sure = with_score(sure, 4.0)
    assert sure.watch.doubted
    assert sure.probabilities[3] > 1e-4


def test_doubt_takes_back_nothing_of_what_taps_have_said_against_the_model() -> None:
    lacking = join(parts_of(START), np.array([1e-6, 1e-6, 1.0, 1e-6]), START)
    assert tap_predictions(lacking).lacking
    doubting = lacking
    for _ in range(6):
        doubting = with_score(doubting, 4.0)
    assert doubting.watch.doubted
    assert doubting.probabilities[3] > 1e-4
    assert log_bayes_factor(doubting) == pytest.approx(log_bayes_factor(lacking), abs=0.1)
    assert tap_predictions(doubting).lacking


def test_doubt_takes_back_nothing_of_what_was_said_of_the_contact() -> None:
    lacking = scattering(axis=2, above=0.1)
    doubting = lacking
    for _ in range(6):
        doubting = with_score(doubting, 4.0)
    assert doubting.watch.doubted
    assert log_bayes_factor(doubting) == pytest.approx(log_bayes_factor(lacking), abs=1e-9)
    accepted = with_model_accepted(doubting)
    assert log_bayes_factor(accepted) == pytest.approx(0.0, abs=1e-9)


def test_where_predictions_turn_out_off_friction_may_have_stepped() -> None:
    learned, _ = taught(np.zeros(FEATURES), 15, 3)
    moved = 1.4 * SLIDE_M

    def friction(posterior: PlannerPosterior) -> float:
        return float(posterior.mean[FRICTION] - learned.mean[FRICTION])

    def miss(posterior: PlannerPosterior, moved_m: float) -> PlannerPosterior:
        return update_posterior(with_score(posterior, 8.0), slide(np.zeros(FEATURES)), moved_m)

    stepped = miss(learned, moved)
    again = update_posterior(stepped, slide(np.zeros(FEATURES)), moved)
    assert friction(again) == pytest.approx(-math.log(1.4), abs=0.05)  # it has
    odd = miss(learned, moved)
    for _ in range(4):
        odd = update_posterior(odd, slide(np.zeros(FEATURES)), SLIDE_M)
    assert friction(odd) == pytest.approx(0.0, abs=0.03)  # it has not: one tap was odd


def test_an_accepted_model_lacks_nothing_until_taps_show_it_and_plans_as_before() -> None:
    weights = np.zeros(FEATURES)
    weights[1] = 0.12
    posterior, _ = taught(weights, 25, 3)
    accepted = with_model_accepted(posterior)
    assert tap_predictions(posterior).lacking
    assert not tap_predictions(accepted).lacking
    assert log_bayes_factor(accepted) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(accepted.mean, posterior.mean, atol=2e-3)
    rng, again = np.random.default_rng(4), accepted
    for _ in range(15):  # what the extended model says is right: no alarm comes back
        features = np.zeros(FEATURES)
        features[:3] = rng.standard_normal(3)
        moved = SLIDE_M * math.exp(features @ weights) * (1.0 + 0.03 * rng.standard_normal())
        again = update_posterior(again, slide(features), moved)
    assert not tap_predictions(again).lacking


def test_what_comes_to_be_missing_after_a_model_was_accepted_is_told() -> None:
    weights = np.zeros(FEATURES)
    weights[1] = 0.12
    posterior = with_model_accepted(taught(weights, 25, 3)[0])
    weights[2] = 0.12  # a second effect, from here on
    rng, told = np.random.default_rng(5), math.inf
    for tap in range(1, 26):
        features = np.zeros(FEATURES)
        features[:3] = rng.standard_normal(3)
        moved = SLIDE_M * math.exp(features @ weights) * (1.0 + 0.03 * rng.standard_normal())
        posterior = update_posterior(posterior, slide(features), moved)
        told = min(told, tap if tap_predictions(posterior).lacking else math.inf)
    predictions = tap_predictions(posterior)
    assert told <= 10
    assert predictions.depends_on == "mass"
    assert predictions.evidence.size == pytest.approx(0.12, abs=4.0 * predictions.evidence.size_std)
