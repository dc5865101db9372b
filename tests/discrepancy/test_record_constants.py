"""A constant force of its own in each record. Truth: least squares with a column each, and no constants."""

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.machine import (
    BaseModel,
    MachineFinding,
    NumberPrior,
    Response,
    TermChoice,
    establishing,
    investigate_machine,
)
from impactcell.discrepancy.machine.finding import Remainder
from impactcell.discrepancy.machine.regression.nuisance_priors import OFFSET
from impactcell.discrepancy.machine.regression.record_constants import constants_note, without_constants
from impactcell.discrepancy.machine.regression.weak_form import Rows
from impactcell.discrepancy.report import german_sentences
from impactcell.discrepancy.report.simulation_notes import BY_RECORD, notes_of_simulation
from impactcell.errors import SettingsError
from impactcell.records import Samples
from impactcell.settings.base_model import base_model_text, read_base_model
from tests.discrepancy.machine_study import establish_in
from tests.discrepancy.stick_slip import SLIDE, VISCOUS_N_S_PER_M, sines, slides

LACKING = replace(SLIDE, inertia=NumberPrior(2.0, 0.2), terms=(TermChoice("coulomb_friction"),))
BY_ITSELF = {"force_offset": NumberPrior(0.0, math.inf), "force_offset_by_record": True}
SPREAD_N = 0.3
"""Of the constants, a fifth of the friction."""
YAML = """\
format: 1
coordinate: translation
excitation: driven
mass_kg: 2.0
nuisances: {force_offset: %s}
"""


@lru_cache
def records(count: int, spread_n: float) -> Campaign:
    """Slides under sines, the force of each off by a constant."""
    plain = slides(lambda rng: sines(4.0, rng), (0.02, 1e-5), count=count)
    constants = spread_n * np.random.default_rng(3).standard_normal(count)
    shots = []
    for shot, constant in zip(plain.shots, constants, strict=True):
        assert shot.force is not None
        shots.append(replace(shot, force=replace(shot.force, values=shot.force.values + constant)))
    return replace(plain, shots=tuple(shots))


@lru_cache
def found(base: BaseModel, count: int, spread_n: float) -> MachineFinding:
    return investigate_machine(records(count, spread_n), base)


@pytest.mark.slow
@pytest.mark.parametrize("response", [Response.POSITION, Response.FORCE])
@pytest.mark.parametrize("count", [4, 9])
def test_what_is_found_is_the_same_whatever_the_constants(response: Response, count: int) -> None:
    base = replace(LACKING, response=response, **BY_ITSELF)  # type: ignore[arg-type]
    without, off = (found(base, count, spread_n) for spread_n in (0.0, SPREAD_N))
    for finding in (without, off):
        assert finding.established == ("viscous_friction",)
        assert finding.fall.after < 1.1 < 100.0 < finding.fall.before
        viscous = next(term for term in finding.final.terms if term.choice.name == "viscous_friction")
        assert finding.final.value(viscous.columns[0]) == pytest.approx(VISCOUS_N_S_PER_M, rel=2e-3)
        assert OFFSET not in finding.final.fit.columns
        assert BY_RECORD in notes_of_simulation(finding, finding.simulated)
    assert off.fall.after == pytest.approx(without.fall.after, rel=1e-3)
    for one, other in zip(off.simulated, without.simulated, strict=True):
        assert one.rmse == pytest.approx(other.rmse, rel=0.01)


@pytest.mark.slow
def test_none_are_told_where_nothing_remains(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of nothing any constant takes all."""
    left = Remainder(math.nan, (), 0.0, 1.0)
    monkeypatch.setattr(establishing, "remainder_of", lambda *_: left)
    whole = replace(LACKING, terms=SLIDE.terms)
    finding = investigate_machine(records(9, 0.0), whole)
    assert finding.is_at_floor
    assert finding.remainder is left
    assert not [note for note in finding.notes if "of what remains" in note]


@pytest.mark.slow
def test_a_base_model_without_them_says_that_they_are_missing() -> None:
    whole = replace(LACKING, terms=SLIDE.terms)
    blind = establish_in(records(9, SPREAD_N), whole)
    assert blind.fall.after > 20.0
    (note,) = constants_note(blind.remainder.constant_share)
    assert note in blind.notes
    assert "9" in note.split("would take ")[1].split("%")[0]
    assert found(replace(whole, **BY_ITSELF), 9, SPREAD_N).is_at_floor  # type: ignore[arg-type]
    assert not [note for note in found(whole, 9, 0.0).notes if "constant force" in note]
    for text in (note, BY_RECORD):
        assert german_sentences.note(text)[0] == "de"


@pytest.mark.parametrize("is_weighed", [False, True])
def test_constants_are_those_of_least_squares_with_a_column_each(is_weighed: bool) -> None:
    rng = np.random.default_rng(5)
    part = np.repeat([0, 3, 1], [4, 7, 20])
    constant, other, target = rng.uniform(0.5, 1.5, 31), rng.normal(size=31), rng.normal(size=31)
    weight = rng.uniform(0.1, 1.0, 31) if is_weighed else np.ones(31)
    columns = {OFFSET: constant, ("other", 0.0, 0): other}
    rows = Rows(target, columns, part.astype(float), np.arange(31.0), np.ones(31), np.zeros(31))
    left = without_constants(rows, part, weight if is_weighed else None)
    each = np.array([constant * (part == one) for one in (0, 1, 3)]).T

    def beside(values: Samples) -> Samples:
        sizes = np.linalg.lstsq(weight[:, None] * each, weight * values, rcond=None)[0]
        return np.asarray(values - each @ sizes)

    assert left.target == pytest.approx(beside(target), abs=1e-12)
    assert left.columns["other", 0.0, 0] == pytest.approx(beside(other), abs=1e-12)
    assert left.columns[OFFSET] == pytest.approx(np.zeros(31), abs=1e-12)
    if not is_weighed:
        hat = each @ np.linalg.pinv(each)
        assert left.variance == pytest.approx(1.0 - np.diag(hat))


def test_it_is_read_and_written_again(tmp_path: Path) -> None:
    file = tmp_path / "base.yaml"
    file.write_text(YAML % "{std: free, each: record}")
    base, excitation = read_base_model(file)
    assert (base.force_offset_by_record, base.force_offset) == (True, NumberPrior(0.0, math.inf))
    assert excitation is Excitation.DRIVEN
    file.write_text(base_model_text(base, excitation, {}))
    assert read_base_model(file)[0] == base
    file.write_text(YAML % "{std: free}")
    assert not read_base_model(file)[0].force_offset_by_record


@pytest.mark.parametrize(
    "number", ["{std: 0.1, each: record}", "{value: 1, std: free, each: record}", "{std: free, each: shot}"]
)
def test_what_it_cannot_be_is_refused_with_its_place(tmp_path: Path, number: str) -> None:
    file = tmp_path / "base.yaml"
    file.write_text(YAML % number)
    with pytest.raises(SettingsError, match=r"base\.yaml:5:\d+: .*record"):
        read_base_model(file)
