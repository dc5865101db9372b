"""Laws that no library lists: found from a spline, refitted, proved, written out, and not invented."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.api.findings import write_findings
from impactcell.campaign import Campaign
from impactcell.discrepancy.laws.grammar import ATOMS, Atom, evaluate, shaped_terms
from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from impactcell.german.findings import german_headline
from impactcell.physics import Effect, Plant, TapInput, simulate_tap
from impactcell.physics.effect_contract import contract_faults
from impactcell.physics.effects import find_effect, withdraw_effect
from impactcell.physics.outside_effects import offer_effects
from tests.discrepancy.study import Job, campaign

pytestmark = pytest.mark.slow

FEW = ("hertz_contact", "friction_drift")
"""A library without anything like what is hidden, and quick to search."""


def _dragged() -> Campaign:
    return campaign(Job("removed", ("quadratic_drag",), 8201, shots=24))


DRAG = 250.0
"""Coefficient of the simulator's quadratic drag [N s²/m²]."""


@pytest.fixture(scope="module")
def found() -> DiscrepancyResult:
    """Investigate a plant with quadratic drag without any drag in the library."""
    with (
        pytest.MonkeyPatch.context() as patch
    ):  # of names held against free forms, which have their own tests
        patch.setattr("impactcell.discrepancy.workflow.hold_against_free_forms", lambda _, named: named)
        return investigate(_dragged(), seed=1, library=FEW)


def test_the_law_is_named_by_its_form_and_proved(found: DiscrepancyResult) -> None:
    assert found.law is not None
    law = found.law.proposed
    assert law is not None
    assert found.law.term.form.effect.identifier == "free_drag_over_speed"
    assert law.functional_form == "u"
    upper = found.law.term.visited.upper
    assert law.values(np.array([upper]))[0] == pytest.approx(DRAG * upper, rel=0.02)
    assert found.law.change.after.trace < 1.1
    assert found.law.change.is_real()
    assert law.effect() is find_effect(law.identifier)  # found again, it is the effect that is there


def test_a_law_that_merely_contains_it_is_no_equivalent(found: DiscrepancyResult) -> None:
    assert found.law is not None
    assert not [item for item in found.law.equivalents if "u" in item.law.functional_form.split(" + ")]


def test_result_report_and_effect_file_say_the_same(found: DiscrepancyResult, tmp_path: Path) -> None:
    data = _dragged()
    write_findings(found, data, tmp_path, "a campaign")
    outcome = json.loads((tmp_path / "result.json").read_text())
    law = outcome["law"]
    assert law["form"] == "u"
    assert law["covariates"] == ["speed"]
    assert law["tested_range"]["speed"]["high"] > 0.05
    assert law["held_out"]["after"] < law["held_out"]["before"]
    assert outcome["law_refused"] is None
    assert [path.name for path in tmp_path.glob("law_of_*.py")] == [law["file"]]
    page = (tmp_path / "report.html").read_text()
    assert law["term"] == "quadratic_drag"
    assert "What would explain the rest: quadratic drag" in page
    assert (
        "Was den Rest erklären würde: Quadratischer Widerstand" in (tmp_path / "report.de.html").read_text()
    )
    assert f"--effects {law['file']} -o DIR" in page
    (interval,) = (one["ci95"] for one in law["parameters"].values())
    assert f"{interval[0]:.5g} to {interval[1]:.5g}" in page
    assert f"{law['held_out']['before']:.2f} auf {law['held_out']['after']:.2f}".replace(".", ",") in (
        german_headline(outcome)
    )
    space: dict[str, object] = {}
    exec((tmp_path / law["file"]).read_text(), space)
    effect = space["EFFECT"]
    assert isinstance(effect, Effect)
    assert effect.identifier == law["file"].removesuffix(".py")
    (parameter,) = effect.parameters
    value, (low, high) = (law["parameters"][parameter.name][key] for key in ("value", "ci95"))
    assert low < value < high
    drag = {effect.identifier: {parameter.name: value}}
    assert find_effect(effect.identifier).equation == effect.equation
    tap = TapInput(velocity_m_s=0.09, mass_kg=12.0, stroke_m=0.004)
    ours = simulate_tap(Plant(6e5, 465.0, 0.2, 0.15, effects=drag), tap)
    named = Plant(6e5, 465.0, 0.2, 0.15, effects={"quadratic_drag": {"drag_coefficient_n_s2_per_m2": DRAG}})
    assert ours.displacement_m == pytest.approx(simulate_tap(named, tap).displacement_m, rel=0.01)


def test_nothing_is_proposed_where_nothing_is_hidden() -> None:
    outcome = investigate(campaign(Job("none", (), 8203, shots=24)), seed=1)
    assert outcome.verdict == "no_gap"
    assert outcome.law is None


@pytest.mark.long
def test_a_law_with_a_memory_is_not_mistaken_for_one_of_position(monkeypatch: pytest.MonkeyPatch) -> None:
    # Names held against free forms have their own tests.
    monkeypatch.setattr("impactcell.discrepancy.workflow.hold_against_free_forms", lambda _, named: named)
    outcome = investigate(
        campaign(Job("outside", ("relaxing_contact",), 8204, shots=16)), seed=1, library=FEW
    )
    assert outcome.law is not None
    assert outcome.law.proposed is None
    assert "what is missing is no function of indentation" in outcome.law.refused


@given(st.sampled_from(ATOMS), st.floats(0.0, 2.0), st.data())
def test_an_atom_in_an_array_is_what_its_source_is_in_python(
    atom: Atom, u: float, data: st.DataObject
) -> None:
    shapes = {shape.name: data.draw(st.floats(0.05, 3.0)) for shape in atom.shapes}
    known = {"math": math, "max": max, "abs": abs, "u": u, "reference": 1.7, **shapes}
    expected = eval(atom.source, {"__builtins__": {}}, known)
    (value,) = evaluate(atom.source, np.array([u]), {"reference": 1.7, **shapes})
    assert value == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_terms_mean_something_on_all_of_their_range() -> None:
    for lower in (0.0, -0.3):
        u = np.linspace(lower, 0.5, 50)
        for item in shaped_terms(lower, 0.5, constant=True):
            assert np.isfinite(item.values(u, 0.5)).all(), item


def test_there_are_ten_thousand_starts_and_each_is_one_function() -> None:
    terms = list(shaped_terms(0.0, 1.0, constant=True))
    assert len(terms) + len(terms) ** 2 // 2 > 10_000
    assert len({(item.term, item.shapes) for item in terms}) == len(terms)


def test_the_effect_file_passes_the_contract_that_effects_are_held_to(
    found: DiscrepancyResult, tmp_path: Path
) -> None:
    assert found.law is not None
    law = found.law.proposed
    assert law is not None
    again = replace(law, identifier="law_from_a_file")
    file = tmp_path / "law_from_a_file.py"
    file.write_text(again.text())
    offered = offer_effects([file])
    try:
        assert offered == ("law_from_a_file",)
        assert contract_faults(find_effect("law_from_a_file")) == []
    finally:
        withdraw_effect("law_from_a_file")
