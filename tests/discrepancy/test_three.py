"""Three effects hidden at once: each is named with what is tied with it; a law of no library is not three."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.search import model_selection, one_more
from impactcell.discrepancy.search.one_more import SearchState
from impactcell.discrepancy.search.policy import POLICY
from tests.discrepancy.study import Job, name_effects, quick_campaign

LIBRARY = (
    "viscous_friction", "surface_tilt", "hertz_contact", "quadratic_drag", "restoring_force",
    "stribeck_friction", "hunt_crossley_damping",
)  # fmt: skip
"""Effects that may be named here: fewer to try are faster."""


@pytest.mark.slow
def test_three_effects_are_named_each_with_what_it_closes_of_what_the_others_leave() -> None:
    hidden = ("viscous_friction", "restoring_force", "hertz_contact")
    found = name_effects(quick_campaign(Job("three", hidden, 3, shots=24)), library=LIBRARY)
    outcome = result_document(found)
    assert outcome["verdict"] == "named"
    assert {one["effect"] for one in outcome["effects"]} == set(hidden)
    assert outcome["remaining"]["explained"]
    for one in outcome["effects"]:
        assert one["held_out"]["closed_ci95"][0] > 0.0
        assert one["p_search"] <= 0.01
        assert one["parameters"].keys()
    smaller = {frozenset(model.effects): model for model in (one.fit for one in found.selection.alternatives)}
    pairs = [smaller[frozenset(hidden) - {left_out}] for left_out in hidden]
    assert all(np.mean(pair.residual**2) > POLICY.max_rms_at_floor**2 for pair in pairs)


@pytest.mark.long
def test_a_law_of_no_library_beside_two_effects_is_not_given_three_names(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whatever free forms would take away of what the search has named."""
    monkeypatch.setattr("impactcell.discrepancy.workflow.hold_against_free_forms", lambda _, named: named)
    hidden = ("viscous_friction", "hertz_contact", "late_friction")
    found = name_effects(quick_campaign(Job("three", hidden, 3, shots=24)), library=LIBRARY)
    assert max(len(one.effects) for one in found.selection.alternatives) == 3
    assert len(found.selection.added) < 3
    assert not found.conclusion.remaining.explained


def fits(*sets: str) -> list[Any]:
    """Models by the letters of their effects."""
    return [SimpleNamespace(fit=SimpleNamespace(effects=tuple(effects))) for effects in sets]


@pytest.mark.parametrize(("weak", "earns"), [("", True), ("ab", False), ("bc", False)])
def test_each_of_three_has_to_add_enough_beside_the_others(weak: str, earns: bool) -> None:
    """`weak` is the pair that is nearly as likely as all three; a pair outside of them does not matter."""
    context: Any = SimpleNamespace(
        gains_enough=lambda fewer, _: fewer.effects not in {tuple(weak), ("a", "d")}
    )
    state = SearchState({}, sets={2: fits("ab", "ad", "bc", "ac"), 3: fits("abc")})
    assert model_selection._each_earns(context, state, 3) is earns


def test_an_effect_is_looked_for_in_the_place_of_each_until_none_is_likelier(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """From a, b, x by a, b, c to no other: the pairs of every set that came first are asked."""
    asked: list[str] = []

    def beside(_: Any, state: SearchState, bases: list[str], size: int, most: int) -> SearchState:
        assert (size, most) == (3, POLICY.max_second_effects)
        asked.extend(bases)
        return replace(state, sets={3: fits("abc")})

    def smaller(_: Any, state: SearchState, size: int) -> tuple[SearchState, list[str]]:
        effects = state.best(size).effects
        return state, ["".join(one for one in effects if one != left_out) for left_out in effects]

    monkeypatch.setattr(one_more, "_fit_beside", beside)
    monkeypatch.setattr(one_more, "refit_smaller", smaller)
    context: Any = None
    state = one_more.exchange_each(context, SearchState({}, sets={3: fits("abx")}), 3)
    assert state.best(3).effects == ("a", "b", "c")
    assert asked == ["bx", "ax", "ab", "bc", "ac", "ab"]
