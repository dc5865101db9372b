"""The workflow through the public API."""

import json
from pathlib import Path

import pytest

import impactcell
from impactcell.errors import CampaignError
from impactcell.settings.model_file import read_model
from tests.discrepancy.test_workflow import make


@pytest.mark.slow
def test_findings_are_looked_at_and_written(tmp_path: Path) -> None:
    result = impactcell.discrepancy(make("viscous_friction", shots=24), seed=4)
    assert result.verdict == "named"
    assert result.effects == ("viscous_friction",)
    assert "viscous friction" in result.headline
    assert result.gap_after < 1.2 < result.gap_before
    value, (low, high) = result.parameters["viscous_friction"]["viscous_coefficient_n_s_per_m"]
    assert low < value < high
    report = result.write(tmp_path / "out", source="twenty-four shots")
    assert report.is_file()
    assert json.loads((tmp_path / "out" / "result.json").read_text()) == json.loads(json.dumps(result.result))
    page = (Path(__file__).resolve().parents[2] / "docs" / "reference" / "result.md").read_text()
    assert [key for key in result.result if f"`{key}`" not in page] == []
    extended = read_model(tmp_path / "out" / "model.extended.yaml")
    assert list(extended.plant.effects) == ["viscous_friction"]
    with pytest.raises(CampaignError, match="cannot be written"):
        result.write(report)


def test_a_directory_that_is_no_campaign_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CampaignError):
        impactcell.discrepancy(tmp_path)
