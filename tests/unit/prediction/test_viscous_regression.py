"""k_v over many slides of the simulator's plant, by least squares and by decrement."""

from dataclasses import replace

import numpy as np
import pytest

from impactcell.errors import CaptureError
from impactcell.records import Capture
from tests.benchmarks._viscous_regression import by_decrement, by_least_squares
from tests.taps import Tap


def shots(seed: int, viscous: bool = True) -> tuple[list[Tap], list[Capture]]:
    rng = np.random.default_rng(seed)
    made = [
        Tap(
            velocity / 6e4,
            0.2 * (1 + 0.01 * rng.normal()),
            mass_kg=mass,
            direction=sign,
            **({} if viscous else {"effects": {}}),
        )
        for velocity in (3000, 4500, 6000)
        for mass in (12.6, 25.2)
        for sign in (1, -1)
    ]
    return made, [tap.capture(rng, cycle=number) for number, tap in enumerate(made, 1)]


@pytest.mark.slow
def test_least_squares_finds_k_v_and_every_mu_k_within_its_error() -> None:
    pulls = []
    for seed in range(6):
        made, captures = shots(seed)
        found = by_least_squares(captures)
        pulls.append((found.coefficient_n_s_per_m - 85.0) / found.std)
        assert found.mu_k == pytest.approx([tap.mu_k for tap in made], rel=0.01)
        assert found.used == tuple(range(1, len(made) + 1))
        assert found.std < 0.5
    assert np.sqrt(np.mean(np.square(pulls))) < 2.0


def test_without_viscous_friction_none_is_found() -> None:
    found = by_least_squares(shots(7, viscous=False)[1])
    assert abs(found.coefficient_n_s_per_m) < 4.0 * found.std


@pytest.mark.slow
def test_the_decrement_agrees_but_less_closely() -> None:
    ours, theirs = [], []
    for seed in range(4):
        captures = shots(20 + seed)[1]
        ours.append(by_least_squares(captures).coefficient_n_s_per_m - 85.0)
        found = by_decrement(captures)
        theirs.append(found.coefficient_n_s_per_m - 85.0)
        assert found.coefficient_n_s_per_m == pytest.approx(85.0, rel=0.1)
        assert found.mu_k == pytest.approx(0.152, rel=0.06)
    assert np.std(ours) < np.std(theirs)


def test_slides_that_cannot_be_used_are_left_out_or_named() -> None:
    _, captures = shots(9)
    broken = [replace(captures[0], position=None), *captures[1:]]
    assert by_least_squares(broken).used == tuple(range(2, 13))
    with pytest.raises(CaptureError, match="no slide can be used; cycle 1: no position"):
        by_least_squares(broken[:1])
    with pytest.raises(CaptureError, match="mass is not known"):
        by_decrement([replace(captures[0], mass_kg=float("nan"))])
