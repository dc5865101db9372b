"""Shots of the same settings, whose starts were told or measured; and encoders that stand still at rest."""

import math
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.discrepancy.data import prepare
from impactcell.discrepancy.data.replicate_groups import (
    replicate_groups,
    start_places,
    velocity_settings,
)
from impactcell.features import noise_at_rest
from impactcell.records import Capture, Channel
from tests.discrepancy.study import Job, quick_campaign

PATH = Channel(np.arange(5.0), np.array([0.0, 1e-3, 3e-3, 4e-3, 4e-3]), None)
"""A part goes 4 mm: a hundredth of it is 40 um."""


def at(starts_mm: Sequence[float], position: Channel | None = PATH) -> list[Capture]:
    return [Capture(i, 0.05, 10.0, None, position, start_m=1e-3 * start) for i, start in enumerate(starts_mm)]


@pytest.mark.parametrize(
    ("starts_mm", "places"),
    [
        ([25.0, 25.0, 25.0], [0, 0, 0]),
        ([25.0001, 24.9999, 25.0], [0, 0, 0]),
        ([25.0, 26.0, 25.00002, 25.99999], [0, 1, 0, 1]),
        ([0.12, 0.0, 0.03, 0.06, 0.09], [2, 0, 0, 1, 1]),  # none is of a place whose first is 40 um away
    ],
)
def test_starts_are_of_one_place_up_to_a_hundredth_of_the_path(
    starts_mm: list[float], places: list[int]
) -> None:
    assert start_places(at(starts_mm)) == places


def test_without_a_position_starts_are_compared_as_they_were_told() -> None:
    assert start_places(at([25.0, 25.0001], None)) == [0, 1]
    assert start_places(at([25.0, 25.0 + 1e-10], None)) == [0, 0]


def test_settings_that_differ_are_no_replicates() -> None:
    shots = at([25.0, 25.0001, 25.0, 25.0, 25.0])
    shots[2], shots[3] = replace(shots[2], mass_kg=10.1), replace(shots[3], direction=-1)
    shots[4] = replace(shots[4], velocity_m_s=math.nan)
    assert replicate_groups(shots, start_places(shots)) == [0, 0, 1, 2, 3]


def test_a_start_that_was_measured_leaves_the_groups_as_they_are() -> None:
    """Each shot was a setting of its own, so that effects between shots were not found."""
    told = quick_campaign(Job("single", (), 3, shots=24))
    rng = np.random.default_rng(4)
    measured = replace(
        told, shots=tuple(replace(s, start_m=s.start_m + 1e-7 * rng.normal()) for s in told.shots)
    )
    before, after = prepare(told), prepare(measured)
    assert [shot.group for shot in after.shots] == [shot.group for shot in before.shots]
    assert len({shot.group for shot in after.shots}) < len(after.shots)
    assert after.covariates == before.covariates


def with_velocities(velocities_m_s: Sequence[float]) -> list[Capture]:
    return [Capture(i, v, 10.0, None, PATH) for i, v in enumerate(velocities_m_s)]


def test_velocities_that_were_measured_are_of_one_setting_up_to_two_per_cent() -> None:
    """An actuator that scatters by half a per cent about four settings, nine taps of each."""
    rng = np.random.default_rng(7)
    nominal = np.repeat([0.04, 0.055, 0.07, 0.09], 9)
    told = with_velocities(nominal.tolist())
    measured = with_velocities((nominal * np.exp(0.003 * rng.normal(size=36))).tolist())
    assert velocity_settings(measured) == velocity_settings(told) == [0] * 9 + [1] * 9 + [2] * 9 + [3] * 9
    assert replicate_groups(measured, [0] * 36) == replicate_groups(told, [0] * 36)


@pytest.mark.parametrize("shots", [8, 30, 60, 200])
def test_velocities_that_were_drawn_at_random_are_no_settings(shots: int) -> None:
    """Some lie within two per cent of each other by chance: that makes no replicates of them."""
    taken = 0
    for seed in range(300):
        drawn = np.random.default_rng(seed).uniform(2000.0 / 60e3, 6000.0 / 60e3, shots)
        taken += sorted(velocity_settings(with_velocities(drawn.tolist()))) != list(range(shots))
    assert taken <= 3


def test_velocities_that_were_told_are_compared_as_told() -> None:
    assert velocity_settings(with_velocities([0.05, 0.0501] * 4)) == [0, 1] * 4
    assert velocity_settings(with_velocities([math.nan] * 3)) == [0, 0, 0]
    assert velocity_settings(with_velocities([0.05, math.nan, 0.05, 0.06])) == [1, 0, 1, 2]


def test_a_velocity_that_was_measured_leaves_the_groups_as_they_are() -> None:
    """Each shot was a setting of its own, so that gap (b) was null."""
    told = quick_campaign(Job("single", (), 3, shots=24))
    rng = np.random.default_rng(4)
    measured = replace(
        told,
        shots=tuple(replace(s, velocity_m_s=s.velocity_m_s * (1 + 3e-3 * rng.normal())) for s in told.shots),
    )
    before, after = prepare(told), prepare(measured)
    assert [shot.group for shot in after.shots] == [shot.group for shot in before.shots]
    assert not any("No replicates" in note for note in after.notes)


@pytest.mark.parametrize("flickering", [0, 3])
def test_an_encoder_that_stands_still_shows_no_noise(flickering: int) -> None:
    """It had been divided by its variance."""
    rng, recorded, counted = np.random.default_rng(6), [], []
    for shot in range(10):
        rest = 1e-6 * (rng.random(100) < 0.3) if shot < flickering else np.zeros(100)
        moves = 1e-6 * np.round(1e6 * np.linspace(0.0, 4e-3, 300) ** 2)
        whole = Channel(np.arange(-100.0, 300.0), np.append(rest, moves), None)
        kept = Channel(np.arange(300.0), moves, None)
        recorded.append(SimpleNamespace(force=None, position=whole, actuator=None))
        counted.append(SimpleNamespace(force=None, position=kept, actuator=None))
    taps: Any = (recorded, counted)
    assert noise_at_rest(*taps) == {}
