"""What a planner is given by mistake is refused by name, and limits changed on it are those it keeps."""

import math
import pickle
import re
import subprocess
import sys

import numpy as np
import pytest

from impactcell.errors import PhysicsError, PositioningError
from impactcell.numerics.raster import Raster
from impactcell.physics import Plant
from impactcell.physics.closed_form import displacement_of
from impactcell.positioning import Tap, TapPlanner, Unreachable

HANG_S = 300
"""Far longer than anything here takes; a loop in compiled code would hold the whole suite."""


def in_a_process(code: str) -> str:
    """What a process says that is ended from outside if it does not end by itself."""
    imports = "import math\nfrom impactcell.errors import ImpactCellError\n"
    imports += "from impactcell.positioning import Tap, TapPlanner\n"
    body = (
        f"try:\n    print({code})\nexcept ImpactCellError as error:\n    print(type(error).__name__, error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", imports + body], capture_output=True, text=True, timeout=HANG_S, check=True
    )
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("TapPlanner(max_velocity_m_s=math.inf).next_tap(.0123, 18.9)", "max_velocity_m_s must be positive"),
        ("TapPlanner().next_tap(.01, 18.9, math.nan)", "position of the part must be a number of metres"),
        ("TapPlanner().next_tap(.01, 18.9, 1e6)", "positions are in metres"),
        ("TapPlanner().next_tap(.01, 1e-6)", "too light to plan for: below 0.0052 kg"),
        ("TapPlanner().observe(Tap(-.03, .5e-3), .0015, 18.9)", "its velocity must be positive"),
        ("TapPlanner().observe(Tap(0.0, 0.0), .0015, 18.9)", "its velocity must be positive"),
    ],
)
def test_what_has_no_end_is_refused(code: str, told: str) -> None:
    assert told in in_a_process(code)


@pytest.mark.slow
def test_a_push_without_end_is_no_endless_loop() -> None:
    told = in_a_process(
        "__import__('impactcell.physics.closed_form', fromlist=['_']).displacement_of(math.nan, *(__import__("
        "'numpy').array(a) for a in ([1e-3], [[6.5e5, 465., .2, .15, 0.]], [1.], [18.9, 9.81])))"
    )
    assert told.startswith("PhysicsError the part would swing on its actuator without end")


def test_the_longest_push_of_a_light_part_has_its_end() -> None:
    """An undamped part of 0.1 kg that sticks no harder than it slides swings 1.5 m long at 5 mm/s."""
    moved = displacement_of(
        5e-3, np.array([1.5]), np.array([[6.5e5, 0.0, 0.2, 0.2, 0.0]]), np.ones(1), np.array([0.1, 9.81])
    )
    assert moved[0] == pytest.approx(1.5, rel=1e-3)
    with pytest.raises(PhysicsError, match="without end"):
        displacement_of(
            5e-6, np.array([1.5]), np.array([[6.5e5, 0.0, 0.2, 0.2, 0.0]]), np.ones(1), np.array([0.1, 9.81])
        )


@pytest.mark.parametrize("position_m", [40.0, 300.0, 3000.0, math.inf, "0.04", None])
def test_a_position_in_mm_or_that_is_none_is_refused(position_m: float) -> None:
    with pytest.raises(PositioningError, match="metres"):
        TapPlanner().next_tap(0.01, 18.9, position_m)


def test_a_position_far_beyond_the_travel_is_refused_and_one_just_beyond_it_is_not() -> None:
    planner = TapPlanner(tolerance_m=50e-6, travel_m=(0.0, 40e-3), two_sided=True)
    with pytest.raises(PositioningError, match=r"cannot lie at 5 m, far beyond the travel of 0 to 0\.04 m"):
        planner.next_tap(-5e-3, 18.9, 5.0)
    assert isinstance(planner.next_tap(-5e-3, 18.9, 41e-3), Tap)


@pytest.mark.parametrize("remaining_m", [1e308, -1e6, 12.3, 1.0, "0.01", None, True])
def test_a_distance_that_no_cell_has_is_refused(remaining_m: float) -> None:
    with pytest.raises(PositioningError, match="metres"):
        TapPlanner(two_sided=True).next_tap(remaining_m, 18.9)


@pytest.mark.parametrize(
    ("travel_m", "position_m", "remaining_m", "told"),
    [
        ((-math.inf, math.inf), 0.0, 4.0, "cannot lie 4 m .* in metres: if that was meant in mm, give 0.004"),
        ((-math.inf, math.inf), 0.0, 400.0, "cannot lie 400 m .* if that was meant in µm, give 0.0004"),
        ((0.0, math.inf), 0.0, 1.0, "cannot lie 1 m .* meant in mm, give 0.001"),
        ((0.0, 0.04), 0.036, 4.0, "cannot lie 4 m .* meant in mm, give 0.004"),
        ((0.0, 0.04), 0.036, -0.1, "cannot lie 0.1 m from its target; distances are in metres: if"),
    ],
)
def test_a_distance_in_mm_is_told_by_the_travel_or_without_one_from_a_metre_on(
    travel_m: tuple[float, float], position_m: float, remaining_m: float, told: str
) -> None:
    """4 mm that were meant as 4.0 were answered by a full tap."""
    planner = TapPlanner(tolerance_m=20e-6, travel_m=travel_m, two_sided=True)
    with pytest.raises(PositioningError, match=told):
        planner.next_tap(remaining_m, 18.9, position_m)


def test_a_target_beyond_the_travel_but_not_far_beyond_is_out_of_reach_as_before() -> None:
    planner = TapPlanner(tolerance_m=20e-6, travel_m=(0.0, 2.0))
    assert planner.next_tap(0.041, 18.9, 1.96) == Unreachable("the target lies 1.000 mm beyond the travel")
    assert isinstance(planner.next_tap(1.5, 18.9, 0.0), Tap)


def test_true_is_no_number() -> None:
    planner = TapPlanner()
    with pytest.raises(PositioningError, match="mass of the part must be a positive number of kg, not True"):
        planner.next_tap(0.004, True)
    with pytest.raises(PositioningError, match="cannot learn from a displacement of True m"):
        planner.observe(Tap(0.03, 0.5e-3), True, 18.9)
    with pytest.raises(PositioningError, match="max_velocity_m_s must be positive, not True"):
        TapPlanner(max_velocity_m_s=True)


@pytest.mark.parametrize(
    "options",
    [
        {"tolerance_m": math.inf}, {"tolerance_m": "20"}, {"max_velocity_m_s": math.nan},
        {"max_stroke_m": 1.5e3}, {"max_stroke_m": None}, {"max_force_n": "60"},
        {"overshoot_probability": "0.1"},
    ],
)  # fmt: skip
def test_a_limit_that_no_cell_has_is_named(options: dict[str, float]) -> None:
    with pytest.raises(PositioningError, match=f"tap planner: .*{next(iter(options))}"):
        TapPlanner(**options)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"tolerance_m": 20.0}, "tolerance_m is 20, .* meant in µm, give 2e-05"),
        ({"tolerance_m": 0.02}, "tolerance_m is 0.02, .* meant in mm, give 2e-05"),
        ({"tolerance_m": "20e-6"}, "tolerance_m must be positive, not '20e-6'"),
        ({"max_velocity_m_s": 6000.0}, "max_velocity_m_s is 6000, .* meant in mm/min, give 0.1"),
        ({"max_velocity_m_s": 100.0}, "max_velocity_m_s is 100, .* meant in mm/s, give 0.1"),
        ({"max_velocity_m_s": "0.1"}, "max_velocity_m_s must be positive, not '0.1'"),
        ({"max_stroke_m": 1.5}, "max_stroke_m is 1.5, .* meant in mm, give 0.0015"),
        ({"max_stroke_m": 1500.0}, "max_stroke_m is 1500, .* meant in µm, give 0.0015"),
        ({"max_force_n": "a"}, "max_force_n must be positive, not 'a'"),
        ({"overshoot_probability": "x"}, "overshoot_probability lies between 0 and 1, not 'x'"),
        ({"travel_m": 0.04}, r"travel_m is to be two positions in m, \(0.0, 0.04\) say, not 0.04"),
        ({"travel_m": ("a", "b")}, r"travel_m is to be two positions in m, .* not \('a', 'b'\)"),
        ({"travel_m": (0.0, 0.02, 0.04)}, "travel_m is to be two positions in m"),
        ({"travel_m": (0.0, math.nan)}, "travel_m must be in order"),
        ({"travel_m": (0.0, 40.0)}, r".*no travel ends at 40 m; if that was meant in mm, give \(0, 0.04\)"),
        ({"velocity_raster": 0.001}, "velocity_raster is to be an .*Raster.* not 0.001"),
        ({"stroke_raster": None}, "stroke_raster is to be an .*Raster.* not None"),
        (
            {"velocity_raster": Raster(0.2, 0.2)},
            "velocity_raster begins with 0.2, above max_velocity_m_s, 0.1: no tap can be commanded; raise",
        ),
        ({"velocity_raster": Raster(0.2)}, "velocity_raster begins with 0.2, above max_velocity_m_s, 0.1"),
        ({"velocity_raster": Raster(1e-3, 0.15)}, "velocity_raster begins with 0.15, above"),
        (
            {"stroke_raster": Raster(5e-3, 5e-3)},
            "stroke_raster begins with 0.005, above max_stroke_m, 0.0015: no tap .* max_stroke_m to 0.005",
        ),
        ({"two_sided": "no"}, "two_sided is to be True or False, not 'no'"),
        ({"two_sided": None}, "two_sided is to be True or False, not None"),
    ],
)
def test_a_limit_in_another_unit_or_that_is_none_is_told_when_it_is_made_and_when_it_is_set(
    options: dict[str, object], told: str
) -> None:
    with pytest.raises(PositioningError, match=f"^tap planner: {told}"):
        TapPlanner(**options)  # type: ignore[arg-type]
    planner = TapPlanner()
    for name, value in options.items():
        setattr(planner, name, value)
    with pytest.raises(PositioningError, match=f"^tap planner: {told}"):
        planner.next_tap(0.01, 18.9)


def test_a_travel_that_is_set_the_wrong_way_round_is_told_as_that() -> None:
    planner = TapPlanner()
    planner.travel_m = (1.0, 0.0)
    with pytest.raises(PositioningError, match=r"travel_m must be in order, not \(1.0, 0.0\)"):
        planner.next_tap(0.01, 18.9)


@pytest.mark.parametrize(
    ("friction", "told"),
    [
        (("x", 0.1), "friction of 'x' with a standard deviation of 0.1"),
        ((None, 0.1), "friction of None"),
        ((0.19, None), "standard deviation of None"),
        ((0.19, 1e300), "friction with a standard deviation of 1e+300: no surface"),
        ((19.0, 0.2), "friction of 19: no surface has it; if that was meant in %, give 0.19"),
    ],
)
def test_a_friction_that_is_none_is_told(friction: tuple[float, float], told: str) -> None:
    with pytest.raises(PositioningError, match=f"^cannot use a .*{told.replace('+', '[+]')}"):
        TapPlanner().observe_friction(*friction)


def test_what_is_no_signature_no_tap_and_no_mass_is_told() -> None:
    planner = TapPlanner()
    with pytest.raises(PositioningError, match="cannot learn from 'x': that is no signature"):
        planner.observe_signature("x")  # type: ignore[arg-type]
    with pytest.raises(PositioningError, match="cannot use None: that is no tap"):
        planner.force(None, 18.9)  # type: ignore[arg-type]
    with pytest.raises(PositioningError, match="mass of the part must be a positive number of kg, not 'a'"):
        planner.force(Tap(0.05, 1e-3), "a")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("tap", "moved_m", "told"),
    [
        (Tap(0.03, 0.5e-3), 4.0, "more than .* m; if that was meant in mm, give 0.004"),
        (Tap(0.03, 0.5e-3), 400.0, "more than .* m; if that was meant in µm, give 0.0004"),
        (Tap(0.1, 1.5e-3), 10.7, "if that was meant in mm, give 0.0107"),
        (Tap(0.03, math.inf), 4.0, "if that was meant in mm, give 0.004"),
        (Tap(0.03, 0.5e-3), -0.004, "displacement of -0.004 m: it is positive along the tap"),
        (Tap(0.03, 0.5e-3, -1), -4.0, "displacement of -4 m: it is positive along the tap"),
        (Tap(0.03, 0.5e-3), "0.004", "displacement of '0.004' m"),
    ],
)
def test_nothing_is_learned_from_a_displacement_that_no_tap_makes(
    tap: Tap, moved_m: float, told: str
) -> None:
    planner = TapPlanner(two_sided=True)
    before = planner.posterior
    with pytest.raises(PositioningError, match=f"^cannot learn from a .*{told}"):
        planner.observe(tap, moved_m, 18.9)
    assert planner.posterior is before


@pytest.mark.parametrize("mu_k", [0.02, 0.19])
@pytest.mark.parametrize("velocity_m_s", [0.005, 0.1, 1.0])
def test_what_the_springiest_contact_makes_of_a_tap_is_learned_from(mu_k: float, velocity_m_s: float) -> None:
    """It leaves at twice the actuator's speed; an encoder that scatters may show a part a little behind.

    A displacement that scatters by 8 % was refused after a slow push, three of its deviations on.
    """
    tap, furthest = Tap(velocity_m_s, 1.5e-3), 4.0 * velocity_m_s**2 / (2.0 * mu_k * 9.81) + 1.5e-3
    for moved in (furthest, 1.3 * furthest, -2e-5):
        planner = TapPlanner(plant={"mu_k": mu_k})
        before = planner.posterior
        planner.observe(tap, moved, 18.9)
        assert planner.posterior is not before


@pytest.mark.parametrize(
    ("plant", "told"),
    [
        ({"mu_s": 0}, "plant: mu_s must be positive, not 0"),
        ({"mu_k": 0}, "plant: mu_s must be positive, not 0"),
        ({"mu_s": 0.2, "mu_k": 0.0}, "plant: mu_k must be positive, not 0.0"),
        (Plant(6.5e5, 465.0, 0.2, 0.0), "plant: mu_k must be positive, not 0.0"),
        ({"mu_s": "0.2"}, "plant: mu_s must be a number, not '0.2'"),
        ({"stiffness_n_per_m": None}, "plant: stiffness_n_per_m must be a number, not None"),
        ({"mu_s": 0.1, "mu_k": 0.3}, "plant: mu_k, 0.3, is above mu_s, 0.1"),
        ("x", "plant is a Plant, or some of its fields by name, not 'x'"),
        ([("mu_s", 0.2)], "plant is a Plant, or some of its fields by name"),
        (0, "plant is a Plant, or some of its fields by name, not 0"),
    ],
)
def test_a_plant_that_cannot_be_planned_with_is_told(plant: Plant | dict[str, float], told: str) -> None:
    with pytest.raises(PositioningError, match=re.escape(told)):
        TapPlanner(plant=plant)


@pytest.mark.parametrize(
    ("tap", "told"),
    [
        (None, "cannot use None: that is no tap"),
        (Unreachable("too far"), "that is no tap"),
        (Tap(math.inf, 1e-3), "velocity must be positive"),
        (Tap(0.05, 0.0), "stroke must be positive"),
        (Tap(0.05, -1e-3), "stroke must be positive"),
        (Tap(0.05, 1e-3, 0), "must be 1 or -1"),
        (Tap(0.05, 1e-3, position_m=40.0), "positions are in metres"),
        (Tap(3.0, 0.5e-3), "tap at 3 m/s, where none is faster than 1 m/s"),
        (Tap(2000.0, 0.5e-3), "tap at 2000 m/s, .*; if that was meant in mm/min, give 0.0333"),
        (
            Tap(0.03, 1.0),
            "stroke of 1 m, where none is longer than 0.1 m; if that was meant in mm, give 0.001",
        ),
        (Tap(0.03, 0.5e-3, -1), "direction -1: this cell strikes from one side only"),
    ],
)
def test_nothing_is_learned_from_what_is_no_tap(tap: Tap, told: str) -> None:
    planner = TapPlanner()
    before = planner.posterior
    with pytest.raises(PositioningError, match=told):
        planner.observe(tap, 1e-3, 18.9)
    assert planner.posterior is before


def test_nothing_is_learned_from_a_part_too_light_to_plan_for() -> None:
    planner = TapPlanner()
    before = planner.posterior
    with pytest.raises(PositioningError, match=r"tap at 1e-09 kg: below 0.0052 kg the damping"):
        planner.observe(Tap(0.05, 1e-3), 1e-3, 1e-9)
    assert planner.posterior is before


def test_a_tap_beyond_limits_that_were_lowered_meanwhile_is_learned_from() -> None:
    """It was planned within those before; a faster cell learns from taps that others do not make."""
    planner = TapPlanner(two_sided=True)
    planner.max_velocity_m_s, planner.max_stroke_m = 0.02, 0.2e-3
    planner.observe(Tap(0.03, 0.5e-3, -1), 0.3e-3, 18.9)
    fast = TapPlanner(max_velocity_m_s=2.0)
    fast.observe(Tap(2.0, 0.5e-3), 0.3, 18.9)
    assert (planner.posterior.taps, fast.posterior.taps) == (1, 1)


def test_a_planner_resumes_from_a_posterior_alone() -> None:
    planner = TapPlanner()
    with pytest.raises(PositioningError, match="resume takes what `posterior` gave, not None"):
        planner.resume(None)
    planner.resume(pickle.loads(pickle.dumps(TapPlanner().posterior)))


def test_limits_that_are_changed_are_planned_with() -> None:
    """As a planner that was made with them: what it has worked out within others is not used."""
    planner = TapPlanner(tolerance_m=20e-6)
    assert isinstance(planner.next_tap(0.02, 18.9), Tap)
    changed = {"max_velocity_m_s": 0.01, "max_stroke_m": 0.2e-3, "max_force_n": 120.0}
    for name, value in changed.items():
        setattr(planner, name, value)
    tap = planner.next_tap(0.02, 18.9)
    assert isinstance(tap, Tap)
    assert tap == TapPlanner(tolerance_m=20e-6, **changed).next_tap(0.02, 18.9)
    assert tap.velocity_m_s <= 0.01
    assert tap.stroke_m <= 0.2e-3
    assert planner.force(tap, 18.9) <= 120.0
    planner.overshoot_probability = 1e-9
    tap = planner.next_tap(0.02, 18.9)
    assert not isinstance(tap, Tap) or tap.overshoot_probability <= 1e-9
    planner.max_velocity_m_s = -1.0
    with pytest.raises(PositioningError, match="max_velocity_m_s must be positive, not -1"):
        planner.next_tap(0.02, 18.9)


def test_tolerance_travel_and_side_are_changed_as_before() -> None:
    planner = TapPlanner(tolerance_m=20e-6)
    planner.tolerance_m = 1e-3
    assert planner.next_tap(0.9e-3, 18.9) is None
    assert isinstance(planner.next_tap(-2e-3, 18.9), Unreachable)
    planner.two_sided = True
    assert isinstance(planner.next_tap(-2e-3, 18.9, 10e-3), Tap)
    planner.travel_m = (9e-3, 40e-3)
    answer = planner.next_tap(-3e-3, 18.9, 10e-3)
    assert answer == Unreachable("the target lies 2.000 mm beyond the travel")


def test_the_force_that_a_part_takes_is_told_where_the_limit_forbids_it() -> None:
    answer = TapPlanner(tolerance_m=20e-6, max_force_n=50.0).next_tap(0.02, 18.9)
    assert isinstance(answer, Unreachable)
    assert answer.reason.startswith(
        "no tap within max_force_n, 50 N, moves a part of 18.9 kg at friction 0.190"
    )
    (needed,) = re.findall(r"the gentlest that does may take (\d+) N$", answer.reason)
    assert 0.25 * 18.9 * 9.81 < int(needed) < 70  # what breaks it away, by the nominal plant; 70 N is enough
    enough = TapPlanner(tolerance_m=20e-6, max_force_n=float(needed)).next_tap(0.02, 18.9)
    assert not isinstance(enough, Unreachable) or "max_force_n" not in enough.reason


def test_a_part_that_no_force_moves_within_velocity_and_stroke_is_not_blamed_on_the_limit_of_force() -> None:
    answer = TapPlanner(max_velocity_m_s=0.01, max_stroke_m=0.05e-3, max_force_n=60.0).next_tap(5e-3, 60.0)
    assert isinstance(answer, Unreachable)
    assert answer.reason.startswith("no tap up to 0.01 m/s and 0.05 mm moves a part of 60.0 kg")


@pytest.mark.parametrize("max_force_n", [math.inf, 600.0])
def test_taps_that_move_nothing_to_be_seen_are_not_told_as_ones_that_overshoot(max_force_n: float) -> None:
    """A stroke of 0.1 µm, meant as 0.1 mm: the safest tap overshot with 1."""
    answer = TapPlanner(tolerance_m=20e-6, max_stroke_m=1e-7, max_force_n=max_force_n).next_tap(4e-3, 18.9)
    assert isinstance(answer, Unreachable)
    assert answer.reason.startswith("no tap up to 0.1 m/s and 0.0001 mm moves a part of 18.9 kg")
