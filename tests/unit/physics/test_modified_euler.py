"""The paper's scheme converges to the located motion at first order, as switching on a grid must."""

import pytest

from impactcell.errors import NoStopError, PhysicsError
from impactcell.physics import Plant, TapInput, simulate_tap
from tests.modified_euler import simulate_modified_euler

PLANT = Plant(6.5e5, 465.0, 0.2, 0.152, effects={"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0}})


@pytest.mark.slow
@pytest.mark.parametrize(
    "tap",
    [
        TapInput(0.1, 18.9, 1.5e-3),
        TapInput(0.02, 18.9, 1.5e-3),
        TapInput(0.05, 18.9, halts_at_separation=True),
    ],
)
def test_it_converges(tap: TapInput) -> None:
    exact = simulate_tap(PLANT, tap)
    errors = []
    for step in (1e-5, 1e-6):
        grid = simulate_modified_euler(PLANT, tap, step)
        assert grid.sliding_distance_m == pytest.approx(exact.sliding_distance_m, rel=1e-3)
        errors.append(
            max(
                abs(grid.peak_force_n / exact.peak_force_n - 1.0),
                abs(grid.displacement_m / exact.displacement_m - 1.0),
            )
        )
    assert errors[0] < 2e-4
    assert errors[1] < 0.5 * errors[0]


def test_it_knows_no_effects_and_no_endless_push() -> None:
    tilted = Plant(6.5e5, 465.0, 0.2, 0.152, effects={"surface_tilt": {"tilt_rad": 0.01}})
    with pytest.raises(PhysicsError, match="without surface_tilt"):
        simulate_modified_euler(tilted, TapInput(0.05, 18.9, 1e-3), 1e-5)
    with pytest.raises(PhysicsError, match="step_s must be positive"):
        simulate_modified_euler(PLANT, TapInput(0.05, 18.9, 1e-3), 0.0)
    with pytest.raises(NoStopError, match="command a stroke"):
        simulate_modified_euler(PLANT, TapInput(0.05, 18.9), 1e-3)
