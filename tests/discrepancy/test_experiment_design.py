"""What a next experiment promises holds when it is simulated."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from impactcell.discrepancy.data.noise_floor import sensor_noise
from impactcell.discrepancy.data.prepared_campaign import prepare, shot_set
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.search import experiment_design
from impactcell.discrepancy.search.experiment_design import propose_experiments, simulated_separation
from tests.discrepancy.test_convergence import fitted
from tests.discrepancy.test_workflow import make


@pytest.fixture(scope="module")
def rivals() -> tuple[Problem, Fit, Fit]:
    """Viscous friction and a drag fitted to the same few shots."""
    prepared = prepare(make("viscous_friction", shots=12))
    shots = shot_set(prepared, np.arange(12), sensor_noise(prepared).noise_std)
    problem = Problem(shots, len(prepared.batches))
    nominal = fit_nominal(problem)
    return problem, fitted(problem, nominal, "viscous_friction"), fitted(problem, nominal, "quadratic_drag")


def test_viscous_friction_and_drag_are_told_apart_by_a_setting_and_its_shots(
    rivals: tuple[Problem, Fit, Fit],
) -> None:
    problem, viscous, drag = rivals
    (proposal,) = propose_experiments(problem, viscous, [("viscous_friction", "quadratic_drag", drag)])
    assert proposal.shots >= 2
    assert "mm/min" in proposal.setting
    assert proposal.power >= 0.9


def test_a_setting_that_keeps_nothing_of_its_promise_is_not_proposed(
    rivals: tuple[Problem, Fit, Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, viscous, drag = rivals
    monkeypatch.setattr(experiment_design, "simulated_separation", lambda *_: 0.0)
    (proposal,) = propose_experiments(problem, viscous, [("viscous_friction", "quadratic_drag", drag)])
    assert proposal.shots == 0


def test_a_model_is_not_told_from_itself_and_the_less_the_more_friction_scatters(
    rivals: tuple[Problem, Fit, Fit],
) -> None:
    problem, viscous, drag = rivals
    shot = problem.shots.items[0]
    assert simulated_separation(problem, viscous, viscous, shot) == 0.0
    steady, scattered = (
        simulated_separation(problem, replace(viscous, spread=spread), replace(drag, spread=spread), shot)
        for spread in (0.001, 0.2)
    )
    assert steady > scattered
    count = experiment_design._shots_needed(0.5)
    assert (
        norm.cdf(math.sqrt(count) * 0.5 - norm.ppf(0.975))
        >= 0.9
        > norm.cdf(math.sqrt(count - 1) * 0.5 - norm.ppf(0.975))
    )
