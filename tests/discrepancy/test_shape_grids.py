"""Shapes between those that are tried: ripples of any period along the stroke, presliding of any length."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from impactcell.discrepancy.machine import investigate_machine
from impactcell.records import Samples
from tests.discrepancy.test_smooth_force import SLIDE, slide

pytestmark = pytest.mark.slow

SEED = 7


@pytest.fixture(scope="module")
def stroke_m() -> float:
    """Range of positions that the slide goes through."""
    records = [shot.position for shot in slide(lambda q, v: 0.0 * q, SEED).shots if shot.position is not None]
    return float(max(one.values.max() for one in records) - min(one.values.min() for one in records))


@pytest.mark.parametrize("periods", [2.2, 5.3, 7.0, 10.0, 17.0])
@pytest.mark.parametrize("is_friction", [False, True], ids=["force", "friction"])
def test_a_ripple_is_named_whatever_its_period(periods: float, is_friction: bool, stroke_m: float) -> None:
    """A wave of one period more or less looks like nothing: of six that were tried, 7 and 10 were missed."""

    def ripple(q: Samples, v: Samples) -> Samples:
        wave: Samples = 0.6 * np.sin(2.0 * np.pi * q * periods / stroke_m + 1.0)
        return -wave * np.tanh(v / 1e-3) if is_friction else wave

    found = investigate_machine(slide(ripple, SEED), SLIDE)
    assert found.established == ("periodic_friction" if is_friction else "periodic_force",)
    assert found.fall.after < 1.0 < found.fall.before
    assert found.final.terms[-1].shape == pytest.approx(stroke_m / periods, rel=0.01)


def dahl_state(q: Samples, length: float) -> Samples:
    """State z of z' = (q' - |q'| z) / l by another integrator, straight from sample to sample."""
    rate = np.append(np.diff(q), 0.0)

    def rates(sample: float, z: Samples) -> Samples:
        moved = rate[int(sample)]
        changed: Samples = (moved - abs(moved) * z) / length
        return changed

    samples = np.arange(q.size)
    run = solve_ivp(rates, samples[[0, -1]], [0.0], method="LSODA", t_eval=samples, max_step=0.5, rtol=1e-6)
    state: Samples = run.y[0]
    return state


@pytest.mark.parametrize("share", [0.0025, 0.012])
def test_presliding_is_named_whatever_its_length(share: float, stroke_m: float) -> None:
    """A four-hundredth of the stroke was unknown: 1/500 came nearest, the shortest that was looked for."""

    def presliding(q: Samples, v: Samples) -> Samples:
        force: Samples = np.sign(v) - dahl_state(q, share * stroke_m)
        return force

    found = investigate_machine(slide(presliding, SEED), SLIDE)
    assert found.established == ("presliding_hysteresis",)
    assert found.fall.after < 1.0 < found.fall.before
    low, high = found.final.shape_intervals["presliding_hysteresis"]
    assert low < share * stroke_m < high < 1.6 * low
