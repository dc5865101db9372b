"""What the cycles since say of a change of batch that was told: never one outside of what it was told of."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import (
    BatchKnowledge,
    FrictionObservation,
    TrackerSettings,
    batch_change_detection,
    initial_state,
    run_length_bank,
)
from impactcell.tracking.wear_batch.state import ChangePoint

STD = 0.002
BEFORE, DETECTED = 20, 40
"""Cycles at which the change before was told, and at which this one was."""
TOLD = ChangePoint(31, 0.006, 0.0015, DETECTED, 20.0, 11.0)
STATE = replace(initial_state(), accepted_before=BEFORE, accepted=DETECTED, change_point=TOLD)


def bank_of(cycles: list[int], seed: int = 0) -> np.ndarray:
    """Give hypotheses of changes at these cycles, of all weights and sizes."""
    rng = np.random.default_rng(seed)
    bank = np.zeros((len(cycles), run_length_bank.WIDTH))
    bank[:, 0] = rng.normal(0.0, 10.0, len(cycles))
    bank[:, 1] = sorted(cycles)
    bank[:, 2:6] = rng.normal(0.0, 0.01, (len(cycles), 4))
    bank[:, 6:] = (1e-6 * np.eye(4)).ravel()
    return bank


@given(cycles=st.lists(st.integers(0, 80), min_size=1, max_size=30), seed=st.integers(0, 99))
def test_a_change_stays_within_what_it_was_told_of(cycles: list[int], seed: int) -> None:
    change = batch_change_detection.refined_change_point(STATE, bank_of(cycles, seed))
    assert change is not None
    assert BEFORE < change.cycle <= change.detected_at == DETECTED
    assert math.isfinite(change.size)
    assert change.size_std > 0.0
    inside = [cycle for cycle in cycles if BEFORE < cycle <= DETECTED]
    assert change.cycle in (inside or [TOLD.cycle])


@pytest.mark.parametrize(
    ("cycles", "left"),
    [
        ([0], replace(TOLD, size=0.0)),
        ([0, 60], replace(TOLD, size=0.0)),
        ([BEFORE], replace(TOLD, size=0.0)),
        ([DETECTED + 1, 60], TOLD),
    ],
)
def test_a_change_that_is_given_up_has_no_size_and_one_before_a_later_one_keeps_it(
    cycles: list[int], left: ChangePoint
) -> None:
    assert batch_change_detection.refined_change_point(STATE, bank_of(cycles)) == left


def test_noise_that_goes_on_from_cycle_to_cycle_brings_no_change_at_the_first_one() -> None:
    """It is taken for a change, which is given up once hundreds of cycles are known."""
    draws = np.random.default_rng(60_000_001).normal(0.0, 1.0, 700)
    settings, state, seen = TrackerSettings(batch=BatchKnowledge.UNKNOWN), initial_state(), []
    noise = draws[0]
    for cycle, draw in enumerate(draws[:300].tolist()):
        noise = 0.9 * noise + math.sqrt(1.0 - 0.9**2) * draw if cycle else draw
        observation = FrictionObservation(cycle, 0.2 + 2e-5 * cycle + STD * noise, STD)
        state = wear_batch.update(settings, state, observation).state
        if state.change_point is not None:
            seen.append(state.change_point)
            assert state.accepted_before < seen[-1].cycle <= seen[-1].detected_at
    assert seen[-1].size == 0.0 < seen[-1].size_std
