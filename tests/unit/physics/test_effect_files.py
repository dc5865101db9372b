"""The effects in config/effects keep the contract, and do what an independent integrator does."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from scipy.integrate import solve_ivp

from impactcell.physics import Plant, TapInput, simulate_free_slide
from impactcell.physics.effect_contract import contract_faults
from impactcell.physics.effects import withdraw_effect
from impactcell.physics.outside_effects import load_effect, offer_effects

DIRECTORY = Path(__file__).resolve().parents[3] / "config" / "effects"
FILES = sorted(DIRECTORY.glob("*.py"))
MASS_KG, MU_K, GRAVITY = 18.9, 0.152, 9.81
LAWS: dict[str, tuple[dict[str, float], Callable[[float, float], float]]] = {
    "directional_viscous_friction": ({"asymmetry_n_s_per_m": 40.0}, lambda x, v: -40.0 * abs(v)),
    "position_force": (
        {"force_n": 6.0, "position_m": 0.002, "width_m": 0.001},
        lambda x, v: 6.0 * math.exp(-((x - 0.002) ** 2) / 2e-6),
    ),
}


@pytest.fixture
def offered() -> Iterator[None]:
    names = offer_effects([DIRECTORY])
    yield
    for name in names:
        withdraw_effect(name)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_it_keeps_the_contract(file: Path) -> None:
    assert contract_faults(load_effect(file)) == []


@pytest.mark.usefixtures("offered")
@pytest.mark.parametrize("identifier", [file.stem for file in FILES])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_slide_is_that_of_an_independent_integrator(identifier: str, direction: int) -> None:
    values, force = LAWS[identifier]
    plant = Plant(6.5e5, 465.0, 0.2, MU_K, effects={identifier: values})
    moved = simulate_free_slide(plant, TapInput(1.0, MASS_KG, direction=direction), 0.1)

    def motion(_t: float, state: list[float]) -> list[float]:
        x, v = state
        return [v, (force(x, v) - direction * MU_K * MASS_KG * GRAVITY) / MASS_KG]

    def stops(_t: float, state: list[float]) -> float:
        return state[1]

    stops.terminal = True  # type: ignore[attr-defined]
    stops.direction = -direction  # type: ignore[attr-defined]
    slid = solve_ivp(motion, (0.0, 1.0), [0.0, 0.1 * direction], rtol=1e-10, atol=1e-14, events=stops)
    assert moved.displacement_m == pytest.approx(abs(slid.y_events[0][0][0]), rel=1e-6)
