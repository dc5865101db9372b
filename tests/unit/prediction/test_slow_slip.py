"""Friction that is larger in slow slip than the model's. Truth: the simulator's own plant."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from impactcell.features import extract
from impactcell.physics import Plant
from impactcell.prediction import Model, Prior, estimate
from impactcell.prediction.capture_blocks import linearised_model
from impactcell.prediction.linearised_model import parameters_of
from impactcell.records import Coefficient, Quality, as_recorded
from impactcell.web.texts.reasons import german_reason
from tests.taps import VISCOUS, Tap

PLANT = Plant(6.5e5, 465.0, 0.2, 0.152, effects=VISCOUS)
MODEL = Model("reference", PLANT, Prior(6500.0, 9.3, 0.0228))


def slower(increase: float, velocity_m_s: float) -> dict[str, Any]:
    law = {"friction_increase": increase, "stribeck_velocity_m_s": velocity_m_s}
    return VISCOUS | {"stribeck_friction": law}


def mu_s_of(tap: Tap, seed: int, model: Model = MODEL) -> Coefficient:
    return estimate(as_recorded(tap.capture(np.random.default_rng(seed))), model).mu_s


@pytest.mark.parametrize("seed", [0, 3, 4, 5])
@pytest.mark.parametrize("velocity_m_s", [0.04, 0.05, 0.075])
@pytest.mark.parametrize("fades_over_m_s", [0.001, 0.002, 0.005])
def test_friction_that_is_larger_in_slow_slip_is_told_and_made_up_for(
    fades_over_m_s: float, velocity_m_s: float, seed: int
) -> None:
    """Over 1 mm/s mu_s was good, and up to ten of its standard deviations too high; over 2 and 5 mm/s it was
    said to be a position that is recorded late, and people sent to a filter.
    """
    tap = Tap(velocity_m_s, stroke_m=1.5e-3, effects=slower(0.03, fades_over_m_s))
    mu_s = mu_s_of(tap, seed)
    assert mu_s.quality is Quality.UNCERTAIN
    assert mu_s.value == pytest.approx(tap.mu_s, abs=3.3 * mu_s.std)
    assert re.search(r"as if friction were (\S+) larger in slow slip", mu_s.reason), mu_s.reason
    assert german_reason(mu_s.reason).count("ls wäre die Reibung in langsamem Gleiten") == 1
    for part in mu_s.reason.split("; "):
        assert german_reason(part) != part


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("known", [0.0, 0.01])
def test_how_much_larger_friction_is_than_the_model_s_is_told(known: float, seed: int) -> None:
    """To a third of itself: it is what a straight line makes of a tap whose model had a wrong mu_s."""
    of_cell = replace(MODEL, plant=replace(PLANT, effects=slower(known, 3e-3)))
    reason = mu_s_of(Tap(0.05, stroke_m=1.5e-3, effects=slower(known + 0.03, 3e-3)), seed, of_cell).reason
    told = re.match(r"as if friction were (\S+) larger in slow slip", reason)
    assert told is not None, reason
    assert float(told[1]) == pytest.approx(0.03, rel=0.34)


def test_what_explains_as_much_is_named_as_well() -> None:
    reason = mu_s_of(Tap(0.05, stroke_m=1.5e-3, effects=slower(0.03, 1e-3)), 0).reason
    own, other = reason.split("; ")
    assert re.fullmatch(r"as if friction were \S+ larger in slow slip, its first and last mm/s: run .*", own)
    assert re.fullmatch(r"or as if position were recorded \S+ µs late against force: check its .*", other)
    assert "; oder als wäre der Weg um" in german_reason(reason)


def test_a_position_that_is_late_is_no_friction() -> None:
    right = Tap(0.05, mass_kg=8.0).capture(np.random.default_rng(5), force_hz=1e5, position_hz=1e5)
    assert right.position is not None
    late = replace(right.position, time_s=right.position.time_s + 5e-5)
    reason = estimate(as_recorded(replace(right, position=late)), MODEL).mu_s.reason
    assert "as if position were recorded" in reason
    assert "slow slip" not in reason


def test_a_model_that_has_it_has_nothing_to_be_told() -> None:
    known = replace(MODEL, plant=replace(PLANT, effects=slower(0.03, 2e-3)))
    mu_s = mu_s_of(Tap(0.05, stroke_m=1.5e-3, effects=slower(0.03, 2e-3)), 1, known)
    assert (mu_s.quality, mu_s.reason) == (Quality.GOOD, "")


def test_taps_that_fit_have_nothing_to_be_told() -> None:
    for seed in range(40):
        tap = Tap((0.035, 0.05, 0.075, 0.1)[seed % 4], stroke_m=1.5e-3)
        mu_s = mu_s_of(tap, seed)
        assert mu_s.quality is Quality.GOOD
        assert "as if" not in mu_s.reason


def test_other_effects_give_the_samples_of_a_plant_that_has_them() -> None:
    capture = as_recorded(Tap(0.05).capture(np.random.default_rng(1)))
    larger = replace(PLANT, effects=slower(0.03, 2e-3))
    theta = np.append(parameters_of(PLANT), np.zeros(5))
    response = linearised_model(extract(capture), PLANT).with_effects_of(larger)
    force, position = response.curves(response.linearise(theta))
    moved = Tap(0.05, effects=slower(0.03, 2e-3)).motion()
    assert force == pytest.approx(moved.force_n(response.force_time_s), abs=1e-3)
    assert position == pytest.approx(moved.position_m(response.position_time_s), abs=1e-9)
