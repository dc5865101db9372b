"""Taps of the simulator whose force hums, or whose noise neighbouring samples share: read from their rest."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from impactcell.campaign import from_contact
from impactcell.campaign.recorded_campaign import from_captures
from impactcell.features import CheckedForce, extract, required, with_noise_at_rest
from impactcell.features.contact import contact_spells, loss_of_contact
from impactcell.prediction.contact_onset import fit_plant_and_onset
from impactcell.records import Capture, Channel, Quality, Samples
from tests.taps import VISCOUS, Tap

RATE_HZ = 2e4
FORCE_STD_N = 0.5


def white(rng: np.random.Generator, times: Samples) -> Samples:
    return rng.normal(0.0, FORCE_STD_N, len(times))


def hum(rng: np.random.Generator, times: Samples) -> Samples:
    return white(rng, times) + np.sin(2.0 * math.pi * (50.0 * times + rng.random()))


def coloured(rng: np.random.Generator, times: Samples) -> Samples:
    """First order, with a decay of 0.3 ms, by a recursive filter."""
    forgotten = math.exp(-1.0 / RATE_HZ / 3e-4)
    values, _ = lfilter([1.0], [1.0, -forgotten], white(rng, times), zi=[FORCE_STD_N * rng.normal()])
    return np.asarray(math.sqrt(1.0 - forgotten**2) * values)


NOISES = {"hum": hum, "coloured": coloured}


def recorded(tap: Tap, rng: np.random.Generator, cycle: int, noise: Any, stated: float | None) -> Capture:
    """Record a tap from 15 ms before contact to 60 ms after its rest; its position's noise is not stated."""
    moved = tap.motion()
    times = np.arange(round((moved.stop_s + 0.075) * RATE_HZ)) / RATE_HZ
    since = times - 0.015 - rng.uniform() / RATE_HZ
    force = np.where(since > 0.0, moved.force_n(np.maximum(since, 0.0)), 0.0) + noise(rng, times)
    force -= force[:290].mean()  # as an import tares it
    position = np.where(since > 0.0, moved.position_m(np.maximum(since, 0.0)), 0.0)[::4]
    return replace(
        tap.capture(cycle=cycle),
        force=Channel(times, force, stated),
        position=Channel(times[::4], position + rng.normal(0.0, 1.5e-6, position.size)),
    )


def campaign(
    seed: int, noise: Any, effects: dict[str, Any] | None = None, stated: float | None = None
) -> tuple[list[Capture], tuple[Capture, ...]]:
    """Twelve taps as they were recorded, and counted from first contact."""
    rng = np.random.default_rng(seed)
    taps = [
        Tap(
            velocity / 6e4, 0.24, 0.71, mass, 1.2e-3, 1, stiffness=4.2e5, damping=320.0, effects=effects or {}
        )
        for velocity in (2400, 3300, 4200, 5400)
        for mass in (12.0, 17.0, 23.0)
    ]
    captures = [recorded(tap, rng, number, noise, stated) for number, tap in enumerate(taps, 1)]
    counted, _ = from_contact(from_captures(captures, 9.81).campaign)
    return captures, counted.shots


@pytest.mark.slow
@pytest.mark.parametrize("name", NOISES)
def test_taps_in_noise_that_neighbours_share_are_what_they_are(name: str) -> None:
    """By neighbouring samples alone the model missed all of them, by 2.0 and 3.7 times the noise."""
    taps, notes = with_noise_at_rest(*campaign(61, NOISES[name]))
    assert len(notes) == 1
    assert "The noise of force is not stated" in notes[0]
    fit, used = fit_plant_and_onset([extract(tap) for tap in taps], 9.81)
    plant, prior = fit.model.plant, fit.model.prior
    assert 0.93 < fit.gap < 1.07
    assert abs(plant.stiffness_n_per_m - 4.2e5) < 3.0 * prior.stiffness_std_n_per_m
    assert abs(plant.damping_n_s_per_m - 320.0) < 3.0 * prior.damping_std_n_s_per_m < 12.0
    rows = [fit.estimate(tap, fit.model) for tap in used]
    for row in rows:
        assert row.mu_s.quality is Quality.GOOD
        assert abs(row.mu_s.value - 0.24) < 3.5 * row.mu_s.std < 0.1 * 0.24
        assert abs(row.mu_k.value - 0.71 * 0.24) < 3.5 * row.mu_k.std < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", NOISES)
def test_what_a_model_lacks_is_still_said_in_such_noise(name: str) -> None:
    taps, _ = with_noise_at_rest(*campaign(62, NOISES[name], VISCOUS))
    fit, used = fit_plant_and_onset([extract(tap) for tap in taps], 9.81)
    assert fit.gap > 1.5
    row = fit.estimate(used[5], fit.model)
    assert row.mu_s.quality is not Quality.GOOD
    assert "residuals are" in row.mu_s.reason


@pytest.mark.parametrize(
    ("noise", "stated", "is_shared"),
    [
        (white, None, False),
        (white, 0.5, False),
        (coloured, None, True),
        (coloured, 0.5, True),
        (hum, 0.5, False),
    ],
)
def test_what_is_stated_holds_and_white_noise_stays_as_it_is(
    noise: Any, stated: float | None, is_shared: bool
) -> None:
    """A hum of 1 N is more than the 0.5 N that are stated: then it is taken to be none."""
    captures, counted = campaign(63, noise, stated=stated)
    taps, notes = with_noise_at_rest(captures, counted)
    assert len(notes) == (is_shared and stated is None)
    if not is_shared:
        assert all(tap.force is before.force for tap, before in zip(taps, counted, strict=True))
        return
    for tap in taps:
        assert tap.force is not None
        assert tap.force.shared_noise is not None
        assert tap.force.noise_std == (stated or pytest.approx(0.5, rel=0.1))
        assert tap.position is not None
        assert tap.position.shared_noise is None


@pytest.mark.parametrize("name", NOISES)
def test_noise_after_the_slide_is_no_contact(name: str) -> None:
    """By what neighbouring samples show, noise passed for contact in every sixth tap."""
    captures, counted = campaign(64, NOISES[name])
    taps, _ = with_noise_at_rest(captures, counted)
    for tap, before in zip(map(extract, taps), captures, strict=True):
        truth = Tap(
            before.velocity_m_s, 0.24, 0.71, before.mass_kg, 1.2e-3, 1, 0.0, 4.2e5, 320.0, {}
        ).motion()
        force = required(tap.force)
        assert isinstance(force, CheckedForce)
        spells = contact_spells(force)
        assert spells
        assert all(end < truth.separation_s + 1e-3 for _, end in spells)
        assert abs(loss_of_contact(force).value - truth.separation_s) < 2.5e-4
