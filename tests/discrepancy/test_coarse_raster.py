"""Positions on a raster that is coarser than their noise: rounding alike in all shots is no gap."""

from dataclasses import replace

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.data import prepare
from impactcell.discrepancy.data.coarse_raster import CoarseRaster, beside_rasters, coarse_rasters
from impactcell.discrepancy.data.prepared_campaign import STRATEGIES
from impactcell.discrepancy.data.prepared_shots import ShotSet
from impactcell.discrepancy.search import NO_GAP
from impactcell.records import Capture, Channel
from tests.discrepancy.study import Job, name_effects, quick_campaign
from tests.taps import Tap

STEP_M = 1e-6


def shots_of(position: np.ndarray) -> ShotSet:
    """Give one shot with this position and a force that is on no raster."""
    prepared = prepare(quick_campaign(Job("single", (), 3, shots=24))).shots[0]
    force = np.random.default_rng(1).normal(size=position.size)
    values = (force, position, np.empty(0))
    times = (np.arange(position.size), np.arange(position.size), np.empty(0))
    shot = replace(prepared, times=times, values=values)
    return ShotSet(
        STRATEGIES[Excitation.TAP],
        9.81,
        1e-3,
        (shot,),
        (1.0, STEP_M, np.nan),
        np.concatenate(values),
        np.ones(2 * position.size) / np.repeat([1.0, STEP_M], position.size),
        np.repeat([0, 1], position.size),
        np.array([0, 2 * position.size]),
    )


@pytest.mark.parametrize("noise", [0.0, 0.2, 0.35])
def test_what_rounding_makes_of_the_true_motion_is_nothing_in_the_mean(noise: float) -> None:
    """A part that is shown where it lay until it has gone half a step is a quarter of a step behind."""
    rng = np.random.default_rng(2)
    true_m = STEP_M * np.tile(np.linspace(-0.5, 0.5, 400, endpoint=False) ** 2 * 2.0, 200)
    seen = STEP_M * np.rint(true_m / STEP_M + noise * rng.normal(size=true_m.size))
    shots = shots_of(seen)
    residual = (shots.values - np.concatenate([shots.values[: true_m.size], true_m])) * shots.weights
    after = beside_rasters(shots, residual, [None, CoarseRaster(STEP_M, noise * STEP_M), None])
    assert not after[: true_m.size].any()  # of the force
    assert abs(residual[true_m.size :].mean()) > 0.01
    assert abs(after[true_m.size :].mean()) < 5e-3


def test_a_motion_that_is_off_is_off_by_as_much_beside_its_raster() -> None:
    rng = np.random.default_rng(3)
    true_m = STEP_M * np.sort(rng.uniform(0.0, 50.0, 20_000))
    shots = shots_of(STEP_M * np.rint(true_m / STEP_M))
    for off in (0.0, 0.1, 0.7, 3.3):
        predicted = np.concatenate([shots.values[: true_m.size], true_m - off * STEP_M])
        after = beside_rasters(
            shots, (shots.values - predicted) * shots.weights, [None, CoarseRaster(STEP_M, 0.0), None]
        )
        assert after[true_m.size :].mean() == pytest.approx(off, abs=0.02)


@pytest.mark.parametrize(("noise", "told"), [(0.0, 0.0), (0.3, 0.3), (1.0, None)])
def test_a_raster_is_coarse_up_to_twice_the_noise(noise: float, told: float | None) -> None:
    rng = np.random.default_rng(4)
    path = 1e3 * np.linspace(0.0, 1.0, 2000) ** 2 + noise * rng.normal(size=2000)
    force, position, actuator = coarse_rasters(shots_of(STEP_M * np.rint(path)).items)
    assert force is None
    assert actuator is None
    if told is None:
        assert position is None
    else:
        assert position is not None
        assert position.step == pytest.approx(STEP_M)
        assert position.noise_std == pytest.approx(told * STEP_M, abs=0.06 * STEP_M)


def rounded_taps(mu_gradient: float = 0.0) -> Campaign:
    """Taps of the simulator's plant that all begin in the middle of a step of a bare raster of 1 um."""
    rng, shots = np.random.default_rng(9), []
    effects = {"position_dependent_friction": {"gradient_per_m": mu_gradient}} if mu_gradient else {}
    design = [(v, m) for v in (0.04, 0.055, 0.07, 0.09) for m in (12.0, 17.0, 23.0) for _ in range(3)]
    for number, place in enumerate(rng.permutation(len(design)), 1):
        velocity, mass = design[place]
        mu_s = 0.24 * (1.0 + 0.02 * rng.normal())
        tap = Tap(velocity, mu_s, 0.71, mass, 1.2e-3, stiffness=4.2e5, damping=320.0, effects=effects)
        exact = tap.capture(cycle=number, position_hz=4e3)
        shots.append(_rounded(exact, rng))
    return Campaign(Excitation.TAP, tuple(shots), stroke_m=1.2e-3)


def _rounded(tap: Capture, rng: np.random.Generator) -> Capture:
    force, position = tap.force, tap.position
    assert force is not None
    assert position is not None
    noisy = force.values + 0.4 * rng.normal(size=force.values.size)
    steps = STEP_M * np.rint(position.values / STEP_M)
    return replace(
        tap,
        force=Channel(force.time_s, noisy, 0.4),
        position=Channel(position.time_s, steps, 1e-9, resolution=STEP_M),
    )


@pytest.mark.slow
def test_a_bare_raster_is_no_gap() -> None:
    """A wave of friction "would explain the training shots", at a held-out gap of 0.98."""
    assert name_effects(rounded_taps()).verdict == NO_GAP


@pytest.mark.slow
def test_friction_that_goes_with_the_place_is_named_on_a_bare_raster() -> None:
    """A gradient of 2/m, a fifth of the typical one."""
    found = name_effects(rounded_taps(2.0))
    assert "position_dependent_friction" in {*found.added, *sum(found.conclusion.ties.values(), ())}
