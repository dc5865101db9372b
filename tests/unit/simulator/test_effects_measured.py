"""Effects of the force channel, and those that act from shot to shot, against their laws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from simulator.plant import Motion, Plant, TapInput, simulate_tap

PLANT = Plant(6.5e5, 465.0, 0.2, 0.152)
STRIKE = TapInput(0.06, 18.9, stroke_m=0.0015, start_m=0.002, dwell_s=20.0, shot=3, shots=10, batch=1)
TIME = np.arange(1, 1200) * 1e-4


def struck(effects: dict[str, dict[str, object]], strike: TapInput = STRIKE) -> Motion:
    return simulate_tap(replace(PLANT, effects=effects), strike)


def test_sensor_chain_gain_then_offset_then_saturation() -> None:
    effects = {
        "force_saturation": {"limit_n": 200.0},
        "force_sensor_offset": {"offset_n": 1.5},
        "force_sensor_gain": {"relative_error": 0.03},
    }
    force = struck({}).force_n(TIME)
    np.testing.assert_allclose(
        struck(effects).force_n(TIME), np.minimum(force * 1.03 + 1.5, 200.0), atol=1e-9
    )


def test_skew_records_late() -> None:
    motion = struck({"channel_skew": {"delay_s": 1e-4}})
    force = struck({}).force_n(TIME - 1e-4)
    np.testing.assert_allclose(motion.force_n(TIME), force, atol=1e-6)
    assert struck({"channel_skew": {"delay_s": 1e-4}}).force_n(np.array([5e-5]))[0] == 0.0


def test_lag_against_convolution() -> None:
    tau = 5e-4
    lagged, motion = struck({"force_sensor_lag": {"time_constant_s": tau}}), struck({})
    breaks = [event.time_s for event in motion.events]
    for t in (0.002, 0.012, 0.03):
        expected = quad(
            lambda s, t=t: math.exp(-(t - s) / tau) / tau * motion.contact_force_n(np.array([s]))[0],
            0.0,
            t,
            points=[p for p in breaks if 0.0 < p < t],
            limit=200,
        )[0]
        assert lagged.force_n(np.array([t]))[0] == pytest.approx(expected, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("direction", [1, -1])
def test_lag_of_the_position_against_convolution(direction: int) -> None:
    tau = 8e-4
    effects = {"position_sensor_lag": {"time_constant_s": tau}}
    strike = replace(STRIKE, direction=direction)
    lagged, motion = struck(effects, strike), struck({}, strike)
    breaks = [event.time_s for event in motion.events]
    for t in (0.002, 0.012, 0.03, motion.end_s + 0.5 * tau):
        expected = quad(
            lambda s, t=t: math.exp(-(t - s) / tau) / tau * motion.position_m(np.array([s]))[0],
            0.0,
            t,
            points=[p for p in breaks if 0.0 < p < t],
            limit=200,
            epsabs=1e-13,
        )[0]
        assert lagged.position_m(np.array([t]))[0] == pytest.approx(expected, rel=1e-6, abs=1e-11)
    np.testing.assert_allclose(lagged.force_n(TIME), motion.force_n(TIME), atol=1e-6)


@pytest.mark.parametrize(
    ("name", "parameters", "static", "kinetic"),
    [
        ("stiction_ageing", {"increase_per_decade": 0.05}, 1.0 + 0.05 * math.log10(20.0), 1.0),
        ("friction_drift", {"relative_change": 0.1}, 1.0 + 0.1 * (0.3 - 0.5), 1.0 + 0.1 * (0.3 - 0.5)),
        ("batch_shift", {"relative_change": (0.06, -0.03)}, 1.06, 1.06),
        ("direction_asymmetry", {"relative_amplitude": 0.04}, 1.04, 1.04),
    ],
)
def test_between_shots(name: str, parameters: dict[str, object], static: float, kinetic: float) -> None:
    motion = struck({name: parameters})
    assert motion.mu_s == pytest.approx(0.2 * static, rel=1e-12)
    assert motion.mu_k == pytest.approx(0.152 * kinetic, rel=1e-12)
    plant = replace(PLANT, mu_s=0.2 * static, mu_k=0.152 * kinetic)
    assert motion.displacement_m == pytest.approx(simulate_tap(plant, STRIKE).displacement_m, rel=1e-9)


def test_covariates_at_their_ends() -> None:
    def mu_s(name: str, parameters: dict[str, object], **changed: float) -> float:
        return struck({name: parameters}, replace(STRIKE, **changed)).mu_s

    ageing = {"increase_per_decade": 0.05}
    assert mu_s("stiction_ageing", ageing, dwell_s=0.001) == pytest.approx(0.2 * 0.95)
    assert mu_s("stiction_ageing", ageing, dwell_s=math.nan) == 0.2
    assert mu_s("batch_shift", {"relative_change": (0.06,)}, batch=0) == 0.2
    assert mu_s("direction_asymmetry", {"relative_amplitude": 0.04}, direction=-1) == pytest.approx(0.192)
