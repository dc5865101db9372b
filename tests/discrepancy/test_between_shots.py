"""What acts between shots is judged by shots: by chance as often as it says."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.discrepancy.search import chance_of_narrowing, trace_rivals


@pytest.mark.parametrize("parameters", [1, 3])
def test_factors_without_an_effect_are_narrowed_by_chance_as_often_as_said(parameters: int) -> None:
    rng = np.random.default_rng(11)
    chances = []
    for _ in range(2000):
        factors = rng.standard_normal(30)
        columns = np.column_stack([np.ones(30), rng.standard_normal((30, parameters))])
        left = factors - columns @ np.linalg.lstsq(columns, factors, rcond=None)[0]
        chances.append(chance_of_narrowing(float(factors.std()), float(left.std()), 30, parameters))
    for level in (0.5, 0.05, 0.01):
        share = np.mean(np.array(chances) <= level)
        assert share == pytest.approx(level, abs=4.0 * np.sqrt(level * (1.0 - level) / 2000))


def test_factors_that_an_effect_explains_are_not_narrowed_by_chance() -> None:
    assert chance_of_narrowing(0.05, 0.02, 30, 1) < 1e-8
    assert chance_of_narrowing(0.05, 0.05, 30, 1) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("rival", "spread", "tied", "explains"),
    [
        ("friction_patch", 0.01, True, True),
        ("friction_patch", 0.021, True, False),
        ("friction_patch", 0.03, False, False),
        ("friction_drift", 0.01, False, False),
    ],
)
def test_a_name_between_shots_gives_way_to_what_narrows_the_factors_within_them(
    rival: str, spread: float, tied: bool, explains: bool
) -> None:
    fitted: Any = SimpleNamespace(effects=("viscous_friction", rival), spread=spread)
    assert trace_rivals(0.02, [fitted], 30) == ((rival,) if tied else (), explains)
