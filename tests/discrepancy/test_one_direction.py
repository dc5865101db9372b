"""Taps in one direction: friction that differs by direction is friction itself."""

from dataclasses import replace

import numpy as np
import pytest

from impactcell.discrepancy.data import prepare, sensor_noise, split_held_out
from impactcell.discrepancy.model import ParameterEstimate
from impactcell.discrepancy.nominal_model import nominal_models
from impactcell.discrepancy.report.result import _nominal
from impactcell.discrepancy.search.evidence import scan_candidates
from impactcell.physics.effects import LIBRARY
from tests.discrepancy.study import Job, quick_campaign


@pytest.mark.parametrize("directions", [(1,), (1, -1)])
def test_an_effect_that_is_one_factor_of_all_shots_is_no_candidate(directions: tuple[int, ...]) -> None:
    """It was one with p 0.0005 and a gain of 81 441, beside a note that it cannot be seen."""
    told = quick_campaign(Job("single", ("viscous_friction",), 3, shots=48))
    shots = tuple(shot for shot in told.shots if shot.direction in directions)
    prepared = prepare(replace(told, shots=shots))
    floor = sensor_noise(prepared)
    start = nominal_models(prepared, floor, split_held_out(prepared, 0)[0], None).start
    scan = scan_candidates(start.coarse, start.fit, ("direction_asymmetry", "surface_tilt"), (0, 2))
    assert ("direction_asymmetry" in scan.seen()) is (len(directions) == 2)
    assert ("direction_asymmetry" in scan.candidates.names) is (len(directions) == 2)
    assert set(scan.seen()) <= set(LIBRARY)
    assert np.isfinite(list(scan.gains().values())).all()


def test_the_ratio_of_a_result_is_told_both_ways() -> None:
    """`ratio` alone was mu_s/mu_k, and `ratio_std` of the model beside it that of mu_k/mu_s."""
    ratio = ParameterEstimate("", "ratio", 0, 1.25, 1.0, 1.6, at_bound=False)
    document = _nominal([ratio])
    assert document["ratio"] == {"value": 1.25, "ci95": [1.0, 1.6], "at_bound": False}
    assert document["mu_k_over_mu_s"] == {"value": 0.8, "ci95": [0.625, 1.0], "at_bound": False}
