"""The plant and the simulator's plant, written apart, say the same to 1e-6 over all effects.

The simulator's integrator runs here at a tighter tolerance and with steps of 0.1 ms at most: at its own
settings the step that crosses a loss of contact is good to some 1e-5 only.
"""

import math

import numpy as np
import pytest

from impactcell.physics import Plant, TapInput, simulate_driven, simulate_free_slide, simulate_tap
from impactcell.physics.effects import LIBRARY
from simulator import plant as simulated
from simulator import plant_integrator

pytestmark = pytest.mark.slow

CASES = 4
MIXTURES = 24


@pytest.fixture(autouse=True)
def tight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plant_integrator, "RELATIVE_TOLERANCE", 1e-12)
    monkeypatch.setattr(plant_integrator, "LONGEST_CONTACT_STEP_S", 1e-4)
    monkeypatch.setattr(plant_integrator, "LONGEST_SLIDE_STEP_S", 1e-3)


def draw_effect(identifier: str, rng: np.random.Generator) -> dict[str, float | list[float]]:
    made: dict[str, float | list[float]] = {}
    for parameter in LIBRARY[identifier].parameters:
        value = parameter.typical * math.exp(0.5 * rng.normal())
        if parameter.lower < 0.0 and rng.random() < 0.5:
            value = -value
        value = min(max(value, parameter.lower), parameter.upper)
        made[parameter.name] = [value] if parameter.per_batch else value
    return made


def draw(identifiers: list[str], rng: np.random.Generator) -> tuple[dict, dict]:
    mu = rng.uniform(0.12, 0.3)
    plant = {
        "stiffness_n_per_m": 6.5e5 * math.exp(0.2 * rng.normal()),
        "damping_n_s_per_m": 465.0 * math.exp(0.4 * rng.normal()),
        "mu_s": mu,
        "mu_k": mu * rng.uniform(0.65, 1.0),
        "effects": {name: draw_effect(name, rng) for name in identifiers},
    }
    tap = {
        "velocity_m_s": rng.uniform(0.01, 0.1),
        "mass_kg": rng.uniform(5.0, 40.0),
        "stroke_m": rng.uniform(4e-4, 1.5e-3),
        "direction": int(rng.choice([-1, 1])),
        "start_m": rng.uniform(-0.01, 0.01),
        "dwell_s": rng.uniform(0.01, 1000.0),
        "shot": int(rng.integers(1, 61)),
        "shots": 60,
        "batch": int(rng.integers(0, 2)),
    }
    return plant, tap


def compare(identifiers: list[str], rng: np.random.Generator) -> None:
    plant, tap = draw(identifiers, rng)
    ours = simulate_tap(Plant(**plant), TapInput(**tap))
    theirs = simulated.simulate_tap(simulated.Plant(**plant), simulated.TapInput(**tap))
    told = f"{plant} {tap}"
    rings = "presliding_compliance" in identifiers and len(identifiers) > 1
    # Elastic stick under a load rings for ever; there is no rest to compare, only the stop before it.
    if not rings:
        assert ours.displacement_m == pytest.approx(theirs.displacement_m, rel=1e-6, abs=1e-12), told
        if not math.isnan(theirs.sliding_distance_m):
            assert ours.sliding_distance_m == pytest.approx(theirs.sliding_distance_m, rel=1e-6, abs=1e-11), (
                told
            )
    if "force_sensor_lag" not in identifiers:
        peak = theirs.sensed(theirs.peak_force_n)
        assert ours.peak_force_n == pytest.approx(peak, rel=1e-6), told
    until = theirs.stop_s if rings else 1.2 * theirs.end_s
    time = np.sort(rng.uniform(-0.002, until, 300))
    made = ours.sample(time)
    scale = max(theirs.peak_force_n, 1.0)
    np.testing.assert_allclose(made.force_n, theirs.force_n(time), rtol=0.0, atol=1e-6 * scale, err_msg=told)
    np.testing.assert_allclose(made.position_m, theirs.position_m(time), rtol=0.0, atol=1e-9, err_msg=told)
    np.testing.assert_allclose(made.actuator_m, theirs.actuator_m(time), rtol=0.0, atol=1e-10, err_msg=told)


@pytest.mark.parametrize("identifier", [None, *sorted(LIBRARY)])
def test_taps_agree(identifier: str | None) -> None:
    rng = np.random.default_rng(20)
    for _ in range(CASES):
        compare([] if identifier is None else [identifier], rng)


def test_taps_with_several_effects_agree() -> None:
    rng = np.random.default_rng(21)
    for _ in range(MIXTURES):
        compare(sorted(rng.choice(sorted(LIBRARY), rng.integers(2, 5), replace=False).tolist()), rng)


@pytest.mark.parametrize(
    "identifiers", [["viscous_friction", "periodic_friction"], ["stribeck_friction"], ["restoring_force"]]
)
def test_free_slides_agree(identifiers: list[str]) -> None:
    rng = np.random.default_rng(22)
    for direction in (1, -1):
        plant, _ = draw(identifiers, rng)
        ours = simulate_free_slide(
            Plant(**plant), TapInput(1.0, 10.0, direction=direction, start_m=0.01), 0.12
        )
        theirs = simulated.simulate_free_slide(
            simulated.Plant(**plant), 10.0, 0.12, simulated.Shot(direction=direction, start_m=0.01)
        )
        assert ours.displacement_m == pytest.approx(theirs.displacement_m, rel=1e-7)


@pytest.mark.parametrize("identifier", [None, "viscous_friction", "surface_tilt", "presliding_compliance"])
def test_driven_parts_agree(identifier: str | None) -> None:
    rng = np.random.default_rng(23)
    plant, _ = draw([] if identifier is None else [identifier], rng)
    plant |= {"mu_s": 0.2, "mu_k": 0.15}
    time = np.arange(0.0, 0.4, 1e-3)
    force = 60.0 * np.sin(2.0 * np.pi * 4.0 * time) + 30.0 * np.sin(2.0 * np.pi * 11.0 * time + 1.0)
    samples = np.linspace(0.0, 0.39, 100)
    ours = simulate_driven(Plant(**plant), TapInput(1.0, 30.0), time, force, samples)
    theirs = simulated.simulate_driven(
        simulated.Plant(**plant), 30.0, lambda t: float(np.interp(t, time, force)), 0.395
    )
    np.testing.assert_allclose(ours.position_m, theirs.position_m(samples), rtol=0.0, atol=1e-8)
    assert np.ptp(ours.position_m) > 1e-4
