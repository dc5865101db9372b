"""What the page shows of a cycle is the table of published quantities, whatever stands in it."""

import json
import math
from dataclasses import replace

import pytest

from impactcell.quantities import CYCLE, MODULE
from impactcell.records import Coefficient, ModuleStatus, Quality
from impactcell.web.cell_view import CellView
from impactcell.web.interface import CellNews
from impactcell.web.listed_values import listed_values
from impactcell.web.messages import Messages
from tests.snapshots import make_capture, make_snapshot

ALL = (*CYCLE, *MODULE)


@pytest.mark.parametrize("language", ["en", "de"])
def test_every_value_has_its_line_in_both_languages(language: str) -> None:
    listed = [value for folder in listed_values(language).values() for value in folder]
    shown = {value.path for value in listed} | {f"{value.path}StdDev" for value in listed}
    assert {quantity.path for quantity in ALL if not quantity.is_array} <= shown
    titles = {quantity.path: quantity.title[language == "de"] for quantity in ALL}
    assert all(value.title == titles[value.path] for value in listed)
    assert len({value.title for value in listed}) == len(listed), "two lines of one name"


def test_a_cycle_that_has_not_been_is_no_number() -> None:
    forms = {value.path: value.form for folder in listed_values("en").values() for value in folder}
    assert forms["Batch/LastShiftCycle"] == "cycle", "0 before the first: a dash"
    assert forms["Module/CyclesMissed"] == "count", "0 is a number"
    assert forms["Wear/CyclesToLimit"] == forms["Wear/CyclesToLimitLow"] == "cycles", "no part of a cycle"


@pytest.mark.parametrize(
    ("path", "std"),
    [
        ("Friction/StaticFriction", 0.002),
        ("Friction/StaticFrictionByForce", 0.003),
        ("Friction/StaticFrictionByDistance", 0.004),
        ("Friction/KineticFriction", 0.001),
        ("Wear/Level", 0.005),
        ("Wear/RatePer1000Cycles", 0.006),
        ("Batch/Offset", 0.007),
        ("Batch/LastShift", 0.008),
    ],
)
def test_a_value_that_is_estimated_has_its_standard_deviation_beside_it(path: str, std: float) -> None:
    snapshot = make_snapshot(make_capture())
    friction = replace(
        snapshot.friction,
        by_force=Coefficient(0.21, 0.003, Quality.GOOD),
        by_distance=Coefficient(0.22, 0.004, Quality.GOOD),
        mu_k=Coefficient(0.15, 0.001, Quality.GOOD),
    )
    wear = replace(snapshot.wear, level_std=0.005, rate_std=6e-6)
    batch = replace(snapshot.batch, offset_std=0.007, last_shift=0.03, last_shift_std=0.008)
    view = CellView("press-1")
    view.take(CellNews("press-1", replace(snapshot, friction=friction, wear=wear, batch=batch)))
    assert json.loads(view.encode("card"))["values"][f"{path}StdDev"] == pytest.approx(std)
    quantities = {quantity.path: quantity for quantity in CYCLE}
    assert quantities[f"{path}StdDev"].unit is quantities[path].unit
    assert quantities[f"{path}StdDev"].has_history == quantities[path].has_history


def test_a_card_has_every_value_in_the_unit_of_its_node() -> None:
    snapshot, status = make_snapshot(make_capture(3)), ModuleStatus(connected=True, received=3)
    view = CellView("press-1")
    view.take(CellNews("press-1", snapshot, status=status))
    card = json.loads(view.encode("card"))
    sources = [(quantity, snapshot) for quantity in CYCLE] + [(quantity, status) for quantity in MODULE]  # type: ignore[misc]
    for quantity, source in sources:
        if quantity.is_array:
            continue
        value, quality = quantity.read(source)  # type: ignore[arg-type]
        shown = card["values"][quantity.path]
        if isinstance(value, float):
            assert shown is None if value != value else shown == pytest.approx(value, rel=1e-4)
        else:
            assert shown == value
        assert card["qualities"].get(quantity.path, "good") == quality.name.lower()


def test_a_limit_that_is_never_reached_is_not_one_of_which_nothing_is_known() -> None:
    snapshot = make_snapshot(make_capture())
    wear = replace(snapshot.wear, cycles_to_limit=316.0, cycles_to_limit_low=math.nan)
    view = CellView("press-1")
    view.take(CellNews("press-1", replace(snapshot, wear=wear)))
    values = json.loads(view.encode("card"))["values"]
    told = [values[f"Wear/CyclesToLimit{end}"] for end in ("", "Low", "High")]
    assert told == [316.0, None, math.inf]


def test_only_what_has_changed_is_said_to_have() -> None:
    view = CellView("press-1")
    first = make_snapshot(make_capture(1))
    assert view.take(CellNews("press-1", first)) == {"card", "detail", "alarms"}
    later = make_snapshot(make_capture(2))
    object.__setattr__(later, "alarms", first.alarms)  # as a cycle in which no alarm moves
    assert view.take(CellNews("press-1", later)) == {"card", "detail"}
    assert view.take(CellNews("press-1", status=view.status)) == set()


@pytest.mark.parametrize(
    ("language", "title", "found"),
    [
        ("en", "Last shift, as estimated by now", "as they were found"),
        ("de", "Letzter Sprung, nach jetziger Schätzung", "wie sie gefunden wurden"),
    ],
)
def test_two_sizes_of_one_shift_say_what_each_is(language: str, title: str, found: str) -> None:
    """The alarm and the trend tell a shift as it was found, the value as it is estimated since."""
    titles = {value.path: value.title for folder in listed_values(language).values() for value in folder}
    assert titles["Batch/LastShift"] == title
    assert found in Messages(language).for_script()["shifts"]


def test_a_standard_deviation_without_a_value_of_its_own_is_shown_as_a_band() -> None:
    forms = {value.path: value.form for folder in listed_values("de").values() for value in folder}
    assert forms["Wear/LevelCommonStdDev"] == "band"
    assert "Wear/LevelStdDev" not in forms
