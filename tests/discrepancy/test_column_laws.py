"""Laws over a further column of `shots.csv`: found, proved on friction factors, written out, not invented."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from impactcell.api.findings import write_findings
from impactcell.discrepancy.search import Part
from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from impactcell.physics.effect import Covariates
from impactcell.physics.effect_contract import contract_faults
from impactcell.physics.effects import withdraw_effect
from impactcell.physics.free_column_forms import column_form, printed
from impactcell.physics.outside_effects import load_effect, offer_effects
from tests.discrepancy.study import Job, with_column

pytestmark = pytest.mark.slow

COLUMN = "oil temperature (°C)"
FEW = ("hertz_contact",)
"""A library without anything like what is hidden, and quick to search."""


def softening(temperature: float) -> float:
    """Friction that falls with temperature, by an Arrhenius-like decay to a floor."""
    return 1.0 + 0.8 * math.exp(-temperature / 12.0)


def job(seed: int) -> Job:
    return Job("removed", (), seed, shots=30)


def under_another_name(file: Path) -> Path:
    """Write an effect file anew, as one that this process has not found itself."""
    other = file.with_name("law_of_oil.py")
    other.write_text(file.read_text().replace(file.stem, other.stem))
    return other


@pytest.fixture(scope="module")
def found() -> DiscrepancyResult:
    return investigate(with_column(job(8301), COLUMN, 15.0, 40.0, softening), seed=1, library=FEW)


def test_friction_is_found_to_go_with_the_column(found: DiscrepancyResult) -> None:
    assert found.law is not None
    assert found.law.refused == ""
    assert found.law.term.form.covariate == COLUMN
    law = found.law.proposed
    assert law is not None
    at = np.linspace(16.0, 39.0, 12)
    true = np.array([softening(float(u)) for u in at])
    estimate = 1.0 + law.values(at)
    # A constant is the plant's own: curves are compared over their means.
    np.testing.assert_allclose(estimate / estimate.mean(), true / true.mean(), atol=0.012)
    assert found.law.change.after.factor < found.law.change.before.factor
    assert found.law.change.parts == (Part.FACTORS,)


def test_it_is_written_as_an_effect_file_that_keeps_the_contract(
    found: DiscrepancyResult, tmp_path: Path
) -> None:
    data = with_column(job(8301), COLUMN, 15.0, 40.0, softening)
    write_findings(found, data, tmp_path, "a campaign")
    law = json.loads((tmp_path / "result.json").read_text())["law"]
    assert law["covariates"] == [COLUMN]
    assert 15.0 <= law["tested_range"][COLUMN]["low"] < law["tested_range"][COLUMN]["high"] <= 40.0
    effect = load_effect(under_another_name(tmp_path / law["file"]))
    assert contract_faults(effect) == []
    assert list(effect.columns) == [COLUMN]
    once = np.ones(3)
    shots = Covariates(once, once, once, once, once, {COLUMN: np.array([20.0, math.nan, 35.0])})
    assert effect.between is not None
    values = [law["parameters"][parameter.name]["value"] for parameter in effect.parameters]
    factors = effect.between([np.full(3, value) for value in values], shots)
    assert factors.mu_s[1] == factors.mu_k[1] == 1.0
    assert factors.mu_k[0] / factors.mu_k[2] == pytest.approx(softening(20.0) / softening(35.0), abs=0.01)
    assert "spread of the friction factors" in (tmp_path / "report.html").read_text()


def test_it_is_named_from_then_on_where_the_column_is_there(found: DiscrepancyResult, tmp_path: Path) -> None:
    data = with_column(job(8301), COLUMN, 15.0, 40.0, softening)
    write_findings(found, data, tmp_path, "a campaign")
    (name,) = offer_effects([under_another_name(next(tmp_path.glob("law_of_*.py")))])
    try:
        other = with_column(job(8305), COLUMN, 15.0, 40.0, softening)
        assert investigate(other, seed=1, library=(*FEW, name)).added == (name,)
        without = with_column(job(8305), "something else", 15.0, 40.0, lambda _: 1.0)
        assert investigate(without, seed=1, library=(*FEW, name)).added == ()
    finally:
        withdraw_effect(name)


def test_no_law_is_made_of_a_column_that_does_nothing() -> None:
    result = investigate(with_column(job(8304), COLUMN, 15.0, 40.0, lambda _: 1.0), seed=1, library=FEW)
    assert result.law is None or result.law.refused


@pytest.mark.parametrize("column", ['x"""\nraise SystemExit', "a\\", "{0}", "'''", "é" * 300])
def test_a_name_of_a_column_is_never_run(column: str) -> None:
    assert not set(printed(column)) & set("\"'\\{}\n")
    form = column_form(column)
    assert form.effect.identifier.isidentifier()
    assert len(form.effect.identifier) < 100
    assert column_form(column) is form
