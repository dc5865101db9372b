"""Laws of two covariates: found where one is not enough, proved, written out, and not made up."""

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.api.findings import write_findings
from impactcell.discrepancy import workflow
from impactcell.discrepancy.laws import (
    condense,
    covariates,
    finding,
    free_term,
    grammar,
    refit,
)
from impactcell.discrepancy.laws.tangent import Tangent
from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from impactcell.physics.bspline import tensor_basis
from impactcell.physics.effect_contract import contract_faults
from impactcell.physics.effects import withdraw_effect
from impactcell.physics.free_pair_forms import column_pair_forms
from impactcell.physics.outside_effects import load_effect, offer_effects
from tests.discrepancy.pairs import COLUMN, DRAG, HIGHEST, LOWEST, oil_campaign, thinning

pytestmark = pytest.mark.long
SHOTS = 26
"""Shots of a campaign: few, for the sake of time."""
FEW = ("hertz_contact",)
"""A library without anything like what is hidden, and quick to search."""


@pytest.fixture(scope="module")
def oil() -> DiscrepancyResult:
    """Fewer forms and places are fitted than a user has, for the sake of time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workflow, "hold_against_free_forms", lambda _context, selection: selection)
        patch.setattr(free_term, "PLACES", 2)
        patch.setattr(free_term, "FINER", {})
        patch.setattr(refit, "REFITTED", 6)
        patch.setattr(refit, "is_simple", lambda _: False)
        return investigate(oil_campaign(8601, shots=SHOTS), seed=1, library=FEW)


@pytest.mark.slow
def test_drag_is_found_to_go_with_speed_and_column(oil: DiscrepancyResult) -> None:
    assert oil.law is not None
    assert oil.law.refused == ""
    assert oil.law.term.form.place.startswith("free_drag_over_speed_and_column")
    law = oil.law.proposed
    assert law is not None
    u, w = np.meshgrid(np.linspace(0.01, 0.1, 5), np.linspace(16.0, 39.0, 7))
    true = DRAG["viscous_coefficient_n_s_per_m"] * np.vectorize(thinning)(w.ravel())
    np.testing.assert_allclose(law.values(np.column_stack([u.ravel(), w.ravel()])), true, rtol=0.03)
    assert oil.law.change.after.trace < 1.1 < 2.0 < oil.law.change.before.trace


@pytest.mark.slow
def test_it_is_written_with_both_ranges_and_named_from_then_on(
    oil: DiscrepancyResult, tmp_path: Path
) -> None:
    write_findings(oil, oil_campaign(8601, shots=SHOTS), tmp_path, "a campaign")
    law = json.loads((tmp_path / "result.json").read_text())["law"]
    assert law["covariates"] == ["speed", COLUMN]
    assert LOWEST <= law["tested_range"][COLUMN]["low"] < law["tested_range"][COLUMN]["high"] <= HIGHEST
    assert law["tested_range"]["speed"]["unit"] == "m/s"
    page = (tmp_path / "report.html").read_text()
    assert "speed from 0 to" in page
    assert "oil temperature (°C) from 1" in page
    file = tmp_path / law["file"]
    other = file.with_name("law_of_thinning_oil.py")
    other.write_text(file.read_text().replace(file.stem, other.stem))
    assert contract_faults(load_effect(other)) == []
    (name,) = offer_effects([other])
    try:
        result = investigate(oil_campaign(8603, shots=SHOTS), seed=1, library=(*FEW, name))
        assert result.added == (name,)
        assert result.law is None
    finally:
        withdraw_effect(name)


def test_a_column_of_few_values_is_told_and_nothing_proposed(monkeypatch: pytest.MonkeyPatch) -> None:
    shots = [SimpleNamespace(columns=((COLUMN, t),), covariates={COLUMN: t}) for t in (15.0, 20.0, 25.0) * 9]
    problem: Any = SimpleNamespace(shots=SimpleNamespace(items=shots))
    assert covariates.poor_columns(problem) == (COLUMN,)
    single: Any = SimpleNamespace(refused="no function of speed alone")
    said = finding._none_of_two(single, "nothing else", problem)
    assert "no function of speed alone; of two covariates: nothing else" in said
    assert f"the column {COLUMN} had fewer than 8 different values" in said


@pytest.mark.parametrize(("noise", "is_one"), [(0.0, True), (0.02, True), (0.5, False)])
def test_a_second_covariate_that_follows_the_first_is_none(noise: float, is_one: bool) -> None:
    rng = np.random.default_rng(2)
    u = rng.uniform(0.0, 0.1, 3000)
    w = 30.0 * u - 90.0 * u**2
    assert covariates._is_function_of(u, w + noise * w.std() * rng.standard_normal(3000)) is is_one


@pytest.mark.slow
def test_a_product_is_ranked_first_where_the_coefficients_are_a_products() -> None:
    """The quadratic likelihood of coefficients that are exactly known is told by least squares alone."""
    ends = ((0.0, 0.2), (15.0, 40.0))
    points = np.random.default_rng(3).uniform([0.0, 15.0], [0.2, 40.0], (4000, 2))
    basis = tensor_basis(points, ends, 7)
    truth = 300.0 * points[:, 0] * np.exp(-points[:, 1] / 11.0)
    information = 4.0 * basis.T @ basis  # noise of 0.5 where the function goes up to 15
    fitted = np.linalg.lstsq(basis, truth)[0]
    quadratic = Tangent(
        information, information @ fitted, *ends[0], 40_000, True, fitted, np.zeros(1), np.zeros((1, 40)),
        ends[1],
    )  # fmt: skip
    ranked = condense.rank_forms(quadratic)
    places = {grammar.name(entry.form): place for place, entry in enumerate(ranked)}
    # The cubic piece along w bends a little otherwise than the exponential: a second term may mend that.
    assert places["exp(-w/l) u"] < 5
    best = ranked[places["exp(-w/l) u"]]
    (shaped,) = best.terms
    assert sorted(shaped.shapes) == [(), (pytest.approx(11.0, rel=0.02),)]
    values = best.amplitudes[0] * shaped.values(points, 0.2, 40.0)
    np.testing.assert_allclose(values, truth, atol=0.02 * truth.max())
    assert max(entry.gain for entry in ranked) <= quadratic.most * (1.0 + 1e-9)


def test_a_law_over_a_column_is_null_where_a_cycle_does_not_say_it() -> None:
    for form in column_pair_forms(COLUMN):
        assert list(form.effect.columns) == [COLUMN]
        assert form.second_argument.startswith("p[")
        assert all(math.isnan(item.null) for item in form.effect.parameters[:4])
