"""`impactcell calibrate`: the committed model again, to the byte each time, and nothing half written."""

from pathlib import Path

import pytest

from impactcell.cli import calibrate as command
from impactcell.errors import SettingsError
from impactcell.settings.model_file import read_model

CONFIG = Path(__file__).resolve().parents[3] / "config"


@pytest.mark.slow
def test_the_prototype_is_calibrated_to_the_byte(tmp_path: Path) -> None:
    first, second = tmp_path / "a.yaml", tmp_path / "b.yaml"
    command.calibrate(CONFIG / "cells" / "prototype.yaml", first)
    command.calibrate(CONFIG / "cells" / "prototype.yaml", second)
    assert first.read_bytes() == second.read_bytes()
    made, kept = read_model(first), read_model(CONFIG / "models" / "prototype.yaml")
    assert made.plant == kept.plant
    assert len(made.predictors) == len(kept.predictors)
    for one, other in zip(made.predictors, kept.predictors, strict=True):
        assert one.force.friction_n == pytest.approx(other.force.friction_n, rel=1e-6)
        assert one.distance.limit == pytest.approx(other.distance.limit, rel=1e-3)
        assert one.velocity_range_m_s == pytest.approx(other.velocity_range_m_s)
    assert "impactcell" in made.provenance["calibrated by"]
    assert 18.9 in [one.mass_kg for one in made.predictors]


def test_an_interrupt_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "fit_predictors", interrupted)
    with pytest.raises(KeyboardInterrupt):
        command.calibrate(CONFIG / "cells" / "prototype.yaml", tmp_path / "m.yaml")
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="cannot be written"):
        command.calibrate(CONFIG / "cells" / "prototype.yaml", tmp_path / "no" / "m.yaml")
